//! The file that is being recorded, and what happens when it cannot be written.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use hbot_api::{Event, StateEvent};
use hbot_core::Controller;
use hbot_record::{About, Writer};
use mcap::McapError;

use super::file::{Counting, Files};
use super::tap::Entry;
use super::{Counts, SceneNote, with_causes};

/// Time after which everything that was recorded is passed to the operating system. After a kill,
/// at most this time is missing.
const FLUSH_EVERY: Duration = Duration::from_millis(500);
/// Time between two states of the control law in a file. A replay can begin at each.
const CONTROLLER_EVERY_NS: u64 = 10_000_000_000;
/// Time after which a new file is tried after one has failed.
pub(super) const RETRY_AFTER: Duration = Duration::from_secs(10);

/// The files of a recording, one after another.
pub(super) struct Output {
    about: About,
    files: Files,
    counts: Arc<Counts>,
    file: Option<Open>,
    failed_at: Option<Instant>,
    retry_after: Duration,
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
    /// Number of recorded ticks that are not with the operating system yet.
    unflushed: u64,
    /// Number of ticks that are missing since the last recorded one. Ticks are recorded again after
    /// the next state of the control law.
    gap: u64,
}

/// The scene that a tick renders.
pub(super) struct Rendered<'a> {
    /// The scene, if it is known.
    pub(super) scene: Option<&'a SceneNote>,
    /// Whether the tick before rendered another one.
    pub(super) changed: bool,
}

/// A state of the control law, with the scene that is rendered.
pub(super) struct Law<'a> {
    pub(super) controller: &'a Controller,
    pub(super) scene: Option<&'a SceneNote>,
}

impl Output {
    /// Creates the output. After a file has failed, a new one is tried after `retry_after`.
    pub(super) fn new(about: About, files: Files, counts: Arc<Counts>, retry_after: Duration) -> Self {
        Self { about, files, counts, file: None, failed_at: None, retry_after }
    }

    pub(super) fn is_open(&self) -> bool {
        self.file.is_some()
    }

    pub(super) fn event(&mut self, event: &Event, at: u64) {
        self.write(|file| file.writer.event(event, at));
    }

    /// Notes that `ticks` ticks before the next one are missing.
    pub(super) fn miss(&mut self, ticks: u64) {
        if let Some(file) = &mut self.file {
            file.gap += ticks;
        }
        // Without `--record` they need not be in a file.
        if self.files.are_wanted() {
            self.counts.lost.fetch_add(ticks, Ordering::Relaxed);
        }
    }

    /// Records a tick. `state` is its state as clients see it, and `at` its Unix time, ns.
    pub(super) fn tick(&mut self, entry: &Entry, state: &StateEvent, rendered: &Rendered<'_>, at: u64) {
        let Rendered { scene, changed } = *rendered;
        let recorded = self.write(|file| {
            if let Some(scene) = scene.filter(|_| changed) {
                file.scene(entry.inputs.tick, scene, at)?;
            }
            if scene.is_none() || file.gap > 0 {
                // The state before this tick, or its scene, is not in the file.
                return file.writer.state(state, at).map(|()| false);
            }
            file.writer.exact_tick(&entry.inputs, &entry.outputs, at)?;
            file.writer.state(state, at)?;
            file.unflushed += 1;
            Ok(true)
        });
        if recorded == Some(true) {
            self.counts.written.fetch_add(1, Ordering::Relaxed);
        } else {
            self.miss(1);
        }
    }

    /// Returns whether the file needs a state of the control law, or a new file can begin with one.
    /// `t_ns` is the time since the start of the loop.
    pub(super) fn needs_law(&self, t_ns: u64) -> bool {
        let Some(file) = &self.file else {
            return self.files.has_more()
                && self.failed_at.is_none_or(|failed| failed.elapsed() >= self.retry_after);
        };
        file.gap > 0 || t_ns - file.controller_ns >= CONTROLLER_EVERY_NS || self.is_full(file, t_ns)
    }

    fn is_full(&self, file: &Open, t_ns: u64) -> bool {
        self.files.is_full(file.bytes.load(Ordering::Relaxed), t_ns - file.begun_ns)
    }

