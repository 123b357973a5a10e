//! Checks of single kinds of effects beyond ranges, recorded paths, and fading out.

use hbot_config::scene::{SceneEffect, kinds};
use hbot_config::{RigConfig, RunningScene, SceneFile};
use hbot_core::render::effects::{Kind, MAX_OWN};
use hbot_core::render::scene::{MAX_EFFECTS, MAX_NUMBERS};
use serde_json::{Map, Value, json};

fn said(kind: &str, line: &str) -> String {
    let text = format!("[[effect]]\nid = 'e'\nkind = '{kind}'\n{line}");
    SceneFile::from_toml(&text, "x.toml").expect_err(&text).to_string()
}

fn map(value: Value) -> Map<String, Value> {
    value.as_object().unwrap().clone()
}

#[test]
fn axes_have_a_direction() {
    let kinds = ["detents", "end_stop", "guide", "vibration", "pulse", "track"];
    for (kind, key) in
        kinds.map(|kind| (kind, "axis")).into_iter().chain([("texture", "at"), ("guide", "pointer")])
    {
        assert_eq!(
            said(kind, &format!("{key} = [0, 0, 0]")),
            format!(
                "x.toml:4:{}: effect[0].{key}: the vector has no length; legal: [x, y, z], not all zero",
                key.len() + 4
            )
        );
    }
}

/// A user who corrects all mistakes of one check does not find another one in the next.
#[test]
fn a_direction_of_length_zero_is_told_with_the_other_mistakes_of_its_effect() {
    for kind in kinds() {
        for (key, parameter) in kind.schema["properties"].as_object().unwrap() {
            if !parameter["description"].as_str().unwrap().ends_with("Any length except zero.") {
                continue;
            }
            let zero = vec!["0"; parameter["minItems"].as_u64().unwrap() as usize].join(", ");
            let told = said(kind.name, &format!("{key} = [{zero}]\ngain = -1\ngian = 1"));
            let starts: Vec<&str> = told.lines().map(|line| line.split("; legal").next().unwrap()).collect();
            let [direction, gain, unknown] = starts[..] else { panic!("{}: {told}", kind.name) };
            assert!(direction.contains(&format!("effect[0].{key}: the ")), "{direction}");
            assert!(direction.ends_with(" has no length"), "{direction}");
            assert_eq!(gain, "x.toml:5:8: effect[0].gain: -1 is out of range");
            assert!(unknown.contains("effect[0].gian: unknown key"), "{unknown}");
        }
    }
}

#[test]
fn positions_ascend_and_ranges_have_two_ends() {
    assert_eq!(
        said("detents", "positions = [0, 1, 1.001]"),
        "x.toml:4:20: effect[0].positions[2]: 1.001 does not follow 1; legal: ascending, 0.002 rad apart or more"
    );
    assert_eq!(
        said("end_stop", "twist = [1, -1]"),
        "x.toml:4:9: effect[0].twist: from 1 to -1; legal: [from, to], ascending"
    );
    assert_eq!(
        said("detents", "count = 0"),
        "x.toml:4:9: effect[0].count: 0 is out of range; legal: 1 to 720"
    );
    assert_eq!(
        said("magnet", "width = 10"),
        "x.toml:4:9: effect[0].width: 10 is out of range; legal: 0.01 to 2 rad, or \"10 deg\" for degrees"
    );
}

