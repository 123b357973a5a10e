//! Reads the encoder counts of a recording (`hbot server --record`), as long as no motor pushes.

use std::collections::BTreeMap;
use std::io::{Read, Seek};

use hbot_config::{Diagnostics, Override, RigConfig};
use hbot_core::design::rig::Zero;
use hbot_core::{Inputs, MAX_JOINTS, Outputs, Rig};
use hbot_record::exact::{FORMAT, OLDEST};
use hbot_record::reader::{Item, ReadError};
use hbot_record::{Exact, Reader, Topic};

use crate::motion::Counts;

/// A longer gap between readings than this many ticks ends a part of the motion.
const LONGEST_GAP: u64 = 4;

/// The counts of a recording during which no motor pushed.
#[derive(Debug, Clone, Default)]
pub struct Recorded {
    /// The counts of all joints, tick by tick, in parts without a gap. They are those that the loop
    /// would see with the rig file that was given to [`Recorded::read`].
    pub parts: Vec<Vec<Counts>>,
    /// Time between two readings, s.
    pub period_s: f64,
    /// Time during which a motor pushed, s. It is left out.
    pub pushed_s: f64,
    /// Whether the port of the recorded server was a simulated rig.
    pub simulated: bool,
}

/// The reason why a recording cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum RecordedError {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The file has no metadata of hbot.
    #[error("not a recording of hbot: it has no readable metadata record \"hbot\"")]
    Foreign,
    /// The recording was made over TCP, or by a replay.
    #[error("it has no encoder counts: record on the rig's computer, with `hbot server --record FILE.mcap`")]
    NoCounts,
    /// The recording has another format.
    #[error("it has the format {0}; this version of hbot reads the formats {OLDEST} to {FORMAT}")]
    Version(String),
    /// The rig file in the recording is not legal, so joints and zeros are not known.
    #[error("record again with a rig file that `hbot rig check` accepts: the one in it is not legal")]
    RigFile(#[from] Diagnostics),
    /// The recording is of a rig with other joints.
    #[error("it is of another rig: {what} is {recorded} in its rig file, and {ours} in the given one")]
    OtherRig {
        /// What differs.
        what: String,
        /// Its value in the recording.
        recorded: String,
        /// Its value in the rig file.
        ours: String,
    },
}

impl Recorded {
    /// Reads the recording `from` of the rig that `rig` describes. Calls `progress` with the number
    /// of ticks that have been read.
    ///
    /// # Errors
    /// Fails if the file is no recording with encoder counts, or is of a rig with other joints.
    pub fn read(
        from: impl Read + Seek,
        rig: &RigConfig,
        progress: &mut dyn FnMut(u64),
    ) -> Result<Self, RecordedError> {
        let mut reader = Reader::new(from)?;
        let about = loop {
            match reader.next()? {
                Some(Item::About(about)) => break about,
                Some(Item::Damaged(_)) => {}
                _ => return Err(RecordedError::Foreign),
            }
        };
        if about.contains_key("server") || about.contains_key("other_scene") {
            return Err(RecordedError::NoCounts);
        }
        let format = about.get("format").cloned().unwrap_or_default();
        let Some(format) = format.parse().ok().filter(|format| (OLDEST..=FORMAT).contains(format)) else {
            return Err(RecordedError::Version(format));
        };
        let period_ns: u64 = about.get("period_ns").and_then(|text| text.parse().ok()).unwrap_or(0);
        let recorded = match about.get("rig_file") {
            Some(text) => RigConfig::from_toml_with(text, "its rig file", rate(&about).as_slice())?,
            None => RigConfig::prototype(),
        };
        same_joints(&recorded.rig, &rig.rig)?;
        let mut taken = Taken::new(rig, &recorded, period_ns.max(1) as f64 * 1.0e-9);
        taken.recorded.simulated = about.get("port").is_some_and(|port| port.starts_with("sim"));
        let mut ticks = 0;
        while let Some(item) = reader.next()? {
            let Item::Message { topic, data, .. } = item else {
                taken.interrupt();
                continue;
            };
            if topic != Topic::Exact.name() {
                continue;
            }
            match Exact::read_from(format, &data) {
                Ok(Exact::Tick(tick)) => {
                    let (inputs, outputs) = *tick;
                    if outputs.state.joints != taken.joints {
                        let [recorded, ours] = [outputs.state.joints, taken.joints].map(|n| n.to_string());
                        let what = "the number of joints".to_owned();
                        return Err(RecordedError::OtherRig { what, recorded, ours });
                    }
                    taken.take(&inputs, &outputs);
                    ticks += 1;
                    progress(ticks);
                }
                Ok(Exact::Scene(_) | Exact::Controller(_)) => {}
                Ok(Exact::Lost(_)) | Err(_) => taken.interrupt(),
            }
        }
        Ok(taken.end())
    }

