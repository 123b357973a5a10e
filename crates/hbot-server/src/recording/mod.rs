//! Recordings of a running server (docs/recordings.md).
//!
//! ```text
//! loop -> tap -> ring -> recorder's thread -> file, memory for flight logs, live viewers
//! service -> notes (scenes, events) ---^
//! ```
//!
//! The loop copies each tick into a ring and never waits. If the ring is full, the tick is lost,
//! and the recorder marks the gap. The recorder's thread makes messages of the ticks and writes
//! them. It requests a copy of the controller from time to time, so that a replay can begin in the
//! middle of a recording and after a gap.

mod file;
mod limit;
mod memory;
mod output;
mod tap;
#[cfg(test)]
mod tests;
mod thread;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use hbot_api::Event;
use hbot_config::{RigConfig, SceneFile};
use hbot_core::{CompiledScene, Controller};
use hbot_host::run_loop::clock::Origin;
use hbot_host::run_loop::engine::Recorder;
use hbot_record::About;

use crate::live;
use crate::web::WebOptions;

pub use self::file::{is_file, is_folder, try_to_make, unsuitable};
pub use self::limit::Limit;
pub(crate) use self::memory::FlightNote;
use self::tap::{Drain, tap};
use self::thread::{RecordingWriter, Setup};

/// Number of scenes and events that can wait for the recorder's thread.
const NOTES: usize = 256;

/// What a server records, and where.
#[derive(Debug, Clone, Default)]
pub struct RecordOptions {
    /// A file whose name ends in `.mcap`, or a folder in which each run gets a file. With `None`
    /// nothing is recorded.
    pub path: Option<PathBuf>,
    /// Size or duration after which a new file begins. It needs a folder.
    pub limit: Option<Limit>,
    /// Entries of the recording's metadata, such as the text of the rig file.
    pub about: BTreeMap<String, String>,
}

/// The counters of a recorder.
#[derive(Debug, Default)]
pub(crate) struct Counts {
    /// Ticks that are in files.
    written: AtomicU64,
    /// Ticks that are in no file, because the recorder or the disk was too slow or failed.
    lost: AtomicU64,
    /// Files that could not be written to their end.
    failed_files: AtomicU64,
    /// Messages that live viewers did not get, because they read too slowly.
    viewers_dropped: AtomicU64,
    files: Mutex<FilesWritten>,
}

impl Counts {
    /// Counts messages that a live viewer did not get.
    #[cfg(feature = "live")]
    pub(crate) fn drop_for_viewer(&self, messages: u64) {
        self.viewers_dropped.fetch_add(messages, Ordering::Relaxed);
    }

    /// Returns the number of messages that live viewers did not get.
    pub(crate) fn dropped_for_viewers(&self) -> u64 {
        self.viewers_dropped.load(Ordering::Relaxed)
    }

    /// Counts a file that has ended. `complete` says whether it was written to its end. A file that
    /// is not there any more is not counted.
    fn end_file(&self, path: &Path, complete: bool) {
        let Ok(found) = std::fs::metadata(path) else { return };
        let mut files = unpoisoned(&self.files);
        if complete {
            files.count += 1;
            files.bytes += found.len();
            files.last = path.to_owned();
        } else {
            files.cut_short += 1;
            files.last_cut_short = path.to_owned();
        }
    }

    /// Returns the files that have ended.
    pub(crate) fn files(&self) -> FilesWritten {
        unpoisoned(&self.files).clone()
    }

    /// Returns the counters as they are now.
    pub(crate) fn now(&self) -> Recorded {
        let get = |count: &AtomicU64| count.load(Ordering::Relaxed);
        Recorded { written: get(&self.written), lost: get(&self.lost), failed_files: get(&self.failed_files) }
    }
}

/// The outcome of a recording.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Recorded {
    /// Number of ticks that are in files.
    pub written: u64,
    /// Number of ticks that are in no file.
    pub lost: u64,
    /// Number of files that could not be written to their end.
    pub failed_files: u64,
}

/// The files of a recording that have ended.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct FilesWritten {
    /// Number of files that were written to their end.
    pub count: u64,
    /// Size of all these files, bytes.
    pub bytes: u64,
    /// The last of them. Empty if there is none.
    pub last: PathBuf,
    /// Number of files that were begun and could not be written to their end.
    pub cut_short: u64,
    /// The last of those. Empty if there is none.
    pub last_cut_short: PathBuf,
}

