//! Tests of the running scene: memories, revisions, and what `set` does and refuses.

use hbot_config::scene::SetError;
use hbot_config::{RunningScene, SceneFile};
use hbot_core::render::scene::CompiledScene;
use serde_json::{Map, Value, json};

const SCENE: &str = "
[[effect]]
id = 'spring'
kind = 'spring'
damping = 0.5
[[effect]]
id = 'air'
kind = 'damper'
";

fn running() -> (RunningScene, CompiledScene) {
    let mut running = RunningScene::new();
    let compiled = running.load(SceneFile::from_toml(SCENE, "x.toml").unwrap());
    (running, compiled)
}

fn map(value: Value) -> Map<String, Value> {
    value.as_object().unwrap().clone()
}

#[test]
fn a_load_makes_every_memory_fresh() {
    let (mut running, first) = running();
    assert!(RunningScene::new().slot_of("spring").is_none());
    let second = running.load(SceneFile::from_toml(SCENE, "x.toml").unwrap());
    assert_eq!(running.revision(), second.revision());
    assert!(first.revision() != 0 && first.revision() != second.revision());
    let epochs: Vec<u32> = first.effects().iter().chain(second.effects()).map(|e| e.epoch).collect();
    assert!(epochs.iter().enumerate().all(|(i, e)| *e != 0 && !epochs[..i].contains(e)), "{epochs:?}");
    let place = running.slot_of("air").unwrap();
    assert_eq!((place.slot, place.epoch, place.has_reference), (1, second.effects()[1].epoch, false));
    assert!(running.slot_of("spring").unwrap().has_reference);
    assert!(running.slot_of("wind").is_none());
}

#[test]
fn set_changes_what_it_names_and_keeps_the_memory() {
    let (mut running, before) = running();
    let after = running.set("spring", &map(json!({"stiffness": 3, "gain": 0.5}))).unwrap();
    let [old, new] = [&before, &after].map(|scene| scene.effects()[0]);
    assert_eq!((new.slot, new.epoch, new.reference_revision), (old.slot, old.epoch, old.reference_revision));
    assert_ne!(after.revision(), before.revision());
    assert_eq!((new.gain, new.fade_s), (0.5, old.fade_s));
    let json = running.file().effects()[0].to_json();
    assert_eq!((&json["stiffness"], &json["damping"]), (&json!(3.0), &json!(0.5)));
    assert_eq!(after.effects()[1], before.effects()[1]);
    // The running scene's file, written as JSON and read again, is unchanged.
    assert_eq!(SceneFile::from_json(running.file().to_json()).unwrap(), *running.file());
}

#[test]
fn a_reference_that_is_set_is_a_new_goal_of_the_same_memory() {
    let (mut running, before) = running();
    let mut last = before.effects()[0];
    for parameters in
        [json!({"reference": [0, 1, 0, 0]}), json!({"reference": [0, 1, 0, 0]}), json!({"anchor": "here"})]
    {
        let now = running.set("spring", &map(parameters)).unwrap().effects()[0];
        assert_eq!(now.epoch, last.epoch);
        assert_ne!(now.reference_revision, last.reference_revision);
        last = now;
    }
    assert_eq!(running.set("air", &map(json!({"damping": 1}))).unwrap().effects()[0], last);
}

#[test]
fn what_is_refused_changes_nothing() {
    let (mut running, _) = running();
    let before = running.clone();
    for (effect, parameters, said) in [
        ("wind", json!({}), "no effect has the id \"wind\"; legal: spring, air"),
        // The kind of an effect in place of its id.
        ("damper", json!({}), "no effect has the id \"damper\" (did you mean `air`?); legal: spring, air"),
        ("spring", json!({"stiffness": -1}), "stiffness: -1 is out of range; legal: 0 to 1000 N m/rad"),
        (
            "spring",
            json!({"gain": 2, "stiffness": 1e9, "colour": 3}),
            "stiffness: 1000000000.0 is out of range; legal: 0 to 1000 N m/rad\n\
             colour: unknown key; legal: law, stiffness, damping, deadband, reference, anchor, \
             gain, fade_s, fade_out_s",
        ),
        (
            "air",
            json!({"kind": "spring", "id": "x"}),
            "kind: cannot be set while the scene runs; legal: damping, deadband, gain, fade_s, fade_out_s\n\
             id: cannot be set while the scene runs; legal: damping, deadband, gain, fade_s, fade_out_s",
        ),
        (
            "spring",
            json!({"reference": [0, 0, 0, 0]}),
            "reference: the quaternion has no length; legal: [w, x, y, z], not all zero",
        ),
        (
            "air",
            json!({"damping": [[1, 0, 0], [0, 1, "soft"], [0, 0, 1]]}),
            "damping[1][2]: found the string \"soft\"; legal: a number, -100 to 100 N m s/rad",
        ),
        // An angle with a unit is a number.
        ("spring", json!({"deadband": "4 rad"}), "deadband: 4.0 is out of range; legal: 0 to 3 rad"),
        (
            "spring",
            json!({"deadband": "200 deg"}),
            "deadband: \"200 deg\" is 3.4907 rad, out of range; legal: 0 to 3 rad",
        ),
        (
            "air",
            json!({"damping": null}),
            "damping: found null; legal: a number, 0 to 100 N m s/rad, or three for the axes, such as [2,3,4], or a symmetric positive semidefinite 3x3 matrix",
        ),
    ] {
        let error = running.set(effect, &map(parameters)).unwrap_err();
        assert_eq!(error.to_string(), said);
        assert_eq!(matches!(error, SetError::UnknownEffect { .. }), ["wind", "damper"].contains(&effect));
        let malformed = ["unknown key", "cannot be set", "found null", "found the string"];
        let malformed = malformed.iter().any(|words| said.contains(words));
        assert_eq!(matches!(error, SetError::Malformed(_)), malformed, "{said}");
        assert_eq!(running, before);
    }
}
