//! Tests of the messages of `hbot rig calibrate` for rigs with an error.

use hbot_host::bus::field;
use hbot_host::commission::bringup::open;
use hbot_host::rig::last_word::Program;
use hbot_host::run_loop::StopFlag;

use super::*;

/// Returns the counts of the simulated prototype while a hand turns it.
fn watched() -> Vec<Counts> {
    watched_on(&RigConfig::prototype())
}

fn watched_on(rig: &RigConfig) -> Vec<Counts> {
    let mut bench = open(rig, Truth::turned(), StopFlag::default(), &Program::this("none")).unwrap();
    watch(&mut bench, rig, 20).unwrap()
}

/// Wheels that are all alike are compared with the sphere.
#[test]
fn radii_that_are_all_wrong_do_not_pass() {
    let file = include_str!("../../../../rigs/prototype.toml");
    let rig = RigConfig::from_toml(&file.replace("radius = 0.0155", "radius = 0.0170"), "wide.toml").unwrap();
    let Told { words, as_filed, corrections } = told(&rig, &watched()).unwrap();
    assert!(!as_filed && words.contains("measure the radii of sphere and wheels"), "{words}");
    assert_eq!(corrections, []);
}

fn mistaken(from: &str, to: &str) -> RigConfig {
    let file = include_str!("../../../../rigs/prototype.toml");
    assert!(file.contains(from), "the prototype has no {from:?}");
    RigConfig::from_toml(&file.replacen(from, to, 1), "mistaken.toml").unwrap()
}

#[test]
fn a_rig_that_is_as_its_file_says_passes() {
    let Told { words, as_filed, .. } = told(&RigConfig::prototype(), &watched()).unwrap();
    assert!(as_filed && !words.contains("set wheel"), "{words}");
}

#[test]
fn two_exchanged_joints_are_named_and_no_zeros_are_made_of_them() {
    for (a, b) in [(0, 2), (1, 3), (0, 1)] {
        let mut counts = watched();
        counts.iter_mut().for_each(|now| now.swap(a, b));
        let Told { words, as_filed, .. } = told(&RigConfig::prototype(), &counts).unwrap();
        assert!(!as_filed && !words.contains("zero_offset"), "{words}");
        assert!(words.contains(&format!("were joints {} and {} exchanged", a + 1, b + 1)), "{words}");
    }
}

#[test]
fn a_dead_encoder_is_named_and_no_zeros_are_made_of_it() {
    for joint in 0..4 {
        let mut counts = watched();
        // The encoder jitters between two counts.
        counts.iter_mut().enumerate().for_each(|(k, now)| now[joint] = 77 + (k % 2) as i32);
        let Told { words, as_filed, .. } = told(&RigConfig::prototype(), &counts).unwrap();
        assert!(!as_filed && !words.contains("zero_offset"), "{words}");
        let named = format!("joint {}, {}:", joint + 1, joint_name(&RigConfig::prototype(), joint));
        assert!(words.contains(&named) && words.contains("encoder is dead"), "{words}");
        assert_eq!(words.lines().count(), 1, "{words}");
    }
    assert!(told(&RigConfig::prototype(), &[[5; 16]; 100]).is_err(), "nobody has turned the sphere");
}

#[test]
fn a_wrong_gear_is_neither_a_radius_nor_a_zero() {
    // The gear of the first drive joint is wrong: its wheel seems larger by the same factor.
    let Told { words, as_filed, .. } = told(&mistaken("gear = 17 ", "gear = 20 "), &watched()).unwrap();
    assert!(
        !as_filed && words.contains("wheel A (wheel[0]) rolls 18 % further than wheel B (wheel[1])"),
        "{words}"
    );
    assert!(
        words.contains("a gear is wrong: that of the drive of wheel A (wheel[0]) would be 17.0"),
        "{words}"
    );
    let Told { words, as_filed, .. } = told(&mistaken("gear = 1 ", "gear = 2 "), &watched()).unwrap();
    assert!(!as_filed && words.contains("a wrong gear") && !words.contains("zero_offset"), "{words}");
}

/// What `rig calibrate` does not write is told, and the rig is not called as its file says. Three
/// wheels show the axis of one; two show axes and zeros only together.
#[test]
fn a_wrong_cone_radius_or_axis_is_told() {
    let file = include_str!("../../../../rigs/three_wheels.toml");
    let read = |text: &str| RigConfig::from_toml(text, "three.toml").unwrap();
    let counts = watched_on(&read(file));
    for (key, wrong, words) in [
        ("cone = ", "cone = 0.24 #", "the cone is "),
        ("radius = 0.0135", "radius = 0.0145", "rolls 7 % further"),
        ("axis = ", "axis = [0.8211, 0.07, -0.5707] #", "an axis in the rig file is wrong"),
    ] {
        assert!(file.contains(key), "{key}");
        let rig = read(&file.replacen(key, wrong, 1));
        let Told { words: said, as_filed, corrections } = told(&rig, &counts).unwrap();
        assert!(!as_filed && said.contains(words), "{wrong}: {said}");
        assert_eq!(corrections, [], "{wrong}: {said}");
    }
}

#[test]
fn every_set_of_wrong_signs_is_named() {
    let rig = RigConfig::prototype();
    let counts = watched();
    for set in 0..16_usize {
        let wrong = |joint: usize| set >> joint & 1 == 1;
        let mut now = counts.clone();
        for reading in &mut now {
            (0..4).filter(|joint| wrong(*joint)).for_each(|joint| reading[joint] = -reading[joint]);
        }
        let Told { words, as_filed, .. } = told(&rig, &now).unwrap();
        assert_eq!(as_filed, set == 0, "{words}");
        for joint in 0..4 {
            let named = words.contains(&format!("set {}.sign = -1", field(joint)));
            assert_eq!(named, wrong(joint), "joint {} of {set:04b}: {words}", joint + 1);
        }
        assert!(!words.contains("zero_offset"), "{set:04b}: {words}");
    }
}