/// A note of the service for the recorder's thread.
pub(crate) enum Note {
    /// The loop may soon render this scene.
    Scene(SceneNote),
    /// An event that all clients receive.
    Event(Box<Event>),
    /// A request to write the recording of a flight log that has ended.
    Flight(FlightNote),
    /// The run is over.
    End,
}

/// A compiled scene, with the file from which it was made.
#[derive(Clone)]
pub(crate) struct SceneNote {
    compiled: Box<CompiledScene>,
    pub(crate) name: String,
    pub(crate) json: String,
}

impl SceneNote {
    pub(crate) fn new(compiled: &CompiledScene, file: &SceneFile) -> Self {
        let (name, json) = (file.name().to_owned(), file.to_json().to_string());
        Self { compiled: Box::new(compiled.clone()), name, json }
    }
}

/// Passes scenes and events to the recorder's thread. The default value passes them to nobody.
#[derive(Clone, Default)]
pub(crate) struct Notes {
    to: Option<SyncSender<Note>>,
    counts: Arc<Counts>,
    /// The newest scene for which there was no room. The thread takes it when the loop renders it.
    unsent: Unsent,
    /// True while there is no room for notes, so that only the first lost note is reported.
    behind: Arc<AtomicBool>,
}

/// The newest scene that was not sent to the recorder's thread.
type Unsent = Arc<Mutex<Option<SceneNote>>>;

impl Notes {
    /// Returns the counters of the recorder. They stay at zero if nothing is recorded.
    pub(crate) fn counts(&self) -> Arc<Counts> {
        Arc::clone(&self.counts)
    }

    /// Announces a scene. Must be called before the scene is sent to the loop.
    pub(crate) fn scene(&self, compiled: &CompiledScene, file: &SceneFile) {
        if let Some(Note::Scene(scene)) = self.send(|| Note::Scene(SceneNote::new(compiled, file))) {
            // If the thread is far behind, it counts the ticks of the scenes before this one as
            // lost.
            *unpoisoned(&self.unsent) = Some(scene);
        }
    }

    /// Requests the recording of a flight log whose last tick has been published.
    pub(crate) fn flight(&self, flight: FlightNote) {
        let path = flight.path.display().to_string();
        if self.send(|| Note::Flight(flight)).is_some() {
            tracing::warn!(path, "no recording of the flight log: the recorder is too slow");
        }
    }

    pub(crate) fn event(&self, event: &Event) {
        self.send(|| Note::Event(Box::new(event.clone())));
    }

    /// Sends a note to the recorder's thread, if there is one. Returns the note if there is no room
    /// for it.
    fn send(&self, note: impl FnOnce() -> Note) -> Option<Note> {
        let full = match self.to.as_ref()?.try_send(note()) {
            Err(TrySendError::Full(note)) => Some(note),
            // The thread has ended: the run is over.
            Ok(()) | Err(TrySendError::Disconnected(_)) => None,
        };
        if !self.behind.swap(full.is_some(), Ordering::Relaxed) && full.is_some() {
            tracing::warn!("the recorder is too slow: events are missing in the recording");
        }
        full
    }
}

/// Locks a mutex. Its value is whole even if a thread has panicked while it held the lock.
fn unpoisoned<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A recorder before the loop has started.
pub(crate) struct Prepared {
    options: RecordOptions,
    flights: bool,
    live: Option<WebOptions>,
    retry_after: Duration,
    drain: Drain,
    scene: SceneNote,
    notes: Notes,
    noted: Receiver<Note>,
}

/// A recorder whose thread is running.
pub(crate) struct Recording {
    pub(crate) notes: Notes,
    /// The first file. `None` if only flight logs are recorded.
    first: Option<PathBuf>,
    thread: JoinHandle<()>,
    /// The thread that serves live viewers, if any.
    viewers: Option<JoinHandle<()>>,
}

