//! Recordings that were cut off or damaged, and what can be saved of them.

use std::io::Cursor;

use hbot_config::SceneFile;
use hbot_record::recover::{RecoverError, Recovered, recover};
use hbot_record::replay::Flaw;

use crate::made::{exact, record, replay, written};

fn recovered(recording: &[u8]) -> (Vec<u8>, Recovered) {
    let mut into = Cursor::new(Vec::new());
    let found = recover(Cursor::new(recording), &mut into).unwrap();
    (into.into_inner(), found)
}

#[test]
fn a_cut_recording_becomes_one_that_replays_and_that_every_reader_opens() {
    let (whole, _) = record(SceneFile::default_scene(), 2, |_| ());
    let cut = &whole[..whole.len() * 2 / 3];
    assert!(mcap::Summary::read(cut).is_err(), "a reader that looks for the index refuses it");
    let before = replay(cut).unwrap();
    assert!(before.flaws.contains(&Flaw::Cut) && before.ticks > 500, "{before:?}");

    let (file, found) = recovered(cut);
    assert!(found.cut && found.damaged.is_empty(), "{found:?}");
    let summary = mcap::Summary::read(&file).unwrap().expect("an index");
    assert_eq!(summary.stats.expect("statistics").message_count, found.messages);
    assert_eq!(mcap::MessageStream::new(&file).unwrap().count() as u64, found.messages);
    assert_eq!((replay(&file).unwrap(), found.ticks.missing()), (before, 0), "the cut is not forgotten");
    assert_eq!(recovered(&file).1, found);
    assert_eq!(format!("{:?}", exact(&file)), format!("{:?}", exact(cut)), "records and their times");
}

#[test]
fn a_whole_recording_is_copied_and_what_is_none_is_refused() {
    let (whole, _) = record(SceneFile::default_scene(), 1, |_| ());
    let (file, found) = recovered(&whole);
    assert!(!found.cut && found.damaged.is_empty());
    assert_eq!(replay(&file).unwrap(), replay(&whole).unwrap());
    let refused = |bytes: &[u8]| recover(Cursor::new(bytes), Cursor::new(Vec::new())).unwrap_err();
    assert!(matches!(refused(b"t,w,x,y,z\n"), RecoverError::Read(_)));
    assert!(matches!(refused(&whole[..8]), RecoverError::Empty));
}

#[test]
fn a_damaged_chunk_is_named_and_the_rest_is_kept() {
    let (mut recording, _) = record(SceneFile::default_scene(), 2, |_| ());
    let place = recording.len() / 2;
    recording[place] ^= 1;
    let (file, found) = recovered(&recording);
    assert_eq!(found.damaged.len(), 1, "{found:?}");
    assert!(found.damaged[0].starts_with("a part that cannot be unpacked (at byte "), "{found:?}");
    assert_eq!((found.ticks.gaps.len(), found.ticks.states + found.ticks.missing()), (1, 2000));
    let report = replay(&file).unwrap();
    assert!(report.ticks > 500);
    assert_eq!(report, replay(&recording).unwrap(), "what is lost is not forgotten");
    assert_eq!(recovered(&file).1, found);
    // An older version has left no note of it.
    let report = replay(&written(&exact(&recording))).unwrap();
    // The state of a tick and its record can lie in two chunks, at both ends of the gap.
    let [Flaw::Missing(records), Flaw::Unknown(_)] = report.flaws[..] else { panic!("{report:?}") };
    assert!(records.abs_diff(found.ticks.missing()) <= 2, "{records} of {:?}", found.ticks);
    assert_eq!(report.difference, None);
}
