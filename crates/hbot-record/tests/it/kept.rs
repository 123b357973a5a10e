//! A recording that an earlier version has made replays bit for bit, or is refused by name.
//!
//! If the control law or its types change on purpose, raise `FORMAT` in `src/exact.rs` and keep a
//! new recording: `HBOT_BLESS=1` writes `kept/format-N.mcap`.

use std::io::Cursor;
use std::path::Path;

use hbot_config::{RunningScene, SceneFile};
use hbot_record::exact::{FORMAT, OLDEST};
use hbot_record::replay::{Replay, ReplayError};

use serde_json::json;

use crate::made::{assert_exact, record_to};

#[test]
fn recordings_of_earlier_versions_replay_or_are_refused_by_name() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/kept");
    let newest = folder.join(format!("format-{FORMAT}.mcap"));
    if std::env::var_os("HBOT_BLESS").is_some() && !newest.exists() {
        std::fs::create_dir_all(&folder).unwrap();
        record_to(&newest, SceneFile::default_scene(), 1, |_| ());
    }
    assert!(newest.exists(), "no recording of format {FORMAT} is kept: HBOT_BLESS=1 writes it");
    for file in std::fs::read_dir(folder).unwrap() {
        let path = file.unwrap().path();
        let recording = std::fs::read(&path).unwrap();
        match Replay::new(Cursor::new(&recording), None) {
            Err(ReplayError::Version { format, .. }) => {
                assert!(format.parse::<u32>().unwrap() < OLDEST, "{}", path.display());
            }
            Err(error) => panic!("{}: {error}", path.display()),
            Ok(_) => assert_exact(&recording, 1000),
        }
    }
}

/// The kinds of effects in the order of their numbers in recordings. New kinds come after them.
const KINDS: [&str; 18] = [
    "constant",
    "spring",
    "damper",
    "inertia",
    "friction",
    "detents",
    "snaps",
    "end_stop",
    "guide",
    "texture",
    "vibration",
    "pendulum",
    "magnet",
    "pulse",
    "track",
    "detents",
    "snaps",
    "end_stop",
];

#[test]
fn kinds_of_effects_keep_their_numbers() {
    for (number, kind) in KINDS.into_iter().enumerate() {
        // The last three are the kinds with a knock.
        let knock = if number < 15 { json!({}) } else { json!({"knock": "wood"}) };
        let mut effect = json!({"id": "e", "kind": kind});
        effect.as_object_mut().unwrap().extend(knock.as_object().unwrap().clone());
        let scene = SceneFile::from_json(json!({"name": "S", "effect": [effect]})).unwrap();
        let kind = RunningScene::new().load(scene).effects()[0].kind;
        assert_eq!(postcard::to_allocvec(&kind).unwrap()[0], number as u8, "{kind:?}");
    }
}
