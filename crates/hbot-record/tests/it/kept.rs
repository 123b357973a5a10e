//! A recording that an earlier version has made replays bit for bit, or is refused by name.
//!
//! If the control law or its types change on purpose, raise `FORMAT` in `src/exact.rs` and keep a
//! new recording: `HBOT_BLESS=1` writes `kept/format-N.mcap`.

use std::io::Cursor;
use std::path::Path;

use hbot_config::SceneFile;
use hbot_record::exact::{FORMAT, OLDEST};
use hbot_record::replay::{Replay, ReplayError};

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
