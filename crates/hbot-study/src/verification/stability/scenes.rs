//! Scenes at random on rigs at random: what the judge says of them, beside what the whole loop does
//! after a tap.

use hbot_config::advice::{Abilities, Finding, Judge, Why};
use hbot_config::scene::{Hand, Motor, kinds};
use hbot_config::{RigConfig, RunningScene, SceneFile};
use hbot_core::inputs::Command;
use hbot_core::render::around::Place;
use hbot_core::safety::mode::Mode;
use hbot_core::{Quat, Vec3};
use hbot_sim::phenomena::Phenomena;
use hbot_sim::plant::PlantState;
use hbot_sim::rig::SimulatedConfig;
use serde_json::{Map, Value, json};

use crate::context::Context;
use crate::report::{Report, row};
use crate::rng::Rng;
use crate::threads;
use crate::whole::{Whole, motor, prototype, scene_of};

/// Number of scenes that are tried, in the whole study and in the short one.
const SCENES: [u64; 2] = [10_000, 60];
/// Time from `enable` to the tap, s: the soft start is over.
const START_S: f64 = 0.7;
/// Angular velocity that the tap gives to the sphere, rad/s.
const TAP: f64 = 0.6;
/// Angular velocity of the tap in a place that a warning names, rad/s. It is small, so that the
/// sphere does not leave the place before it shakes.
const TOUCH: f64 = 0.1;
/// Time after a tap in which a sphere without a warning comes to rest, and in which one that is
/// warned of shakes, s.
const REST_S: f64 = 3.0;
const SHAKE_S: f64 = 6.0;
/// Time after that in which a drifting sphere rests that fell into a notch or a well late, s.
const LATE_S: f64 = 0.6;
/// Duration of the parts in which the swing is measured, s.
const PART_S: f64 = 0.3;
/// Amplitude of a swing that counts as shaking, rad/s.
const SHAKES: f64 = 0.3;
/// Amplitude that still is shaking if the torque limit keeps it from growing, rad/s.
const TREMBLES: f64 = 0.05;
/// Part of the largest torque by which a torque that still swings is felt and heard.
const CHATTERS: f64 = 0.1;
/// Largest share of warnings that may be false.
const FALSE_ALARMS: f64 = 0.05;
/// Kinds that give out energy on purpose. Their torque is scaled to nothing, so that they change
/// nothing and must change no warning.
const ON_PURPOSE: [&str; 4] = ["constant", "pulse", "track", "vibration"];

/// A scene at random, and a rig at random that renders it.
struct Trial {
    config: RigConfig,
    judge: Judge,
    scene: Value,
    motor: Motor,
}

impl Trial {
    fn new(seed: u64) -> Self {
        let mut rng = Rng(seed.wrapping_mul(0xd134_2543_de82_ef95) ^ 0x5851_f42d_4c95_7f2d);
        let rate = [500, 1000, 2000, 4000][(rng.unit() * 4.0) as usize];
        let mut config = prototype(&[
            ("loop.rate_hz", json!(rate)),
            ("loop.passivity", json!(false)),
            ("sphere.mass", json!(0.467 * (4.0_f64).powf(rng.between(-1.0, 1.0)))),
            ("limits.torque", json!(rng.between(0.3, 0.9))),
            ("limits.enable_max_angle", json!(3.1)),
        ]);
        let lag_s = 1.0e-4 * 20.0_f64.powf(rng.unit());
        config.torque_lag = lag_s;
        let judge = Abilities::of(&config).judge;
        let judge = judge.unwrap_or_else(|| unreachable!("the prototype's inertias are possible"));
        let motor = motor(lag_s);
        let all = kinds();
        let count = 1 + (rng.unit() * 8.0 * rng.unit()) as usize;
        let effects: Vec<Value> = (0..count)
            .map(|i| {
                let kind = &all[(rng.unit() * all.len() as f64) as usize];
                effect(&mut rng, &format!("e{i}"), kind.name, &kind.schema)
            })
            .collect();
        Self { config, judge, scene: json!({"name": "random", "effect": effects}), motor }
    }

    fn file(scene: &Value) -> Option<SceneFile> {
        SceneFile::from_json(scene.clone()).ok()
    }

    /// Returns the torque of the scene at `place`, N m.
    fn pull(&self, place: &Place) -> Vec3 {
        let Some(file) = Self::file(&self.scene) else { return Vec3::ZERO };
        let scene = RunningScene::new().load(file);
        (0..scene.effects().len()).map(|i| scene.pull(i, place, Quat::IDENTITY, place.q)).sum()
    }