#[test]
fn orientations_of_one_s_own_are_apart_and_stand_with_their_set_alone() {
    assert_eq!(
        said("snaps", "set = 'own'"),
        "x.toml:1:1: effect[0].orientations: the set is \"own\" and there is none; legal: 1 to 16 quaternions"
    );
    assert_eq!(
        said("snaps", "orientations = [[1, 0, 0, 0]]"),
        "x.toml:4:16: effect[0].orientations: the set is not \"own\"; legal: no orientations, or set = \"own\""
    );
    assert_eq!(
        said("snaps", "orientations = [[1, 0, 0, 0], [0, 1, 0, 0], [2, 0.1, 0, 0]]\nset = 'own'"),
        "x.toml:4:45: effect[0].orientations[2]: only 0.100 rad from orientation 0; legal: 0.2 rad apart or more"
    );
    assert_eq!(
        said("snaps", "orientations = [[1, 0, 0]]\nset = 'own'"),
        "x.toml:4:17: effect[0].orientations[0]: found an array of 3 elements; legal: an array of 4 numbers"
    );
    let many = format!("orientations = {:?}\nset = 'own'", vec![[1, 0, 0, 0]; MAX_OWN + 1]);
    assert_eq!(
        said("snaps", &many),
        "x.toml:4:16: effect[0].orientations: found an array of 17 elements; legal: up to 16 quaternions [w, x, y, z]"
    );
}

#[test]
fn points_begin_at_zero_ascend_and_close_where_they_repeat() {
    let said =
        |points: &str| said("track", &format!("points = [{points}]\npath = 'waypoints'\nrepeat = true"));
    assert_eq!(
        said("[0, 1, 0, 0, 0]"),
        "x.toml:4:10: effect[0].points: 1 points make no path; legal: 2 to 800 points [t, w, x, y, z]"
    );
    assert_eq!(
        said("[1, 1, 0, 0, 0], [2, 1, 0, 0, 0]"),
        "x.toml:4:12: effect[0].points[0][0]: the time 1 s does not follow; legal: 0 s at the first point"
    );
    assert_eq!(
        said("[0, 1, 0, 0, 0], [2, 1, 0, 0, 0], [2, 1, 0, 0, 0]"),
        "x.toml:4:46: effect[0].points[2][0]: the time 2 s does not follow; legal: 2.001 s or more"
    );
    assert_eq!(
        said("[0, 1, 0, 0, 0], [2, 0, 0, 0, 0]"),
        "x.toml:4:28: effect[0].points[1]: the quaternion has no length; legal: [w, x, y, z], not all zero"
    );
    assert_eq!(
        said("[0, 1, 0, 0, 0], [2, 0, 1, 0, 0]"),
        "x.toml:6:10: effect[0].repeat: the path would jump from its end to its start; legal: a last point that is the first \
         one again"
    );
}

#[test]
fn a_scene_file_without_effects_is_a_scene() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("scene.toml");
    std::fs::write(&scene, "name = 'Nothing'\n").unwrap();
    assert_eq!(SceneFile::from_path(&scene).unwrap().effects().len(), 0);
}

#[test]
fn a_scene_file_may_name_a_recorded_file_and_nobody_else() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("scene.toml");
    let text = "[[effect]]\nid = 'e'\nkind = 'track'\npath = 'record'\nfile = 'way.csv'\n";
    std::fs::write(&scene, text).unwrap();
    let said = || {
        SceneFile::from_path(&scene)
            .unwrap_err()
            .to_string()
            .replace(&format!("{}", folder.path().display()), "")
    };
    assert!(said().starts_with("/scene.toml:5:8: effect[0].file: /way.csv: "), "{}", said());
    assert!(
        said().ends_with("legal: a CSV file with the columns t, w, x, y, z and 2 to 800 rows"),
        "{}",
        said()
    );
    for (csv, what) in [
        ("w,x,y,z\n1,0,0,0\n", "the first line is \"w,x,y,z\""),
        ("t,w,x,y,z\n0,1,0,0,nan\n", "row 1 has a number that is not finite"),
        ("t,w,x,y,z\n0,1,0,0\n", "found record with 4 fields"),
        (
            &format!("t,w,x,y,z\n{}", (0..801).map(|k| format!("{k},1,0,0,0\n")).collect::<String>()),
            "more than 800 rows",
        ),
    ] {
        std::fs::write(folder.path().join("way.csv"), csv).unwrap();
        assert!(said().contains(what), "{}", said());
    }
    std::fs::write(folder.path().join("way.csv"), "t, w, x, y, z\n# a comment\n0,1,0,0,0\n1.5,0,2,0,0\n")
        .unwrap();
    let file = SceneFile::from_path(&scene).unwrap();
    let json = file.to_json();
    assert_eq!(json["effect"][0]["points"], json!([[0.0, 1.0, 0.0, 0.0, 0.0], [1.5, 0.0, 2.0, 0.0, 0.0]]));
    assert_eq!(SceneFile::from_json(json).unwrap(), file, "what goes over the wire carries its points");
    let mut running = RunningScene::new();
    let compiled = running.load(file);
    let numbers = compiled.numbers(compiled.effects()[0].numbers);
    assert_eq!(numbers, [0.0, 1.0, 0.0, 0.0, 0.0, 1.5, 0.0, 1.0, 0.0, 0.0]);
    let said = SceneFile::from_toml(text, "x.toml").unwrap_err().to_string();
    assert_eq!(
        said,
        "x.toml:5:8: effect[0].file: a file is read with a scene file alone; legal: points here, or a scene file that names the \
         file"
    );
}

