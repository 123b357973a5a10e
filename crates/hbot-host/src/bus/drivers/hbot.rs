//! The driver of hbot's own serial link (docs/link.md).

use hbot_core::MAX_JOINTS;
use hbot_core::inputs::Complaints;
use hbot_link::{
    Command, ControllerFlags, Decoder, Description, Feedback, FromController, JointDescription, JointFlags,
    MAX_COMMAND_FRAME, PROTOCOL_VERSION, ToController, command_frame_bytes, encode, feedback_frame_bytes,
};

use crate::bus::{
    BusCommand, Expected, ExpectedJoint, Filtering, Found, Heard, JointReading, MeetError, MotorBus,
    Obedience, Protocol, Reading, Remedy, Telemetry, TelemetryLog, Traffic, converse, field,
};
use crate::line::Line;

/// Temperature above which a motor or its controller counts as too hot, °C, whatever limit the
/// controller itself has.
const TOO_HOT: f32 = 150.0;
/// Largest plausible motor current, A. If a controller reports more, this counts as overcurrent.
const TOO_STRONG: f32 = 1000.0;
/// Number of ticks between two requests for a description from controllers that have lost power.
const DESCRIBE_EVERY: u32 = 100;

/// The driver of hbot's own serial protocol.
#[derive(Debug, Clone, Copy)]
pub struct HbotLink;

impl Protocol for HbotLink {
    fn meet(&self, line: &mut dyn Line, expected: &Expected) -> Result<(), MeetError> {
        let description = describe(line, expected)?;
        match difference(expected, &description) {
            None => {
                for at in 0..expected.joints() {
                    expected.set_firmware(at, description.firmware.as_str().to_owned());
                }
                Ok(())
            }
            Some(Difference::Version) => {
                Err(MeetError::Version { theirs: description.protocol, ours: PROTOCOL_VERSION })
            }
            Some(Difference::Joints) => Err(expected.wrong_joints(description.joints.len())),
            Some(Difference::Counts(at)) => {
                Err(expected.wrong_counts(at, description.joints[at].counts_per_turn))
            }
        }
    }

    fn switch_off(&self, line: &mut dyn Line, expected: &Expected) -> Result<bool, MeetError> {
        ask(line, expected, &off(expected), |message| match message {
            FromController::Feedback(feedback) => Some(feedback.flags.contains(ControllerFlags::UNDESCRIBED)),
            FromController::Description(_) => None,
        })
    }

    fn off_bytes(&self, expected: &Expected) -> Vec<u8> {
        framed(&off(expected))
    }

    fn bus(&self, line: Box<dyn Line>, expected: Expected) -> Box<dyn MotorBus> {
        Box::new(HbotBus {
            line,
            expected,
            decoder: Decoder::new(),
            received: [0; 4096],
            frame: [0; MAX_COMMAND_FRAME],
            obedience: Obedience::default(),
            telemetry: [JointLog::default(); MAX_JOINTS],
            answered: None,
            cut: false,
            mismatched: false,
            undescribed: false,
            asks: false,
        })
    }

    fn scan(&self, line: &mut dyn Line, expected: &Expected) -> Result<Vec<Found>, MeetError> {
        let there = describe(line, expected)?;
        let found = |(at, joint): (usize, &JointDescription)| Found {
            id: at as u8,
            // The rig file counts joints from 1, and so does `hbot rig test`.
            model: format!(
                "{}, {} counts a turn",
                expected.joint(at).map_or_else(
                    || "no joint of the rig file".to_owned(),
                    |ours| format!("joint {}, {}", ours.number + 1, field(ours.number))
                ),
                joint.counts_per_turn
            ),
            firmware: format!("{}, protocol {}", there.firmware, there.protocol),
            supply_v: None,
            zero: None,
            filtering: Filtering::default(),
            remedies: (wrong_version(&there).into_iter())
                .chain(expected.joint(at).and_then(|ours| wrong_counts(ours, joint)))
                .collect(),
        };
        Ok(there.joints.iter().enumerate().map(found).collect())
    }

    fn traffic(&self, joints: usize) -> Traffic {
        let (commands, feedback) = (command_frame_bytes(joints), feedback_frame_bytes(joints));
        Traffic { commands, feedback, turnaround_us: 0, bus: None }
    }
}

