//! Recordings that are altered, damaged, cut off or of another version.

use std::io::Cursor;

use hbot_api::StateEvent;
use hbot_config::SceneFile;
use hbot_core::CompiledScene;
use hbot_core::render::effects::{Effect, Span};
use hbot_record::exact::FORMAT;
use hbot_record::replay::{Flaw, Replay, ReplayError};
use hbot_record::{About, Exact, Writer};

use crate::made::{CHUNK, DATA_END, assert_exact, exact, places, record, records, replay, written};

fn altered(recording: &[u8], alter: impl FnOnce(&mut Vec<(Exact, u64)>)) -> Vec<u8> {
    let mut records = exact(recording);
    alter(&mut records);
    written(&records)
}

fn at(records: &[(Exact, u64)], tick: u64) -> usize {
    let is_it = |(record, _): &(Exact, u64)| matches!(record, Exact::Tick(found) if found.0.tick == tick);
    records.iter().position(is_it).unwrap()
}

/// Place of the check code in a chunk: after a kind and a length, two times and a length.
const SUM: usize = 9 + 8 + 8 + 8;

fn damaged(recording: &[u8], place: usize, bit: u32) -> Vec<u8> {
    let mut damaged = recording.to_vec();
    damaged[place] ^= 1 << bit;
    damaged
}

#[test]
fn a_changed_count_is_found_at_its_tick() {
    let (recording, _) = record(SceneFile::default_scene(), 2, |_| ());
    assert_exact(&altered(&recording, |_| ()), 2000);
    let wrong = altered(&recording, |records| {
        let index = at(records, 1234);
        let Exact::Tick(tick) = &mut records[index].0 else { unreachable!() };
        tick.0.feedback.as_mut().unwrap().counts[1] += 1;
    });
    let difference = replay(&wrong).unwrap().difference.unwrap();
    assert_eq!((difference.tick, difference.field.as_str()), (1234, "state.q"));
    assert_ne!(difference.values[0], difference.values[1]);
}

#[test]
fn a_changed_bit_of_an_output_is_found_at_its_tick() {
    let (recording, _) = record(SceneFile::default_scene(), 2, |_| ());
    let wrong = altered(&recording, |records| {
        let index = at(records, 1500);
        let Exact::Tick(tick) = &mut records[index].0 else { unreachable!() };
        let torque = &mut tick.1.drive.torque[3];
        *torque = f64::from_bits(torque.to_bits() ^ 1);
    });
    let difference = replay(&wrong).unwrap().difference.unwrap();
    assert_eq!((difference.tick, difference.field.as_str()), (1500, "drive.torque"));
}

#[test]
fn a_changed_bit_of_a_scene_is_found_at_its_tick() {
    let (recording, _) = record(SceneFile::default_scene(), 2, |_| ());
    // The scene is announced again in the middle of the run, with one bit of one gain changed.
    let wrong = altered(&recording, |records| {
        let same = |scene: &CompiledScene, gain: fn(f64) -> f64| {
            let effects: Vec<Effect> =
                scene.effects().iter().map(|effect| Effect { gain: gain(effect.gain), ..*effect }).collect();
            let len = effects.iter().map(|effect| effect.numbers.start + effect.numbers.len).max().unwrap();
            let numbers = scene.numbers(Span { start: 0, len });
            CompiledScene::with_numbers(scene.revision(), &effects, numbers).unwrap()
        };
        let scene = records.iter().find_map(|(record, _)| match record {
            Exact::Scene(scene) => Some(scene.clone()),
            _ => None,
        });
        let changed = same(&scene.unwrap(), |gain| f64::from_bits(gain.to_bits() ^ 1));
        let (index, when) = (at(records, 1700), records[0].1);
        records.insert(index, (Exact::Scene(Box::new(changed)), when));
    });
    let difference = replay(&wrong).unwrap().difference.unwrap();
    assert_eq!((difference.tick, difference.field.as_str()), (1700, "state.torque"));
}

