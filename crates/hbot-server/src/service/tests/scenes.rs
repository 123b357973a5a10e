//! Tests of loading and changing scenes.

use std::sync::{Arc, Mutex};

use hbot_api::{ErrorCode, LoadSceneOk, SetOk};

use super::*;

fn set(effect: &str, parameters: Value) -> Op {
    Op::Set { effect: effect.to_owned(), parameters: parameters.as_object().unwrap().clone() }
}

#[test]
fn info_tells_up_to_which_stiffness_the_running_scene_is_stable() {
    let bench = bench();
    let mut client = bench.holder();
    let load = |client: &mut Client, effects: Vec<Value>| {
        client.call(scene(json!({"name": "x", "effect": effects}))).unwrap();
        let mut told = None;
        eventually("the borders", || {
            told = client.info().unwrap().stable;
            told.is_some()
        });
        told.unwrap()
    };
    let damped = |id: &str, stiffness: Value| json!({"id": id, "kind": "spring", "stiffness": stiffness, "damping": 0.02, "anchor": "here"});
    let alone = load(&mut client, vec![damped("a", json!(1))]);
    assert_eq!((alone.len(), alone[0].effect.as_str(), alone[0].axis), (1, "a", None));
    // The server warns of a stiffer spring, and of no softer one. The search ends at 3 % of the
    // border, below it.
    for (part, warned) in [(0.97, false), (1.06, true)] {
        let stiffness = json!(part * alone[0].stiffness);
        let parameters = serde_json::Map::from_iter([("stiffness".to_owned(), stiffness)]);
        let told = client.set("a", parameters).unwrap();
        assert_eq!(told.warnings.iter().any(|text| text.contains("may shake")), warned, "{told:?}");
    }
    // The parameters of the others count, and an answer about an earlier scene is none about this.
    let beside = load(&mut client, vec![damped("a", json!(1)), damped("b", json!(60))]);
    assert!(beside[0].stiffness < alone[0].stiffness - 10.0, "{beside:?}");
    client.set("b", serde_json::Map::from_iter([("stiffness".to_owned(), json!(120))])).unwrap();
    let mut changed = client.info().unwrap().stable;
    eventually("the borders of the changed scene", || {
        changed = client.info().unwrap().stable;
        changed.is_some()
    });
    assert!(changed.unwrap()[0].stiffness < beside[0].stiffness - 10.0, "{beside:?}");
    let apart = load(&mut client, vec![damped("a", json!([[1, 0, 0], [0, 2, 0], [0, 0, 3]]))]);
    assert_eq!(apart.iter().map(|stable| stable.axis).collect::<Vec<_>>(), [Some(1), Some(2), Some(3)]);
    assert_eq!(load(&mut client, vec![json!({"id": "a", "kind": "damper"})]), []);
}

#[test]
fn a_scene_is_loaded_answered_and_told_to_all() {
    let bench = bench();
    let (mut client, mut watcher) = (bench.holder(), bench.client("watcher"));
    let wanted =
        json!({"name": "Two", "effect": [spring("a"), {"id": "b", "kind": "damper", "damping": 0.1}]});
    let answer: LoadSceneOk = serde_json::from_value(client.call(scene(wanted)).unwrap()).unwrap();
    let ids: Vec<_> = answer.effects.iter().map(|e| (e.id.as_str(), e.kind.as_str())).collect();
    assert_eq!((ids, answer.ignored.len()), (vec![("a", "spring"), ("b", "damper")], 0));
    let told = event(&mut watcher, "scene event", |event| match event {
        Event::Scene(scene) => Some(scene.clone()),
        _ => None,
    });
    assert_eq!((told.name.as_str(), &told.effects), ("Two", &answer.effects));
    assert_eq!(client.info().unwrap().scene["name"], "Two");
    bench.wait_until("the scene in the status", |status| status.scene == "Two");
}

#[test]
fn a_ready_made_scene_is_loaded_by_the_name_that_info_gives() {
    let bench = bench();
    let mut client = bench.holder();
    let told = client.info().unwrap().scenes;
    let hinge = told.iter().find(|scene| scene.file == "hinge").expect("a ready-made scene");
    client.call(scene(json!("hinge"))).unwrap();
    let running = client.info().unwrap().scene;
    assert_eq!((&running["name"], &running["description"]), (&json!(hinge.name), &json!(hinge.description)));
    let error = refused(client.call(scene(json!("hing"))));
    assert_eq!(error.code, ErrorCode::BadRequest);
    for part in ["\"hing\"", "(did you mean `hinge`?)", "legal: spring, "] {
        assert!(error.message.contains(part), "{part}: {error}");
    }
    assert_eq!(client.info().unwrap().scene, running);
}