/// Returns what is wrong if controllers speak another version of the protocol.
fn wrong_version(there: &Description) -> Option<Remedy> {
    (there.protocol != PROTOCOL_VERSION).then(|| Remedy {
        what: format!(
            "it speaks version {} of the link protocol, this program {PROTOCOL_VERSION}",
            there.protocol
        ),
        command: "update the older one".to_owned(),
    })
}

/// Returns what is wrong if a joint counts otherwise than the rig file says.
fn wrong_counts(ours: &ExpectedJoint, theirs: &JointDescription) -> Option<Remedy> {
    (ours.counts_per_turn != theirs.counts_per_turn).then(|| Remedy {
        what: format!("the rig file says {} counts a turn", ours.counts_per_turn),
        command: format!(
            "counts_per_turn = {} in {} of the rig file",
            theirs.counts_per_turn,
            field(ours.number)
        ),
    })
}

/// The motor controllers on one line that use hbot's own protocol.
struct HbotBus {
    line: Box<dyn Line>,
    expected: Expected,
    decoder: Decoder<FromController>,
    received: [u8; 4096],
    frame: [u8; MAX_COMMAND_FRAME],
    obedience: Obedience,
    telemetry: [JointLog; MAX_JOINTS],
    /// The newest tick whose command has been answered.
    answered: Option<u32>,
    /// True if the line accepted only a part of the last frame, so that the next frame must be
    /// separated from it.
    cut: bool,
    /// True if the last description received does not match the rig's controllers.
    mismatched: bool,
    /// True if the newest readings come from controllers that have restarted since
    /// [`Protocol::meet`], or from other controllers.
    undescribed: bool,
    /// True if the bus must ask the controllers to describe themselves after the next command.
    asks: bool,
}

impl MotorBus for HbotBus {
    fn receive(&mut self, now_ns: u64, tick: u32) -> Heard {
        let mut heard = Heard::default();
        if let Some(renewed) = self.line.renewed() {
            heard.reopened = true;
            heard.zeros_lost = renewed.rebooted;
            self.decoder.reset();
            // The thread that reopens lines has already identified these controllers.
            (self.cut, self.mismatched) = (false, false);
        }
        self.undescribed = self.mismatched;
        // Reads at most 4 x 4096 bytes. The rest waits for the next tick.
        for _ in 0..4 {
            let n = self.line.read(now_ns, &mut self.received).unwrap_or(0);
            let Self { decoder, expected, answered, mismatched, undescribed, received, .. } = self;
            let Self { obedience, telemetry, .. } = self;
            decoder.feed(&received[..n], |frame| match frame {
                Ok(FromController::Feedback(feedback)) if feedback.joints.len() == expected.joints() => {
                    *undescribed |= feedback.flags.contains(ControllerFlags::UNDESCRIBED);
                    heard.complaints = heard.complaints.or(complaints(&feedback, obedience));
                    // Answers can arrive twice, late, or out of order. An answer to a command that
                    // has not been sent comes from other controllers. The command of `tick` is sent
                    // after this call.
                    let ahead = |than: u32| feedback.sequence.wrapping_sub(than) as i32;
                    if ahead(tick) >= 0 {
                        heard.foreign += 1;
                    } else if answered.is_none_or(|last| ahead(last) > 0) {
                        *answered = Some(feedback.sequence);
                        heard.reading = Some(reading(&feedback));
                        let shared = shared_complaints(&feedback, obedience);
                        for (log, joint) in telemetry.iter_mut().zip(&feedback.joints) {
                            log.record(now_ns, joint, shared);
                        }
                    }
                }
                Ok(FromController::Feedback(_)) => heard.foreign += 1,
                Ok(FromController::Description(description)) => {
                    *mismatched = difference(expected, &description).is_some();
                    *undescribed |= *mismatched;
                }
                Err(_) => heard.damaged = heard.damaged.saturating_add(1),
            });
            if n < self.received.len() {
                break;
            }
        }
        heard.zeros_lost |= self.undescribed;
        if self.undescribed {
            self.telemetry.iter_mut().for_each(|joint| joint.log.restarted(now_ns));
        }
        self.asks = self.undescribed && tick.is_multiple_of(DESCRIBE_EVERY);
        heard
    }

