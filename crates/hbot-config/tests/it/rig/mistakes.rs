//! One case for each kind of mistake in a rig file, with its message.

use hbot_config::RigConfig;

use super::{LEAST, said, said_of};

#[test]
fn types_names_and_keys() {
    assert_eq!(
        said("radius = 0.1,", "radius = '0.1',"),
        r#"x.toml:2:21: sphere.radius: found the string "0.1"; legal: a number, 0.001 to 10 m"#
    );
    assert_eq!(
        said("radius = 0.1,", "radius = 0.1, colour = 'red',"),
        "x.toml:2:26: sphere.colour: unknown key; legal: radius, mass, friction, imbalance, drift"
    );
    assert_eq!(
        said("steer = { counts_per_turn = 4096", "steer = { geer = 17, counts_per_turn = 4096"),
        "x.toml:7:11: wheel[0].steer.geer: unknown key (did you mean `gear`?); legal: port, controller, counts_per_turn, \
         gear, sign, zero, zero_offset, inertia, peak, continuous, torque_lag, rate_lag, torque_scale, gear_loss, friction, cogging, motor"
    );
    assert_eq!(
        said("counts_per_turn = 4096", "counts_per_turn = 4096.5"),
        "x.toml:7:29: wheel[0].steer.counts_per_turn: found 4096.5; legal: a whole number, 4 to 1073741824"
    );
    assert_eq!(
        said("axis = [1, 0, -1]", "axis = [1, 0]"),
        "x.toml:4:8: wheel[0].axis: found an array of 2 elements; legal: an array of 3 numbers"
    );
    assert_eq!(
        said_of(&format!("{LEAST}[api]\non_client_lost = 'romp'")),
        r#"x.toml:16:18: api.on_client_lost: "romp" is not known here (did you mean "ramp"?); legal: "ramp", "keep", "fault""#
    );
    assert_eq!(
        said_of(&format!("{LEAST}[loop]\naccuracy = 3")),
        r#"x.toml:16:12: loop.accuracy: found 3; legal: "fast", "balanced", "exact", or a table"#
    );
    assert_eq!(
        said_of("sphere = 3"),
        "x.toml: wheel: missing; legal: an array of 2 to 8 tables\nx.toml:1:10: sphere: found 3; legal: a table"
    );
}

#[test]
fn what_toml_can_say_and_no_key_takes() {
    assert_eq!(
        said("mass = 0.5", "mass = nan"),
        "x.toml:2:33: sphere.mass: nan is not a finite number; legal: a number, 0.001 to 1000 kg"
    );
    assert_eq!(
        said("[1, 0, -1]", "[1, 0, -inf]"),
        "x.toml:4:15: wheel[0].axis[2]: -inf is not a finite number; legal: a number, -1000 to 1000"
    );
    assert_eq!(
        said("mass = 0.5", "mass = 2020-01-01"),
        "x.toml:2:33: sphere.mass: 2020-01-01 is a date; legal: a number, 0.001 to 1000 kg"
    );
    assert_eq!(
        said("mass = 0.5", "mass = 99999999999999999999"),
        "x.toml:2:33: sphere.mass: an integer of more than 64 bits; legal: a number, 0.001 to 1000 kg"
    );
    assert_eq!(said("mass = 0.5", "mass = "), "x.toml:2:34: not TOML: invalid literal string, expected `'`");
}

#[test]
fn values_that_do_not_fit_each_other() {
    assert_eq!(
        said("continuous = 0.1", "continuous = 2"),
        "x.toml:7:58: wheel[0].steer.continuous: 2 is more than peak; legal: > 0 and <= 1 N m"
    );
    assert_eq!(
        said("motor = false", "sign = -1"),
        "x.toml:14:9: wheel[1].drive.peak: missing; legal: a number, > 0 and <= 1000 N m; or motor = false\n\
         x.toml:14:9: wheel[1].drive.continuous: missing; legal: a number, > 0 and <= 1000 N m; or motor = false"
    );
    assert_eq!(
        said("motor = false", "motor = false, controller = 1"),
        "x.toml:14:63: wheel[1].drive.controller: 1 is taken by another joint; legal: each of 0 to 3 once; the place of a \
         joint that names none is its own, here 3"
    );
    assert_eq!(
        said("motor = false", "motor = false, controller = 4"),
        "x.toml:14:63: wheel[1].drive.controller: 4 is past the last of 4 joints; legal: each of 0 to 3 once; the place of a \
         joint that names none is its own, here 3"
    );
    assert_eq!(
        said("axis = [1,", "name = 'B'\naxis = [1,"),
        "x.toml:10:1: wheel[1].name: \"B\" is the name of wheel[0] already; legal: names that differ"
    );
    assert_eq!(
        said_of(&format!("{LEAST}[loop]\nrate_hz = 50\n[link]\nport = '/dev/ttyACM0'")),
        "x.toml:17:1: link.watchdog_ms: 20 ms is less than two loop periods at 50 Hz; legal: 40 to 1000 ms"
    );
    assert_eq!(
        said_of(&format!("{LEAST}[api]\nlisten = 'here'")),
        "x.toml:16:10: api.listen: \"here\" is not an address with a port; legal: such as \"127.0.0.1:4268\" or \"[::1]:4268\""
    );
    assert_eq!(
        said("counts_per_turn = 4096", "gear = 10000, counts_per_turn = 1000000000"),
        "x.toml:7:18: wheel[0].steer.gear: 10000 times counts_per_turn is 10000000000000 counts a turn of the joint; legal: 4 \
         to 2147483648 counts"
    );
}