/// Prepares a recorder that begins with the scene `scene`. Returns the callback for the loop and
/// the rest of the recorder. `flights` says whether recordings of flight logs are written, and
/// `waits` whether the loop may wait for the recorder, as in virtual time. Live viewers are served
/// on `live`, if given.
pub(crate) fn prepare(
    options: RecordOptions,
    flights: bool,
    live: Option<WebOptions>,
    scene: SceneNote,
    waits: bool,
) -> (Recorder, Prepared) {
    let (mut tap, drain) = tap(waits);
    let (to, noted) = sync_channel(NOTES);
    let notes = Notes { to: Some(to), ..Notes::default() };
    let retry_after = output::RETRY_AFTER;
    let prepared = Prepared { options, flights, live, retry_after, drain, scene, notes, noted };
    (Box::new(move |ticked| tap.take(ticked)), prepared)
}

impl Prepared {
    /// Starts the recorder's thread, and that of live viewers.
    ///
    /// # Errors
    /// Fails if the system provides no thread.
    pub(crate) fn start(self, rig: &RigConfig, origin: Origin) -> std::io::Result<Recording> {
        let counts = self.notes.counts();
        let entries = about(self.options.about, rig, &self.scene, origin);
        let files = file::Files::new(self.options.path, self.options.limit);
        let first = files.first().map(Path::to_owned);
        let live = self.live.map(|at| live::start(at, &rig.name, joints(rig), Arc::clone(&counts)));
        let (feed, viewers) = live.transpose()?.unzip();
        let setup = Setup {
            about: About { joints: joints(rig), entries },
            controller: Controller::new(rig.rig),
            scene: self.scene,
            unix_ns: origin.unix_ns,
            files,
            counts,
            flights: self.flights,
            retry_after: self.retry_after,
            feed,
        };
        let writer = RecordingWriter::new(setup, self.drain, self.noted, Arc::clone(&self.notes.unsent));
        let thread =
            std::thread::Builder::new().name("hbot-record".to_owned()).spawn(move || writer.run())?;
        Ok(Recording { notes: self.notes, first, thread, viewers })
    }
}

impl Recording {
    /// Returns the path of the first file. Returns `None` if only flight logs are recorded.
    pub(crate) fn first(&self) -> Option<&Path> {
        self.first.as_deref()
    }

    /// Writes what is left and ends the recording. Must be called after the loop has ended. Blocks
    /// until the files are written. Returns `None` if only flight logs are recorded.
    pub(crate) fn end(self) -> Option<Recorded> {
        if let Some(notes) = &self.notes.to {
            // Fails only if the thread has ended.
            let _ = notes.send(Note::End);
        }
        if self.thread.join().is_err() {
            tracing::error!("the recorder's thread has panicked");
            // Nobody knows what is in its file.
            self.notes.counts.failed_files.fetch_add(1, Ordering::Relaxed);
        }
        // The recorder's thread has ended, and with it the messages of the viewers.
        if self.viewers.is_some_and(|viewers| viewers.join().is_err()) {
            tracing::error!("the thread of live viewers has panicked");
        }
        self.first.is_some().then(|| self.notes.counts.now())
    }
}

/// Returns the text of an error with its causes. Errors of the MCAP library do not name them: the
/// reason that the system gives is only in the causes.
fn with_causes(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        text = format!("{text}: {cause}");
        next = cause.source();
    }
    text
}

/// Returns the names of the joints, in the order steer, drive of each wheel.
fn joints(rig: &RigConfig) -> Vec<String> {
    let names = rig.wheels.iter().map(|wheel| wheel.replace(' ', "_"));
    names.flat_map(|wheel| ["steer", "drive"].map(|joint| format!("{wheel}.{joint}"))).collect()
}

/// Returns the entries of the recording's metadata.
fn about(
    mut entries: BTreeMap<String, String>,
    rig: &RigConfig,
    scene: &SceneNote,
    origin: Origin,
) -> BTreeMap<String, String> {
    let mut put = |key: &str, value: String| entries.insert(key.to_owned(), value);
    put("rig_name", rig.name.clone());
    put("rate_hz", rig.rate_hz.to_string());
    put("accuracy", rig.accuracy.to_owned());
    put("period_ns", rig.rig.timing.period_ns.to_string());
    put("scene", scene.json.clone());
    put("clock_unix_ns", origin.unix_ns.to_string());
    put("clock_monotonic_ns", origin.monotonic_ns.to_string());
    entries
}
