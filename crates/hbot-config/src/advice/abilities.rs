//! What a rig cannot make of a scene or may not keep stable, and what has no effect in it.

use std::sync::LazyLock;

use hbot_core::around::Spot;
use serde_json::{Map, Value};

use super::bound::StiffnessBound;
use super::judge::{Finding, Judge, Why};
use super::sampled::HOLDS;
use crate::scene::{IdleKey, Listed, RunningScene, SceneEffect, kinds};
use crate::{RigConfig, SceneFile};

/// The kinds of effects with their schemas, which name the unit of each parameter.
static KINDS: LazyLock<Vec<Listed>> = LazyLock::new(kinds);

/// Units of the parameters that a rig limits.
const TORQUE: &str = "N m";
const STIFFNESS: &str = "N m/rad";
const DAMPING: &str = "N m s/rad";
const MASS: &str = "kg";
/// Units of the parameters that make an effect stiff, the most direct one first.
const STIFF: [&str; 3] = [STIFFNESS, TORQUE, MASS];

/// The torque that a rig can make, and the loop that decides what it keeps stable.
#[derive(Debug, Clone)]
pub struct Abilities {
    /// Largest torque on the sphere, N m.
    pub torque: f64,
    /// Rate of the loop, Hz.
    pub rate_hz: u32,
    /// Judges what the loop keeps stable. `None` if the inertias in the rig file contradict each
    /// other.
    pub judge: Option<Judge>,
    /// Time constant of the motors' torque by which stiffness is judged, s. `None` if a scene
    /// cannot make the motors later, because the rig is real.
    pub simulated_lag: Option<f64>,
}

impl Abilities {
    /// Computes the abilities of a rig.
    #[must_use]
    pub fn of(config: &RigConfig) -> Self {
        let judge = StiffnessBound::of(config).map(|bound| Judge {
            sampled: bound.sampled().clone(),
            torque: config.rig.limits.torque,
            torque_rate: config.rig.limits.torque_rate,
            speed: config.rig.limits.speed,
            passive: config.rig.methods.passivity.is_some(),
        });
        Self {
            torque: config.rig.limits.torque,
            rate_hz: config.rate_hz,
            simulated_lag: judge
                .as_ref()
                .filter(|_| config.link.port.is_simulated())
                .map(|judge| judge.sampled.lag),
            judge,
        }
    }

    /// Returns a sentence for each effect that the rig does not keep stable, for each parameter
    /// that asks for more torque than the rig makes, and for each that has no effect because of the
    /// values of others.
    ///
    /// Stability is judged by [`Judge`]: for a sphere without friction, free and in two hands, at
    /// each place where a law is steepest or changes.
    #[must_use]
    pub fn warnings(&self, scene: &SceneFile) -> Vec<String> {
        let mut found = self.unstable(scene);
        for effect in scene.effects() {
            for (name, torque) in values(effect, TORQUE).filter(|(_, torque)| *torque > self.torque) {
                let (id, most) = (effect.id(), self.torque);
                found.push(format!(
                    "{id}: {name} {torque} N m is more than this rig makes; the sum of all torques is cut off at {most} N m \
                     (limits.torque)"
                ));
            }
        }
        found.extend(in_vain(scene));
        found.extend(self.too_late(scene));
        found
    }

    /// Returns a sentence for each effect that the rig does not keep stable.
    fn unstable(&self, scene: &SceneFile) -> Vec<String> {
        let Some(judge) = &self.judge else { return Vec::new() };
        let compiled = RunningScene::new().load(scene.clone());
        judge.findings(&compiled).iter().map(|finding| self.sentence(scene, finding)).collect()
    }