#[test]
fn a_client_names_no_file_whatever_the_path_and_neither_by_set() {
    for path in ["sine", "chirp", "record", "waypoints"] {
        let track = json!({"id": "t", "kind": "track", "path": path, "file": "/etc/passwd"});
        let said = SceneFile::from_json(json!({"effect": [track]})).unwrap_err().to_string();
        assert!(said.contains("effect[0].file: a file is read with a scene file alone"), "{path}: {said}");
    }
    let mut running = RunningScene::new();
    let _ = running.load(SceneFile::from_json(json!({"effect": [{"id": "t", "kind": "track"}]})).unwrap());
    let said = running.set("t", &map(json!({"file": "/etc/passwd"}))).unwrap_err().to_string();
    assert!(said.contains("a file is read with a scene file alone"), "{said}");
}

fn points(count: usize) -> Value {
    (0..count).map(|k| json!([k, 1, 0, 0, 0])).collect()
}

#[test]
fn figures_have_room_or_the_scene_is_refused_and_set_changes_nothing() {
    let track =
        |id: &str, count| json!({"id": id, "kind": "track", "path": "record", "points": points(count)});
    let said =
        SceneFile::from_json(json!({"effect": [track("a", 800), track("b", 20)]})).unwrap_err().to_string();
    assert_eq!(
        said,
        "effect: positions, orientations and points take 4100 numbers; legal: at most 4096 in a scene (a point takes 5)"
    );
    let file = SceneFile::from_json(json!({"effect": [track("a", 800), track("b", 10)]})).unwrap();
    let mut running = RunningScene::new();
    running.load(file);
    let before = running.clone();
    let error = running.set("b", &map(json!({"points": points(20)}))).unwrap_err();
    assert!(error.to_string().contains("take 4100 numbers"), "{error}");
    assert_eq!(running, before);
    running.set("b", &map(json!({"points": points(19)}))).unwrap();
}

#[test]
fn each_effect_s_figures_are_its_own() {
    let file = SceneFile::from_toml(
        "[[effect]]\nid = 'a'\nkind = 'detents'\npositions = [1, 2]\n[[effect]]\nid = 'b'\nkind = 'damper'\n\
         [[effect]]\nid = 'c'\nkind = 'snaps'\nset = 'own'\norientations = [[0, 2, 0, 0]]",
        "x.toml",
    );
    let mut running = RunningScene::new();
    let scene = running.load(file.unwrap());
    let numbers: Vec<&[f64]> = scene.effects().iter().map(|effect| scene.numbers(effect.numbers)).collect();
    assert_eq!(numbers, [&[1.0, 2.0][..], &[], &[0.0, 1.0, 0.0, 0.0]]);
    let Kind::Snaps(snaps) = scene.effects()[2].kind else { panic!("the third") };
    assert!(snaps.rounding > 0.0);
    assert_eq!((running.id_at(0), running.id_at(2), running.id_at(3)), (Some("a"), Some("c"), None));
}