    /// Returns the time of all readings, s.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.parts.iter().map(|part| part.len().saturating_sub(1) as f64 * self.period_s).sum()
    }
}

/// Returns the rate in the metadata `about` of a recording, which the command line may have changed
/// from that of the rig file.
#[must_use]
pub fn rate(about: &BTreeMap<String, String>) -> Option<Override> {
    let rate = about.get("rate_hz")?.parse::<u32>().ok()?;
    Some(Override { path: "loop.rate_hz", value: rate.into(), from: "the recording" })
}

/// Checks that the encoders of two rigs count alike.
fn same_joints(recorded: &Rig, ours: &Rig) -> Result<(), RecordedError> {
    let other =
        |what: String, recorded: String, ours: String| Err(RecordedError::OtherRig { what, recorded, ours });
    let joints = [recorded, ours].map(|rig| rig.device.joints());
    if joints[0] != joints[1] {
        let [recorded, ours] = joints.map(|joints| (joints / 2).to_string());
        return other("the number of wheels".to_owned(), recorded, ours);
    }
    for j in 0..joints[0] {
        let [a, b] = [recorded, ours].map(|rig| rig.joints[j]);
        let table = format!("wheel[{}].{}", j / 2, if j % 2 == 0 { "steer" } else { "drive" });
        let sign = |reversed: bool| if reversed { "-1" } else { "1" }.to_owned();
        if a.counts_per_turn != b.counts_per_turn {
            let counts = [a, b].map(|joint| joint.counts_per_turn.to_string());
            let [recorded, ours] = counts;
            return other(format!("{table}.counts_per_turn"), recorded, ours);
        }
        if a.reversed != b.reversed {
            return other(format!("{table}.sign"), sign(a.reversed), sign(b.reversed));
        }
        if a.gear != b.gear {
            return other(format!("{table}.gear"), a.gear.to_string(), b.gear.to_string());
        }
    }
    Ok(())
}

/// The counts taken so far.
struct Taken {
    recorded: Recorded,
    part: Vec<Counts>,
    joints: usize,
    /// What is added to the recorded counts: zero offsets that the given rig file has and the
    /// recorded one has not.
    more: Counts,
    /// Joints that must have seen their index mark.
    indexed: u16,
    last: Option<u64>,
}

impl Taken {
    fn new(rig: &RigConfig, recorded: &RigConfig, period_s: f64) -> Self {
        let joints = rig.rig.device.joints();
        let whole =
            |of: &RigConfig, j: usize| of.rig.joints[j].whole_counts(of.zero_offsets[j]) as i64 as i32;
        let mut more = [0; MAX_JOINTS];
        let mut indexed = 0;
        for j in (0..joints).step_by(2) {
            more[j] = whole(rig, j).wrapping_sub(whole(recorded, j));
            indexed |= u16::from(rig.rig.joints[j].zero == Zero::Index) << j;
        }
        let recorded = Recorded { period_s, ..Recorded::default() };
        Self { recorded, part: Vec::new(), joints, more, indexed, last: None }
    }

    fn take(&mut self, inputs: &Inputs, outputs: &Outputs) {
        let pushes = outputs.drive.enable && outputs.drive.torque[..self.joints].iter().any(|t| *t != 0.0);
        if pushes {
            self.recorded.pushed_s += self.recorded.period_s;
            return self.interrupt();
        }
        let Some(reading) = &inputs.feedback else { return };
        if reading.index_seen & self.indexed != self.indexed {
            return self.interrupt();
        }
        if self.last.is_some_and(|last| inputs.tick.saturating_sub(last) > LONGEST_GAP) {
            self.interrupt();
        }
        self.last = Some(inputs.tick);
        self.part.push(std::array::from_fn(|j| reading.counts[j].wrapping_add(self.more[j])));
    }

    /// Ends the present part.
    fn interrupt(&mut self) {
        self.last = None;
        if self.part.len() > 1 {
            self.recorded.parts.push(std::mem::take(&mut self.part));
        }
        self.part.clear();
    }

    fn end(mut self) -> Recorded {
        self.interrupt();
        self.recorded
    }
}