    fn sentence(&self, scene: &SceneFile, finding: &Finding) -> String {
        let effect = &scene.effects()[finding.effect];
        let (id, rate) = (effect.id(), self.rate_hz);
        let place = place(scene, finding);
        let about = finding.axis.map_or(String::new(), |axis| {
            format!(" about {:?}", axis.to_array().map(|x| (x * 100.0).round() / 100.0 + 0.0))
        });
        let whom = if finding.hold == HOLDS[0] { "the sphere" } else { "the sphere in a hand" };
        // What the effect's own key must become for its law to become `part` of what it is.
        let key = |units: &[&'static str]| {
            units.iter().find_map(|unit| values(effect, unit).max_by(|a, b| a.1.total_cmp(&b.1)))
        };
        let gain = effect.gain().max(1.0e-9);
        let softer = |units: &[&'static str], part: f64| {
            let (name, value) = key(units).filter(|_| part > 0.0)?;
            Some(format!("{name} = {} or less", short(value * part / gain)))
        };
        let damped = |added: f64| {
            let (name, own) = key(&[DAMPING]).unwrap_or(("damping".to_owned(), 0.0));
            format!("{name} = {} or more", short_up((own + added) / gain))
        };
        match finding.why {
            Why::Stiff { stiffness, stable, damping, cure } => {
                let most = short(stiffness * stable);
                let whatever = if cure.added.is_none() { ", with any damping" } else { "" };
                let cures: Vec<String> =
                    cure.added.map(damped).into_iter().chain(softer(&STIFF, cure.own)).collect();
                let cure = match &cures[..] {
                    [] => "make the effects of the scene softer".to_owned(),
                    cures => format!("set {}", cures.join(", or ")),
                };
                format!(
                    "{id}: may shake {whom}{about} {place}: the scene has {} N m/rad and a damping of {} N m s/rad there, and at \
                     {rate} Hz at most {most} N m/rad is stable{whatever}; {cure}",
                    near(stiffness),
                    near(damping),
                )
            }
            Why::Damped { damping, stable, own } => {
                let cure = softer(&[DAMPING], own).map_or("damp less".to_owned(), |key| format!("set {key}"));
                format!(
                    "{id}: may shake {whom}{about} {place}: the damping of the scene, {} N m s/rad, acts too late, and at {rate} Hz \
                     at most {} is stable; {cure}",
                    near(damping),
                    short(damping * stable),
                )
            }
            Why::Rings { added } => {
                format!(
                    "{id}: a free sphere swings for more than 3 s after a tap{about} {place}; set {}",
                    damped(added)
                )
            }
            Why::Bounces { times } => {
                let (name, own) = key(&[DAMPING]).unwrap_or(("damping".to_owned(), 0.0));
                format!(
                    "{id}: walls throw a free sphere back and forth for more than 3 s after a tap{about} {place}; set {name} = {} or more",
                    short_up(own.max(1.0e-3) * times / gain)
                )
            }
            Why::Turning { speed, damping } => {
                let reaches =
                    if speed.is_finite() { format!(" up to {} rad/s", short(speed)) } else { String::new() };
                format!(
                    "{id}: a free sphere that turns{about} gains speed{reaches}, because its torque acts late; add {} N m s/rad of \
                     damping, or set passivity = true in the rig file",
                    short_up(damping),
                )
            }
        }
    }

    /// Returns the words that say that the simulated motors of a scene are later than those by
    /// which a stiffness is judged, or `None` if they are not.
    fn too_late(&self, scene: &SceneFile) -> Option<String> {
        let (simulated, judged) = (scene.simulate()?.motor?.lag_s, self.simulated_lag?);
        (simulated > judged).then(|| {
            format!(
                "simulate.motor: lag_s {simulated} s is more than the lag of {judged} s by which a stiffness is judged \
                 (torque_lag of the rig file's joints); springs buzz sooner"
            )
        })
    }
}

/// Returns where a finding is, in words.
fn place(scene: &SceneFile, finding: &Finding) -> String {
    let whose = match &scene.effects()[finding.place.effect] {
        _ if finding.place.effect == finding.effect => "its".to_owned(),
        other => format!("the {}'s", other.id()),
    };
    match finding.place.spot {
        _ if finding.away => "when it has turned away from its rest".to_owned(),
        Spot::Rest if whose == "its" => "at its rest".to_owned(),
        Spot::Rest => format!("at {whose} rest"),
        Spot::Notch => format!("in {whose} notch"),
        Spot::Wall => format!("at {whose} wall"),
        Spot::Edge => format!("at the end of {whose} dead band"),
        Spot::Bump => format!("on {whose} bumps"),
    }
}

