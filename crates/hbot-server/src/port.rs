//! One serial line with the joints on it: frames in, frames out.

use hbot_core::inputs::{Complaints, JointFeedback};
use hbot_core::outputs::Drive;
use hbot_core::{MAX_JOINTS, Rig};
use hbot_link::{
    Command, ControllerFlags, Decoder, Feedback, FromController, JointFlags, MAX_COMMAND_FRAME, ToController,
    encode,
};

use crate::engine::Line;
use crate::handshake::Expected;
use crate::sample::Counters;
use crate::wire::Wire;

/// Before anything is heard.
pub(crate) const NO_READINGS: JointFeedback = JointFeedback {
    sequence: 0,
    counts: [0; MAX_JOINTS],
    rates: [0.0; MAX_JOINTS],
    index_seen: 0,
    complaints: NO_COMPLAINTS,
};

const NO_COMPLAINTS: Complaints = Complaints {
    fault: false,
    watchdog: false,
    overcurrent: false,
    overtemperature: false,
    disobeyed: false,
    not_finite: false,
};

/// A motor or driver at this temperature is too hot whatever its own limit, °C.
const TOO_HOT: f32 = 150.0;
/// A current beyond this is no motor's of such a rig, A.
const TOO_STRONG: f32 = 1000.0;
/// Commands of which a line remembers whether they switched the motors on.
const COMMANDS: usize = 64;

/// One line.
pub(crate) struct Port<W> {
    pub(crate) wire: W,
    /// Which joints of the rig it carries, each with its place on it.
    joints: Vec<(usize, usize)>,
    /// What is added to the count of each joint of the rig, so that zero is where the rig has it.
    offsets: [i32; MAX_JOINTS],
    decoder: Decoder<FromController>,
    frame: [u8; MAX_COMMAND_FRAME],
    /// The last commands: their sequence, and whether they switched the motors on.
    enables: [(u32, bool); COMMANDS],
    /// The line took only a part of the last frame.
    cut: bool,
    /// It was gone; said with the next reading, so that no torque comes back unasked.
    lost: bool,
    /// The newest reading since the last tick.
    pub(crate) fresh: Option<Feedback>,
    /// What any reading since the last tick complains of.
    pub(crate) complaints: Complaints,
    /// The command that the newest reading answers.
    pub(crate) sequence: Option<u32>,
    /// Damaged frames since the last tick.
    pub(crate) corrupt: u16,
    /// Who must be there.
    expected: Expected,
    /// Those who have said last who they are, are not those of the rig.
    stranger: bool,
    /// The newest readings come from controllers that nobody has asked who they are, or that are others.
    pub(crate) undescribed: bool,
    /// The controllers of a line that is back have lost power meanwhile.
    pub(crate) rebooted: bool,
}

impl<W: Wire> Port<W> {
    /// Line number `port` of `line`, which carries joints of `rig`.
    pub(crate) fn new(wire: W, rig: &Rig, line: &Line, port: usize) -> Self {
        Self {
            wire,
            joints: line.joints(port).collect(),
            offsets: line.offsets,
            decoder: Decoder::new(),
            frame: [0; MAX_COMMAND_FRAME],
            enables: [(u32::MAX, false); COMMANDS],
            cut: false,
            lost: false,
            fresh: None,
            complaints: Complaints::default(),
            sequence: None,
            corrupt: 0,
            // The name is for messages of a handshake.
            expected: Expected::new("", rig, line, port),
            stranger: false,
            undescribed: false,
            rebooted: false,
        }
    }