#[test]
fn a_file_that_is_cut_anywhere_replays_up_to_there() {
    let (recording, _) = record(SceneFile::default_scene(), 8, |_| ());
    let mut last = 0;
    for tenth in 0..=10 {
        let length = recording.len() * tenth / 10 * 99 / 100;
        match replay(&recording[..length]) {
            Ok(report) => {
                assert!(report.difference.is_none() && !report.is_exact(), "{report:?}");
                assert_eq!(report.flaws, [Flaw::Cut]);
                assert!(report.ticks >= last, "{report:?}");
                last = report.ticks;
            }
            Err(ReplayError::Foreign | ReplayError::Read(_)) => assert!(tenth == 0),
            Err(other) => panic!("{other}"),
        }
    }
    assert!(last > 6000, "{last} of 8000 ticks in 99 % of the file");
}

#[test]
fn a_damaged_chunk_costs_the_ticks_until_the_next_state_of_the_law() {
    let (recording, _) = record(SceneFile::default_scene(), 25, |_| ());
    let chunks = places(&recording, CHUNK);
    // The first chunk says which topic has which number; only the index at the end repeats it. The
    // last place is the kind of a chunk: then nobody knows what the record is. A chunk has at most
    // 0.6 s.
    for place in [chunks[0] + SUM, chunks[4] + SUM, chunks[4]] {
        let report = replay(&damaged(&recording, place, 4)).unwrap();
        assert!(report.difference.is_none(), "{report:?}");
        assert!(matches!(report.flaws[..], [Flaw::Damaged(_), Flaw::Unknown(_)]), "{report:?}");
        // States of the law are ten seconds apart.
        assert!((10_000..25_000).contains(&report.ticks), "{report:?}");
        assert_eq!(report.range.unwrap().1, 24_999);
        // A part that begins behind it is whole.
        let damaged = Cursor::new(damaged(&recording, place, 4));
        let part = Replay::new(damaged, None).unwrap().run(15_000, u64::MAX, |_| Ok::<_, ReplayError>(()));
        let part = part.unwrap();
        assert!(part.is_exact() && part.range == Some((15_000, 24_999)), "{part:?}");
    }
    // The index at the end is believed only if its check code is right.
    let end = *places(&recording, DATA_END).last().unwrap();
    let report = replay(&damaged(&damaged(&recording, chunks[0] + SUM, 4), end + 40, 0)).unwrap();
    assert!(matches!(report.flaws[..], [Flaw::Damaged(_)]), "{report:?}");
    assert_eq!(report.range, None);
}

/// Asserts that the replay of `recording`, of which a bit at `place` was changed, claims no more
/// than it can know.
fn assert_honest(recording: &[u8], place: usize, first_chunk: usize) {
    match replay(recording) {
        Ok(report) => assert!(report.difference.is_none() && !report.is_exact(), "{place}: {report:?}"),
        Err(error) => assert!(place < first_chunk, "{place}: {error}"),
    }
}

#[test]
fn one_changed_bit_is_never_a_difference_and_never_goes_unnoticed() {
    let (recording, _) = record(SceneFile::default_scene(), 2, |_| ());
    let (first, end) = (places(&recording, CHUNK)[0], places(&recording, DATA_END)[0]);
    for place in (0..end).step_by(24_007) {
        assert_honest(&damaged(&recording, place, 4), place, first);
    }
    // The kinds decide how all other bytes are read.
    for (_, place) in records(&recording).into_iter().filter(|(_, place)| *place <= end) {
        for bit in 0..8 {
            assert_honest(&damaged(&recording, place, bit), place, first);
        }
    }
    // What follows the end repeats the rest, and is not replayed.
    assert_exact(&damaged(&recording, end + 100, 4), 2000);
}

#[test]
fn damage_outside_of_the_chunks_costs_no_tick() {
    let (recording, _) = record(SceneFile::default_scene(), 1, |_| ());
    let end = places(&recording, DATA_END)[0];
    // The kind of the header, and the last entry in the index of the first or the last chunk.
    for place in [8, places(&recording, CHUNK)[1] - 4, end - 4] {
        let report = replay(&damaged(&recording, place, 4)).unwrap();
        assert!(matches!(report.flaws[..], [Flaw::Damaged(_)]), "{report:?}");
        assert_eq!((report.ticks, report.range), (1000, Some((0, 999))));
    }
}

