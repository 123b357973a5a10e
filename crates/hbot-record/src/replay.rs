//! Runs the recorded inputs through the control law again and compares the outputs.

use std::collections::BTreeMap;
use std::io::{Read, Seek};

use hbot_core::render::effects::Effect;
use hbot_core::{CompiledScene, Controller, Inputs, Outputs};

use crate::difference;
use crate::exact::{self, Exact, FORMAT, OLDEST, same_bits};
use crate::reader::{Item, ReadError, Reader};
use crate::topic::Topic;

/// The reason why a recording cannot be replayed at all.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The file has no metadata of hbot.
    #[error("not a recording of hbot: it has no readable metadata record \"hbot\"")]
    Foreign,
    /// The recording is of another version, whose control law may compute other bits.
    #[error(
        "recorded by hbot {version} in format {format}; this is hbot {}, which replays the formats {OLDEST} to {FORMAT}: replay it with that version",
        env!("CARGO_PKG_VERSION")
    )]
    Version {
        /// The version of hbot that made the recording.
        version: String,
        /// The format of its private topic.
        format: String,
    },
    /// The recording was made over TCP.
    #[error(
        "made by `hbot record`: it has no exact inputs, because they do not pass through TCP. To replay a run, record it on the rig's computer: \
         `hbot server --record FILE.mcap`"
    )]
    OverTcp,
    /// The recording was made by a replay.
    #[error(
        "made by `hbot replay --scene`: it has no exact inputs. Replay the recording from which it was made"
    )]
    OfReplay,
    /// The file has nothing to replay.
    #[error(
        "no exact inputs in the wanted part: {}",
        .last.map_or_else(
            || "the recording has no tick there, begins later, or is cut off before its first second".to_owned(),
            |(tick, s)| format!("the recording ends at {s:.3} s of the run (tick {tick})")
        )
    )]
    Empty {
        /// Number of the last tick before the wanted part, and its time of the run, s.
        last: Option<(u64, f64)>,
    },
}

/// The first tick whose outputs differ from the recorded ones.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Difference {
    /// Number of the tick.
    pub tick: u64,
    /// The first field that differs.
    pub field: String,
    /// Its recorded value and the one that was computed.
    pub values: [String; 2],
}

/// Something that keeps a part of a recording from being replayed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Flaw {
    /// The recorder lost ticks: their number.
    Gap(u64),
    /// Ticks are missing without a note: their number. The next one differs from what is computed.
    Missing(u64),
    /// A part of the file is damaged: the reason.
    Damaged(String),
    /// The file ends before the end of the recording.
    Cut,
    /// Ticks whose starting state is unknown because of a flaw before them: their number.
    Unknown(u64),
}

/// The outcome of a replay.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Report {
    /// Number of ticks that were compared and agree in every bit, or were computed with another
    /// scene.
    pub ticks: u64,
    /// First and last of these ticks.
    pub range: Option<(u64, u64)>,
    /// The first difference, if any. The replay ends there.
    pub difference: Option<Difference>,
    /// What could not be replayed of the wanted part, in the order of the file.
    pub flaws: Vec<Flaw>,
}

impl Report {
    /// Returns whether every tick of the recording agrees in every bit.
    #[must_use]
    pub fn is_exact(&self) -> bool {
        self.ticks > 0 && self.difference.is_none() && self.flaws.is_empty()
    }
}

/// Returns `scene` under numbers that no recorded scene has. So its effects do not take over the
/// memory of recorded effects, and the change to it blends.
#[must_use]
pub fn renumbered(scene: &CompiledScene) -> CompiledScene {
    let effects = scene.effects().iter().map(|effect| Effect { epoch: effect.epoch | 1 << 31, ..*effect });
    let effects: Vec<Effect> = effects.collect();
    CompiledScene::with_numbers(scene.revision() | 1 << 63, &effects, exact::numbers(scene))
        .unwrap_or_else(|error| unreachable!("the effects of a scene make a scene: {error}"))
}

/// One tick of a replay.
pub struct Replayed<'a> {
    /// The recorded inputs.
    pub inputs: &'a Inputs,
    /// The recorded outputs.
    pub recorded: &'a Outputs,
    /// The outputs that were computed from the inputs.
    pub computed: &'a Outputs,
    /// Unix time of the tick's deadline, ns.
    pub log_time: u64,
}

/// Replays a recording.
pub struct Replay<R> {
    reader: Reader<R>,
    about: BTreeMap<String, String>,
    /// The format of the recording.
    format: u32,
    /// State of the control law. `None` while it is unknown.
    controller: Option<Box<Controller>>,
    scene: Option<Box<CompiledScene>>,
    /// The scene that replaces all recorded ones, if any.
    other: Option<Box<CompiledScene>>,
    unknown: u64,
    /// Number of the last tick that was read.
    last: Option<u64>,
    /// Number of ticks that are missing before the present one.
    missing: u64,
    report: Report,
}

impl<R: Read + Seek> Replay<R> {
    /// Begins to replay a recording. With `other`, this scene is rendered instead of the recorded
    /// ones, and outputs are not compared.
    ///
    /// # Errors
    /// Fails if the file cannot be read, is no recording of hbot, or is one of another format.
    pub fn new(from: R, other: Option<Box<CompiledScene>>) -> Result<Self, ReplayError> {
        let mut reader = Reader::new(from)?;
        let mut report = Report::default();
        let about = loop {
            match reader.next()? {
                Some(Item::About(about)) => break about,
                Some(Item::Damaged(why)) => report.flaws.push(Flaw::Damaged(why)),
                _ => return Err(ReplayError::Foreign),
            }
        };
        let entry = |key: &str| about.get(key).cloned().unwrap_or_else(|| "unknown".to_owned());
        let Some(format) = entry("format").parse().ok().filter(|format| (OLDEST..=FORMAT).contains(format))
        else {
            return Err(ReplayError::Version { version: entry("version"), format: entry("format") });
        };
        // Only `hbot record` writes the one entry, and only `hbot replay --scene` the other.
        if about.contains_key("server") {
            return Err(ReplayError::OverTcp);
        }
        if about.contains_key("other_scene") {
            return Err(ReplayError::OfReplay);
        }
        Ok(Self {
            reader,
            about,
            format,
            controller: None,
            scene: None,
            other,
            unknown: 0,
            last: None,
            missing: 0,
            report,
        })
    }

