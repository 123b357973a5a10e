//! The recorder's thread: it passes ticks, scenes and events to the file, to the memory for flight
//! logs, and to live viewers.

use std::sync::Arc;
use std::sync::mpsc::Receiver;
use std::thread::JoinHandle;
use std::time::Duration;

use hbot_api::{Event, StateEvent};
use hbot_core::Controller;
use hbot_record::About;

use super::file::Files;
use super::memory::{FlightNote, Memory};
use super::output::{Law, Output, Rendered};
use super::tap::{Drain, Entry};
use super::{Counts, Note, SceneNote, Unsent, unpoisoned, with_causes};
use crate::live::Feed;
use crate::service::convert;

/// How long the thread sleeps if nothing waits for it. The ring has room for far more ticks.
const SLEEP: Duration = Duration::from_millis(10);

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
    /// Time after which a new file is tried after one has failed.
    pub(super) retry_after: Duration,
    /// Where live viewers get their messages from, if they are served.
    pub(super) feed: Option<Feed>,
}

/// The recorder's thread.
pub(super) struct RecordingWriter {
    about: About,
    unix_ns: u64,
    drain: Drain,
    notes: Receiver<Note>,
    /// The newest scene for which there was no room in `notes`.
    unsent: Unsent,
    ended: bool,
    output: Output,
    feed: Option<Feed>,
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
    /// Unix time of the newest tick, ns.
    newest: u64,
    state: StateEvent,
    /// The last ticks, if recordings of flight logs are written.
    memory: Option<Memory>,
    /// Flight logs whose last tick has not arrived yet.
    flights: Vec<FlightNote>,
    writing: Vec<JoinHandle<()>>,
}

impl RecordingWriter {
    pub(super) fn new(setup: Setup, drain: Drain, notes: Receiver<Note>, unsent: Unsent) -> Self {
        let Setup { about, controller, scene, unix_ns, files, counts, flights, retry_after, feed } = setup;
        Self {
            output: Output::new(about.clone(), files, counts, retry_after),
            about,
            unix_ns,
            drain,
            notes,
            unsent,
            ended: false,
            feed,
            scenes: Vec::new(),
            scene: Some(Arc::new(scene)),
            controller: Box::new(controller),
            requested: false,
            lost: 0,
            newest: unix_ns,
            state: StateEvent::default(),
            memory: flights.then(Memory::default),
            flights: Vec::new(),
            writing: Vec::new(),
        }
    }

