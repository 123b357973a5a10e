//! The recorder's thread: it makes messages of ticks, scenes and events, and writes them.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::Receiver;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use hbot_api::{Event, StateEvent};
use hbot_core::Controller;
use hbot_record::{About, Writer};
use mcap::McapError;

use super::file::{Counting, Files};
use super::memory::{FlightNote, Memory};
use super::tap::{Drain, Entry};
use super::{Counts, Note, SceneNote};
use crate::service::convert;

/// How long the thread sleeps if nothing waits for it. The ring has room for far more ticks.
const SLEEP: Duration = Duration::from_millis(10);
/// Time after which everything that was recorded is passed to the operating system. After a kill,
/// at most this time is missing.
const FLUSH_EVERY: Duration = Duration::from_millis(500);
/// Time between two states of the control law in a file. A replay can begin at each.
const CONTROLLER_EVERY_NS: u64 = 10_000_000_000;
/// Time after which a new file is tried after one has failed.
const RETRY_AFTER: Duration = Duration::from_secs(10);

/// What a recorder needs to begin.
pub(super) struct Setup {
    pub(super) about: About,
    /// State of the control law before tick 0.
    pub(super) controller: Controller,
    /// The scene that the loop renders first.
    pub(super) scene: SceneNote,
    /// Unix time of tick 0, ns.
    pub(super) unix_ns: u64,
    pub(super) files: Files,
    pub(super) counts: Arc<Counts>,
    /// Whether recordings of flight logs are written.
    pub(super) flights: bool,
}

/// The recorder's thread.
pub(super) struct Scribe {
    about: About,
    unix_ns: u64,
    files: Files,
    counts: Arc<Counts>,
    drain: Drain,
    notes: Receiver<Note>,
    ended: bool,
    file: Option<Open>,
    failed_at: Option<Instant>,
    /// Scenes that the loop has not rendered yet, oldest first.
    scenes: Vec<Arc<SceneNote>>,
    /// The scene that the loop renders. `None` if it is not known.
    scene: Option<Arc<SceneNote>>,
    /// The newest state of the control law.
    controller: Box<Controller>,
    /// Whether a copy of the controller is on its way.
    requested: bool,
    /// Number of lost ticks that the loop has reported.
    lost: u64,
    newest: u64,
    state: StateEvent,
    /// The last ticks, if recordings of flight logs are written.
    memory: Option<Memory>,
    /// Flight logs whose last tick has not arrived yet.
    flights: Vec<FlightNote>,
    writing: Vec<JoinHandle<()>>,
}

/// The file that is being written.
struct Open {
    path: PathBuf,
    writer: Writer<Counting>,
    bytes: Arc<AtomicU64>,
    flushed: Instant,
    begun_ns: u64,
    /// Time of the last state of the control law in the file, ns since the start of the loop.
    controller_ns: u64,
    /// Number of ticks that are missing since the last recorded one. Ticks are recorded again after
    /// the next state of the control law.
    gap: u64,
}

impl Scribe {
    pub(super) fn new(setup: Setup, drain: Drain, notes: Receiver<Note>) -> Self {
        let Setup { about, controller, scene, unix_ns, files, counts, flights } = setup;
        Self {
            about,
            unix_ns,
            files,
            counts,
            drain,
            notes,
            ended: false,
            file: None,
            failed_at: None,
            scenes: Vec::new(),
            scene: Some(Arc::new(scene)),
            controller: Box::new(controller),
            requested: false,
            lost: 0,
            newest: 0,
            state: StateEvent::default(),
            memory: flights.then(Memory::default),
            flights: Vec::new(),
            writing: Vec::new(),
        }
    }

    /// Records until the run is over.
    pub(super) fn run(mut self) {
        self.begin(0, 0);
        if let (Some(memory), Some(scene)) = (&mut self.memory, &self.scene) {
            // There is no tick before tick 0. The state before it is used from there on.
            memory.begin(self.controller.clone(), Arc::clone(scene), 0, 0);
        }
        while !self.ended {
            self.listen();
            let mut idle = true;
            while let Ok(entry) = self.drain.entries.pop() {
                idle = false;
                self.listen();
                self.take(entry);
            }
            self.flush();
            if idle && !self.ended {
                std::thread::sleep(SLEEP);
            }
        }
        self.finish();
    }

    /// Takes the notes of the service. A scene is always noted before the loop renders it.
    fn listen(&mut self) {
        while let Ok(note) = self.notes.try_recv() {
            match note {
                Note::Scene(scene) => self.scenes.push(Arc::new(scene)),
                Note::Event(event) => self.event(&event),
                Note::Flight(flight) => self.flights.push(flight),
                Note::End => self.ended = true,
            }
        }
    }

