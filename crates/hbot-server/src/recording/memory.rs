//! The last ticks in memory, from which the recording of a flight log is written.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::Arc;

use hbot_api::{Event, FaultEvent, StateEvent};
use hbot_core::Controller;
use hbot_record::{About, Writer};
use mcap::McapError;

use super::SceneNote;
use super::file;
use super::tap::Entry;
use crate::service::convert;

/// Time between two states of the control law in memory, ns.
pub(super) const PART_NS: u64 = 1_000_000_000;
/// Time that the memory reaches back at least, ns: a flight log of 1 s and at most three times
/// 100 ms, and the time until it is requested.
const REACH_NS: u64 = 2_000_000_000;

/// A request to write the recording of a flight log.
#[derive(Debug, Clone)]
pub(crate) struct FlightNote {
    pub(crate) path: PathBuf,
    /// First tick of the log.
    pub(crate) from: u64,
    /// Last tick of the log.
    pub(crate) until: u64,
}

/// Largest number of faults and stops in memory.
const MOST_FAULTS: usize = 16;

/// The last ticks, each with the scene if it renders another one than the tick before; and the last
/// faults and stops.
#[derive(Default)]
pub(super) struct Memory {
    parts: VecDeque<Part>,
    pub(super) faults: VecDeque<FaultEvent>,
}

/// Ticks in succession, with what a replay needs to begin.
#[derive(Clone)]
struct Part {
    /// State of the control law before the first tick.
    controller: Box<Controller>,
    /// The scene that the first tick renders, unless it changes there.
    scene: Arc<SceneNote>,
    /// Number of the tick after which `controller` was copied.
    after: u64,
    t_ns: u64,
    ticks: Vec<(Entry, Option<Arc<SceneNote>>)>,
}

impl Memory {
    /// Begins a part: `controller` is the state after tick `after`. Forgets what is too old.
    pub(super) fn begin(
        &mut self,
        controller: Box<Controller>,
        scene: Arc<SceneNote>,
        after: u64,
        t_ns: u64,
    ) {
        self.parts.push_back(Part { controller, scene, after, t_ns, ticks: Vec::new() });
        while self.parts.get(1).is_some_and(|part| part.t_ns + REACH_NS <= t_ns) {
            self.parts.pop_front();
        }
    }

    /// Adds a tick.
    pub(super) fn push(&mut self, entry: &Entry, scene: Option<Arc<SceneNote>>) {
        if let Some(part) = self.parts.back_mut() {
            part.ticks.push((entry.clone(), scene));
        }
    }

    /// Adds an event if it is a fault, a stop or a reset.
    pub(super) fn event(&mut self, event: &Event) {
        let Event::Fault(fault) = event else { return };
        if self.faults.len() == MOST_FAULTS {
            self.faults.pop_front();
        }
        self.faults.push_back(fault.clone());
    }

    /// Forgets all ticks, because one is missing.
    pub(super) fn clear(&mut self) {
        self.parts.clear();
    }

    /// Returns whether a new part is due at `t_ns`.
    pub(super) fn is_due(&self, t_ns: u64) -> bool {
        self.parts.back().is_none_or(|part| t_ns >= part.t_ns + PART_NS)
    }

    /// Returns a copy of the ticks of a flight log, from the last state of the control law before
    /// it. If the ticks are not in memory, because the run or the memory began later, the copy
    /// begins later.
    pub(super) fn copy(&self, flight: &FlightNote) -> Self {
        let first = self.parts.iter().rposition(|part| part.after < flight.from).unwrap_or(0);
        let mut parts: VecDeque<Part> = self.parts.iter().skip(first).cloned().collect();
        for part in &mut parts {
            part.ticks.retain(|(entry, _)| entry.inputs.tick <= flight.until);
        }
        parts.retain(|part| !part.ticks.is_empty());
        // With the faults and stops of all its ticks, also of those before the log's first one.
        let begins = parts.front().map_or(flight.from, |part| part.after + 1);
        let wanted = begins..=flight.until;
        let faults = self.faults.iter().filter(|fault| wanted.contains(&fault.tick)).cloned();
        Self { parts, faults: faults.collect() }
    }

    /// Writes a recording of all ticks in memory. Blocks until it is written. After an error no
    /// file is left.
    pub(super) fn write(&self, flight: &FlightNote, about: &About, unix_ns: u64) -> Result<(), McapError> {
        let (into, _) = file::open(&flight.path)?;
        self.write_to(into, about, unix_ns).inspect_err(|_| {
            // Without room for the recording there may be none for a better message either.
            let _ = std::fs::remove_file(&flight.path);
        })
    }

    fn write_to(&self, into: file::Counting, about: &About, unix_ns: u64) -> Result<(), McapError> {
        let mut writer = Writer::new(into, about)?;
        let mut state = StateEvent::default();
        for (k, part) in self.parts.iter().enumerate() {
            if k == 0 {
                let at = unix_ns + part.t_ns;
                writer.scene(part.after, &part.scene.name, &part.scene.json, at)?;
                writer.exact_scene(part.after, &part.scene.compiled, at)?;
                writer.exact_controller(part.after, &part.controller, at)?;
            }
            for (entry, scene) in &part.ticks {
                let (tick, at) = (entry.inputs.tick, unix_ns + entry.t_ns);
                if let Some(scene) = scene {
                    writer.scene(tick, &scene.name, &scene.json, at)?;
                    writer.exact_scene(tick, &scene.compiled, at)?;
                }
                writer.exact_tick(&entry.inputs, &entry.outputs, at)?;
                convert::fill_state(&mut state, &entry.outputs.state, entry.t_ns, &entry.timing);
                writer.state(&state, at)?;
                for fault in self.faults.iter().filter(|fault| fault.tick == tick) {
                    writer.event(&Event::Fault(fault.clone()), at)?;
                }
            }
        }
        writer.finish().map(drop)
    }
}
