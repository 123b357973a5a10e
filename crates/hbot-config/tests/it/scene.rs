//! Tests of scene files: what loads, and one case for each kind of mistake.

use hbot_config::scene::{Hand, kinds, phenomena};
use hbot_config::{RunningScene, SceneFile};
use hbot_core::render::effects::{Anchor, Damper, Kind, Spring, SpringLaw};
use hbot_core::{Mat3, Quat};
use serde_json::json;

use crate::{folder, toml_files};

fn scene(text: &str) -> SceneFile {
    SceneFile::from_toml(text, "x.toml").unwrap_or_else(|mistakes| panic!("{mistakes}"))
}

fn said(text: &str) -> String {
    SceneFile::from_toml(text, "x.toml").expect_err(text).to_string()
}

fn said_of_spring(line: &str) -> String {
    said(&format!("[[effect]]\nid = 's'\nkind = 'spring'\n{line}"))
}

#[test]
fn every_file_in_scenes_loads_and_comes_back_from_json() {
    for path in toml_files("scenes") {
        let scene = SceneFile::from_path(&path).unwrap_or_else(|error| panic!("{error}"));
        let json = scene.to_json();
        let text = serde_json::to_string(&json).unwrap();
        let again = SceneFile::from_json(serde_json::from_str(&text).unwrap()).unwrap();
        assert_eq!(again, scene, "{}", path.display());
        assert_eq!(again.to_json(), json);
    }
}

#[test]
fn the_default_scene_is_built_in() {
    let scene = SceneFile::default_scene();
    assert_eq!(scene, SceneFile::from_path(&folder("scenes/spring.toml")).unwrap());
    let spring = &scene.effects()[0];
    assert_eq!((spring.id(), spring.kind_name()), ("spring", "spring"));
    assert!(scene.simulate().is_none());
}

#[test]
fn what_an_effect_leaves_out_has_the_documented_default() {
    let scene = scene("[[effect]]\nid = 's'\nkind = 'spring'\n[[effect]]\nid = 'd'\nkind = 'damper'");
    let [spring, damper] = scene.effects() else { panic!("two effects") };
    assert_eq!((spring.gain(), spring.fade_s()), (1.0, 0.05));
    let legal =
        Spring::new(SpringLaw::Geodesic, Mat3::IDENTITY, Mat3::ZERO, Quat::IDENTITY, Anchor::Absolute)
            .unwrap();
    assert_eq!(*spring.kind(), Kind::Spring(legal));
    assert_eq!(*damper.kind(), Kind::Damper(Damper::new(Mat3::IDENTITY * 0.02).unwrap()));
    assert_eq!(scene.name(), "unnamed");
    assert_eq!(SceneFile::from_json(json!({})).unwrap().effects(), []);
}

#[test]
fn parameters_reach_the_core() {
    let scene = scene(
        "[[effect]]\nid = 's'\nkind = 'spring'\ngain = 0.5\nfade_s = 2\nlaw = 'quaternion'\nanchor = 'here'\n\
         stiffness = [[4, 1, 0], [1, 3, 0], [0, 0, 2]]\ndamping = 0.5\nreference = [0, 0, 0, -2]",
    );
    let spring = &scene.effects()[0];
    assert_eq!((spring.gain(), spring.fade_s()), (0.5, 2.0));
    let stiffness = Mat3::from_cols_array(&[4.0, 1.0, 0.0, 1.0, 3.0, 0.0, 0.0, 0.0, 2.0]);
    let reference = Quat::from_xyzw(0.0, 0.0, -1.0, 0.0);
    let legal =
        Spring::new(SpringLaw::Quaternion, stiffness, Mat3::IDENTITY * 0.5, reference, Anchor::Here).unwrap();
    assert_eq!(*spring.kind(), Kind::Spring(legal));
}