    fn command(&mut self, now_ns: u64, command: &BusCommand) -> bool {
        self.obedience.note(command.tick, command.enable);
        let mut message = Command {
            sequence: command.tick,
            enable: command.enable,
            watchdog_ms: command.watchdog_ms,
            ..Command::default()
        };
        for torque in &command.torque[..self.expected.joints()] {
            // This cannot fail: a line has at most MAX_JOINTS joints, and the list has room for
            // them.
            let _ = message.torque.push(*torque as f32);
        }
        let whole = self.write(now_ns, &ToController::Command(message));
        // Asks at most once after each `receive`, so that no question follows the last word.
        let asks = std::mem::take(&mut self.asks);
        whole & (!asks || self.write(now_ns, &ToController::Describe))
    }

    fn telemetry(&self, now_ns: u64, at: usize) -> Telemetry {
        let log = self.telemetry.get(at);
        log.map_or_else(Telemetry::default, |joint| joint.log.at(now_ns))
    }

    fn release(&mut self) {
        self.line.release();
    }
}

/// The telemetry of one joint. The link sends 0 for a current or a temperature that is not measured
/// (docs/link.md), so 0 counts as a value only after the joint has reported another one.
#[derive(Debug, Clone, Copy, Default)]
struct JointLog {
    log: TelemetryLog,
    measures_current: bool,
    measures_temperature: bool,
}

impl JointLog {
    /// Records what the newest feedback says of the joint. `shared` are the complaints that concern
    /// all joints.
    fn record(&mut self, now_ns: u64, joint: &hbot_link::JointReading, shared: Complaints) {
        self.log.hear(now_ns, shared.or(joint_complaints(joint)));
        self.measures_current |= joint.current != 0.0;
        self.measures_temperature |= joint.temperature != 0.0;
        if self.measures_current {
            self.log.current(now_ns, joint.current);
        }
        if self.measures_temperature {
            self.log.temperature(now_ns, joint.temperature);
        }
    }
}

impl HbotBus {
    /// Writes a message. Returns whether the line accepted all of its bytes.
    fn write(&mut self, now_ns: u64, message: &ToController) -> bool {
        if self.cut {
            // A zero byte ends the incomplete frame, which would otherwise corrupt this one as
            // well.
            self.cut = !self.line.write(now_ns, &[0]).is_ok_and(|written| written == 1);
        }
        let whole = encode(message, &mut self.frame)
            .is_ok_and(|n| self.line.write(now_ns, &self.frame[..n]).is_ok_and(|written| written == n));
        self.cut |= !whole;
        whole
    }
}

fn reading(feedback: &Feedback) -> Reading {
    let mut joints = [JointReading::default(); MAX_JOINTS];
    for (joint, said) in joints.iter_mut().zip(&feedback.joints) {
        *joint = JointReading {
            count: said.count,
            rate: f64::from(said.rate),
            index_seen: said.flags.contains(JointFlags::INDEX_SEEN),
        };
    }
    Reading { answers: feedback.sequence, joints }
}

/// Returns the complaints in one message from the motor controllers.
fn complaints(feedback: &Feedback, obedience: &Obedience) -> Complaints {
    let shared = shared_complaints(feedback, obedience);
    feedback.joints.iter().fold(shared, |all, joint| all.or(joint_complaints(joint)))
}

/// Returns the complaints in one message that concern all joints. Motors that are on or off against
/// the command are a complaint, too.
fn shared_complaints(feedback: &Feedback, obedience: &Obedience) -> Complaints {
    let on = feedback.flags.contains(ControllerFlags::ENABLED);
    let reasons = ControllerFlags::WATCHDOG_EXPIRED | ControllerFlags::FAULT | ControllerFlags::UNDESCRIBED;
    Complaints {
        fault: feedback.flags.contains(ControllerFlags::FAULT),
        watchdog: feedback.flags.contains(ControllerFlags::WATCHDOG_EXPIRED),
        disobeyed: obedience.is_broken(feedback.sequence, on, feedback.flags.intersects(reasons)),
        ..Complaints::default()
    }
}

