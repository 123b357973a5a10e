//! Recordings that were cut off or damaged, and what can be saved of them.

use std::cell::Cell;
use std::io::{Cursor, Read, Seek, SeekFrom};
use std::ops::Range;
use std::rc::Rc;

use hbot_api::StateEvent;
use hbot_config::SceneFile;
use hbot_record::reader::Item;
use hbot_record::recover::{RecoverError, Recovered, recover};
use hbot_record::replay::Flaw;
use hbot_record::ticks::Gap;
use hbot_record::told::{Told, told};
use hbot_record::{About, Reader, Writer};

use crate::made::{CHUNK, exact, places, record, records, replay, written, written_with};

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

/// Bytes of the kind and the length of a record.
const HEAD: usize = 9;

/// Returns a recording of 4000 ticks with a chunk for every 400, and the places of the chunks. A
/// server ends its chunks by the clock.
fn chunked() -> (Vec<u8>, Vec<usize>) {
    let (recording, _) = record(SceneFile::default_scene(), 4, |_| ());
    let whole = written_with(&exact(&recording), |writer, tick, at| {
        writer.state(&StateEvent { tick, t: tick as f64 * 1.0e-3, ..StateEvent::default() }, at).unwrap();
        if tick % 400 == 399 {
            writer.flush().unwrap();
        }
    });
    let chunks = places(&whole, CHUNK);
    assert_eq!(chunks.len(), 10, "{chunks:?}");
    (whole, chunks)
}

/// Returns the numbers of the ticks whose states `recording` has, in the order of the file.
fn ticks(recording: &[u8]) -> Vec<u64> {
    let mut reader = Reader::new(Cursor::new(recording)).unwrap();
    let mut ticks = Vec::new();
    while let Some(item) = reader.next().unwrap() {
        if let Item::Message { topic, data, .. } = item
            && let Some(Told::State(state)) = told(&topic, &data)
        {
            ticks.push(state.tick);
        }
    }
    ticks
}

/// Asserts that of the `chunks` of `whole`, `damaged` has lost those in `lost`, says so once, and
/// that all ticks of the others are recovered, in their order. Returns why they are lost.
fn assert_lost(whole: &[u8], damaged: &[u8], chunks: &[usize], lost: Range<usize>) -> Vec<String> {
    let (file, found) = recovered(damaged);
    // What is before a chunk can be read without what follows.
    let before = |chunk: usize| ticks(&whole[..chunks[chunk]]).len() as u64;
    let gap = before(lost.start)..before(lost.end);
    let kept: Vec<u64> = (0..gap.start).chain(gap.end..4000).collect();
    assert_eq!(ticks(&file), kept);
    assert_eq!((found.ticks.states, found.ticks.missing()), (kept.len() as u64, gap.end - gap.start));
    let [Gap { states, damaged: true, .. }] = found.ticks.gaps[..] else { panic!("{found:?}") };
    assert_eq!(states, gap.end - gap.start);
    assert!(!found.cut && !found.ticks.damaged_before && !found.ticks.damaged_after, "{found:?}");
    assert_eq!(replay(&file).unwrap(), replay(damaged).unwrap(), "what is lost is not forgotten");
    assert_eq!(recovered(&file).1, found);
    found.damaged
}

#[test]
fn intact_chunks_behind_a_hole_are_found() {
    let (whole, chunks) = chunked();
    // The record of a chunk ends here, and its indexes follow.
    let end = |chunk: usize| records(&whole).into_iter().find(|(_, at)| *at > chunks[chunk]).unwrap().1;
    let without = |hole: Range<usize>| [&whole[..hole.start], &whole[hole.end..]].concat();
    let unpacked = |chunk: usize| format!("a part that cannot be unpacked (at byte {})", chunks[chunk]);
    let unread = |from: usize, to: usize| format!("bytes {from} to {} cannot be read", to - 1);

    let hole = chunks[2] + 10_000..chunks[2] + 15_000;
    let why = assert_lost(&whole, &without(hole), &chunks, 2..3);
    assert_eq!(why, [unpacked(2), unread(end(2), chunks[3] - 5000)]);
    // The indexes are shorter, so the record reaches into the next chunk, which is found in it.
    let hole = chunks[2] + 10_000..chunks[2] + 110_000;
    let why = assert_lost(&whole, &without(hole), &chunks, 2..3);
    assert_eq!(why, [unread(chunks[2], chunks[3] - 100_000)]);
    // From one chunk into the next one.
    let hole = end(2) - 1000..chunks[3] + 1000;
    let length = hole.len();
    let why = assert_lost(&whole, &without(hole), &chunks, 2..4);
    assert_eq!(why, [unpacked(2), unread(end(2), chunks[4] - length)]);
    // From the indexes of one chunk into the next one.
    let hole = chunks[3] - 1000..chunks[3] + 1000;
    let why = assert_lost(&whole, &without(hole), &chunks, 3..4);
    assert_eq!(why.len(), 1, "{why:?}");
    // A length that cannot be, and one that reaches beyond the end.
    for length in [u64::MAX, whole.len() as u64] {
        let mut wrong = whole.clone();
        wrong[chunks[2] + 1..chunks[2] + HEAD].copy_from_slice(&length.to_le_bytes());
        let why = assert_lost(&whole, &wrong, &chunks, 2..3);
        assert_eq!(why, [unread(chunks[2], chunks[3])]);
    }
}