#[test]
fn an_empty_description_is_the_same_as_none() {
    let [empty, none] = ["description = ''", ""].map(scene);
    assert_eq!((&empty, empty.description()), (&none, ""));
    assert!(empty.to_json().get("description").is_none());
    assert_eq!(
        said(&format!("description = '{}'", "ä".repeat(301))),
        format!(
            "x.toml:1:15: description: the string \"{}\"... has 301 characters; legal: at most 300 characters",
            "ä".repeat(40)
        )
    );
}

#[test]
fn a_rig_is_no_scene_and_only_that_is_told() {
    let rig = include_str!("../../../../rigs/prototype.toml");
    let said = said(rig);
    assert!(
        said.contains("sphere: this is a rig file, not a scene file. `hbot server --rig x.toml`"),
        "{said}"
    );
    assert_eq!(said.lines().count(), 1);
    let json = SceneFile::from_json(json!({"wheel": [], "gain": 3})).unwrap_err().to_string();
    assert_eq!(json, "wheel: this is a rig, not a scene; legal: a file with [[effect]]");
}

fn listed() -> String {
    kinds().iter().map(|kind| format!("{:?}", kind.name)).collect::<Vec<_>>().join(", ")
}

#[test]
fn ids_and_kinds() {
    let kinds = listed();
    assert!(kinds.starts_with("\"constant\", \"spring\", "), "{kinds}");
    assert_eq!(
        said("[[effect]]\nid = 's'\nkind = 'sprng'\ngain = -1"),
        format!(
            "x.toml:3:8: effect[0].kind: \"sprng\" is not known here (did you mean \"spring\"?); legal: {kinds}\n\
             x.toml:4:8: effect[0].gain: -1 is out of range; legal: 0 to 10"
        )
    );
    assert_eq!(
        said("[[effect]]"),
        format!(
            "x.toml:1:1: effect[0].id: missing; legal: a name of your own, such as id = \"a\"\n\
             x.toml:1:1: effect[0].kind: missing; legal: {kinds}"
        )
    );
    assert!(
        said("[[effect]]\nid = 's'\nknid = 'spring'")
            .contains("effect[0].kind: missing (is it `knid`?); legal:")
    );
    assert_eq!(
        said("[[effect]]\nid = 'a'\nkind = 'damper'\n[[effect]]\nid = 'a'\nkind = 'spring'"),
        "x.toml:5:6: effect[1].id: \"a\" is the id of effect[0] already; legal: ids that differ"
    );
    // The same with another mistake in each effect, and an effect between them.
    assert_eq!(
        said(
            "[[effect]]\nid = 'a'\nkind = 'damper'\ngain = -1\n[[effect]]\nid = 'b'\nkind = 'damper'\n\
             [[effect]]\nid = 'a'\nkind = 'damper'\ngain = -2"
        ),
        "x.toml:4:8: effect[0].gain: -1 is out of range; legal: 0 to 10\n\
         x.toml:9:6: effect[2].id: \"a\" is the id of effect[0] already; legal: ids that differ\n\
         x.toml:11:8: effect[2].gain: -2 is out of range; legal: 0 to 10"
    );
    assert_eq!(
        said("[[effect]]\nid = 'a b'\nkind = 'damper'"),
        "x.toml:2:6: effect[0].id: \"a b\" has other characters; legal: letters, digits, `_`, `-` and `.`"
    );
    assert_eq!(
        said("[[effect]]\nid = ''\nkind = 'damper'"),
        "x.toml:2:6: effect[0].id: found the string \"\"; legal: 1 to 64 characters"
    );
    assert_eq!(said("effect = [1]"), "x.toml:1:11: effect[0]: found 1; legal: a table");
    let many: String = (0..33).map(|i| format!("[[effect]]\nid = 'e{i}'\nkind = 'damper'\n")).collect();
    assert_eq!(
        said(&many),
        "x.toml:1:1: effect: found an array of 33 elements; legal: an array of at most 32 tables"
    );
}

