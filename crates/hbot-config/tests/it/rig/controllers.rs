//! The keys of a rig file that depend on the protocol of the motor controllers, and its ports.

use hbot_config::RigConfig;
use hbot_config::rig::{Port, Protocol};

use super::{LEAST, said, said_of};

/// Returns the shortest rig file whose controllers have ids. `protocol` is the value of
/// `link.protocol`. `ids` has the keys of each joint that replace `counts_per_turn`, such as the
/// id.
fn with_ids(protocol: &str, ids: [&str; 4]) -> String {
    let mut text = LEAST.to_owned();
    for id in ids {
        text = text.replacen("{ counts_per_turn = 4096", &format!("{{ {id}"), 1);
    }
    text = text.replace("{ ,", "{");
    format!("{text}[link]\nprotocol = '{protocol}'")
}

#[test]
fn controllers_with_ids_are_named_by_them_within_their_range_each_once_on_its_port() {
    assert_eq!((Protocol::Moteus.ids(), Protocol::Odrive.ids()), (Some(1..=127), Some(0..=63)));
    let id = |id: u32| format!("controller = {id}");
    for (protocol, first, last) in [("moteus", 1, 127), ("odrive", 0, 63)] {
        let text = |ids: [u32; 4]| {
            let ids = ids.map(id);
            with_ids(protocol, ids.each_ref().map(String::as_str))
        };
        let said = |ids: [u32; 4]| said_of(&text(ids));
        if protocol == "moteus" {
            let config = RigConfig::from_toml(&text([first, 126, 7, 5]), "x.toml").unwrap();
            assert_eq!(config.link.protocol, Protocol::Moteus);
            assert_eq!(config.controllers, [1, 126, 7, 5]);
        }
        let twice = said([first, 7, 5, 7]);
        let where_and_how =
            "wheel[1].drive.controller: 7 is taken by another joint; legal: ids that differ on each port";
        assert!(twice.contains(where_and_how), "{twice}");
        let beyond = said([first, 7, 5, last + 1]);
        assert!(beyond.contains("wheel[1].drive.controller: "), "{beyond}");
        let missing = said_of(&with_ids(protocol, [&id(first), "", &id(5), &id(6)]));
        let legal = format!(
            "wheel[0].drive.controller: missing; legal: the id of its controller on the bus, {first} to {last}"
        );
        assert!(missing.contains(&legal), "{missing}");
    }
    let below = said_of(&with_ids(
        "moteus",
        ["controller = 0", "controller = 1", "controller = 2", "controller = 3"],
    ));
    let words = "wheel[0].steer.controller: 0 is no id of a controller that speaks moteus; legal: the id of its controller on \
                 the bus, 1 to 127";
    assert!(below.contains(words), "{below}");
}

/// All moteus servos of a line obey commands to id 127, so that a servo with this id must be alone.
#[test]
fn the_id_that_all_controllers_obey_is_legal_only_for_one_that_is_alone_on_its_port() {
    let joints = |last: &str| {
        let ids = ["controller = 1", "controller = 2", "controller = 3", last];
        with_ids("moteus", ids)
    };
    let shared = said_of(&joints("controller = 127"));
    let words = "wheel[1].drive.controller: all controllers of this line would obey commands to 127; legal: another id, or a \
                 separate port for the controller 127";
    assert!(shared.contains(words), "{shared}");
    let alone = joints("controller = 127, port = 1") + "\nport = ['/dev/a', '/dev/b']";
    let config = RigConfig::from_toml(&alone, "x.toml").expect("127 is alone on its port");
    assert_eq!(config.controllers, [1, 2, 3, 127]);
}

