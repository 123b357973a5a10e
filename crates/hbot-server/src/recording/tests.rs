//! Tests of what happens if the recorder or the disk cannot follow, and of new files. The loop is
//! played by the test, so that it can be faster than the recorder.

use std::io::Cursor;
use std::path::Path;

use hbot_api::FaultEvent;
use hbot_config::RunningScene;
use hbot_core::Inputs;
use hbot_host::run_loop::engine::Ticked;
use hbot_host::run_loop::sample::{Counters, Sample, TickTiming};
use hbot_record::Replay;
use hbot_record::replay::{Flaw, ReplayError, Report};
use hbot_testing::patience::eventually;

use super::memory::{Memory, PART_NS};
use super::tap::{ENTRIES, Entry};
use super::*;

const UNIX_NS: u64 = 1_000_000_000_000_000;

struct Loop {
    recorder: Recorder,
    controller: Controller,
    scenes: RunningScene,
    scene: Box<CompiledScene>,
    rig: RigConfig,
    tick: u64,
}

/// Returns a loop and its recorder, which records to `path`. `waits` says whether the loop waits
/// for the recorder.
fn prepared(path: &Path, limit: Option<Limit>, waits: bool) -> (Loop, Prepared) {
    let rig = RigConfig::prototype();
    let file = SceneFile::default_scene();
    let mut scenes = RunningScene::new();
    let scene = Box::new(scenes.load(file.clone()));
    let options = RecordOptions { path: Some(path.to_owned()), limit, ..RecordOptions::default() };
    let (recorder, prepared) = prepare(options, false, None, SceneNote::new(&scene, &file), waits);
    let controller = Controller::new(rig.rig);
    (Loop { recorder, controller, scenes, scene, rig, tick: 0 }, prepared)
}

impl Loop {
    fn tick(&mut self) {
        let inputs = Inputs::quiet(self.tick);
        let outputs = self.controller.tick(&self.scene, &inputs);
        let sample = Sample {
            state: outputs.state,
            t_ns: self.tick * self.rig.rig.timing.period_ns,
            scene: self.scene.revision(),
            timing: TickTiming::default(),
            counters: Counters::default(),
            answers: Default::default(),
            telemetry: Default::default(),
            complaints: Default::default(),
            restarted: false,
        };
        (self.recorder)(&Ticked {
            scene: &self.scene,
            inputs: &inputs,
            outputs: &outputs,
            sample: &sample,
            controller: &self.controller,
        });
        self.tick += 1;
    }

    /// Renders the scene of before with a new revision, and announces it to the recorder.
    fn load(&mut self, notes: &Notes) {
        let file = SceneFile::default_scene();
        *self.scene = self.scenes.load(file.clone());
        notes.scene(&self.scene, &file);
    }

    fn start(&self, prepared: Prepared) -> Recording {
        prepared.start(&self.rig, Origin { monotonic_ns: 0, unix_ns: UNIX_NS }).unwrap()
    }

    /// Ticks, one tick every millisecond, until `condition` holds.
    fn until(&mut self, what: &str, recording: &Recording, condition: impl Fn(Recorded) -> bool) {
        eventually(what, || {
            self.tick();
            condition(recording.notes.counts().now())
        });
    }
}

fn replayed(path: &Path) -> Report {
    let file = std::fs::read(path).unwrap();
    Replay::new(Cursor::new(file), None).unwrap().run(0, u64::MAX, |_| Ok::<_, ReplayError>(())).unwrap()
}

fn scenes(path: &Path) -> usize {
    let file = std::fs::read(path).unwrap();
    let messages = mcap::MessageStream::new(&file).unwrap().map(Result::unwrap);
    messages.filter(|message| message.channel.topic == "/hbot/scene").count()
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    let mut all: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    // The numbers are at the end of the names.
    all.sort_by_key(|path| path.to_string_lossy().rsplit('-').next().map(str::to_owned));
    all
}