    fn event(&mut self, event: &Event) {
        let at = self.newest;
        self.write(|file| file.writer.event(event, at));
    }

    /// Records one tick.
    fn take(&mut self, mut entry: Entry) {
        let missing = entry.lost - self.lost;
        self.lost = entry.lost;
        self.newest = self.unix_ns + entry.t_ns;
        let controller = entry.controller.take();
        let changed = self.scene.as_ref().map(|scene| scene.compiled.revision()) != Some(entry.scene);
        if changed {
            self.adopt(entry.scene);
        }
        if let Some(file) = &mut self.file {
            file.gap += missing;
        }
        self.count_lost(missing);
        self.remember(&entry, changed, missing);
        self.tick(&entry, changed);
        if let Some(controller) = controller {
            self.requested = false;
            self.restart(controller, &entry);
        }
        self.request(&entry);
        self.log_flights(entry.inputs.tick);
    }

    /// Keeps a tick in memory for a flight log.
    fn remember(&mut self, entry: &Entry, changed: bool, missing: u64) {
        let Some(memory) = &mut self.memory else { return };
        if missing > 0 || self.scene.is_none() {
            memory.clear();
        }
        memory.push(entry, self.scene.clone().filter(|_| changed));
    }

    /// Writes the recordings of flight logs that end at `tick` or before, on threads of their own.
    fn log_flights(&mut self, tick: u64) {
        let Some(memory) = &self.memory else { return };
        for flight in self.flights.extract_if(.., |flight| flight.until <= tick) {
            let (copy, about, unix_ns) = (memory.copy(&flight), self.about.clone(), self.unix_ns);
            self.writing.push(std::thread::spawn(move || {
                let path = flight.path.display();
                match copy.write(&flight, &about, unix_ns) {
                    Ok(()) => tracing::info!(%path, "recording of the flight log written"),
                    Err(error) => tracing::warn!(%path, %error, "no recording of the flight log"),
                }
            }));
        }
        self.writing.retain(|thread| !thread.is_finished());
    }

    /// Finds the scene with this revision among the announced ones. Older ones are never rendered
    /// again.
    fn adopt(&mut self, revision: u64) {
        let found = self.scenes.iter().position(|scene| scene.compiled.revision() == revision);
        self.scene = found.map(|k| self.scenes.swap_remove(k));
        self.scenes.retain(|scene| scene.compiled.revision() > revision);
    }

    fn tick(&mut self, entry: &Entry, changed: bool) {
        if self.file.is_none() {
            self.count_lost(1);
            return;
        }
        let at = self.newest;
        let mut state = std::mem::take(&mut self.state);
        convert::fill_state(&mut state, &entry.outputs.state, entry.t_ns, &entry.timing);
        let scene = self.scene.clone().filter(|_| changed);
        let known = self.scene.is_some();
        let recorded = self.write(|file| {
            if !known || file.gap > 0 {
                // The state before this tick, or its scene, is not in the file.
                file.gap += 1;
                return file.writer.state(&state, at).map(|()| false);
            }
            if let Some(scene) = &scene {
                file.scene(entry.inputs.tick, scene, at)?;
            }
            file.writer.exact_tick(&entry.inputs, &entry.outputs, at)?;
            file.writer.state(&state, at).map(|()| true)
        });
        let count = if recorded == Some(true) { &self.counts.written } else { &self.counts.lost };
        count.fetch_add(1, Ordering::Relaxed);
        self.state = state;
    }

    /// Uses a new state of the control law: begins a new file if it is time, or ends a gap.
    fn restart(&mut self, controller: Box<Controller>, entry: &Entry) {
        let next = entry.inputs.tick + 1;
        if let (Some(memory), Some(scene)) = (&mut self.memory, &self.scene) {
            memory.begin(controller.clone(), Arc::clone(scene), entry.inputs.tick, entry.t_ns);
        }
        if !self.file_needs(entry) {
            return;
        }
        let full = self.file.as_ref().is_none_or(|file| {
            self.files.is_full(file.bytes.load(Ordering::Relaxed), entry.t_ns - file.begun_ns)
        });
        if full && self.files.has_more() {
            self.close();
            self.controller = controller;
            self.begin(next, entry.t_ns);
            return;
        }
        let (at, scene) = (self.newest, self.scene.clone());
        self.write(|file| {
            let Some(scene) = &scene else { return Ok(()) };
            file.end_gap(next, at)?;
            file.controller_ns = entry.t_ns;
            file.writer.exact_scene(next, &scene.compiled, at)?;
            file.writer.exact_controller(entry.inputs.tick, &controller, at)
        });
        self.controller = controller;
    }