    /// Returns the orientation at which the sphere rests, from the identity.
    fn rest(&self) -> Quat {
        let Some(file) = Self::file(&self.scene) else { return Quat::IDENTITY };
        let scene = RunningScene::new().load(file);
        let mut first = None;
        scene.places(Quat::IDENTITY, |place| _ = first.get_or_insert(place));
        let Some(place) = first else { return Quat::IDENTITY };
        let here = place.rest_at(Quat::IDENTITY);
        // Where nothing is found, the place of the first effect serves.
        let rest = self.judge.rest(&scene, &here).or_else(|| self.judge.rest(&scene, &place));
        rest.map_or(
            if self.pull(&here).length() < 0.1 * self.judge.torque { here.q } else { place.q },
            |place| place.q,
        )
    }

    fn findings(&self, scene: &Value) -> Option<Vec<Finding>> {
        Some(self.judge.findings(&RunningScene::new().load(Self::file(scene)?)))
    }

    /// Runs the whole loop after a tap that gives the sphere the angular velocity `tap` (frame N,
    /// rad/s), at the orientation `q`, where `load` (N m) balances the scene. Returns the swings in
    /// each part of [`PART_S`] after the tap. They end with infinity if the rig faults.
    fn run(&self, q: Quat, load: Vec3, tap: Vec3, hand: Option<Hand>, watch_s: f64) -> Vec<Swing> {
        let phenomena = Phenomena { motor: Some(self.motor), hand, ..Phenomena::default() };
        let start = PlantState { q, ..PlantState::default() };
        let simulated = SimulatedConfig { start, phenomena, ..SimulatedConfig::new(&self.config.rig) };
        let mut whole = Whole::simulated(&self.config, scene_of(self.scene.clone()), &simulated);
        // The controller is told where the sphere is before it is enabled.
        whole.rig_mut().set_external(load);
        for tick in 0..whole.ticks(START_S) {
            whole.step((tick == 4).then_some(Command::Align { q, weight: 1.0, tick: 3 }));
        }
        if !whole.is_active() {
            // Too far from a rest: `enable` was refused.
            return Vec::new();
        }
        let state = *whole.rig().state();
        whole.rig_mut().set_state(PlantState { omega: state.omega + tap, ..state });
        let part = whole.ticks(PART_S) as usize;
        let (mut swings, mut rates, mut torques) =
            (Vec::new(), Vec::with_capacity(part), Vec::with_capacity(part));
        for _ in 0..whole.ticks(watch_s) {
            let state = whole.step(None).state;
            if state.mode != Mode::Active {
                swings.push(Swing { rate: f64::INFINITY, torque: f64::INFINITY });
                break;
            }
            rates.push(whole.rig().state().omega);
            torques.push(state.torque);
            if rates.len() == part {
                swings.push(Swing { rate: amplitude(&rates), torque: amplitude(&torques) });
                rates.clear();
                torques.clear();
            }
        }
        swings
    }
}

/// How far the sphere's rate (rad/s) and the torque on it (N m) swing about their straight lines:
/// amplitudes.
#[derive(Debug, Clone, Copy)]
struct Swing {
    rate: f64,
    torque: f64,
}

/// Returns the amplitude of the swing in `rates` about their straight line.
fn amplitude(rates: &[Vec3]) -> f64 {
    let n = rates.len() as f64;
    let middle = 0.5 * (n - 1.0);
    let mean = rates.iter().sum::<Vec3>() / n;
    let time = |k: usize| k as f64 - middle;
    let square: f64 = (0..rates.len()).map(|k| time(k) * time(k)).sum();
    let slope = rates.iter().enumerate().map(|(k, rate)| *rate * time(k)).sum::<Vec3>() / square;
    let left = rates.iter().enumerate().map(|(k, rate)| (*rate - mean - slope * time(k)).length_squared());
    (2.0 * left.sum::<f64>() / n).sqrt()
}