#[test]
fn counts_a_turn_are_the_file_s_or_the_protocol_s() {
    assert_eq!(
        said("counts_per_turn = 4096, ", ""),
        "x.toml:7:9: wheel[0].steer.counts_per_turn: missing; legal: a whole number, 4 to 1073741824"
    );
    let with = |counts: &str| {
        with_ids(
            "moteus",
            [&format!("controller = 1{counts}"), "controller = 2", "controller = 3", "controller = 4"],
        )
    };
    let words = "wheel[0].steer.counts_per_turn: 4096 counts a turn, and controllers that speak moteus report turns; \
                 legal: 131072; best leave it out";
    let wrong = said_of(&with(", counts_per_turn = 4096"));
    assert!(wrong.contains(words), "{wrong}");
    for counts in ["", ", counts_per_turn = 131072"] {
        let joints = RigConfig::from_toml(&with(counts), "x.toml").unwrap().rig.joints;
        assert!(joints[..4].iter().all(|joint| joint.counts_per_turn == 131_072), "{counts}");
    }
}

#[test]
fn a_rig_may_have_several_ports() {
    let ports = "[link]\nport = ['/dev/ttyACM0', '/dev/ttyACM1']";
    let (first, second) = LEAST.rsplit_once("[[wheel]]").unwrap();
    let second = second.replace("{ counts", "{ port = 1, counts");
    let config = RigConfig::from_toml(&format!("{first}[[wheel]]{second}{ports}"), "x.toml").unwrap();
    assert_eq!(config.link.port.to_string(), "/dev/ttyACM0, /dev/ttyACM1");
    // Positions are counted separately on each line.
    assert_eq!((config.ports, config.controllers), (vec![0, 0, 1, 1], vec![0, 1, 0, 1]));
    // The same file works on the simulated rig, which has one line for all joints.
    let simulated = RigConfig::from_toml(&format!("{first}[[wheel]]{second}"), "x.toml").unwrap();
    assert_eq!(simulated.link.port, Port::Sim);
    assert_eq!(
        said_of(&format!("{LEAST}{ports}")),
        "x.toml:16:8: link.port: no joint is on /dev/ttyACM1; legal: ports with joints"
    );
    let text = format!("{first}[[wheel]]{second}[link]\nport = '/dev/ttyACM0'");
    assert_eq!(
        said_of(&text),
        "x.toml:13:18: wheel[1].steer.port: 1 is past the last of 1 in link.port; legal: 0 to 0\n\
         x.toml:14:18: wheel[1].drive.port: 1 is past the last of 1 in link.port; legal: 0 to 0"
    );
    let text = format!("{first}[[wheel]]{second}[link]\nport = ['/dev/a', '/dev/a']");
    assert!(said_of(&text).contains("/dev/a is named twice"));
    assert!(said_of(&format!("{LEAST}[link]\nport = []")).contains("an array of 1 to 8 elements"));
    assert!(said_of(&format!("{LEAST}[link]\nport = 3")).contains("a list of 1 to 8 paths"));
}

/// The joints of this file have what moteus servos need. As joints of another protocol they would
/// lack `counts_per_turn`, and in the second file also have a wrong zero.
#[test]
fn a_misspelt_protocol_is_the_only_mistake_of_its_file() {
    let ids = ["controller = 1", "controller = 2", "controller = 3", "controller = 4"];
    let legal = r#"legal: "hbot", "moteus", "odrive""#;
    assert_eq!(
        said_of(&with_ids("motues", ids)),
        format!(
            r#"x.toml:16:12: link.protocol: "motues" is not known here (did you mean "moteus"?); {legal}"#
        )
    );
    let number = with_ids("", ids).replace("protocol = ''", "protocol = 3");
    assert_eq!(said_of(&number), format!("x.toml:16:12: link.protocol: found 3; {legal}"));
    // Mistakes that do not depend on the protocol are still reported with it.
    let peak = with_ids("motues", ids).replacen("continuous = 0.1", "continuous = 2", 1);
    let both = said_of(&peak);
    assert_eq!(both.lines().count(), 2, "{both}");
    assert!(both.contains("wheel[0].steer.continuous: 2 is more than peak"), "{both}");
}