/// Returns a number with two digits, rounded to the nearest.
fn near(x: f64) -> String {
    rounded(x, f64::round)
}

/// Returns a number with two digits, rounded down so that what is stable stays so.
fn short(x: f64) -> String {
    rounded(x, f64::floor)
}

/// Returns a number with two digits, rounded up.
fn short_up(x: f64) -> String {
    rounded(x, f64::ceil)
}

fn rounded(x: f64, round: fn(f64) -> f64) -> String {
    if !(x > 1.0e-9 && x.is_finite()) {
        return if x > 1.0e-9 { format!("{x}") } else { "0".to_owned() };
    }
    let unit = 10.0_f64.powf(x.log10().floor() - 1.0);
    // A value that has two digits already stays as it is, in spite of rounding errors.
    let digits = x / unit;
    let whole =
        if (digits - digits.round()).abs() < 1.0e-9 * digits { digits.round() } else { round(digits) };
    let places = (1.0 - x.log10().floor()).max(0.0) as usize;
    format!("{:.places$}", whole * unit)
}

/// Returns a sentence for each parameter that the file of the scene names although it has no effect
/// because of the values of others.
pub fn in_vain(scene: &SceneFile) -> impl Iterator<Item = String> {
    scene.effects().iter().flat_map(|effect| {
        effect.in_vain().iter().map(move |IdleKey { name, remedy, .. }| {
            format!("{}: {name} has no effect here; to make it count, {remedy}", effect.id())
        })
    })
}

/// Returns the names of the parameters of `effect` that have the unit `unit`, with their values
/// times the effect's gain. Of a vector it is the length. Of a matrix it is the largest sum of a
/// row's absolute values, which its largest eigenvalue does not exceed. Parameters that have no
/// effect because of the values of others are left out.
fn values(effect: &SceneEffect, unit: &'static str) -> impl Iterator<Item = (String, f64)> {
    let kind = KINDS.iter().find(|kind| kind.name == effect.kind_name());
    let written = effect.to_json().as_object().cloned().unwrap_or_else(Map::new);
    let gain = effect.gain();
    written.into_iter().filter_map(move |(name, value)| {
        let property = &kind?.schema["properties"][&name];
        let is_idle = effect.idle().iter().any(|key| key.name == name);
        let size = size(&value).filter(|_| property["unit"] == unit && !is_idle)?;
        Some((name, gain * size))
    })
}