#[test]
fn a_chunk_whose_length_swallows_others_is_damaged() {
    let (mut recording, _) = record(SceneFile::default_scene(), 3, |_| ());
    let chunks = places(&recording, CHUNK);
    let length = (chunks[3] - chunks[1] - 9) as u64;
    recording[chunks[1] + 1..chunks[1] + 9].copy_from_slice(&length.to_le_bytes());
    let report = replay(&recording).unwrap();
    assert!(matches!(report.flaws[..], [Flaw::Damaged(_), Flaw::Unknown(_)]), "{report:?}");
    assert!(report.difference.is_none(), "{report:?}");
}

/// A chunk that says it has gigabytes is refused by this size, before any of it is decompressed.
#[test]
fn a_chunk_that_says_it_is_huge_is_damaged() {
    let (recording, _) = record(SceneFile::default_scene(), 2, |_| ());
    let mut huge = recording.clone();
    let size = places(&recording, CHUNK)[0] + 9 + 8 + 8;
    huge[size..size + 8].copy_from_slice(&(2800_u64 << 20).to_le_bytes());
    let told = format!("{:?}", replay(&huge));
    assert!(told.contains("a chunk of 2936012800 bytes, at most 16777216 are read"), "{told}");
}

/// A file can have intact chunks with wrong numbers in them.
#[test]
fn a_record_with_more_joints_than_there_can_be_is_damaged() {
    let (recording, _) = record(SceneFile::default_scene(), 2, |_| ());
    let wrong = altered(&recording, |records| {
        let index = at(records, 1500);
        let Exact::Tick(tick) = &mut records[index].0 else { unreachable!() };
        tick.1.state.joints = 17;
    });
    let report = replay(&wrong).unwrap();
    assert!(report.difference.is_none() && !report.is_exact(), "{report:?}");
    assert!(matches!(report.flaws[..], [Flaw::Damaged(_), Flaw::Unknown(_)]), "{:?}", report.flaws);
    assert_eq!((report.ticks, report.range), (1500, Some((0, 1499))));
}

#[test]
fn a_gap_is_told_and_the_replay_goes_on_after_it() {
    // In virtual time, a state of the law arrives up to 4096 ticks after its request.
    let (recording, _) = record(SceneFile::default_scene(), 16, |_| ());
    let with_gap = altered(&recording, |records| {
        let (from, to) = (at(records, 4000), at(records, 4100));
        let when = records[from].1;
        drop(records.splice(from..to, [(Exact::Lost(100), when)]));
    });
    let report = replay(&with_gap).unwrap();
    assert!(report.difference.is_none() && !report.is_exact());
    assert!(matches!(report.flaws[..], [Flaw::Gap(100), Flaw::Unknown(n)] if n > 5000), "{:?}", report.flaws);
    assert_eq!(report.range.unwrap(), (0, 15_999));
}

#[test]
fn a_recording_without_exact_inputs_is_refused_with_what_to_do() {
    for (entry, words) in [
        ("server", ["made by `hbot record`", "`hbot server --record FILE.mcap`"]),
        ("other_scene", ["made by `hbot replay --scene`", "Replay the recording from which"]),
    ] {
        let about = About { entries: [(entry.to_owned(), "x".to_owned())].into(), ..About::default() };
        let mut writer = Writer::new(Cursor::new(Vec::new()), &about).unwrap();
        writer.state(&StateEvent::default(), 1).unwrap();
        let recording = writer.finish().unwrap().into_inner();
        let said = replay(&recording).unwrap_err().to_string();
        assert!(words.iter().all(|word| said.contains(word)), "{said}");
    }
}

#[test]
fn what_is_no_recording_of_this_version_is_refused_by_name() {
    assert!(matches!(replay(b"not an MCAP file, but text").unwrap_err(), ReplayError::Read(_)));
    let (mut recording, _) = record(SceneFile::default_scene(), 1, |_| ());
    let entry = format!("\x06\0\0\0format\x01\0\0\0{FORMAT}");
    let place = recording.windows(entry.len()).position(|bytes| bytes == entry.as_bytes()).unwrap();
    // The entry has room for one digit.
    recording[place + entry.len() - 1] = b'2';
    let Err(error) = Replay::new(Cursor::new(recording), None) else { panic!("another format is replayed") };
    let text = error.to_string();
    assert!(text.contains("in format 2") && text.contains(env!("CARGO_PKG_VERSION")), "{text}");
}