#[test]
fn info_has_the_warnings_of_the_running_scene() {
    let bench = bench();
    let mut client = bench.holder();
    assert_eq!(client.info().unwrap().warnings, Vec::<String>::new());
    let answer: SetOk =
        serde_json::from_value(client.call(set("spring", json!({"stiffness": 500}))).unwrap()).unwrap();
    assert_eq!(bench.client("watcher").info().unwrap().warnings, answer.warnings);
    assert!(answer.warnings[0].contains("may shake"), "{answer:?}");
    client.call(scene(json!("clay"))).unwrap();
    assert_eq!(client.info().unwrap().warnings, Vec::<String>::new());
}

#[test]
fn all_clients_hear_what_one_sets() {
    let bench = bench();
    let mut watcher = bench.client("watcher");
    let mut client = bench.holder();
    client.call(set("spring", json!({"stiffness": 2}))).unwrap();
    let set = event(&mut watcher, "a change", |event| match event {
        Event::Set(set) => Some(set.clone()),
        _ => None,
    });
    assert_eq!((set.effect.as_str(), json!(set.parameters)), ("spring", json!({"stiffness": 2.0})));
    assert_eq!(set.by.unwrap().session, Some(client.hello().session));
}

#[test]
fn a_scene_with_mistakes_changes_nothing_and_all_are_told() {
    let bench = bench();
    let mut client = bench.holder();
    let before = client.info().unwrap().scene.clone();
    let error = refused(client.call(scene(json!({"effect": [
        {"id": "a", "kind": "sprng"},
        {"id": "b", "kind": "damper", "damping": -1},
        {"id": "c", "kind": "spring", "stifness": 1},
    ]}))));
    assert_eq!(error.code, ErrorCode::BadRequest);
    for part in ["effect[0]", "sprng", "effect[1].damping", "effect[2]", "stifness"] {
        assert!(error.message.contains(part), "{part}: {error}");
    }
    assert_eq!(client.info().unwrap().scene, before);
}

#[test]
fn an_endless_list_of_mistakes_is_cut_short() {
    let bench = bench();
    let mut client = bench.holder();
    let unknown: serde_json::Map<_, _> = (0..4000).map(|i| (format!("ä{i}"), json!(0))).collect();
    let error = refused(client.call(scene(Value::Object(unknown))));
    assert!(error.message.len() < 9000 && error.message.ends_with("and more"), "{}", error.message.len());
}

#[test]
fn parameters_are_set_while_the_scene_runs() {
    let bench = bench();
    let mut client = bench.holder();
    client.call(set("spring", json!({"stiffness": 0.5, "gain": 2}))).unwrap();
    let effect = client.info().unwrap().scene["effect"][0].clone();
    assert_eq!((&effect["stiffness"], &effect["gain"]), (&json!(0.5), &json!(2.0)));
    let cases = [
        (set("sprig", json!({"gain": 1})), ErrorCode::UnknownEffect, "spring"),
        (
            set("spring", json!({"gain": 11})),
            ErrorCode::OutOfRange,
            "effect \"spring\": gain: 11 is out of range; legal: 0 to 10",
        ),
        (set("spring", json!({"gian": 1})), ErrorCode::BadRequest, "gain"),
        (
            set("spring", json!({"stiffness": "soft"})),
            ErrorCode::BadRequest,
            "effect \"spring\": stiffness: found the string \"soft\"; legal: a number, 0 to 1000 N m/rad",
        ),
        (
            set("spring", json!({"gain": 11, "law": "hooke"})),
            ErrorCode::OutOfRange,
            "effect \"spring\": law: \"hooke\" is not known here",
        ),
    ];
    for (op, code, part) in cases {
        let error = refused(client.call(op));
        assert!(error.code == code && error.message.contains(part), "{error}");
    }
    assert_eq!(client.info().unwrap().scene["effect"][0], effect);
}

#[test]
fn phenomena_go_to_the_simulated_rig_and_a_real_one_has_its_own() {
    let wanted = json!({"name": "held", "simulate": {"hand": {"amplitude": 0.1}}});
    let seen = Arc::new(Mutex::new(Vec::new()));
    let called = Arc::clone(&seen);
    let phenomena: SetPhenomena = Box::new(move |simulate| called.lock().unwrap().push(*simulate));
    let simulated = TestService::start(TestOptions { phenomena: Some(phenomena), ..TestOptions::default() });
    let mut client = simulated.holder();
    assert_eq!(client.call(scene(wanted.clone())).unwrap()["ignored"], json!([]));
    client.call(scene(json!({}))).unwrap();
    let called: Vec<_> = seen.lock().unwrap().iter().map(|s| s.hand.map(|hand| hand.amplitude)).collect();
    assert_eq!(called, [Some(0.1)], "a scene that names no phenomena leaves them");
    assert!(client.info().unwrap().phenomena.is_some());

    let real = bench();
    let mut client = real.holder();
    assert_eq!(client.call(scene(wanted)).unwrap()["ignored"], json!(["hand"]));
}