#[test]
fn what_only_looks_like_a_chunk_is_not_taken_for_data() {
    let (whole, chunks) = chunked();
    // Garbage from the middle of a chunk on, in it a copy of an earlier chunk with a wrong check
    // code, without one, and with a changed message.
    let copy = &whole[chunks[1]..chunks[2]];
    for (place, with) in [(33, &[1, 2, 3, 4][..]), (33, &[0; 4]), (copy.len() / 2, &[0xaa; 8])] {
        let mut false_chunk = copy.to_vec();
        false_chunk[place..place + with.len()].copy_from_slice(with);
        let mut wrong = whole[..chunks[2] + 10_000].to_vec();
        wrong.extend([0xff; 500]);
        wrong.extend(&false_chunk);
        wrong.extend([0xff; 500]);
        wrong.extend(&whole[chunks[3]..]);
        assert_lost(&whole, &wrong, &chunks, 2..3);
    }
}

#[test]
fn a_damaged_end_leaves_the_number_of_ticks_open() {
    let (whole, chunks) = chunked();
    let last = *chunks.last().unwrap();
    let mut wrong = whole.clone();
    wrong[last + 1..last + HEAD].fill(0xff);
    let (file, found) = recovered(&wrong);
    assert_eq!(ticks(&file), ticks(&whole[..last]));
    assert_eq!(found.damaged, [format!("nothing from byte {last} on can be read")]);
    assert!(found.ticks.damaged_after && !found.cut, "{found:?}");
}

/// A disk that cannot be read from a place on.
struct Broken<'a> {
    from: Cursor<&'a [u8]>,
    place: u64,
}

impl Read for Broken<'_> {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        let left = self.place.saturating_sub(self.from.position()) as usize;
        if left == 0 {
            return Err(std::io::Error::other("a bad block"));
        }
        let length = into.len().min(left);
        self.from.read(&mut into[..length])
    }
}

impl Seek for Broken<'_> {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        self.from.seek(to)
    }
}

#[test]
fn what_is_before_a_bad_block_of_the_disk_is_kept() {
    let (whole, chunks) = chunked();
    let broken = |place: usize| Broken { from: Cursor::new(&whole), place: place as u64 };
    let mut into = Cursor::new(Vec::new());
    let found = recover(broken(chunks[5] + 1000), &mut into).unwrap();
    assert_eq!(found.damaged, ["a bad block"]);
    assert!(found.ticks.damaged_after && !found.cut, "{found:?}");
    assert_eq!(ticks(&into.into_inner()), ticks(&whole[..chunks[5]]));
    // With nothing before it, the reason is the disk's.
    let refused = recover(broken(20), Cursor::new(Vec::new())).unwrap_err();
    assert_eq!(refused.to_string(), "a bad block");
}

struct Counted<'a> {
    from: Cursor<&'a [u8]>,
    /// Number of bytes that were read.
    bytes: Rc<Cell<u64>>,
}

impl Read for Counted<'_> {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        let read = self.from.read(into)?;
        self.bytes.set(self.bytes.get() + read as u64);
        Ok(read)
    }
}

impl Seek for Counted<'_> {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        self.from.seek(to)
    }
}

/// Reads of a file that grow with the square of its length would take for ever.
#[test]
fn a_file_full_of_false_lengths_is_read_in_linear_time() {
    let mut writer = Writer::new(Cursor::new(Vec::new()), &About::default()).unwrap();
    writer.gap(0, 1, 1).unwrap();
    let small = writer.finish().unwrap().into_inner();
    let all = records(&small);
    let first = all.iter().position(|(kind, _)| *kind == CHUNK).unwrap();
    let (begin, intact) = small[..all[first + 1].1].split_at(all[first].1);
    // A record that reaches beyond the end, and has an intact chunk in it.
    let beyond = [&[0x7f, 0, 0, 0, 15, 0, 0, 0, 0], intact].concat();
    // The beginning of a chunk that has the next ones in it.
    let nested =
        [&[CHUNK, 0, 0, 16, 0, 0, 0, 0, 0][..], &[1; 16], &[0, 0, 16, 0, 0, 0, 0, 0], &[1; 4]].concat();
    for (unit, count) in [(beyond, 2000), (nested, 60_000)] {
        let hostile = [begin, &unit.repeat(count), &[0; 2 << 20][..]].concat();
        let bytes = Rc::new(Cell::new(0));
        let from = Counted { from: Cursor::new(&hostile[..]), bytes: Rc::clone(&bytes) };
        let mut reader = Reader::new(from).unwrap();
        while reader.next().unwrap().is_some() {}
        assert!(bytes.get() < (256 << 20) + 64 * hostile.len() as u64, "{} bytes", bytes.get());
    }
}
