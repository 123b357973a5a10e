//! A simulated rig at the end of a line in memory, for whoever has no server: commands go to it and readings come back as
//! the same bytes that a port would carry.

use hbot_core::device::MAX_JOINTS;
use hbot_core::inputs::{Complaints, JointFeedback};
use hbot_core::outputs::Drive;
use hbot_link::{Command, Decoder, FromController, MAX_COMMAND_FRAME, ToController, encode};

use crate::rig::SimulatedRig;

/// How long the simulated controllers hold a command, ms: longer than any tick.
const WATCHDOG_MS: u16 = 1000;
/// Room for the answers of a tick, bytes.
const REPLY: usize = 4096;

/// A simulated rig and its line.
#[derive(Debug, Clone)]
pub struct Exchange {
    rig: SimulatedRig,
    decoder: Decoder<FromController>,
    reply: Vec<u8>,
    joints: usize,
}

impl Exchange {
    /// `rig`, whose device has so many joints, at the end of a line.
    #[must_use]
    pub fn new(rig: SimulatedRig, joints: usize) -> Self {
        let mut exchange = Self {
            rig,
            decoder: Decoder::new(),
            reply: Vec::with_capacity(REPLY),
            joints: joints.min(MAX_JOINTS),
        };
        exchange.write(0, &ToController::Describe);
        exchange
    }

    /// The rig.
    #[must_use]
    pub fn rig(&self) -> &SimulatedRig {
        &self.rig
    }

    /// The rig, to change it.
    pub fn rig_mut(&mut self) -> &mut SimulatedRig {
        &mut self.rig
    }

    /// One tick of the line at `now_ns`: the command `drive` goes out under the number `sequence`, and the newest reading that has
    /// come back is taken, if any has.
    pub fn tick(&mut self, now_ns: u64, sequence: u32, drive: &Drive) -> Option<JointFeedback> {
        let mut command =
            Command { sequence, enable: drive.enable, watchdog_ms: WATCHDOG_MS, ..Command::default() };
        for torque in &drive.torque[..self.joints] {
            // As many as it holds.
            let _ = command.torque.push(*torque as f32);
        }
        self.write(now_ns, &ToController::Command(command));
        let mut newest = None;
        self.decoder.feed(&self.reply, |frame| {
            if let Ok(FromController::Feedback(feedback)) = frame {
                let mut reading = JointFeedback {
                    sequence: feedback.sequence,
                    counts: [0; MAX_JOINTS],
                    rates: [0.0; MAX_JOINTS],
                    index_seen: 0,
                    complaints: Complaints::default(),
                };
                for (joint, at) in feedback.joints.iter().enumerate() {
                    reading.counts[joint] = at.count;
                    reading.rates[joint] = f64::from(at.rate);
                }
                newest = Some(reading);
            }
        });
        newest
    }

    /// Sends `message`; what is answered stands in `reply`.
    fn write(&mut self, now_ns: u64, message: &ToController) {
        let mut frame = [0; MAX_COMMAND_FRAME];
        // A frame of the largest size holds every message.
        let length = encode(message, &mut frame).unwrap_or(0);
        self.reply.clear();
        self.rig.receive(now_ns, &frame[..length], &mut self.reply);
    }
}