/// Returns the complaints in one message that concern only this joint.
fn joint_complaints(joint: &hbot_link::JointReading) -> Complaints {
    Complaints {
        overcurrent: joint.flags.contains(JointFlags::OVERCURRENT) || joint.current.abs() > TOO_STRONG,
        overtemperature: joint.flags.contains(JointFlags::OVERTEMPERATURE) || joint.temperature > TOO_HOT,
        not_finite: ![joint.rate, joint.current, joint.temperature].into_iter().all(f32::is_finite),
        ..Complaints::default()
    }
}

/// The property in which the controllers on a line differ from those in the rig file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Difference {
    /// The version of the protocol.
    Version,
    /// The number of joints.
    Joints,
    /// The encoder counts per turn of one joint. The value is the joint's place on the bus.
    Counts(usize),
}

/// Compares a description with the controllers of the rig. Returns the first difference, or `None`
/// if there is none. Does not allocate memory.
fn difference(expected: &Expected, there: &Description) -> Option<Difference> {
    if there.protocol != PROTOCOL_VERSION {
        return Some(Difference::Version);
    }
    if there.joints.len() != expected.joints() {
        return Some(Difference::Joints);
    }
    expected
        .first_wrong_counts(there.joints.iter().map(|joint| joint.counts_per_turn))
        .map(Difference::Counts)
}

/// Returns the message that commands all motors of the line off.
fn off(expected: &Expected) -> ToController {
    let mut off = Command { watchdog_ms: 1, ..Command::default() };
    // This cannot fail: a line has at most as many joints as the list has room for.
    let _ = off.torque.resize(expected.joints(), 0.0);
    ToController::Command(off)
}

/// Returns the frame of `message` after a zero byte. The zero byte ends an incomplete frame that
/// could be on the line.
fn framed(message: &ToController) -> Vec<u8> {
    let mut frame = vec![0; 1 + MAX_COMMAND_FRAME];
    let n = encode(message, &mut frame[1..]).unwrap_or(0);
    frame.truncate(1 + n);
    frame
}

/// Asks the controllers for their description, and returns it.
fn describe(line: &mut dyn Line, expected: &Expected) -> Result<Description, MeetError> {
    ask(line, expected, &ToController::Describe, |message| match message {
        FromController::Description(description) => Some(description),
        FromController::Feedback(_) => None,
    })
}

/// Sends `message` repeatedly until `answer` returns a value for one of the received messages.
/// Returns this value.
fn ask<T>(
    line: &mut dyn Line,
    expected: &Expected,
    message: &ToController,
    mut answer: impl FnMut(FromController) -> Option<T>,
) -> Result<T, MeetError> {
    let mut decoder = Decoder::<FromController>::new();
    converse(line, expected, &framed(message), |bytes| {
        let mut found = None;
        decoder.feed(bytes, |frame| {
            if let Some(it) = frame.ok().and_then(&mut answer) {
                found = Some(it);
            }
        });
        found
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_flags_of_a_joint_tell_every_value_that_is_not_finite() {
        let told = |joint| {
            let mut log = JointLog::default();
            log.record(0, &joint, Complaints::default());
            log.log.at(0).complaints.not_finite
        };
        let joint = hbot_link::JointReading::default();
        assert!(!told(joint));
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert!(told(hbot_link::JointReading { rate: value, ..joint }), "rate {value}");
            assert!(told(hbot_link::JointReading { current: value, ..joint }), "current {value}");
            assert!(told(hbot_link::JointReading { temperature: value, ..joint }), "temperature {value}");
        }
    }

    #[test]
    fn a_current_or_a_temperature_of_0_counts_only_after_another_value() {
        let mut log = JointLog::default();
        let mut told = |current, temperature| {
            let joint = hbot_link::JointReading { current, temperature, ..Default::default() };
            log.record(0, &joint, Complaints::default());
            let Telemetry { current, temperature, .. } = log.log.at(0);
            (current, temperature)
        };
        assert_eq!(told(0.0, 0.0), (None, None));
        assert_eq!(told(0.0, 21.5), (None, Some(21.5)));
        assert_eq!(told(-0.5, 0.0), (Some(-0.5), Some(0.0)));
        assert_eq!(told(0.0, 0.0), (Some(0.0), Some(0.0)));
    }
}