fn size(value: &Value) -> Option<f64> {
    let Some(rows) = value.as_array() else { return value.as_f64().map(f64::abs) };
    let numbers = |row: &Value| -> Option<Vec<f64>> { row.as_array()?.iter().map(Value::as_f64).collect() };
    match rows.iter().map(Value::as_f64).collect::<Option<Vec<f64>>>() {
        Some(vector) => Some(vector.iter().map(|x| x * x).sum::<f64>().sqrt()),
        None => {
            let sums = rows.iter().map(|row| Some(numbers(row)?.iter().map(|x| x.abs()).sum()));
            sums.collect::<Option<Vec<f64>>>().map(|sums| sums.into_iter().fold(0.0, f64::max))
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn warnings(text: &str) -> Vec<String> {
        let scene = SceneFile::from_toml(text, "x.toml").unwrap_or_else(|error| panic!("{error}"));
        Abilities::of(&RigConfig::prototype()).warnings(&scene)
    }

    #[test]
    fn every_scene_of_the_shelf_is_within_the_prototype() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
        let mut seen = 0;
        for entry in std::fs::read_dir(folder).expect("scenes") {
            let path = entry.expect("readable").path();
            if path.extension().is_some_and(|e| e == "toml") {
                let text = std::fs::read_to_string(&path).expect("readable");
                assert_eq!(warnings(&text), Vec::<String>::new(), "{}", path.display());
                seen += 1;
            }
        }
        assert!(seen >= 17, "{seen} scenes");
    }

    /// The stiffness is judged by the lag of the rig file. Simulated motors that are later than
    /// that would buzz without a warning.
    #[test]
    fn simulated_motors_that_are_later_than_the_rig_file_says_are_named() {
        let motor = |lag: &str| warnings(&format!("[simulate]\nmotor = {{ {lag} }}\n"));
        assert_eq!(motor("lag_s = 0.0005"), Vec::<String>::new());
        assert_eq!(motor(""), Vec::<String>::new(), "the defaults of both files agree");
        let late = motor("lag_s = 0.002");
        assert!(
            late.len() == 1 && late[0].contains("lag_s 0.002 s is more than the lag of 0.0005 s"),
            "{late:?}"
        );
    }

    /// Each case has an effect's kind, its other keys, and the keys without effect, each with what
    /// makes it count.
    #[test]
    fn a_key_that_another_makes_meaningless_is_named_with_what_makes_it_count() {
        const TO_TWIST: &str = "set walls = \"twist\" or walls = \"both\"";
        const TO_CONE: &str = "set walls = \"cone\" or walls = \"both\"";
        const TO_CLOSED: &str = "set ends = \"closed\"";
        const TO_ENDS: &str = "give positions and set ends = \"closed\"";
        const TO_SWING: &str = "set path = \"sine\" or path = \"chirp\"";
        const TO_CHIRP: &str = "set path = \"chirp\"";
        const TO_POINTS: &str = "set path = \"waypoints\" or path = \"record\"";
        const ANOTHER: &str = "set another path (a sine always repeats)";
        const POINTS: &str = "points = [[0, 1, 0, 0, 0], [1, 0, 1, 0, 0], [2, 1, 0, 0, 0]]";
        let record = format!("{POINTS}\npath = 'record'\nrepeat = true\namplitude = 1\nfrequency_end = 3");
        /// The kind of an effect, its parameters, and the keys that are named, each with what makes
        /// it count.
        type Case<'a> = (&'a str, &'a str, &'a [(&'a str, &'a str)]);
        let cases: &[Case<'_>] = &[
            ("end_stop", "twist = [-0.5, 0.5]", &[("twist", TO_TWIST)]),
            // The default, but the file does not say that there are no walls of the twist.
            ("end_stop", "twist = [-1, 1]", &[("twist", TO_TWIST)]),
            ("end_stop", "twist = [-1, 1]\nwalls = 'cone'", &[]),
            ("end_stop", "cone = 0.2\nwalls = 'twist'\ntwist = [-0.5, 0.5]", &[("cone", TO_CONE)]),
            ("end_stop", "cone = 0.2\nwalls = 'both'\ntwist = [-0.5, 0.5]", &[]),
            ("detents", "count = 20\npositions = [0, 1]", &[("count", "remove positions")]),
            ("detents", "end_stiffness = 3\npositions = [0, 1]", &[("end_stiffness", TO_CLOSED)]),
            ("detents", "end_stiffness = 3", &[("end_stiffness", TO_ENDS)]),
            ("detents", "ends = 'closed'", &[("ends", "give positions")]),
            ("detents", "count = 20", &[]),
            ("guide", "pointer = [0, 1, 0]", &[("pointer", "set free = \"plane\"")]),
            ("guide", "pointer = [0, 1, 0]\nfree = 'plane'", &[]),
            ("track", "sweep_s = 3", &[("sweep_s", TO_CHIRP)]),
            ("track", "sweep_s = 3\npath = 'chirp'\nrepeat = true", &[]),
            ("track", "repeat = true", &[("repeat", ANOTHER)]),
            ("track", POINTS, &[("points", TO_POINTS)]),
            ("track", &record, &[("amplitude", TO_SWING), ("frequency_end", TO_CHIRP)]),
            ("vibration", "release_s = 1", &[("release_s", "set hold_s above 0")]),
            ("vibration", "hold_s = 3\nrepeat_s = 3", &[("hold_s", "set hold_s below repeat_s")]),
            ("vibration", "hold_s = 1\nrepeat_s = 3\nrelease_s = 1", &[]),
        ];
        // Enough damping for every stiffness in the cases.
        let air = "[[effect]]\nid = 'air'\nkind = 'damper'\ndamping = 0.1\n";
        for (kind, keys, idle) in cases {
            let said = warnings(&format!("[[effect]]\nid = 'e'\nkind = '{kind}'\n{keys}\n{air}"));
            let sentence = |(key, remedy): &(&str, &str)| {
                format!("e: {key} has no effect here; to make it count, {remedy}")
            };
            assert_eq!(said, idle.iter().map(sentence).collect::<Vec<_>>(), "{kind}: {keys}");
        }
    }

    /// The walls of a dial with open ends do not exist, so they cannot shake the sphere.
    #[test]
    fn a_stiffness_that_does_not_act_is_not_judged() {
        let dial = |keys: &str| {
            warnings(&format!(
                "[[effect]]\nid = 'd'\nkind = 'detents'\npositions = [0, 1]\ndamping = 0.01\n{keys}\n"
            ))
        };
        assert_eq!(dial(""), Vec::<String>::new());
        let open = dial("end_stiffness = 600");
        assert!(open.len() == 1 && open[0].contains("end_stiffness has no effect"), "{open:?}");
        let closed = dial("end_stiffness = 600\nends = 'closed'");
        assert!(closed.len() == 1 && closed[0].starts_with("d: may shake the sphere"), "{closed:?}");
        assert!(closed[0].contains("at its wall") && closed[0].contains("end_stiffness = "), "{closed:?}");
    }

    /// A scene that a server sends has all parameters. Loading it again causes no more warnings.
    #[test]
    fn defaults_without_effect_are_not_named() {
        for kind in kinds() {
            let bare = json!({"effect": [{"id": "e", "kind": kind.name}]});
            let scene = SceneFile::from_json(bare).unwrap_or_else(|error| panic!("{error}"));
            let again = SceneFile::from_json(scene.to_json()).unwrap_or_else(|error| panic!("{error}"));
            let said = Abilities::of(&RigConfig::prototype()).warnings(&again);
            assert!(!said.iter().any(|warning| warning.contains("has no effect")), "{said:?}");
        }
    }

    fn effect(id: &str, kind: &str, keys: &str) -> String {
        format!("[[effect]]\nid = '{id}'\nkind = '{kind}'\n{keys}\n")
    }

    /// The loop keeps 2.98 N m s/rad stable on the prototype, and the margin is 10 %.
    #[test]
    fn dampings_that_are_too_large_only_together_are_named_once() {
        let damping = |id: &str, damping: f64| effect(id, "damper", &format!("damping = {damping}"));
        let (air, honey) = (damping("air", 0.9), damping("honey", 2.2));
        assert_eq!(warnings(&air), Vec::<String>::new());
        let both = warnings(&format!("{air}{honey}"));
        assert!(both.len() == 1 && both[0].starts_with("honey: may shake the sphere"), "{both:?}");
        assert!(both[0].contains("acts too late") && both[0].contains("set damping = "), "{both:?}");
        let wall = effect("wall", "end_stop", "damping = 0.5");
        assert_eq!(warnings(&format!("{air}{wall}")), Vec::<String>::new(), "the wall is far away");
    }

    /// Scenes that were legal and had no warning, and that shook the sphere. Each has what the
    /// warning must name: the effect, the place, and a key to change.
    #[test]
    fn scenes_that_shake_are_warned_of() {
        let here = |keys: &str| effect("spring", "spring", &format!("anchor = 'here'\n{keys}"));
        let many = |n: usize, keys: &str| -> String {
            (0..n).map(|i| effect(&format!("s{i}"), "spring", &format!("anchor = 'here'\n{keys}"))).collect()
        };
        let stiff = here("stiffness = 40");
        let cases = [
            (many(20, "stiffness = 20\ndamping = 0.002"), "s19", "rest"),
            (here("stiffness = 40\ndamping = [[0.1,0,0],[0,0,0],[0,0,0]]"), "spring", "rest"),
            (
                format!("{stiff}{}", effect("dial", "detents", "axis=[1,0,0]\nstrength=0\ndamping=0.1")),
                "spring",
                "rest",
            ),
            (
                format!("{stiff}{}", effect("w", "end_stop", "cone=2.7\nstiffness=1\ndamping=0.7")),
                "spring",
                "rest",
            ),
            (format!("{stiff}{}", effect("air", "damper", "damping=0.7\ndeadband=100")), "spring", "rest"),
            (effect("e", "end_stop", "cone=0\nanchor='here'\nstiffness=200\ndamping=0.45"), "e", "wall"),
            (effect("e", "snaps", "strength=0.9\nwidth=0.01"), "e", "notch"),
            (effect("e", "magnet", "anchor='here'\nstrength=0.9\nwidth=0.01"), "e", "rest"),
            (effect("e", "texture", "waves=500\ndepth=0.9"), "e", "bumps"),
            (effect("e", "detents", "count=720\nstrength=0.9"), "e", "notch"),
            (effect("e", "friction", "torque=0.3"), "e", "rest"),
            (effect("e", "friction", "torque=0.9\nstiffness=1000\ndamping=0"), "e", "rest"),
            (effect("e", "pendulum", "mass=100\ncentre=[0,0,-10]\ngravity=100"), "e", "rest"),
            (
                format!("{}{}", here("stiffness = 60"), effect("w", "end_stop", "cone=2.5\ndamping=0.5")),
                "spring",
                "rest",
            ),
        ];
        for (text, id, place) in cases {
            let said = warnings(&text);
            let named = said.iter().find(|said| said.starts_with(&format!("{id}: may shake")));
            assert!(named.is_some_and(|said| said.contains(place)), "{text}{said:?}");
        }
    }

    /// An effect that makes no torque and no damping at a place changes no warning there.
    #[test]
    fn an_effect_without_torque_changes_no_warning() {
        let idle = [
            effect("far", "end_stop", "cone=2.7\nstiffness=1\ndamping=0.7"),
            effect("still", "constant", "torque=[0,0,0]"),
            effect("off", "spring", "gain=0\nstiffness=900\ndamping=90"),
            effect("flat", "detents", "strength=0\ndamping=0"),
            effect("rare", "damper", "damping=0.7\ndeadband=100"),
        ];
        let own = |text: &str| -> Vec<String> {
            warnings(text).into_iter().filter(|said| said.starts_with("s:")).collect()
        };
        for (stiffness, damping) in [(2.0, 0.02), (9.0, 0.02), (12.0, 0.02), (40.0, 0.0), (300.0, 0.5)] {
            let spring = effect("s", "spring", &format!("stiffness={stiffness}\ndamping={damping}"));
            let alone = own(&spring);
            for idle in &idle {
                assert_eq!(own(&format!("{spring}{idle}")), alone, "{idle}");
                assert_eq!(own(&format!("{idle}{spring}")), alone, "{idle}");
            }
        }
    }

    #[test]
    fn stiffness_is_judged_with_the_damping_of_the_whole_scene() {
        let spring = effect("s", "spring", "stiffness = [[30, 0, 0], [0, 2, 0], [0, 0, 1]]");
        let bare = warnings(&spring);
        assert!(
            bare.len() == 1 && bare[0].starts_with("s: may shake the sphere about [1.0, 0.0, 0.0]"),
            "{bare:?}"
        );
        // 30 N m/rad takes 30 (1.5 ms + 0.5 ms) = 0.06 N m s/rad away, and the margin is 10 %.
        let air = effect("air", "damper", "damping = 0.075");
        assert_eq!(warnings(&format!("{spring}{air}")), Vec::<String>::new());
        // most = 0.1465 J/h² = 495 N m/rad with the prototype's 3.4e-3 kg m².
        let wall = warnings(&effect("w", "spring", "stiffness = 600\ndamping = 1"));
        assert!(wall[0].contains("with any damping"), "{wall:?}");
        let gain = warnings(&effect("w", "spring", "stiffness = 100\ndamping = 0.1\ngain = 2"));
        assert!(gain[0].contains("200 N m/rad"), "{gain:?}");
    }

    /// A lead gives back the damping that the delay takes.
    #[test]
    fn a_lead_makes_stiff_scenes_stable() {
        let mut abilities = Abilities::of(&RigConfig::prototype());
        let scene = effect("s", "spring", "stiffness = 60\ndamping = 0.02");
        let scene = SceneFile::from_toml(&scene, "x.toml").unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(abilities.warnings(&scene).len(), 1);
        let sampled = &mut abilities.judge.as_mut().expect("a plant").sampled;
        sampled.lead = 1.1 * sampled.lateness();
        assert_eq!(abilities.warnings(&scene), Vec::<String>::new());
    }
}