#[test]
fn keys_and_types() {
    assert_eq!(
        said_of_spring("stifness = 3"),
        "x.toml:4:1: effect[0].stifness: unknown key (did you mean `stiffness`?); legal: id, kind, law, \
         stiffness, damping, deadband, reference, anchor, gain, fade_s, fade_out_s"
    );
    assert_eq!(
        said_of_spring("stiffness = 'soft'"),
        "x.toml:4:13: effect[0].stiffness: found the string \"soft\"; legal: a number, 0 to 1000 N m/rad, or three for \
         the axes, such as [2,3,4], or a symmetric positive semidefinite 3x3 matrix"
    );
    assert_eq!(
        said_of_spring("law = 'hooke'"),
        "x.toml:4:7: effect[0].law: \"hooke\" is not known here; legal: \"geodesic\", \"quaternion\""
    );
    assert_eq!(
        said_of_spring("[effects]"),
        "x.toml:4:2: effects: unknown key (did you mean `effect`?); legal: name, description, effect, simulate"
    );
}

#[test]
fn the_keys_of_a_misspelt_kind_and_of_a_misspelt_key_are_checked_at_once() {
    let said = said(
        "[[effect]]\nid = 'a'\nkind = 'sprng'\nstifness = 3\nreference = [0, 0, 0, 0]\n\
         [[effects]]\nid = 'a'\nkind = 'end_stop'\ntwst = [1, 0]\n",
    );
    let said: Vec<&str> = said.lines().map(|line| line.split("; legal").next().unwrap()).collect();
    assert_eq!(
        said,
        [
            "x.toml:3:8: effect[0].kind: \"sprng\" is not known here (did you mean \"spring\"?)",
            "x.toml:4:1: effect[0].stifness: unknown key (did you mean `stiffness`?)",
            "x.toml:5:13: effect[0].reference: the quaternion has no length",
            "x.toml:6:3: effects: unknown key (did you mean `effect`?)",
        ]
    );
    let said = self::said("[[effects]]\nid = 'a'\nkind = 'end_stop'\ntwst = [1, 0]\n");
    let said: Vec<&str> = said.lines().map(|line| line.split("; legal").next().unwrap()).collect();
    assert_eq!(
        said,
        [
            "x.toml:1:3: effects: unknown key (did you mean `effect`?)",
            "x.toml:4:1: effect[0].twst: unknown key (did you mean `twist`?)",
            "x.toml:4:8: effect[0].twist: from 1 to 0",
        ]
    );
}

#[test]
fn three_numbers_are_a_value_for_each_axis() {
    let loaded = |keys: &str| {
        let text = format!("[[effect]]\nid = 'a'\nkind = 'spring'\n{keys}\n");
        hbot_config::SceneFile::from_toml(&text, "x.toml").unwrap_or_else(|error| panic!("{error}"))
    };
    let rows = loaded("stiffness = [[1, 0, 0], [0, 2, 0], [0, 0, 3]]");
    assert_eq!(loaded("stiffness = [1, 2, 3]"), rows);
    let mut running = RunningScene::new();
    let _ = running.load(loaded("stiffness = 4"));
    let three = serde_json::json!({"stiffness": [1, 2, 3]});
    let _ = running.set("a", three.as_object().unwrap()).unwrap();
    assert_eq!(running.file().effects()[0].to_json()["stiffness"], rows.effects()[0].to_json()["stiffness"]);
    assert_eq!(
        said_of_spring("stiffness = [1, 2, 2000]"),
        "x.toml:4:20: effect[0].stiffness[2][2]: 2000 is out of range; legal: -1000 to 1000 N m/rad"
    );
    let negative = said_of_spring("damping = [1, -2, 3]");
    assert!(negative.contains("not positive semidefinite"), "{negative}");
}