    /// Reads and decodes what has arrived before the command of `tick` goes out.
    pub(crate) fn receive(&mut self, tick: u32, buffer: &mut [u8], counters: &mut Counters) {
        if let Some(renewed) = self.wire.renewed() {
            counters.reopened += 1;
            self.decoder.reset();
            (self.cut, self.lost, self.rebooted) = (false, true, renewed.rebooted);
            // Who they are has been asked before the line was given back.
            self.stranger = false;
        }
        self.undescribed = self.stranger;
        // A line that babbles faster than it is read is read on next tick.
        for _ in 0..4 {
            let n = self.wire.read(buffer).unwrap_or(0);
            let Self {
                decoder,
                joints,
                fresh,
                complaints,
                sequence,
                corrupt,
                undescribed,
                lost,
                enables,
                ..
            } = self;
            let (expected, stranger) = (&self.expected, &mut self.stranger);
            decoder.feed(&buffer[..n], |frame| match frame {
                Ok(FromController::Feedback(feedback)) if feedback.joints.len() == joints.len() => {
                    *undescribed |= feedback.flags.contains(ControllerFlags::UNDESCRIBED);
                    *complaints = complaints.or(Complaints {
                        disobeyed: disobeys(&feedback, enables),
                        ..complained(&feedback, std::mem::take(lost))
                    });
                    // Answers may come twice, late, or out of order; one to a command that has not been sent is nobody's.
                    let ahead = |than: u32| feedback.sequence.wrapping_sub(than) as i32;
                    if ahead(tick) > 0 {
                        counters.foreign_frames += 1;
                    } else if sequence.is_none_or(|last| ahead(last) > 0) {
                        *sequence = Some(feedback.sequence);
                        *fresh = Some(feedback);
                    }
                }
                Ok(FromController::Feedback(_)) => counters.foreign_frames += 1,
                Ok(FromController::Description(description)) => {
                    *stranger = expected.difference(&description).is_some();
                    *undescribed |= *stranger;
                }
                Err(_) => *corrupt = corrupt.saturating_add(1),
            });
            if n < buffer.len() {
                break;
            }
        }
    }

    /// Puts a reading of this line where the rig's joints have it.
    pub(crate) fn take(&self, feedback: &Feedback, readings: &mut JointFeedback) {
        for (joint, place) in &self.joints {
            let at = &feedback.joints[*place];
            readings.counts[*joint] = at.count.wrapping_add(self.offsets[*joint]);
            readings.rates[*joint] = f64::from(at.rate);
            let bit = 1 << joint;
            readings.index_seen &= !bit;
            if at.flags.contains(JointFlags::INDEX_SEEN) {
                readings.index_seen |= bit;
            }
        }
    }

    /// The command to the joints of this line.
    pub(crate) fn command(&mut self, sequence: u32, watchdog_ms: u16, drive: &Drive) -> Command {
        self.enables[sequence as usize % COMMANDS] = (sequence, drive.enable);
        let mut torque = [0.0_f32; MAX_JOINTS];
        for (joint, place) in &self.joints {
            torque[*place] = drive.torque[*joint] as f32;
        }
        let mut command = Command { sequence, enable: drive.enable, watchdog_ms, ..Command::default() };
        // At most MAX_JOINTS, which is what it holds.
        let _ = command.torque.extend_from_slice(&torque[..self.joints.len()]);
        command
    }

    /// Sends a message: whether the line took it whole.
    pub(crate) fn write(&mut self, message: &ToController) -> bool {
        if self.cut {
            // A zero ends the half frame, or it would spoil this one too.
            self.cut = !self.wire.write(&[0]).is_ok_and(|written| written == 1);
        }
        let whole = encode(message, &mut self.frame)
            .is_ok_and(|n| self.wire.write(&self.frame[..n]).is_ok_and(|written| written == n));
        self.cut |= !whole;
        whole
    }
}

/// Whether a reading says that motors are on although the command that it answers switched them off,
/// or off although it switched them on, and no other flag says why.
fn disobeys(feedback: &Feedback, enables: &[(u32, bool); COMMANDS]) -> bool {
    let (sequence, enable) = enables[feedback.sequence as usize % COMMANDS];
    let enabled = feedback.flags.contains(ControllerFlags::ENABLED);
    let reasons = ControllerFlags::WATCHDOG_EXPIRED | ControllerFlags::FAULT | ControllerFlags::UNDESCRIBED;
    let explained = enable && feedback.flags.intersects(reasons);
    sequence == feedback.sequence && enabled != enable && !explained
}

/// What a reading complains of; `lost`: the first after its line was gone.
fn complained(feedback: &Feedback, lost: bool) -> Complaints {
    let mut complaints = Complaints {
        fault: feedback.flags.contains(ControllerFlags::FAULT),
        watchdog: lost | feedback.flags.contains(ControllerFlags::WATCHDOG_EXPIRED),
        ..NO_COMPLAINTS
    };
    for joint in &feedback.joints {
        complaints.overcurrent |=
            joint.flags.contains(JointFlags::OVERCURRENT) || joint.current.abs() > TOO_STRONG;
        complaints.overtemperature |=
            joint.flags.contains(JointFlags::OVERTEMPERATURE) || joint.temperature > TOO_HOT;
        complaints.not_finite |= !(joint.current.is_finite() && joint.temperature.is_finite());
    }
    complaints
}