    /// Records until the run is over.
    pub(super) fn run(mut self) {
        let law = Law { controller: &self.controller, scene: self.scene.as_deref() };
        self.output.begin(&law, 0, 0, self.unix_ns);
        if let Some(scene) = &self.scene {
            if let Some(feed) = &mut self.feed {
                feed.scene(0, scene, self.unix_ns);
            }
            if let Some(memory) = &mut self.memory {
                // There is no tick before tick 0. The state before it is used from there on.
                memory.begin(self.controller.clone(), Arc::clone(scene), 0, 0);
            }
        }
        while !self.ended {
            self.listen();
            let mut idle = true;
            while let Ok(entry) = self.drain.entries.pop() {
                idle = false;
                self.listen();
                self.take(entry);
                // In virtual time the loop waits for this thread, so the ring is never empty.
                self.output.flush();
            }
            self.output.flush();
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
        self.output.event(event, self.newest);
        if let Some(memory) = &mut self.memory {
            memory.event(event);
        }
        if let Some(feed) = &mut self.feed {
            feed.event(event, self.newest);
        }
    }

    /// Passes on one tick.
    fn take(&mut self, mut entry: Entry) {
        let missing = entry.lost - self.lost;
        self.lost = entry.lost;
        self.newest = self.unix_ns + entry.t_ns;
        let controller = entry.controller.take();
        let changed = self.scene.as_ref().map(|scene| scene.compiled.revision()) != Some(entry.scene);
        if changed {
            self.adopt(entry.scene);
        }
        if missing > 0 {
            self.output.miss(missing);
        }
        self.remember(&entry, changed, missing);
        self.publish(&entry, changed);
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

    /// Writes the recordings of flight logs that end at `tick` or before, each on a new thread.
    fn log_flights(&mut self, tick: u64) {
        let Some(memory) = &self.memory else { return };
        for flight in self.flights.extract_if(.., |flight| flight.until <= tick) {
            let (copy, about, unix_ns) = (memory.copy(&flight), self.about.clone(), self.unix_ns);
            let path = flight.path.display().to_string();
            let write = move || {
                let path = flight.path.display();
                match copy.write(&flight, &about, unix_ns) {
                    Ok(()) => tracing::info!(%path, "recording of the flight log written"),
                    Err(error) => {
                        let error = with_causes(&error);
                        tracing::warn!(%path, %error, "no recording of the flight log");
                    }
                }
            };
            match std::thread::Builder::new().name("hbot-flight".to_owned()).spawn(write) {
                Ok(thread) => self.writing.push(thread),
                Err(error) => tracing::warn!(path, %error, "no recording of the flight log"),
            }
        }
        self.writing.retain(|thread| !thread.is_finished());
    }

    /// Finds the scene with this revision among the announced ones. Older ones are never rendered
    /// again.
    fn adopt(&mut self, revision: u64) {
        let found = self.scenes.iter().position(|scene| scene.compiled.revision() == revision);
        self.scene = found.map(|k| self.scenes.remove(k)).or_else(|| {
            let mut unsent = unpoisoned(&self.unsent);
            let rendered = |scene: &mut SceneNote| scene.compiled.revision() == revision;
            unsent.take_if(rendered).map(Arc::new)
        });
        self.scenes.retain(|scene| scene.compiled.revision() > revision);
    }

    /// Passes a tick to the file and to live viewers.
    fn publish(&mut self, entry: &Entry, changed: bool) {
        let (at, scene) = (self.newest, self.scene.as_deref());
        let watched = self.feed.as_ref().is_some_and(Feed::is_watched);
        if watched || self.output.is_open() {
            convert::fill_state(&mut self.state, &entry.outputs.state, entry.t_ns, &entry.timing);
        }
        self.output.tick(entry, &self.state, &Rendered { scene, changed }, at);
        let Some(feed) = &mut self.feed else { return };
        // A viewer that comes later receives the scene too.
        if let Some(scene) = scene.filter(|_| changed) {
            feed.scene(entry.inputs.tick, scene, at);
        }
        if watched {
            feed.state(&self.state, at);
        }
    }

    /// Uses a new state of the control law.
    fn restart(&mut self, controller: Box<Controller>, entry: &Entry) {
        if let (Some(memory), Some(scene)) = (&mut self.memory, &self.scene) {
            memory.begin(controller.clone(), Arc::clone(scene), entry.inputs.tick, entry.t_ns);
        }
        self.controller = controller;
        let law = Law { controller: &self.controller, scene: self.scene.as_deref() };
        self.output.restart(&law, entry, self.newest);
    }

    /// Requests a copy of the controller if the file or the memory needs one. It is of no use
    /// without the scene.
    fn request(&mut self, entry: &Entry) {
        if self.scene.is_none() {
            return;
        }
        let due = self.memory.as_ref().is_some_and(|memory| memory.is_due(entry.t_ns));
        if !self.requested && (due || self.output.needs_law(entry.t_ns)) {
            self.requested = true;
            self.drain.request(self.controller.clone());
        }
    }

    fn finish(mut self) {
        while let Ok(entry) = self.drain.entries.pop() {
            self.take(entry);
        }
        self.output.close(self.state.tick, self.newest);
        // The run has ended, so no further tick of a flight log will arrive.
        self.log_flights(u64::MAX);
        for thread in self.writing {
            // A panic there has been reported.
            let _ = thread.join();
        }
    }
}