    /// Uses the state of the control law after the tick `entry`: begins a new file if it is time,
    /// or ends a gap.
    pub(super) fn restart(&mut self, law: &Law<'_>, entry: &Entry, at: u64) {
        let (next, t_ns) = (entry.inputs.tick + 1, entry.t_ns);
        if !self.needs_law(t_ns) {
            return;
        }
        let full = self.file.as_ref().is_none_or(|file| self.is_full(file, t_ns));
        if full && self.files.has_more() {
            self.close(next, at);
            self.begin(law, next, t_ns, at);
            return;
        }
        self.write(|file| {
            let Some(scene) = law.scene else { return Ok(()) };
            file.end_gap(next, at)?;
            file.controller_ns = t_ns;
            file.writer.exact_scene(next, &scene.compiled, at)?;
            file.writer.exact_controller(entry.inputs.tick, law.controller, at)
        });
    }

    /// Begins a file at tick `tick`, with the present scene and state of the control law. `t_ns` is
    /// the time of the tick since the start of the loop, and `at` its Unix time, ns.
    pub(super) fn begin(&mut self, law: &Law<'_>, tick: u64, t_ns: u64, at: u64) {
        let Some((path, opened)) = self.files.create() else { return };
        let begun = opened.map_err(McapError::Io).and_then(|(into, bytes)| {
            Ok(Open {
                path: path.clone(),
                writer: Writer::new(into, &self.about)?,
                bytes,
                flushed: Instant::now(),
                begun_ns: t_ns,
                controller_ns: t_ns,
                unflushed: 0,
                gap: 0,
            })
        });
        match begun {
            Err(error) => self.failed(&path, &error),
            Ok(file) => {
                self.file = Some(file);
                self.write(|file| {
                    if let Some(scene) = law.scene {
                        file.scene(tick, scene, at)?;
                    }
                    file.writer.exact_controller(tick, law.controller, at)
                });
            }
        }
    }

    /// Passes everything to the operating system if it is time. Gives up a file that somebody has
    /// deleted: the system would go on writing, and nobody could read it.
    pub(super) fn flush(&mut self) {
        let due = self.file.as_ref().is_some_and(|file| file.flushed.elapsed() >= FLUSH_EVERY);
        if due {
            self.write(|file| {
                file.flushed = Instant::now();
                file.writer.flush()?;
                file.unflushed = 0;
                std::fs::symlink_metadata(&file.path).map(drop).map_err(McapError::Io)
            });
        }
    }

    /// Ends the open file with its index. `tick` is the number of the tick after the last one.
    pub(super) fn close(&mut self, tick: u64, at: u64) {
        self.write(|file| file.end_gap(tick, at));
        if let Some(Open { path, writer, unflushed, .. }) = self.file.take() {
            // The file is complete after it is dropped.
            match writer.finish().map(drop) {
                Ok(()) => {
                    self.counts.end_file(&path, true);
                    tracing::info!(path = %path.display(), "recording written");
                }
                Err(error) => self.give_up(&path, unflushed, &error),
            }
        }
    }

    /// Writes to the open file, if any. After an error the file is given up.
    fn write<T>(&mut self, write: impl FnOnce(&mut Open) -> Result<T, McapError>) -> Option<T> {
        let file = self.file.as_mut()?;
        match write(file) {
            Ok(value) => Some(value),
            Err(error) => {
                if let Some(Open { path, unflushed, .. }) = self.file.take() {
                    self.give_up(&path, unflushed, &error);
                }
                None
            }
        }
    }

    /// Gives up a file, of which nobody knows how many of the last `unflushed` ticks are in it.
    fn give_up(&mut self, path: &Path, unflushed: u64, error: &McapError) {
        self.counts.written.fetch_sub(unflushed, Ordering::Relaxed);
        self.miss(unflushed);
        self.counts.end_file(path, false);
        self.failed(path, error);
    }

    fn failed(&mut self, path: &Path, error: &McapError) {
        self.failed_at = Some(Instant::now());
        self.counts.failed_files.fetch_add(1, Ordering::Relaxed);
        let error = with_causes(error);
        tracing::warn!(path = %path.display(), %error, "the recording cannot be written; the server goes on without it");
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