/// Returns an effect of the kind `kind` with parameters at random, over their whole ranges.
fn effect(rng: &mut Rng, id: &str, kind: &str, schema: &Value) -> Value {
    let mut effect = Map::new();
    effect.insert("id".to_owned(), id.into());
    effect.insert("kind".to_owned(), kind.into());
    for (name, property) in schema["properties"].as_object().into_iter().flatten() {
        let value = match name.as_str() {
            "fade_s" | "fade_out_s" | "file" | "points" | "path" | "fire" | "orientations" | "set" => {
                continue;
            }
            // A knock ends by itself, and each warning is the same with and without it.
            "knock" | "knock_amplitude" | "knock_frequency" | "knock_decay_s" => continue,
            "anchor" => json!("absolute"),
            "reference" if rng.unit() < 0.5 => continue,
            "reference" => {
                let v = Vec3::from_array(rng.direction()) * rng.between(0.0, 0.5);
                json!([1.0, v.x, v.y, v.z])
            }
            "gain" if ON_PURPOSE.contains(&kind) => json!(0),
            "gain" if rng.unit() < 0.7 => continue,
            "positions" if rng.unit() < 0.8 => continue,
            "positions" => {
                let gap = rng.between(0.01, 1.0);
                json!((0..1 + (rng.unit() * 5.0) as u32).map(|k| gap * f64::from(k)).collect::<Vec<_>>())
            }
            "twist" => {
                let low = -logarithmic(rng, 1.0e-3, 10.0);
                json!([low, low + logarithmic(rng, 1.0e-2, 20.0)])
            }
            "axis" | "at" | "pointer" => json!(rng.direction()),
            "centre" => {
                let length = logarithmic(rng, 1.0e-3, 10.0);
                json!(rng.direction().map(|x| x * length))
            }
            _ => match random(rng, property) {
                Some(value) => value,
                None => continue,
            },
        };
        effect.insert(name.clone(), value);
    }
    effect.into()
}

/// Returns a value at random that the schema of a parameter allows, or `None` for its default.
fn random(rng: &mut Rng, property: &Value) -> Option<Value> {
    if let Some(choices) = property["oneOf"].as_array() {
        let choice = &choices[(rng.unit() * choices.len() as f64) as usize];
        return Some(choice["const"].clone());
    }
    if let Some(forms) = property["anyOf"].as_array() {
        let size = random(rng, &forms[0])?;
        if rng.unit() < 0.7 {
            return Some(size);
        }
        // A matrix with these sizes about axes at random.
        let size = size.as_f64()?;
        let (u, v) = (Vec3::from_array(rng.direction()), rng.unit());
        let m: Vec<Vec<f64>> = (0..3)
            .map(|i| {
                (0..3).map(|k| size * (u[i] * u[k] + if i == k { v } else { 0.0 }) / (1.0 + v)).collect()
            })
            .collect();
        return Some(json!(m));
    }
    let (low, high) = (property["minimum"].as_f64()?, property["maximum"].as_f64()?);
    if rng.unit() < 0.15 {
        return None;
    }
    let value =
        if low < 0.0 { rng.between(low, high) } else { logarithmic(rng, low.max(1.0e-5 * high), high) };
    Some(if property["type"] == "integer" { json!(value as u64) } else { json!(value) })
}

fn logarithmic(rng: &mut Rng, low: f64, high: f64) -> f64 {
    low * (high / low).powf(rng.unit())
}

/// The two hands of the judge, at rest.
fn hands() -> [Option<Hand>; 3] {
    hbot_config::advice::HOLDS.map(|hold| {
        (hold.stiffness > 0.0).then_some(Hand {
            stiffness: hold.stiffness,
            damping: hold.damping,
            inertia: hold.inertia,
            amplitude: 0.0,
            ..Hand::default()
        })
    })
}

/// What was counted over all scenes.
#[derive(Debug, Default)]
struct Count {
    legal: u32,
    warned: u32,
    judged: u32,
    misses: Vec<u64>,
    late: Vec<u64>,
    false_alarms: Vec<u64>,
}

impl Count {
    fn add(&mut self, seed: u64) {
        let trial = Trial::new(seed);
        let Some(findings) = trial.findings(&trial.scene) else { return };
        self.legal += 1;
        let mut rng = Rng(seed);
        let axis = Vec3::from_array(rng.direction());
        if findings.is_empty() {
            let start = trial.rest();
            let swings = |hand: &Option<Hand>, watch_s| {
                let swings = trial.run(start, Vec3::ZERO, axis * TAP, *hand, watch_s);
                swings.last().map_or(0.0, |swing| swing.rate)
            };
            let shakes = |hand: &Option<Hand>| swings(hand, REST_S) > SHAKES;
            let shaking: Vec<_> = hands().into_iter().filter(shakes).collect();
            if shaking.iter().any(|hand| swings(hand, REST_S + LATE_S) > TREMBLES) {
                self.misses.push(seed);
            } else if !shaking.is_empty() {
                self.late.push(seed);
            }
            return;
        }
        self.warned += 1;
        // At twice its border it must shake in the place that is named. Nearer to the border that
        // takes longer than the trial.
        let beyond = findings.iter().find(|finding| match finding.why {
            Why::Stiff { stable, .. } | Why::Damped { stable, .. } => stable <= 0.5,
            Why::Rings { .. } | Why::Bounces { .. } | Why::Turning { .. } => false,
        });
        let Some(finding) = beyond else { return };
        let [free, soft, firm] = hands();
        let hand = [free, soft, firm]
            [usize::from(finding.hold.stiffness > 1.0) + usize::from(finding.hold.stiffness > 10.0)];
        let axis = finding.axis.unwrap_or(axis);
        // A wall is touched lightly.
        let touched = finding.place.at_depth(1.0e-3);
        let load = -trial.pull(&touched);
        if load.length() > trial.judge.torque {
            // The rig cannot hold the sphere there.
            return;
        }
        self.judged += 1;
        let rests = |tap: f64| {
            let swings = trial.run(touched.q, load, axis * tap, hand, SHAKE_S);
            let trembles =
                |swing: &Swing| swing.rate > TREMBLES || swing.torque > CHATTERS * trial.judge.torque;
            !swings.last().is_none_or(trembles) && swings.iter().all(|swing| swing.rate <= SHAKES)
        };
        if rests(TOUCH) && rests(TAP) {
            self.false_alarms.push(seed);
        }
    }
}

