//! A simulated rig at the end of a line in memory, for programs without a server. Commands and
//! readings cross the line as the same bytes that a serial port would carry.

use hbot_core::design::device::MAX_JOINTS;
use hbot_core::inputs::JointReadings;
use hbot_core::outputs::Drive;
use hbot_link::{Command, Decoder, FromController, MAX_COMMAND_FRAME, ToController, encode};

use crate::rig::SimulatedRig;

/// Watchdog time sent with each command, ms. It is longer than any tick, so the watchdog of the
/// simulated motor controllers never expires between two ticks.
const WATCHDOG_MS: u16 = 1000;
/// Initial capacity of the buffer for the bytes that the rig answers in one tick.
const REPLY: usize = 4096;

/// A simulated rig together with the line in memory that leads to it. The caller runs it tick by
/// tick.
#[derive(Debug, Clone)]
pub struct Exchange {
    rig: SimulatedRig,
    decoder: Decoder<FromController>,
    reply: Vec<u8>,
    joints: usize,
}

impl Exchange {
    /// Connects `rig` to a line in memory. `joints` is the number of joints of the rig's device; at
    /// most [`MAX_JOINTS`] are used.
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

    /// Returns the simulated rig.
    #[must_use]
    pub fn rig(&self) -> &SimulatedRig {
        &self.rig
    }

    /// Returns the simulated rig mutably, for example to set an external torque.
    pub fn rig_mut(&mut self) -> &mut SimulatedRig {
        &mut self.rig
    }

    /// Runs one tick at the time `now_ns`: sends the command `drive`, numbered `sequence`, and
    /// returns the newest reading that the rig answered.
    ///
    /// Returns `None` if no reading has arrived.
    pub fn tick(&mut self, now_ns: u64, sequence: u32, drive: &Drive) -> Option<JointReadings> {
        let mut command =
            Command { sequence, enable: drive.enable, watchdog_ms: WATCHDOG_MS, ..Command::default() };
        for torque in &drive.torque[..self.joints] {
            // If the list is full, further torques are left out.
            let _ = command.torque.push(*torque as f32);
        }
        self.write(now_ns, &ToController::Command(command));
        let mut newest = None;
        self.decoder.feed(&self.reply, |frame| {
            if let Ok(FromController::Feedback(feedback)) = frame {
                let mut reading = JointReadings::new(feedback.sequence, [0; MAX_JOINTS], [0.0; MAX_JOINTS]);
                for (joint, at) in feedback.joints.iter().enumerate() {
                    reading.counts[joint] = at.count;
                    reading.rates[joint] = f64::from(at.rate);
                }
                newest = Some(reading);
            }
        });
        newest
    }

    /// Sends `message` to the rig and stores the rig's answer in `reply`.
    fn write(&mut self, now_ns: u64, message: &ToController) {
        let mut frame = [0; MAX_COMMAND_FRAME];
        // A buffer of the largest frame size holds every message.
        let length = encode(message, &mut frame).unwrap_or(0);
        self.reply.clear();
        self.rig.receive(now_ns, &frame[..length], &mut self.reply);
    }
}