    /// Returns the metadata of the recording.
    #[must_use]
    pub fn about(&self) -> &BTreeMap<String, String> {
        &self.about
    }

    /// Replays the recording up to the tick `to`, and calls `each` for every tick from `from` on.
    /// Ends at the first difference. Returns what was found.
    ///
    /// # Errors
    /// Fails if the file has nothing to replay. An error of `each` ends the replay.
    pub fn run<E: From<ReplayError>>(
        mut self,
        from: u64,
        to: u64,
        mut each: impl FnMut(&Replayed<'_>) -> Result<(), E>,
    ) -> Result<Report, E> {
        loop {
            let (data, log_time) = match self.reader.next() {
                Ok(Some(Item::Message { topic, log_time, data })) if topic == Topic::Exact.name() => {
                    (data, log_time)
                }
                Ok(Some(Item::Message { .. } | Item::About(_))) => continue,
                Ok(Some(Item::Damaged(why))) => {
                    self.lose(Flaw::Damaged(why));
                    continue;
                }
                Ok(Some(Item::Cut)) => {
                    self.report.flaws.push(Flaw::Cut);
                    continue;
                }
                Ok(None) => break,
                Err(error) => {
                    self.lose(Flaw::Damaged(error.to_string()));
                    break;
                }
            };
            match Exact::read_from(self.format, &data) {
                Ok(Exact::Tick(tick)) if tick.0.tick > to => {
                    self.last = None;
                    break;
                }
                Ok(Exact::Tick(tick)) => {
                    let last = self.last.replace(tick.0.tick);
                    self.missing = last.map_or(0, |last| tick.0.tick.saturating_sub(last + 1));
                    let wanted = tick.0.tick >= from;
                    if !self.tick(&tick, wanted, |replayed| each(&Replayed { log_time, ..replayed }))? {
                        break;
                    }
                }
                Ok(Exact::Scene(scene)) => self.scene = Some(scene),
                Ok(Exact::Controller(controller)) => self.restart(controller),
                Ok(Exact::Lost(ticks)) => self.lose(Flaw::Gap(ticks)),
                Err(why) => self.lose(Flaw::Damaged(why.to_string())),
            }
        }
        self.settle();
        if self.report.range.is_none() && self.report.difference.is_none() && self.report.flaws.is_empty() {
            let period_ns = self.about.get("period_ns").and_then(|text| text.parse::<f64>().ok());
            let last = self.last.zip(period_ns);
            let last = last.map(|(tick, period_ns)| (tick, tick as f64 * period_ns * 1.0e-9));
            return Err(ReplayError::Empty { last }.into());
        }
        Ok(self.report)
    }

    /// Replays one tick, if the state before it is known. Returns false if its outputs differ.
    fn tick<E>(
        &mut self,
        (inputs, recorded): &(Inputs, Outputs),
        wanted: bool,
        each: impl FnOnce(Replayed<'_>) -> Result<(), E>,
    ) -> Result<bool, E> {
        let scene = self.other.as_ref().or(self.scene.as_ref());
        let (Some(controller), Some(scene)) = (&mut self.controller, scene) else {
            self.unknown += 1;
            return Ok(true);
        };
        let computed = controller.tick(scene, inputs);
        if self.other.is_none() && !same_bits(recorded, &computed) {
            // Ticks that the loop has skipped are missing too, but then the bits agree.
            if self.missing > 0 {
                self.lose(Flaw::Missing(self.missing));
                self.unknown = 1;
                return Ok(true);
            }
            let (field, values) = difference::first(recorded, &computed)
                .unwrap_or_else(|| ("the outputs".to_owned(), Default::default()));
            self.report.difference = Some(Difference { tick: inputs.tick, field, values });
            return Ok(false);
        }
        if wanted {
            let first = self.report.range.map_or(inputs.tick, |(first, _)| first);
            self.report.range = Some((first, inputs.tick));
            self.report.ticks += 1;
            each(Replayed { inputs, recorded, computed: &computed, log_time: 0 })?;
        } else {
            // What is missing before the wanted part does not matter to it.
            self.report.flaws.clear();
        }
        Ok(true)
    }

    /// Takes a recorded state of the control law, if the present one is unknown. With another
    /// scene, the computed state goes on.
    fn restart(&mut self, controller: Box<Controller>) {
        if self.controller.is_none() {
            self.settle();
            self.controller = Some(controller);
            // What is missing before this state does not matter after it.
            self.last = None;
        }
    }

    /// Notes a flaw after which the state of the control law and the scene are unknown.
    fn lose(&mut self, flaw: Flaw) {
        self.settle();
        self.report.flaws.push(flaw);
        self.controller = None;
        self.scene = None;
    }

    /// Notes the ticks that could not be replayed until here.
    fn settle(&mut self) {
        let unknown = std::mem::take(&mut self.unknown);
        if unknown > 0 {
            self.report.flaws.push(Flaw::Unknown(unknown));
        }
    }
}