#[test]
fn an_effect_with_a_time_to_fade_out_stays_for_it_beside_the_next_scene() {
    let scene = |ids: &[&str], fade: f64| {
        let effects: Vec<Value> = ids
            .iter()
            .map(|id| json!({"id": id, "kind": "detents", "positions": [1, 2], "fade_out_s": fade}))
            .collect();
        SceneFile::from_json(json!({ "effect": effects })).unwrap()
    };
    let mut running = RunningScene::new();
    let first = running.load(scene(&["a", "b"], 2.0));
    let second = running.load(scene(&["a"], 0.0));
    let all: Vec<_> = second.effects().iter().map(|e| (e.slot, e.epoch, e.leaving)).collect();
    assert_eq!(all, [(2, 3, false), (0, 1, true), (1, 2, true)]);
    assert_eq!(second.numbers(second.effects()[2].numbers), first.numbers(first.effects()[1].numbers));
    assert_eq!(running.slot_of("a").unwrap().slot, 2);
    assert!(running.slot_of("b").is_none() && running.id_at(0).is_none());
    // An effect that fades out stays while parameters are set, and is gone after the next `load`.
    assert_eq!(running.set("a", &map(json!({"gain": 2}))).unwrap().effects().len(), 3);
    assert_eq!(running.load(scene(&["a"], 0.0)).effects().len(), 1);
    // If the next scene uses all slots, no effect can fade out.
    running.load(scene(&["a", "b"], 2.0));
    let ids: Vec<String> = (0..MAX_EFFECTS).map(|i| format!("e{i}")).collect();
    let ids: Vec<&str> = ids.iter().map(String::as_str).collect();
    let full = running.load(scene(&ids, 2.0));
    assert!(full.effects().len() == MAX_EFFECTS && full.effects().iter().all(|effect| !effect.leaving));
    assert!(full.effects().iter().map(|e| usize::from(e.numbers.len)).sum::<usize>() <= MAX_NUMBERS);
}

fn effect(value: &Value) -> Option<SceneEffect> {
    let scene = SceneFile::from_json(json!({"effect": [value]})).ok()?;
    scene.effects().first().cloned()
}

/// Checks that no kind forgets a parameter in its list of those without effect. Each parameter of
/// many effects is given other values. If no value changes the effect that the core computes, the
/// parameter must be in the list.
#[test]
fn a_parameter_that_changes_nothing_is_called_idle() {
    let points = json!([[0, 1, 0, 0, 0], [1, 0, 1, 0, 0], [2, 1, 0, 0, 0]]);
    let mut all: Vec<Value> = kinds().iter().map(|kind| json!({"kind": kind.name})).collect();
    all.extend([
        json!({"kind": "detents", "positions": [0, 1]}),
        json!({"kind": "detents", "positions": [0, 1], "ends": "closed"}),
        json!({"kind": "end_stop", "walls": "twist"}),
        json!({"kind": "end_stop", "walls": "both"}),
        json!({"kind": "guide", "free": "swing"}),
        json!({"kind": "guide", "free": "plane"}),
        json!({"kind": "track", "path": "chirp"}),
        json!({"kind": "track", "path": "waypoints", "points": points}),
        json!({"kind": "track", "path": "record", "points": points}),
    ]);
    let values = [
        json!(0.5),
        json!(2),
        json!(true),
        json!([0.5, 1.0]),
        json!([1, 0, 0]),
        json!([0, 1, 0]),
        json!([0, 1, 0, 0]),
        json!([[0, 0, 1, 0]]),
        json!([[0, 1, 0, 0, 0], [1, 1, 0, 0, 0]]),
    ];
    let mut idle = 0;
    for mut written in all {
        written["id"] = json!("e");
        let base = effect(&written).unwrap_or_else(|| panic!("{written}"));
        let kind = kinds().into_iter().find(|kind| kind.name == base.kind_name()).unwrap();
        for (name, schema) in kind.schema["properties"].as_object().unwrap() {
            let choices = schema["oneOf"].as_array().into_iter().flatten().map(|choice| &choice["const"]);
            let others: Vec<SceneEffect> = values
                .iter()
                .chain(choices)
                .filter_map(|value| {
                    let mut changed = written.clone();
                    changed[name] = value.clone();
                    effect(&changed)
                })
                .filter(|other| other.to_json()[name] != base.to_json()[name])
                .collect();
            let acts = |other: &SceneEffect| {
                let common = |effect: &SceneEffect| [effect.gain(), effect.fade_s(), effect.fade_out_s()];
                (other.kind(), other.numbers(), common(other)) != (base.kind(), base.numbers(), common(&base))
            };
            let is_idle = base.idle().iter().any(|key| key.name == name);
            if !others.is_empty() && !others.iter().any(acts) {
                assert!(is_idle, "{written}: {name} has no effect");
                idle += 1;
            }
        }
    }
    // Detents 4, end stops 2, guides 2, and the paths of a track 4, 1, 5 and 5.
    assert_eq!(idle, 23);
}