#[test]
fn one_bracket_and_a_decimal_comma_are_told_what_to_write() {
    let said = |text: &str| hbot_config::SceneFile::from_toml(text, "x.toml").unwrap_err().to_string();
    assert_eq!(
        said("[effect]\nid = 'a'\nkind = 'spring'\n"),
        "x.toml:1:2: effect: this is one table, and a scene has a list of effects; legal: [[effect]] with two brackets, once \
         for each effect"
    );
    let comma = said("[[effect]]\nid = 'a'\nkind = 'spring'\nstiffness = 2,5 # N m/rad\n");
    assert!(comma.contains("x.toml:4:") && comma.contains("(write a decimal point: 2.5)"), "{comma}");
    for value in ["2 N m/rad", "0.1rad # wide", "-3 %", "'2 N m/rad'"] {
        let unit = said(&format!("[[effect]]\nid = 'a'\nkind = 'spring'\nstiffness = {value}\n"));
        assert!(unit.contains("(write the number alone: its unit is that of the key)"), "{unit}");
    }
    let degrees = said("[[effect]]\nid = 'a'\nkind = 'end_stop'\ncone = 35 deg # wide\n");
    assert!(degrees.contains("(write it in quotes: \"35 deg\")"), "{degrees}");
    let three = said("[[effect]]\nid = 'a'\nkind = 'constant'\ntorque = '0.1 N m'\n");
    assert!(three.contains("an array of 3 numbers") && !three.contains("number alone"), "{three}");
    for value in ["2nd", "3-wheel", "1e", "N m"] {
        assert!(!said(&format!("name = {value}\n")).contains("number alone"), "{value}");
    }
    let open = said("[[effect]]\nid = 'a'\nkind = 'spring'\nanchor = [1, 0, 0, 0\ndamping = 0.1\n");
    let line = "x.toml:5:1: not TOML: missing comma between array elements, expected `,` (is a `]` missing before this line?)";
    assert_eq!(open, line);
    let comma = said("[[effect]]\nid = 'a'\nkind = 'spring'\nanchor = [1 0, 0, 0]\n");
    assert!(comma.contains("x.toml:4:") && !comma.contains("before this line"), "{comma}");
    let header = said("[sphere\nradius = 1\n[sphere]\nradius = 2\nradius = 3\n");
    assert!(header.contains("unclosed table") && !header.contains("duplicate"), "{header}");
    let grad = said("[[effect]]\nid = 'a'\nkind = 'end_stop'\ncone = '35 grad'\n");
    assert!(grad.contains("the string \"35 grad\" (write degrees as \"35 deg\"); legal: "), "{grad}");
    let typed = said("[[effect]]\nid = 'a'\ntype = 'spring'\n");
    assert!(typed.contains("effect[0].kind: missing (is it `type`?); legal: "), "{typed}");
    let twice = said("[effect]\nid = 'a'\n[effect]\nid = 'b'\n");
    assert!(twice.contains("x.toml:3:2: not TOML") && twice.contains("write [[effect]]"), "{twice}");
    assert!(!said("a = [1, 2\n").contains("decimal"));
}

