//! A device on hardware that records all calls, and the host at the other end of its line.

use hbot_device::{Condition, Device, Identity, Joint, JointReading, Joints};
use hbot_link::{
    Command, ControllerFlags, Decoder, Description, Feedback, FromController, MAX_COMMAND_FRAME,
    ToController, encode,
};

/// The joints of the bench. The first measures its temperature, the second does not.
pub(crate) const JOINTS: [Joint; 2] = [
    Joint { counts_per_turn: 4096, peak: 1.0, max_temperature: 80.0 },
    Joint { counts_per_turn: 8192, peak: 0.5, max_temperature: f32::INFINITY },
];
pub(crate) const NAME: &str = "bench 1.0";
/// Torques that are legal and not zero, N m.
pub(crate) const PUSH: [f32; 2] = [0.25, -0.125];

/// Two joints that only remember how they were driven.
pub(crate) struct Hardware {
    pub(crate) readings: [JointReading; 2],
    pub(crate) condition: Condition,
    /// The torques of the last call of `drive`, N m.
    pub(crate) torque: Vec<f32>,
    pub(crate) on: bool,
    /// The calls since the last look, by name.
    pub(crate) calls: Vec<&'static str>,
}

impl Joints for Hardware {
    fn read(&mut self, readings: &mut [JointReading]) {
        assert_eq!(readings, [JointReading::default(); 2]);
        readings.copy_from_slice(&self.readings);
        self.calls.push("read");
    }

    fn drive(&mut self, torque: &[f32], on: bool) {
        self.torque = torque.to_vec();
        self.on = on;
        self.calls.push("drive");
    }

    fn condition(&mut self) -> Condition {
        self.condition
    }
}

/// A device, its hardware, and a host that talks to it.
pub(crate) struct Bench {
    pub(crate) device: Device,
    pub(crate) hardware: Hardware,
    pub(crate) now_us: u32,
    sequence: u32,
}

impl Bench {
    /// Boots a device. Before that its motors still have the torque that they had before a reset.
    pub(crate) fn boot(now_us: u32) -> Self {
        let mut hardware = Hardware {
            readings: [JointReading::default(); 2],
            condition: Condition::Ready,
            torque: vec![9.0; 2],
            on: true,
            calls: Vec::new(),
        };
        let device = Device::boot(Identity::new(NAME, &JOINTS).unwrap(), now_us, &mut hardware);
        Self { device, hardware, now_us, sequence: 0 }
    }

    pub(crate) fn new() -> Self {
        let mut bench = Self::boot(1_000_000);
        bench.describe();
        bench
    }

    pub(crate) fn send(&mut self, bytes: &[u8]) -> Vec<FromController> {
        let mut answers = Vec::new();
        let mut decoder = Decoder::new();
        for byte in bytes {
            if let Some(answer) = self.device.receive(self.now_us, *byte, &mut self.hardware) {
                decoder.feed(&answer, |message| answers.push(message.expect("a legal answer")));
            }
        }
        answers
    }

    pub(crate) fn describe(&mut self) -> Description {
        match &self.send(&frame(&ToController::Describe))[..] {
            [FromController::Description(description)] => description.clone(),
            other => panic!("{other:?}"),
        }
    }

    /// Sends a command with the next sequence number. Returns the feedback, if there is one.
    pub(crate) fn command(&mut self, enable: bool, watchdog_ms: u16, torque: &[f32]) -> Option<Feedback> {
        self.sequence += 1;
        let sequence = self.sequence;
        let torque = torque.iter().copied().collect();
        let command = Command { sequence, enable, watchdog_ms, torque };
        let mut answers = self.send(&frame(&ToController::Command(command)));
        assert!(answers.len() <= 1);
        answers.pop().map(|answer| match answer {
            FromController::Feedback(feedback) => {
                assert_eq!((feedback.sequence, feedback.joints.len()), (sequence, 2));
                feedback
            }
            FromController::Description(description) => panic!("{description:?}"),
        })
    }

    /// Commands [`PUSH`] for 20 ms and returns the flags of the answer.
    pub(crate) fn push(&mut self) -> ControllerFlags {
        self.command(true, 20, &PUSH).expect("an answer").flags
    }

    /// Commands the joints off and returns the flags of the answer. The torques of the command are
    /// not zero.
    pub(crate) fn release(&mut self) -> ControllerFlags {
        self.command(false, 20, &PUSH).expect("an answer").flags
    }

    pub(crate) fn pass(&mut self, ms: u32) {
        for _ in 0..ms {
            self.now_us = self.now_us.wrapping_add(1000);
            self.device.poll(self.now_us, &mut self.hardware);
        }
    }

    pub(crate) fn pushes(&self) -> bool {
        self.hardware.on && self.hardware.torque == PUSH && self.device.is_on()
    }

    pub(crate) fn is_free(&self) -> bool {
        !self.hardware.on && self.hardware.torque == [0.0; 2] && !self.device.is_on()
    }
}

pub(crate) fn frame(message: &ToController) -> Vec<u8> {
    let mut buffer = [0; MAX_COMMAND_FRAME];
    let length = encode(message, &mut buffer).unwrap();
    buffer[..length].to_vec()
}

pub(crate) fn command_frame(enable: bool, watchdog_ms: u16, torque: &[f32]) -> Vec<u8> {
    let torque = torque.iter().copied().collect();
    frame(&ToController::Command(Command { sequence: 0, enable, watchdog_ms, torque }))
}
