//! Makes recordings, and takes them apart.

use std::io::Cursor;
use std::net::SocketAddr;
use std::path::Path;
use std::time::Duration;

use hbot_config::{RigConfig, SceneFile};
use hbot_record::reader::Item;
use hbot_record::replay::{Replay, ReplayError, Report};
use hbot_record::{About, Exact, Reader, Topic, Writer};
use hbot_server::recording::{RecordOptions, Recorded};
use hbot_server::server::{Finished, ServerOptions, Time};
use hbot_testing::server::{any_port, serve};

/// Records `seconds` of `scene` in virtual time, while `client` talks to the server on a thread of
/// its own. Returns the recording.
pub(crate) fn record(scene: SceneFile, seconds: u64, client: fn(SocketAddr)) -> (Vec<u8>, Finished) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("run.mcap");
    let finished = record_to(&path, scene, seconds, client);
    (std::fs::read(path).unwrap(), finished)
}

pub(crate) fn record_to(path: &Path, scene: SceneFile, seconds: u64, client: fn(SocketAddr)) -> Finished {
    let options = ServerOptions::new(RigConfig::prototype(), scene, Time::Virtual);
    let recording = RecordOptions { path: Some(path.to_owned()), ..RecordOptions::default() };
    let duration = Some(Duration::from_secs(seconds));
    let finished =
        serve(ServerOptions { duration, recording, ..options }, any_port(), |address| async move {
            tokio::task::spawn_blocking(move || client(address)).await.unwrap();
            std::future::pending().await
        });
    let ticks = 1000 * seconds;
    assert_eq!(finished.recorded, Some(Recorded { written: ticks, lost: 0, failed_files: 0 }));
    finished
}

pub(crate) fn replay(recording: &[u8]) -> Result<Report, ReplayError> {
    Replay::new(Cursor::new(recording), None)?.run(0, u64::MAX, |_| Ok(()))
}

/// Asserts that `ticks` ticks replay bit for bit, and that nothing else is said.
pub(crate) fn assert_exact(recording: &[u8], ticks: u64) {
    let report = replay(recording).unwrap();
    let range = Some((0, ticks - 1));
    assert_eq!(report, Report { ticks, range, ..Report::default() });
    assert!(report.is_exact());
}

pub(crate) fn exact(recording: &[u8]) -> Vec<(Exact, u64)> {
    let mut reader = Reader::new(Cursor::new(recording)).unwrap();
    let mut all = Vec::new();
    while let Some(item) = reader.next().unwrap() {
        if let Item::Message { topic, log_time, data } = item
            && topic == Topic::Exact.name()
        {
            all.push((Exact::read(&data).unwrap(), log_time));
        }
    }
    all
}

pub(crate) fn written(records: &[(Exact, u64)]) -> Vec<u8> {
    written_with(records, |_, _, _| ())
}

/// Writes `records`. Calls `after` after each tick, with its number and its Unix time, ns.
pub(crate) fn written_with(
    records: &[(Exact, u64)],
    mut after: impl FnMut(&mut Writer<Cursor<Vec<u8>>>, u64, u64),
) -> Vec<u8> {
    let mut writer = Writer::new(Cursor::new(Vec::new()), &About::default()).unwrap();
    let mut next = 0;
    for (record, at) in records {
        match record {
            Exact::Tick(tick) => {
                next = tick.0.tick + 1;
                let written = writer.exact_tick(&tick.0, &tick.1, *at);
                after(&mut writer, tick.0.tick, *at);
                written
            }
            Exact::Scene(scene) => writer.exact_scene(next, scene, *at),
            Exact::Controller(controller) => writer.exact_controller(next, controller, *at),
            Exact::Lost(ticks) => writer.gap(next, *ticks, *at),
        }
        .unwrap();
    }
    writer.finish().unwrap().into_inner()
}

/// Kinds of records: a chunk, and the end of all chunks.
pub(crate) const CHUNK: u8 = 6;
pub(crate) const DATA_END: u8 = 15;

/// Returns the kind and the place of each record in `recording`: after eight bytes of signature, a
/// kind, a length, and as many bytes.
pub(crate) fn records(recording: &[u8]) -> Vec<(u8, usize)> {
    let (mut at, mut records) = (8, Vec::new());
    while let Some(head) = recording.get(at..at + 9) {
        records.push((head[0], at));
        at += 9 + u64::from_le_bytes(head[1..].try_into().unwrap()) as usize;
    }
    records
}

pub(crate) fn places(recording: &[u8], kind: u8) -> Vec<usize> {
    records(recording).into_iter().filter(|(found, _)| *found == kind).map(|(_, at)| at).collect()
}