#[test]
fn matrices_and_quaternions() {
    assert_eq!(
        said_of_spring("stiffness = [[1, 0.5, 0], [0.4, 1, 0], [0, 0, 1]]"),
        "x.toml:4:13: effect[0].stiffness: the matrix is not symmetric: row 1, column 2 is 0.5 and row 2, column 1 is 0.4; \
         legal: three for the axes, such as [2,3,4], or a symmetric positive semidefinite 3x3 matrix"
    );
    assert_eq!(
        said_of_spring("damping = [[1, 2, 0], [2, 1, 0], [0, 0, 1]]"),
        "x.toml:4:11: effect[0].damping: the matrix is not positive semidefinite: it would push away in some direction; \
         legal: three for the axes, such as [2,3,4], or a symmetric positive semidefinite 3x3 matrix"
    );
    let saddle = said_of_spring("stiffness = [[0, 1, 0], [1, 0, 0], [0, 0, 0]]");
    assert!(saddle.contains("the matrix is not positive semidefinite"), "{saddle}");
    let least = scene("[[effect]]\nid = 'a'\nkind = 'spring'\nstiffness = 5e-324");
    assert_eq!(least.effects().len(), 1, "legal, and no effect is lost");
    assert_eq!(
        said_of_spring("stiffness = [[1, 0, 0], [0, 1, 0]]"),
        "x.toml:4:13: effect[0].stiffness: found an array of 2 elements; legal: three for the axes, such as [2,3,4], or a symmetric positive semidefinite 3x3 matrix"
    );
    let two = "x.toml:4:13: effect[0].stiffness: found an array of 2 elements; legal: three for the axes, such as [2,3,4], or a symmetric positive semidefinite 3x3 matrix";
    assert_eq!(said_of_spring("stiffness = [1, 2]"), two);
    assert_eq!(
        said_of_spring("stiffness = [[1, 0, 0], [0, nan, 0], [0, 0, 2000]]"),
        "x.toml:4:29: effect[0].stiffness[1][1]: nan is not a finite number; legal: a number, -1000 to 1000 N m/rad\n\
         x.toml:4:45: effect[0].stiffness[2][2]: 2000 is out of range; legal: -1000 to 1000 N m/rad"
    );
    assert_eq!(
        said_of_spring("reference = [0, 0, 0.0, 0]"),
        "x.toml:4:13: effect[0].reference: the quaternion has no length; legal: [w, x, y, z], not all zero"
    );
    assert_eq!(
        said_of_spring("reference = [1, 0, 0]"),
        "x.toml:4:13: effect[0].reference: found an array of 3 elements; legal: an array of 4 numbers"
    );
    assert_eq!(
        said_of_spring("reference = [nan, 0, 0, 0]"),
        "x.toml:4:14: effect[0].reference[0]: nan is not a finite number; legal: a number, -1000 to 1000"
    );
}

#[test]
fn phenomena_are_there_where_they_are_named() {
    assert!(scene("").simulate().is_none());
    assert_eq!(scene("[simulate]").simulate().unwrap().hand, None);
    assert_eq!(scene("[simulate]\nhand = {}").simulate().unwrap().hand, Some(Hand::default()));
    let hand = scene("[simulate]\nhand = { rate = 1 }").simulate().unwrap().hand.unwrap();
    assert_eq!(hand, Hand { rate: 1.0, ..Hand::default() });
    let hand =
        scene("[simulate]\nhand = { axis = [0, 0, 2], angle = '-40 deg' }").simulate().unwrap().hand.unwrap();
    let angle = -40.0_f64.to_radians();
    assert_eq!(hand, Hand { axis: [0.0, 0.0, 2.0], angle, ..Hand::default() });
    assert_eq!(
        said("[simulate]\nhand = { axis = [0, 0, 0] }"),
        "x.toml:2:17: simulate.hand.axis: the vector has no length; legal: [x, y, z], not all zero"
    );
    assert_eq!(
        said("[simulate]\nhands = {}"),
        "x.toml:2:1: simulate.hands: unknown key (did you mean `hand`?); legal: joint_friction, \
         cage_friction, slip, pivoting, eccentric, imbalance, wheel_modules, gear, compliance, encoder, motor, \
         torque_constants, cogging, link, hand"
    );
    assert_eq!(said("[simulate]\nhand = true"), "x.toml:2:8: simulate.hand: found true; legal: a table");
}

#[test]
fn json_mistakes_have_paths_and_no_lines() {
    let said = |value| SceneFile::from_json(value).unwrap_err().to_string();
    assert_eq!(said(json!([])), "found an array of 0 elements; legal: a table");
    assert_eq!(said(json!({"name": null})), "name: found null; legal: a string");
    assert_eq!(
        said(json!({"effect": [{"id": "d", "kind": "damper", "damping": -1, "\u{1b}[2J": 1}]})),
        "effect[0].damping: -1 is out of range; legal: 0 to 100 N m s/rad\n\
         effect[0].\"\\u{1b}[2J\": unknown key; legal: id, kind, damping, deadband, gain, fade_s, fade_out_s"
    );
}