#[test]
fn a_full_ring_is_a_gap_of_which_the_replay_tells() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let (mut run, prepared) = prepared(&path, None, false);
    // The recorder's thread does not run yet, as on a machine that gives it no time.
    let (room, lost) = (ENTRIES as u64, 900);
    (0..room).for_each(|_| run.tick());
    // The scene changes while ticks are lost.
    run.load(&prepared.notes);
    (0..lost).for_each(|_| run.tick());
    let recording = run.start(prepared);
    run.until("ticks after the gap", &recording, |recorded| recorded.written >= room + 100);
    let recorded = recording.end().unwrap();
    assert!(recorded.lost >= lost && recorded.failed_files == 0, "{recorded:?}");
    assert_eq!(recorded.written + recorded.lost, run.tick);
    let report = replayed(&path);
    assert_eq!(report.flaws, [Flaw::Gap(recorded.lost)]);
    assert_eq!((report.ticks, report.difference), (recorded.written, None));
    assert_eq!(report.range, Some((0, run.tick - 1)));
    assert_eq!(scenes(&path), 2, "viewers see the scene that was loaded meanwhile");
}

#[test]
fn the_newest_scene_is_recorded_even_if_there_is_no_room_for_its_note() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let (mut run, prepared) = prepared(&path, None, false);
    (0..NOTES + 10).for_each(|_| run.load(&prepared.notes));
    (0..100).for_each(|_| run.tick());
    let recording = run.start(prepared);
    run.until("all ticks", &recording, |recorded| recorded.written + recorded.lost >= 200);
    let recorded = recording.end().unwrap();
    assert_eq!(recorded, Recorded { written: run.tick, lost: 0, failed_files: 0 });
    assert!(replayed(&path).is_exact());
    assert_eq!(scenes(&path), 2);
}

#[test]
fn a_new_file_begins_at_the_limit_and_replays_without_the_one_before() {
    for limit in [Limit::Size(100_000), Limit::Time(Duration::from_secs(5))] {
        let folder = tempfile::tempdir().unwrap();
        let (mut run, prepared) = prepared(folder.path(), Some(limit), true);
        let recording = run.start(prepared);
        (0..20_000).for_each(|_| run.tick());
        let (first, counts) = (recording.first().unwrap().to_owned(), recording.notes.counts());
        assert_eq!(recording.end(), Some(Recorded { written: 20_000, lost: 0, failed_files: 0 }));
        let (files, mut next) = (files(folder.path()), 0);
        let bytes = files.iter().map(|path| path.metadata().unwrap().len()).sum();
        let (count, last) = (files.len() as u64, files.last().unwrap().clone());
        let written = FilesWritten { count, bytes, last, ..FilesWritten::default() };
        assert_eq!((first, counts.files()), (files[0].clone(), written));
        assert!(files.len() >= 3, "{limit:?}: {files:?}");
        for path in &files {
            let report = replayed(path);
            assert!(report.is_exact(), "{limit:?}: {report:?}");
            let (first, last) = report.range.unwrap();
            assert_eq!(first, next, "{limit:?}: no tick is missing or in two files");
            next = last + 1;
            let is_last = next == run.tick;
            match limit {
                Limit::Size(bytes) => assert!(is_last || path.metadata().unwrap().len() >= bytes),
                // Tick 5000 is the first after the limit. The next file begins with the next copy
                // of the controller. Before the copy there are at most: a full ring, the tick that
                // waits for room in it, and the tick in which the loop sees the request.
                Limit::Time(_) => {
                    let most = 5001 + ENTRIES as u64 + 2;
                    assert!(is_last || (5001..=most).contains(&report.ticks), "{} ticks", report.ticks);
                }
            }
        }
        assert_eq!(next, run.tick, "{limit:?}");
    }
}

/// Whether a path is a folder is said by its `/` or by the folder that is there, also if its name
/// ends like a file's.
#[test]
fn a_folder_can_have_the_ending_of_a_file() {
    let dir = tempfile::tempdir().unwrap();
    let (slash, there) = (dir.path().join("slash.mcap/"), dir.path().join("there.mcap"));
    assert!(is_file(&there), "nothing is there yet");
    std::fs::create_dir(&there).unwrap();
    for folder in [slash, there] {
        assert!(!is_file(&folder), "{}", folder.display());
        let (mut run, prepared) = prepared(&folder, None, true);
        let recording = run.start(prepared);
        (0..100).for_each(|_| run.tick());
        assert_eq!(recording.end(), Some(Recorded { written: 100, lost: 0, failed_files: 0 }));
        let files = files(&folder);
        assert!(files.len() == 1 && is_file(&files[0]), "{files:?}");
    }
}