#[test]
fn the_hand_of_an_earlier_scene_is_named_when_it_stays() {
    let phenomena: Option<SetPhenomena> = Some(Box::new(|_| ()));
    let simulated = TestService::start(TestOptions { phenomena, ..TestOptions::default() });
    let mut client = simulated.holder();
    simulated.wait_for(Mode::Idle);
    let far = json!({"id": "s", "kind": "spring", "damping": 0.1, "reference": [0, 1, 0, 0]});
    let plain = json!({"name": "Far", "effect": [far]});
    assert_eq!(client.call(scene(plain.clone())).unwrap()["warnings"], json!([]), "no scene had a hand");
    let error = refused(client.call(Op::Enable));
    let remedy = "(`hbot set s anchor=here`), then enable again";
    assert!(error.message.ends_with(remedy), "{error}");

    for (simulate, kept, still) in [
        (json!({"hand": {}, "slip": {}}), "keeps that of the scene \"Held\": slip, hand. ", true),
        (json!({}), "keeps that of the scene \"Held\": no hand and no other phenomenon. ", false),
    ] {
        let held = json!({"name": "Held", "simulate": simulate, "effect": [far]});
        assert_eq!(client.call(scene(held)).unwrap()["warnings"], json!([]));
        let error = refused(client.call(Op::Enable));
        assert!(error.message.ends_with(remedy), "its own hand: {error}");
        let warnings = client.call(scene(plain.clone())).unwrap()["warnings"].clone();
        let [Value::String(warning)] = &warnings.as_array().unwrap()[..] else { panic!("{warnings}") };
        assert!(warning.starts_with("simulate: ") && warning.contains(kept), "{warning}");
        let error = refused(client.call(Op::Enable));
        let words = "The simulated hand of the scene \"Held\" still moves the sphere";
        assert_eq!(error.message.contains(words), still, "{error}");
    }

    // The scene with which the server starts counts too, but not on a real rig.
    let first = SceneFile::from_json(json!({"name": "First", "simulate": {"hand": {}, "slip": {}}})).unwrap();
    let phenomena: Option<SetPhenomena> = Some(Box::new(|_| ()));
    for (phenomena, count) in [(phenomena, 1), (None, 0)] {
        let scene_at_start = first.clone();
        let bench =
            TestService::start(TestOptions { phenomena, scene: scene_at_start, ..TestOptions::default() });
        let warnings = bench.holder().call(scene(plain.clone())).unwrap()["warnings"].clone();
        let warnings = warnings.as_array().unwrap();
        assert_eq!(warnings.len(), count, "{warnings:?}");
        let names_first =
            |warning: &Value| warning.as_str().unwrap().contains("the scene \"First\": slip, hand. ");
        assert!(warnings.iter().all(names_first), "{warnings:?}");
    }
}

#[test]
fn a_scene_that_the_rig_cannot_make_is_loaded_with_warnings() {
    let bench = TestService::start(TestOptions::default());
    let mut client = bench.holder();
    let wall = json!({"name": "Wall", "effect": [
        {"id": "wall", "kind": "end_stop", "stiffness": 900, "damping": 0.03},
        {"id": "push", "kind": "constant", "torque": [0, 0, 5]},
        {"id": "stop", "kind": "end_stop", "stiffness": 1, "damping": 0.1, "twist": [-0.5, 0.5]},
    ]});
    let warnings = client.call(scene(wall)).unwrap()["warnings"].clone();
    let warnings = warnings.as_array().unwrap();
    assert_eq!(warnings.len(), 3, "{warnings:?}");
    assert!(warnings[0].as_str().unwrap().starts_with("wall: may shake the sphere"), "{warnings:?}");
    assert!(warnings[1].as_str().unwrap().starts_with("push: torque 5 N m"), "{warnings:?}");
    assert!(warnings[2].as_str().unwrap().starts_with("stop: twist has no effect here"), "{warnings:?}");
    let calm = json!({"name": "Calm", "effect": [{"id": "s", "kind": "spring", "damping": 0.02}]});
    assert_eq!(client.call(scene(calm)).unwrap()["warnings"], json!([]));
    // A change of a parameter is answered with the warnings about the scene that it makes.
    let warnings = client.call(set("s", json!({"stiffness": 400}))).unwrap()["warnings"].clone();
    let [Value::String(warning)] = &warnings.as_array().unwrap()[..] else { panic!("{warnings}") };
    assert!(warning.starts_with("s: may shake the sphere") && warning.contains("400 N m/rad"), "{warning}");
    assert_eq!(client.call(set("s", json!({"stiffness": 1}))).unwrap()["warnings"], json!([]));
}
