//! What is said of scenes: which effects shake the sphere, and which keys have no effect.

use hbot_config::advice::{Abilities, StiffnessBound};
use hbot_config::scene::kinds;
use hbot_config::{RigConfig, RunningScene, SceneFile};
use hbot_core::{Mat3, Vec3};
use serde_json::{Value, json};

/// Returns the prototype without a lead, whose borders have simple formulas.
fn unled() -> RigConfig {
    let mut config = RigConfig::prototype();
    config.rig = config.rig.with(|parts| parts.lead = None).expect("legal");
    config
}

fn warnings(text: &str) -> Vec<String> {
    warnings_on(&unled(), text)
}

fn warnings_on(rig: &RigConfig, text: &str) -> Vec<String> {
    let scene = SceneFile::from_toml(text, "x.toml").unwrap_or_else(|error| panic!("{error}"));
    Abilities::of(rig).warnings(&scene).iter().map(ToString::to_string).collect()
}

#[test]
fn every_scene_of_the_shelf_is_within_the_prototype() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let mut seen = 0;
    for entry in std::fs::read_dir(folder).expect("scenes") {
        let path = entry.expect("readable").path();
        if path.extension().is_some_and(|e| e == "toml") {
            let text = std::fs::read_to_string(&path).expect("readable");
            for rig in [unled(), RigConfig::prototype()] {
                assert_eq!(warnings_on(&rig, &text), Vec::<String>::new(), "{}", path.display());
            }
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

#[test]
fn a_virtual_mass_that_is_not_rendered_as_a_whole_is_named() {
    let rig = RigConfig::prototype();
    // Half of the sphere's inertia over h/(smoothing + h).
    let most = 0.5 * rig.rig.device.sphere_inertia() * 11.0;
    let mass = |mass: f64| {
        let heavy = format!("[[effect]]\nid = 'm'\nkind = 'inertia'\nsmoothing_s = 0.01\nmass = {mass}\n");
        warnings_on(&rig, &heavy)
    };
    assert_eq!(mass(0.99 * most), Vec::<String>::new());
    let told = mass(1.0);
    let want = "m: mass 1 kg m² is more than this loop keeps stable; it renders 0.017 kg m²";
    assert!(most > 0.017 && most < 0.018 && told.len() == 1 && told[0].starts_with(want), "{told:?}");
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
        let sentence =
            |(key, remedy): &(&str, &str)| format!("e: {key} has no effect here; to make it count, {remedy}");
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
        assert!(!said.iter().any(|warning| warning.what.contains("has no effect")), "{said:?}");
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

/// A pendulum has no key for damping, so the remedy is another effect. It ends the warning.
#[test]
fn what_cannot_damp_itself_is_damped_by_a_damper() {
    let said = |text: &str| warnings_on(&RigConfig::prototype(), text);
    for gain in [0.5, 1.0] {
        let swings = effect("p", "pendulum", &format!("gain = {gain}"));
        let [told] = &said(&swings)[..] else { panic!("one warning") };
        let (_, remedy) = told.split_once("; add a damper with ").expect(told);
        let (damping, _) = remedy.split_once(" or more").expect(told);
        let damper = effect("air", "damper", damping);
        assert_eq!(said(&format!("{swings}{damper}")), Vec::<String>::new(), "{told}");
    }
}

/// A wall without damping has none that could be multiplied.
#[test]
fn a_wall_that_is_made_as_soft_as_its_warning_says_is_not_warned_of() {
    let said = |stiffness: &str| {
        let wall = effect("stop", "end_stop", &format!("cone = 0.5\nstiffness = {stiffness}"));
        warnings_on(&RigConfig::prototype(), &wall)
    };
    // A far stiffer wall shakes without a tap, which is told first.
    for stiffness in ["300", "400"] {
        let [told] = &said(stiffness)[..] else { panic!("one warning") };
        let (_, remedy) = told.split_once("set stiffness = ").expect(told);
        let (softer, _) = remedy.split_once(' ').expect(told);
        // A wall that does not shake may still throw a sphere back.
        let after = said(softer);
        assert!(!after.iter().any(|warning| warning.contains("may shake")), "{after:?} after {told}");
    }
}

#[test]
fn a_wall_that_throws_a_sphere_back_is_told_how_much_damping_ends_it() {
    let said = |damping: &str| {
        let wall = effect("w", "end_stop", &format!("cone = 0.3\nstiffness = 20\n{damping}"));
        warnings_on(&RigConfig::prototype(), &wall)
    };
    let [told] = &said("damping = 0")[..] else { panic!("one warning") };
    assert!(told.ends_with("; give it a damping"), "{told}");
    let [told] = &said("damping = 0.01")[..] else { panic!("one warning") };
    let (_, remedy) = told.split_once("; set ").expect(told);
    assert_eq!(said(remedy.trim_end_matches(" or more")), Vec::<String>::new(), "{told}");
}

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

/// A guide holds two axes and leaves the third free. Its damping is so large that the delay takes
/// less of it away than it is, so no axis has a negative damping.
#[test]
fn a_guide_that_damps_too_much_is_warned_of_about_an_axis_that_it_holds() {
    let said = warnings(&effect("g", "guide", "stiffness = 192\ndamping = 1.92"));
    assert!(said.len() == 1 && said[0].contains("the scene has 192 N m/rad"), "{said:?}");
}

#[test]
fn a_lead_makes_stiff_scenes_stable() {
    let scene = effect("s", "spring", "stiffness = 60\ndamping = 0.02");
    assert_eq!(warnings(&scene).len(), 1);
    assert_eq!(warnings_on(&RigConfig::prototype(), &scene), Vec::<String>::new(), "on by default");
}

/// Both springs are stable in small swings. The second one is so in large ones too.
#[test]
fn a_spring_that_only_a_torque_at_its_limits_shakes_is_warned_of_as_such() {
    const LIMITS: &str = "after a tap that takes the torque to its limits (0.90 N m, 200 N m/s)";
    let rig = RigConfig::prototype();
    let said = |keys: &str| warnings_on(&rig, &effect("s", "spring", keys));
    let [tapped] = &said("stiffness = 300\ndamping = 0.08")[..] else { panic!("one warning") };
    assert!(tapped.contains(LIMITS), "{tapped}");
    assert_eq!(said("stiffness = 100\ndamping = 0.08"), Vec::<String>::new());
    // Without a lead small swings shake first.
    let [small] = &warnings(&effect("s", "spring", "stiffness = 60\ndamping = 0.02"))[..] else {
        panic!("one warning")
    };
    assert!(!small.contains("after a tap"), "{small}");
}

/// The defaults of these kinds need no damping of the sphere's own.
#[test]
fn defaults_that_damp_are_not_warned_of_on_any_ready_made_rig() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../rigs");
    for entry in std::fs::read_dir(folder).expect("rigs") {
        let path = entry.expect("readable").path();
        let rig = RigConfig::load(Some(&path), &[]).unwrap_or_else(|error| panic!("{error}"));
        for kind in ["friction", "end_stop", "magnet", "texture", "snaps", "detents", "guide"] {
            let said = warnings_on(&rig, &effect("e", kind, ""));
            assert_eq!(said, Vec::<String>::new(), "{kind} on {}", path.display());
        }
    }
}

/// A stream of numbers from 0 to 1 (xorshift).
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Returns an effect of a kind at random that makes no torque: with a gain of 0, with no strength
/// at all, or out of reach. Its other numbers are anywhere in their ranges.
fn idle_effect(random: &mut Random) -> Value {
    let all = kinds();
    let kind = &all[(random.unit() * all.len() as f64) as usize];
    let mut effect = json!({"id": "idle", "kind": kind.name});
    let no_gain = random.unit() < 0.5;
    for (name, property) in kind.schema["properties"].as_object().into_iter().flatten() {
        // A size that may also be a matrix.
        let range = if property["anyOf"].is_array() { &property["anyOf"][0] } else { property };
        let (Some(low), Some(high)) = (range["minimum"].as_f64(), range["maximum"].as_f64()) else {
            continue;
        };
        let force = ["N m", "N m/rad", "N m s/rad", "kg"].iter().any(|unit| property["unit"] == *unit)
            || name == "mass";
        let is_zero = if no_gain { name == "gain" } else { force && low <= 0.0 };
        let (low, at) = (low.max(1.0e-5 * high), random.unit());
        let value = if is_zero { 0.0 } else { low * (high / low).powf(at) };
        if is_zero || !force && property["type"] != "integer" && random.unit() < 0.3 && name != "gain" {
            effect[name] = json!(value);
        }
    }
    effect
}

#[test]
fn an_effect_at_random_without_torque_changes_no_warning() {
    let abilities = Abilities::of(&unled());
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let (mut warned, mut legal) = (0, 0);
    for seed in 0..105 {
        let k = 10.0_f64.powf(random.unit() * 3.0 - 0.5);
        let b = 10.0_f64.powf(random.unit() * 3.0 - 3.0);
        let width = 10.0_f64.powf(random.unit() * 1.5 - 2.0);
        let own = [
            json!({"kind": "spring", "stiffness": k, "damping": b}),
            json!({"kind": "guide", "free": "axis", "stiffness": k, "damping": b}),
            json!({"kind": "detents", "count": 24, "strength": 0.01 * k, "width": width, "damping": 0.1 * b}),
            json!({"kind": "magnet", "strength": 0.01 * k, "width": width, "damping": b}),
            json!({"kind": "end_stop", "cone": width, "stiffness": k, "damping": b}),
            json!({"kind": "damper", "damping": 5.0 * b}),
            json!({"kind": "friction", "torque": 0.01 * k, "stiffness": 2.0 * k, "damping": b}),
        ];
        let mut own = own[seed % own.len()].clone();
        own["id"] = json!("s");
        let idle = idle_effect(&mut random);
        let said = |effects: &[&Value]| -> Option<Vec<String>> {
            let scene = SceneFile::from_json(json!({"effect": effects})).ok()?;
            let said = abilities.warnings(&scene).into_iter();
            Some(said.map(|said| said.to_string()).filter(|said| said.starts_with("s:")).collect())
        };
        let alone = said(&[&own]).unwrap_or_else(|| panic!("{own}"));
        warned += usize::from(!alone.is_empty());
        for effects in [[&own, &idle], [&idle, &own]] {
            let Some(both) = said(&effects) else { continue };
            legal += 1;
            assert_eq!(both, alone, "{own} and {idle}");
        }
    }
    assert!(warned > 35 && warned < 90, "{warned} of 105 are warned of");
    assert!(legal > 180, "{legal} of 210 are legal");
}

/// The axis of the smallest inertia turns with the posture. A damping that is stable about the axes
/// of one posture can shake the sphere in another.
#[test]
fn a_damping_is_judged_with_the_smallest_inertia_about_any_axis() {
    let mut judge = Abilities::of(&unled()).judge.expect("legal inertias");
    let least = judge.sampled.inertia.min_element();
    judge.sampled.inertia = Vec3::new(1.0, 2.0, 2.0) * least;
    judge.sampled.axes = Mat3::IDENTITY;
    let most = StiffnessBound::of(&unled()).expect("legal inertias").most_damping();
    for (part, warned) in [(0.9, false), (1.1, true)] {
        let damping = json!([[0, 0, 0], [0, part * most, 0], [0, 0, 0]]);
        let scene = json!({"effect": [{"id": "d", "kind": "damper", "damping": damping}]});
        let file = SceneFile::from_json(scene).unwrap_or_else(|error| panic!("{error}"));
        let found = judge.findings(&RunningScene::new().load(file));
        assert_eq!(!found.is_empty(), warned, "{part}: {found:?}");
    }
}

/// A sphere in a narrow cone swings about two axes at once, beside the middle as often as through
/// it. Beside it, the walls' damping takes no part.
#[test]
fn a_round_wall_damps_half_of_what_a_straight_swing_feels() {
    let mut judge = Abilities::of(&unled()).judge.expect("legal inertias");
    judge.sampled.inertia = Vec3::new(1.0, 2.0, 1.5) * judge.sampled.inertia.min_element();
    judge.sampled.axes = Mat3::from_rotation_z(0.7);
    for (damping, warned) in [(0.08, true), (0.16, false)] {
        let cone = json!({"id": "c", "kind": "end_stop", "walls": "cone", "cone": 3e-4, "stiffness": 3, "damping": damping});
        let file = SceneFile::from_json(json!({"effect": [cone]})).unwrap_or_else(|error| panic!("{error}"));
        let found = judge.findings(&RunningScene::new().load(file));
        assert_eq!(!found.is_empty(), warned, "{damping}: {found:?}");
    }
}