#[test]
fn geometry_that_no_device_can_have() {
    assert_eq!(
        said("[1, 0, -1]", "[0, 0, 0.0]"),
        "x.toml:4:8: wheel[0].axis: the axis has no direction; legal: [x, y, z], not all zero"
    );
    assert_eq!(
        said("cone = 0.17", "cone = 1e-9"),
        "x.toml:5:8: wheel[0].cone: wheel 1: singular by design: sin(cone) cos(toe) is 1e-9, at least 1e-6 is needed for \
         steering and driving to be independent"
    );
    assert_eq!(
        said("[-1, 0, -1]", "[1, 0, -1.1]"),
        "x.toml:10:8: wheel[1].axis: wheels 1 and 2: their contact points can meet at one point at some steering angles, and \
         no other wheel prevents the singularity; tilt an axis or change a cone angle"
    );
    let one = LEAST.split("[[wheel]]").take(2).collect::<Vec<_>>().join("[[wheel]]");
    assert_eq!(
        said_of(&one),
        "x.toml:3:1: wheel: found an array of 1 element; legal: an array of 2 to 8 tables"
    );
}

#[test]
fn an_angle_in_degrees_says_how_degrees_are_written() {
    assert_eq!(
        said("cone = 0.17", "cone = 10"),
        "x.toml:5:8: wheel[0].cone: 10 is out of range; legal: > 0 and < 3.141592653589793 rad, or \"10 deg\" for degrees"
    );
    assert_eq!(
        said("cone = 0.17", "toe = -10\ncone = 0.17"),
        "x.toml:5:7: wheel[0].toe: -10 is out of range; legal: > -1.5707963267948966 and < 1.5707963267948966 rad, \
         or \"-10 deg\" for degrees"
    );
    let right = LEAST.replacen("cone = 0.17", "cone = \"10 deg\"", 1);
    assert!(RigConfig::from_toml(&right, "x.toml").is_ok());
}

#[test]
fn mistakes_are_told_all_at_once() {
    let text = LEAST
        .replace("mass = 0.5", "mass = -1")
        .replace("cone = 0.17", "cone = 4")
        .replace("4096", "0")
        .replace("motor = false", "motor = 0");
    let lines = said_of(&text);
    assert_eq!(lines.lines().count(), 8, "{lines}");
    assert_eq!(
        lines.lines().next(),
        Some("x.toml:2:33: sphere.mass: -1 is out of range; legal: 0.001 to 1000 kg")
    );
    // An unknown key hides no mistake of meaning, and a misspelt one counts as the right one: here
    // the watchdog time is long enough, and peak is not missing.
    let text = LEAST.replacen("continuous = 0.1", "continuous = 2", 1).replacen("peak", "peek", 1).replacen(
        "mass",
        "colour = 'red', mass",
        1,
    ) + "[loop]\nrate_hz = 50\n[link]\nport = '/dev/ttyACM0'\nwatchdogms = 100\n[api]\nlisten = 'here'";
    let lines = said_of(&text);
    let lines: Vec<&str> = lines.lines().map(|line| line.split("; legal").next().unwrap()).collect();
    assert_eq!(
        lines,
        [
            "x.toml:2:26: sphere.colour: unknown key",
            "x.toml:7:35: wheel[0].steer.peek: unknown key (did you mean `peak`?)",
            "x.toml:7:58: wheel[0].steer.continuous: 2 is more than peak",
            "x.toml:19:1: link.watchdogms: unknown key (did you mean `watchdog_ms`?)",
            "x.toml:21:10: api.listen: \"here\" is not an address with a port",
        ]
    );
    // A mistake in one wheel is reported together with a type error in the other.
    let text = LEAST.replacen("continuous = 0.1", "continuous = 2", 1).replace("motor = false", "motor = 0");
    assert_eq!(
        said_of(&text),
        "x.toml:7:58: wheel[0].steer.continuous: 2 is more than peak; legal: > 0 and <= 1 N m\n\
         x.toml:14:43: wheel[1].drive.motor: found 0; legal: true or false"
    );
}

#[test]
fn a_scene_is_no_rig_and_only_that_is_told() {
    for (scene, at) in
        [("name = 'x'\n[[effect]]\nid = 's'", "2:3: effect"), ("[simulate]\nhand = {}", "1:2: simulate")]
    {
        assert_eq!(
            said_of(scene),
            format!(
                "x.toml:{at}: this is a scene file, not a rig file. `hbot server --scene x.toml` starts with it, and \
                 `hbot scene load x.toml` loads it into a running server; legal: a file with [sphere] and [[wheel]]"
            )
        );
    }
    // A rig with such a key is a rig with a mistake.
    assert!(said_of(&format!("effect = []\n{LEAST}")).contains("effect: unknown key"));
}