#[test]
fn a_folder_that_cannot_be_written_is_tried_again() {
    let dir = tempfile::tempdir().unwrap();
    let (blocked, folder) = (dir.path().join("blocked"), dir.path().join("blocked/recordings"));
    std::fs::write(&blocked, "a file where the folder should be").unwrap();
    let (mut run, mut prepared) = prepared(&folder, None, true);
    prepared.retry_after = Duration::ZERO;
    let recording = run.start(prepared);
    run.until("a second attempt", &recording, |recorded| recorded.failed_files >= 2);
    std::fs::remove_file(&blocked).unwrap();
    run.until("a recording", &recording, |recorded| recorded.written >= 100);
    let recorded = recording.end().unwrap();
    assert_eq!(recorded.written + recorded.lost, run.tick);
    let files = files(&folder);
    let report = replayed(&files[0]);
    assert!(files.len() == 1 && report.is_exact(), "{files:?} {report:?}");
    assert_eq!(report.range, Some((run.tick - recorded.written, run.tick - 1)));
}

#[test]
fn a_file_that_is_deleted_while_it_is_recorded_is_followed_by_another() {
    let folder = tempfile::tempdir().unwrap();
    let (mut run, mut prepared) = prepared(folder.path(), None, true);
    prepared.retry_after = Duration::ZERO;
    let recording = run.start(prepared);
    run.until("a recording", &recording, |recorded| recorded.written >= 100);
    let pulled = files(folder.path());
    std::fs::remove_file(&pulled[0]).unwrap();
    run.until("its loss is noticed", &recording, |recorded| recorded.failed_files == 1);
    let before = recording.notes.counts().now().written;
    run.until("another recording", &recording, |recorded| recorded.written >= before + 100);
    let recorded = recording.end().unwrap();
    assert_eq!((recorded.written + recorded.lost, recorded.failed_files), (run.tick, 1));
    let files = files(folder.path());
    assert!(files.len() == 1 && files[0] != pulled[0], "{files:?}");
    assert!(replayed(&files[0]).is_exact());
}

#[test]
fn a_file_that_is_cut_short_is_not_among_those_that_are_complete() {
    let folder = tempfile::tempdir().unwrap();
    let [whole, cut, gone] = ["whole", "cut", "gone"].map(|name| folder.path().join(name));
    std::fs::write(&whole, "1234").unwrap();
    std::fs::write(&cut, "12").unwrap();
    let counts = Counts::default();
    counts.end_file(&whole, true);
    counts.end_file(&cut, false);
    counts.end_file(&gone, false);
    let wanted = FilesWritten { count: 1, bytes: 4, last: whole, cut_short: 1, last_cut_short: cut };
    assert_eq!(counts.files(), wanted);
}

#[test]
fn an_error_of_a_recording_names_the_reason_that_the_system_gives() {
    let full = std::io::Error::from(std::io::ErrorKind::StorageFull);
    let reason = full.to_string();
    let told = with_causes(&mcap::McapError::Io(full));
    assert!(told.ends_with(&format!(": {reason}")), "{told}");
}

/// The recording of a flight log begins at a stored state of the law, before the log's first tick.
#[test]
fn the_recording_of_a_flight_log_has_the_stops_of_all_its_ticks() {
    let file = SceneFile::default_scene();
    let scene = RunningScene::new().load(file.clone());
    let note = Arc::new(SceneNote::new(&scene, &file));
    let mut controller = Box::new(Controller::new(RigConfig::prototype().rig));
    let mut memory = Memory::default();
    for tick in 0..2000 {
        let t_ns = tick * PART_NS / 1000;
        if memory.is_due(t_ns) {
            memory.begin(controller.clone(), Arc::clone(&note), tick.saturating_sub(1), t_ns);
        }
        let inputs = Inputs::quiet(tick);
        let outputs = controller.tick(&scene, &inputs);
        let timing = TickTiming::default();
        memory.push(&Entry { inputs, outputs, t_ns, scene: 0, timing, controller: None, lost: 0 }, None);
    }
    for tick in [900, 1100, 1900, 1950] {
        memory.event(&Event::Fault(FaultEvent {
            tick,
            t: 0.001 * tick as f64,
            mode: hbot_api::Mode::Estop,
            fault: None,
            message: String::new(),
            found: None,
            remedy: None,
            flight_log: None,
            by: None,
        }));
    }
    let copy = memory.copy(&FlightNote { path: "log".into(), from: 1500, until: 1920 });
    assert_eq!(copy.faults.iter().map(|fault| fault.tick).collect::<Vec<_>>(), [1100, 1900]);
}
