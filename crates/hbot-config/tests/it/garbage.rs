//! No content of a client's message makes the reader panic. `tests/fuzz` does this for files.

use hbot_config::{RunningScene, SceneFile};
use proptest::prelude::*;
use serde_json::{Map, Value};

fn any_json() -> impl Strategy<Value = Value> {
    let words = "id kind name effect simulate hand spring damper detents snaps track positions orientations \
                 points file path waypoints set own stiffness damping reference gain law anchor here a.b[0]";
    let word = prop::sample::select(words.split(' ').chain([""]).collect::<Vec<_>>());
    let leaf = prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        any::<i64>().prop_map(Value::from),
        any::<f64>().prop_map(Value::from),
        word.clone().prop_map(Value::from),
    ];
    leaf.prop_recursive(5, 64, 6, move |inner| {
        prop_oneof![
            prop::collection::vec(inner.clone(), 0..5).prop_map(Value::from),
            prop::collection::vec((word.clone(), inner), 0..6)
                .prop_map(|entries| entries.into_iter().map(|(k, v)| (k.to_owned(), v)).collect()),
        ]
    })
}

proptest! {
    #[test]
    fn json(value in any_json(), parameters in any_json()) {
        let _ = SceneFile::from_json(value).map_err(|e| e.to_string());
        let mut running = RunningScene::new();
        running.load(SceneFile::default_scene());
        let parameters = parameters.as_object().cloned().unwrap_or_else(Map::new);
        let before = running.clone();
        if running.set("spring", &parameters).is_err() {
            prop_assert_eq!(running, before);
        }
    }
}

#[test]
fn deep_nesting_is_an_error_and_no_overflow() {
    let text = format!("effect = {}", "[".repeat(100_000));
    assert!(SceneFile::from_toml(&text, "x.toml").is_err());
    let text = format!("effect = {}{}", "[".repeat(5000), "]".repeat(5000));
    assert!(SceneFile::from_toml(&text, "x.toml").is_err());
}