/// The last lines of the message are those to write, and a file with them is as the rig is.
#[test]
fn the_message_ends_with_lines_to_write_and_a_file_with_them_passes() {
    let mut counts = watched();
    // The second drive counts backwards, and the first steer joint has its zero 0.2 rad away.
    let off = (0.2 / RigConfig::prototype().rig.joints[0].radians_per_count()).round() as i32;
    for reading in &mut counts {
        reading[3] = -reading[3];
        reading[0] += off;
    }
    let rig = RigConfig::prototype();
    let found = told(&rig, &counts).unwrap();
    let end = to_paste(&rig, &found);
    assert!(end.contains("[wheel.steer] of wheel A (wheel[0]):\n  zero_offset = -0."), "{end}");
    // A zero is right if it is as small as it can be made by hand.
    assert!((found.corrections[0].value + 0.2).abs() < TRIFLE, "{end}");
    assert!(end.ends_with("[wheel.drive] of wheel B (wheel[1]):\n  sign = -1"), "{end}");
    let mut document = edit::open(None).unwrap();
    correct(&mut document, &found.corrections).unwrap();
    let text = document.to_string();
    assert!(text.contains("# below the equator") || text.contains("# direct drive, section IV.A"), "{text}");
    let written = RigConfig::from_toml(&text, "written.toml").unwrap();
    // The bus adds the offset of the rig file to the counts.
    let offset = (written.zero_offsets[0] / written.rig.joints[0].radians_per_count()).round() as i32;
    counts.iter_mut().for_each(|reading| reading[0] += offset);
    let again = told(&written, &counts).unwrap();
    assert!(again.as_filed && again.corrections.is_empty(), "{}", again.words);
    assert!(to_paste(&rig, &again).contains("nothing to write"), "{}", to_paste(&rig, &again));
}

/// Without another value of `zero`, no offset makes the rig referenced.
#[test]
fn a_zero_that_is_left_to_a_calibration_is_told_with_what_to_write() {
    let rig = mistaken("zero = \"assume\"", "zero = \"calibrate\"");
    let found = told(&rig, &watched()).unwrap();
    assert!(found.as_filed && found.corrections.is_empty(), "{}", found.words);
    let end = to_paste(&rig, &found);
    assert!(!end.contains("nothing to write"), "{end}");
    for words in ["wheel A (wheel[0])", "unreferenced", "zero = \"assume\"", "\"absolute\"", "[wheel.steer]"]
    {
        assert!(end.contains(words), "{end}");
    }
    assert!(!end.contains("wheel B"), "its zero is assumed: {end}");
}

/// The prototype whose first steering encoder has a zero that was measured.
fn measured(sign: i8, zero_offset: f64) -> RigConfig {
    mistaken("sign = 1", &format!("sign = {sign}\nzero_offset = {zero_offset}"))
}

/// With another sign the same zero is another offset, also where the zero was right.
#[test]
fn a_wrong_sign_takes_the_measured_zero_with_it() {
    // Both files give the same counts: only the sign differs.
    let counts = watched_on(&measured(-1, -0.2));
    let Told { corrections, words, .. } = told(&measured(1, 0.2), &counts).unwrap();
    assert!(corrections.len() == 2 && !words.contains("cogging"), "{words}");
    for (key, value) in [("sign", -1.0), ("zero_offset", -0.2)] {
        let correction = corrections.iter().find(|it| it.key == key).expect(key);
        assert!(correction.joint == 0 && (correction.value - value).abs() < TRIFLE, "{correction:?}");
    }
}

/// Rig files take offsets up to about a turn.
#[test]
fn a_zero_is_written_within_half_a_turn() {
    let (truth, file) = (measured(1, 0.2), measured(1, 4.0));
    let mut counts = watched_on(&truth);
    let [offset, filed] =
        [&truth, &file].map(|rig| rig.rig.joints[0].whole_counts(rig.zero_offsets[0]) as i32);
    counts.iter_mut().for_each(|now| now[0] += filed - offset);
    let corrections = told(&file, &counts).unwrap().corrections;
    let [Correction { key: "zero_offset", value, .. }] = corrections[..] else { panic!("{corrections:?}") };
    assert!((value - 0.2).abs() < TRIFLE, "{value}");
}

/// The phases of cogging belong to a zero.
#[test]
fn cogging_of_another_zero_is_to_be_measured_again() {
    let cogging = "zero_offset = 0.2\ncogging = [{ per_turn = 84, amplitude = 0.01, phase = 1.0 }]\nsign = 1";
    let Told { words, .. } = told(&mistaken("sign = 1", cogging), &watched()).unwrap();
    assert!(!words.contains("cogging"), "nothing changes: {words}");
    let rig = mistaken("sign = 1", cogging);
    let mut counts = watched_on(&rig);
    counts.iter_mut().for_each(|now| now[0] += 200);
    let Told { words, .. } = told(&rig, &counts).unwrap();
    assert!(words.contains("zero_offset") && words.contains(COGGING), "{words}");
}

/// The counts of an encoder jump when its index passes.
#[test]
fn nothing_is_recorded_before_the_index_has_passed() {
    let rig = mistaken("zero = \"assume\"", "zero = \"index\"");
    let counts = watched_on(&rig);
    assert!((10_000..20_000).contains(&counts.len()), "{}", counts.len());
    let Told { as_filed, words, .. } = told(&rig, &counts).unwrap();
    assert!(as_filed, "{words}");
}