pub(super) fn study(context: &Context, report: &mut Report) {
    context.part("scenes at random");
    let scenes = SCENES[usize::from(context.quick)];
    let counts = threads::map(&[0, 1], |worker| {
        let mut count = Count::default();
        (1 + worker..=scenes).step_by(2).for_each(|seed| count.add(seed));
        count
    });
    let mut sum = Count::default();
    for count in counts {
        sum.legal += count.legal;
        sum.warned += count.warned;
        sum.judged += count.judged;
        sum.misses.extend(count.misses);
        sum.late.extend(count.late);
        sum.false_alarms.extend(count.false_alarms);
    }
    report.heading("Scenes at random");
    report.say(&format!(
        "Seeds 1 to {scenes}: one to eight effects of all kinds, with parameters over their whole ranges, on rigs of 500 to 4000 Hz with motors of 0.1 to 2 ms lag and \
         spheres of a quarter to four times the prototype's mass; the stage for passivity is off. A scene without a warning is tapped with {TAP} rad/s, free and in two hands. It shakes if {REST_S} s later it \
         still swings by more than {SHAKES} rad/s, and {LATE_S} s after that does not rest: a sphere that drifts can fall into a notch late. A scene that is warned of at twice its border or more must shake in the place that the warning names."
    ));
    report.family("scenes_at_random_{what} | scenes | scenes at random: `legal` ones, `warned` of, `beyond` twice their border, `misses` (no warning, but they shake), `late` (no warning, and they rest late), `false_alarms` (beyond twice their border, but they rest)");
    let numbers = [
        ("legal", sum.legal),
        ("warned", sum.warned),
        ("beyond", sum.judged),
        ("misses", sum.misses.len() as u32),
        ("late", sum.late.len() as u32),
        ("false_alarms", sum.false_alarms.len() as u32),
    ];
    let mut table = vec![row(["scenes", "number"])];
    for (what, number) in numbers {
        report.figure(format!("scenes_at_random_{what}"), f64::from(number));
        table.push(row([what, &number.to_string()]));
    }
    report.table(&table);
    report.check(
        "no scene without a warning shakes".to_owned(),
        format!("{} do: seeds {:?}; seeds {:?} rest late", sum.misses.len(), sum.misses, sum.late),
        sum.misses.is_empty(),
    );
    let share = sum.false_alarms.len() as f64 / f64::from(sum.judged.max(1));
    report.check(
        format!("of the warnings at twice the border at most {} % are false", 100.0 * FALSE_ALARMS),
        format!("{:.1} %", 100.0 * share),
        share <= FALSE_ALARMS,
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A judge that sees nothing would miss scenes that shake, and one that sees too much would
    /// warn of scenes that rest.
    #[test]
    fn what_is_warned_of_shakes_and_what_is_not_rests() {
        let mut count = Count::default();
        (1..=40).for_each(|seed| count.add(seed));
        assert_eq!((count.legal, &count.misses, &count.late), (40, &Vec::new(), &Vec::new()));
        assert!(count.warned >= 15 && count.judged >= 10, "{count:?}");
        assert!(count.false_alarms.len() <= 2, "{count:?}");
    }

    #[test]
    fn the_amplitude_is_that_of_the_swing_about_the_line() {
        let swing = |k: u32| Vec3::X * (3.0 + 0.1 * f64::from(k) + 0.5 * libm::sin(0.3 * f64::from(k)));
        let rates: Vec<Vec3> = (0..600).map(swing).collect();
        // Parts of a swing at both ends tilt the line.
        assert!((amplitude(&rates) - 0.5).abs() < 0.01, "{}", amplitude(&rates));
    }
}