#[test]
fn what_there_is_to_choose_from_is_listed_with_what_a_panel_needs() {
    let kinds = kinds();
    for listed in kinds.iter().chain(&phenomena()) {
        assert!(!listed.description.is_empty(), "{}", listed.name);
        let properties = listed.schema["properties"].as_object().unwrap();
        for (name, parameter) in properties {
            assert!(!["id", "op", "effect", "kind"].contains(&name.as_str()), "{name} is a reserved name");
            assert!(parameter["description"].is_string(), "{name}");
            assert!(!parameter["default"].is_null(), "{name}");
            if parameter["type"] == "number" {
                assert!(parameter["minimum"].is_number() && parameter["maximum"].is_number(), "{name}");
            }
        }
    }
    let stiffness = &kinds[1].schema["properties"]["stiffness"];
    assert_eq!(stiffness["anyOf"][0]["maximum"], 1000.0);
    assert_eq!(stiffness["unit"], "N m/rad");
    let names: Vec<_> = phenomena().iter().map(|listed| listed.name).collect();
    assert_eq!((names[0], names.last()), ("joint_friction", Some(&"hand")));
}

#[test]
fn what_is_listed_as_default_is_what_absence_means() {
    for kind in kinds() {
        let mut written = json!({"id": "e", "kind": kind.name});
        let bare = SceneFile::from_json(json!({"effect": [written.clone()]})).unwrap();
        for (name, parameter) in kind.schema["properties"].as_object().unwrap() {
            written[name] = parameter["default"].clone();
        }
        assert_eq!(SceneFile::from_json(json!({"effect": [written]})).unwrap(), bare);
    }
}

#[test]
fn a_list_of_nothing_but_mistakes_is_told_to_its_hundredth_and_looked_at_no_further() {
    // As many effects as a message of 64 KiB can hold in its shortest encoding. Without the limit
    // on mistakes this takes minutes.
    for effect in [json!({}), json!(0), json!({"kind": "sprng"})] {
        let mistakes = SceneFile::from_json(json!({"effect": vec![effect; 60_000]})).unwrap_err();
        assert!(mistakes.len() <= 101, "{}", mistakes.len());
        assert!(mistakes[0].message.contains("60000 elements"), "{}", mistakes[0]);
        assert!(!mistakes.iter().any(|mistake| mistake.path.starts_with("effect[32]")), "{mistakes}");
    }
    let unknown: serde_json::Map<_, _> = (0..101).map(|i| (format!("x{i}"), json!(0))).collect();
    let mistakes = SceneFile::from_json(unknown.clone().into()).unwrap_err();
    assert_eq!((mistakes.len(), mistakes[99].path.as_str()), (101, "x99"));
    assert!(mistakes.to_string().ends_with("\n... and more"), "{mistakes}");
    let hundred: serde_json::Map<_, _> = unknown.into_iter().take(100).collect();
    let mistakes = SceneFile::from_json(hundred.into()).unwrap_err();
    assert!(mistakes.len() == 100 && !mistakes.to_string().contains("and more"), "{mistakes}");
}

#[test]
fn a_name_is_one_line_of_text() {
    for name in ["\u{1b}[2J", "a\nb", "\u{9b}31m", "\u{202e}abc", "a\u{2028}b", "a\u{200b}b"] {
        let mistakes = SceneFile::from_json(json!({"name": name})).unwrap_err();
        assert_eq!(
            mistakes.to_string(),
            "name: it has control or invisible characters; legal: text of one line"
        );
    }
    assert_eq!(SceneFile::from_json(json!({"name": "Zähne, 3×3"})).unwrap().name(), "Zähne, 3×3");
}
