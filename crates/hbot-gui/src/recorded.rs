//! Reads a recording or a flight log (MCAP), to look at it.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context as _, bail};
use hbot_api::{Event, InfoOk, LimitsInfo, Mode, RigInfo, StateEvent};
use hbot_config::advice::{told_limits, told_rig};
use hbot_config::{Override, RigConfig};
use hbot_record::Reader;
use hbot_record::reader::Item;
use hbot_record::told::{self, Told};
use serde::Deserialize;
use serde_json::Value;

use crate::model::{Mark, What};

/// Largest number of states that are kept, about 100 MB. Of a longer recording, every second state
/// is kept, or every fourth, and so on.
const MOST_STATES: usize = 150_000;

/// What a recording says, as far as the window shows it.
#[derive(Debug, Default)]
pub(crate) struct Recorded {
    pub(crate) path: PathBuf,
    /// The states in the order of time, at least one.
    pub(crate) states: Vec<Arc<StateEvent>>,
    /// One in this many states of the recording is kept.
    pub(crate) every: usize,
    /// Each scene as JSON, with its first tick, in the order of time.
    pub(crate) scenes: Vec<(u64, Value)>,
    /// Faults, stops and scenes, in the order of time.
    pub(crate) marks: Vec<Mark>,
    /// The rig and its limits. The rest is empty.
    pub(crate) info: InfoOk,
    /// Whether the recording has no end, or parts that cannot be read.
    pub(crate) damaged: bool,
}

impl Recorded {
    /// Reads a recording, also one that is cut off or damaged.
    ///
    /// # Errors
    /// Fails if the file cannot be read, or if it has no state.
    pub(crate) fn read(path: &Path) -> anyhow::Result<Self> {
        let path = &hbot_record::recording_of(path);
        let name = || path.display().to_string();
        let file = File::open(path).with_context(name)?;
        let mut reader = Reader::new(BufReader::new(file)).with_context(name)?;
        let mut all = Self { path: path.to_owned(), every: 1, ..Self::default() };
        let mut seen = 0;
        loop {
            match reader.next().with_context(name)? {
                None => break,
                Some(Item::About(about)) => all.about(&about),
                Some(Item::Message { topic, data, .. }) => match told::told(&topic, &data) {
                    Some(Told::State(state)) => {
                        all.state(told::event(&state), seen);
                        seen += 1;
                    }
                    Some(Told::Event(event)) => all.event(&event),
                    Some(Told::Scene(scene)) => {
                        let file = serde_json::from_str(&scene.json).unwrap_or(Value::Null);
                        all.mark(What::Scene, scene.tick, format!("scene {}", scene.name));
                        all.scenes.push((scene.tick, file));
                    }
                    None => {}
                },
                // What can be read counts.
                Some(Item::Damaged(_) | Item::Cut) => all.damaged = true,
            }
        }
        if all.states.is_empty() {
            bail!("{}: the recording has no state", path.display());
        }
        Ok(all)
    }

    /// Takes the state with the index `index` of the recording.
    fn state(&mut self, state: StateEvent, index: usize) {
        let last = self.states.last();
        let stopped = |mode| matches!(mode, Mode::Fault | Mode::Estop);
        if stopped(state.mode) && last.is_some_and(|last| !stopped(last.mode)) {
            let name = state.fault.map_or_else(|| state.mode.to_string(), |fault| fault.to_string());
            self.marks.push(Mark { what: What::Fault, t: state.t, text: name });
        }
        // A recording goes on in time, so a state that does not is damaged.
        if !index.is_multiple_of(self.every) || last.is_some_and(|last| state.tick <= last.tick) {
            return;
        }
        if self.states.len() == MOST_STATES {
            let mut k = 0;
            self.states.retain(|_| {
                k += 1;
                k % 2 == 1
            });
            self.every *= 2;
            if !index.is_multiple_of(self.every) {
                return;
            }
        }
        self.states.push(Arc::new(state));
    }

    fn event(&mut self, event: &Event) {
        if let Event::Shaking(shaking) = event
            && shaking.shaking
        {
            let who = shaking.effect.as_deref().unwrap_or("scene");
            self.mark(What::Fault, shaking.tick, format!("{who} shakes"));
        }
    }

    /// Adds a mark at a tick. Before the first state, the time is that of tick 0.
    fn mark(&mut self, what: What, tick: u64, text: String) {
        let rate = f64::from(self.info.rig.rate_hz);
        let known = self.states.last().map(|last| last.t);
        let t = if rate > 0.0 { tick as f64 / rate } else { known.unwrap_or_default() };
        self.marks.push(Mark { what, t, text });
    }

    /// Takes the metadata: the rig file that a server has written, or the rig that a client has.
    fn about(&mut self, about: &BTreeMap<String, String>) {
        #[derive(Deserialize)]
        struct Rig {
            rig: RigInfo,
            limits: LimitsInfo,
        }
        let rate = about.get("rate_hz").and_then(|rate| rate.parse::<u32>().ok());
        if let Some(rig) = about.get("rig").and_then(|rig| serde_json::from_str::<Rig>(rig).ok()) {
            self.info.rig = rig.rig;
            self.info.limits = rig.limits;
        } else if let Some(text) = about.get("rig_file") {
            let change =
                rate.map(|rate| Override { path: "loop.rate_hz", value: rate.into(), from: "the recording" });
            let changes: Vec<_> = change.into_iter().collect();
            if let Ok(config) = RigConfig::from_toml_with(text, "the recorded rig file", &changes) {
                self.info.rig = told_rig(&config, false);
                self.info.limits = told_limits(&config);
            }
        }
        if let Some(rate) = rate {
            self.info.rig.rate_hz = rate;
        }
        if let Some(name) = about.get("rig_name") {
            self.info.rig.name.clone_from(name);
        }
        let scene = about.get("scene").and_then(|scene| serde_json::from_str(scene).ok());
        self.scenes.extend(scene.map(|scene| (0, scene)));
    }
}