/// A knock is part of the effect: presets have the values of docs/effects.md, `own` those of its
/// keys, and a scene is warned of as without it.
#[test]
fn knocks_are_compiled_and_change_no_warning() {
    use hbot_config::advice::Abilities;
    use hbot_core::render::effects::Knock;
    let scene = |kind: &str, knock: Value| {
        let mut effect = json!({"id": "a", "kind": kind});
        // Stiff enough to be warned of.
        match kind {
            "detents" => effect["strength"] = 3.into(),
            "snaps" => effect["strength"] = 5.into(),
            _ => effect["stiffness"] = 500.into(),
        }
        effect.as_object_mut().unwrap().extend(knock.as_object().unwrap().clone());
        SceneFile::from_json(json!({"name": "knock", "effect": [effect]})).unwrap()
    };
    let own = json!({
        "knock": "own", "knock_amplitude": 0.1, "knock_frequency": 50, "knock_decay_s": 0.005
    });
    let abilities = Abilities::of(&RigConfig::prototype());
    for kind in ["detents", "snaps", "end_stop"] {
        let plain = scene(kind, json!({}));
        let warned = abilities.warnings(&plain);
        assert!(!warned.is_empty(), "{kind}");
        for (knock, [amplitude, frequency, decay]) in [
            (json!({"knock": "rubber"}), [0.03, 18.0, 1.0 / 60.0]),
            (json!({"knock": "wood"}), [0.02, 100.0, 0.0125]),
            (json!({"knock": "metal"}), [0.04, 300.0, 1.0 / 90.0]),
            (own.clone(), [0.1, 50.0, 0.005]),
        ] {
            let scene = scene(kind, knock);
            let found = match scene.effects()[0].kind() {
                Kind::KnockingDetents(knocking) => knocking.knock,
                Kind::KnockingSnaps(knocking) => knocking.knock,
                Kind::KnockingEndStop(knocking) => knocking.knock,
                other => panic!("{kind}: {other:?}"),
            };
            assert_eq!(found, Knock { amplitude, frequency, decay }, "{kind}");
            assert_eq!(abilities.warnings(&scene), warned, "{kind}");
        }
        // Values that are named without `own` have no effect, and the scene says so.
        let vain = scene(kind, json!({"knock": "wood", "knock_frequency": 50}));
        let names: Vec<_> = vain.effects()[0].in_vain().iter().map(|key| key.name).collect();
        assert_eq!(names, ["knock_frequency"], "{kind}");
    }
}

#[test]
fn the_text_to_copy_of_each_kind_is_a_scene_with_its_defaults() {
    for kind in hbot_config::scene::kinds() {
        let scene =
            SceneFile::from_toml(&kind.snippet(), kind.name).unwrap_or_else(|error| panic!("{error}"));
        let least = format!("[[effect]]\nid = '{0}'\nkind = '{0}'\n", kind.name);
        assert_eq!(scene, SceneFile::from_toml(&least, kind.name).unwrap(), "{}", kind.snippet());
        assert!(scene.effects()[0].in_vain().is_empty(), "{}", kind.snippet());
    }
}