    /// Counts ticks that are in no file. Without `--record` they need not be in one.
    fn count_lost(&self, ticks: u64) {
        if self.files.are_wanted() {
            self.counts.lost.fetch_add(ticks, Ordering::Relaxed);
        }
    }

    /// Returns whether the file needs a state of the control law, or a new file can begin with one.
    fn file_needs(&self, entry: &Entry) -> bool {
        let Some(file) = &self.file else {
            return self.files.has_more()
                && self.failed_at.is_none_or(|failed| failed.elapsed() >= RETRY_AFTER);
        };
        let bytes = file.bytes.load(Ordering::Relaxed);
        file.gap > 0
            || entry.t_ns - file.controller_ns >= CONTROLLER_EVERY_NS
            || self.files.is_full(bytes, entry.t_ns - file.begun_ns)
    }

    /// Requests a copy of the controller if the file or the memory needs one.
    fn request(&mut self, entry: &Entry) {
        let due = self.memory.as_ref().is_some_and(|memory| memory.is_due(entry.t_ns));
        if !self.requested && (due || self.file_needs(entry)) {
            self.requested = true;
            self.drain.request(self.controller.clone());
        }
    }

    /// Begins a file at tick `tick`, with the present scene and state of the control law.
    fn begin(&mut self, tick: u64, t_ns: u64) {
        let Some((path, opened)) = self.files.create() else { return };
        let at = self.unix_ns + t_ns;
        let begun = opened.map_err(McapError::Io).and_then(|(into, bytes)| {
            let writer = Writer::new(into, &self.about)?;
            let now = Instant::now();
            Ok(Open {
                path: path.clone(),
                writer,
                bytes,
                flushed: now,
                begun_ns: t_ns,
                controller_ns: t_ns,
                gap: 0,
            })
        });
        match begun {
            Err(error) => self.failed(&path, &error),
            Ok(file) => {
                self.file = Some(file);
                let (scene, controller) = (self.scene.clone(), self.controller.clone());
                self.write(|file| {
                    if let Some(scene) = &scene {
                        file.scene(tick, scene, at)?;
                    }
                    file.writer.exact_controller(tick, &controller, at)
                });
            }
        }
    }

    /// Writes to the open file, if any. After an error the file is given up.
    fn write<T>(&mut self, write: impl FnOnce(&mut Open) -> Result<T, McapError>) -> Option<T> {
        let file = self.file.as_mut()?;
        match write(file) {
            Ok(value) => Some(value),
            Err(error) => {
                if let Some(file) = self.file.take() {
                    self.failed(&file.path, &error);
                }
                None
            }
        }
    }

    fn failed(&mut self, path: &std::path::Path, error: &McapError) {
        self.failed_at = Some(Instant::now());
        self.counts.failed_files.fetch_add(1, Ordering::Relaxed);
        tracing::warn!(path = %path.display(), %error, "the recording cannot be written; the server goes on without it");
    }

    fn flush(&mut self) {
        let due = self.file.as_ref().is_some_and(|file| file.flushed.elapsed() >= FLUSH_EVERY);
        if due {
            self.write(|file| {
                file.flushed = Instant::now();
                file.writer.flush()
            });
        }
    }

    /// Ends the open file with its index.
    fn close(&mut self) {
        let (at, tick) = (self.newest, self.state.tick);
        self.write(|file| file.end_gap(tick, at));
        if let Some(Open { path, writer, .. }) = self.file.take() {
            match writer.finish() {
                Ok(_) => tracing::info!(path = %path.display(), "recording written"),
                Err(error) => self.failed(&path, &error),
            }
        }
    }

    fn finish(mut self) {
        while let Ok(entry) = self.drain.entries.pop() {
            self.take(entry);
        }
        self.close();
        // The run has ended, so no further tick of a flight log will arrive.
        self.log_flights(u64::MAX);
        for thread in self.writing {
            // A panic there has been reported.
            let _ = thread.join();
        }
    }
}

impl Open {
    /// Marks the ticks that are missing until here, if any.
    fn end_gap(&mut self, tick: u64, at: u64) -> Result<(), McapError> {
        let missing = std::mem::take(&mut self.gap);
        if missing > 0 { self.writer.gap(tick, missing, at) } else { Ok(()) }
    }

    /// Writes a scene that is rendered from `tick` on.
    fn scene(&mut self, tick: u64, scene: &SceneNote, at: u64) -> Result<(), McapError> {
        self.writer.scene(tick, &scene.name, &scene.json, at)?;
        self.writer.exact_scene(tick, &scene.compiled, at)
    }
}
