//! The simulated firmware of docs/link.md. One controller has all joints of the line.

use hbot_core::device::MAX_JOINTS;
use hbot_link::{
    Command, ControllerFlags, Decoder, Description, Feedback, FromController, JointDescription, JointFlags,
    JointReading, MAX_FEEDBACK_FRAME, PROTOCOL_VERSION, ToController, encode,
};

use super::joints::{Joints, Truth};
use super::{InjectedFault, Speaks};
use crate::plant::JointTorques;

/// Temperature that the simulated motors report, in degrees Celsius.
const TEMPERATURE: f32 = 25.0;

/// The name of the simulated firmware, as the controller reports it in its [`Description`].
pub const FIRMWARE: &str = concat!("hbot-sim ", env!("CARGO_PKG_VERSION"));

/// A simulated motor controller with hbot's own protocol, which controls all joints of a line.
#[derive(Debug, Clone)]
pub(super) struct Hbot {
    decoder: Decoder<ToController>,
    /// Commanded torque of each joint, limited to the joint's peak, N m. It is positive in the
    /// joint's positive direction.
    torque: JointTorques,
    enabled: bool,
    expired: bool,
    described: bool,
    /// Time at which the last valid command expires, ns. `None` if no command has arrived since
    /// power-up.
    deadline: Option<u64>,
    failed: bool,
    /// True if a test makes the controller ignore all commands and send no answers.
    deaf: bool,
    refused: u64,
}

impl Hbot {
    pub(super) fn new() -> Self {
        Self {
            decoder: Decoder::new(),
            torque: [0.0; MAX_JOINTS],
            enabled: false,
            expired: false,
            described: false,
            deadline: None,
            failed: false,
            deaf: false,
            refused: 0,
        }
    }

    fn describe(&mut self, joints: &Joints) -> Description {
        self.described = true;
        let each = joints.axes[..joints.count()].iter();
        let joint = |counts_per_turn| JointDescription { counts_per_turn };
        Description {
            protocol: PROTOCOL_VERSION,
            firmware: FIRMWARE.try_into().unwrap_or_default(),
            joints: each.map(|axis| joint(axis.joint.counts_per_turn)).collect(),
        }
    }

    /// Carries out a command that arrived at `now_ns` and returns the answer. Returns `None` for an
    /// invalid command, which changes nothing.
    fn command(
        &mut self,
        now_ns: u64,
        command: &Command,
        joints: &mut Joints,
        truth: &Truth<'_>,
    ) -> Option<Feedback> {
        let valid = command.torque.len() == joints.count() && command.torque.iter().all(|t| t.is_finite());
        if !valid {
            return None;
        }
        self.watch(now_ns);
        if !command.enable {
            self.expired = false;
        }
        self.enabled = command.enable;
        self.deadline = Some(now_ns.saturating_add(u64::from(command.watchdog_ms) * 1_000_000));
        self.watch(now_ns);
        for (j, asked) in command.torque.iter().enumerate() {
            let given = joints.within_peak(j, *asked);
            let clipped = given.abs() != f64::from(asked.abs());
            joints.axes[j].flags.set(JointFlags::OVERCURRENT, command.enable && clipped);
            self.torque[j] = given;
        }
        self.push(joints);
        Some(self.feedback(command.sequence, joints, truth))
    }

    fn watch(&mut self, now_ns: u64) {
        if self.deadline.is_some_and(|deadline| now_ns >= deadline) {
            self.expired = true;
        }
    }

    fn gives_torque(&self) -> bool {
        self.enabled && !self.expired && !self.failed
    }

    fn push(&self, joints: &mut Joints) {
        for (j, torque) in self.torque.iter().enumerate() {
            joints.ask(j, if self.gives_torque() { *torque } else { 0.0 });
        }
    }

    fn feedback(&self, sequence: u32, joints: &Joints, truth: &Truth<'_>) -> Feedback {
        let mut flags = ControllerFlags::empty();
        flags.set(ControllerFlags::ENABLED, self.gives_torque());
        flags.set(ControllerFlags::WATCHDOG_EXPIRED, self.expired);
        flags.set(ControllerFlags::FAULT, self.failed);
        flags.set(ControllerFlags::UNDESCRIBED, !self.described);
        let reading = |j: usize| {
            let mut flags = joints.axes[j].flags;
            flags.set(JointFlags::OVERTEMPERATURE, joints.is_hot(j) || joints.derates(j));
            JointReading {
                count: joints.count_at(j, truth),
                rate: joints.rate_at(j, truth),
                current: 0.0,
                temperature: TEMPERATURE,
                flags,
            }
        };
        Feedback { sequence, flags, joints: (0..joints.count()).map(reading).collect() }
    }
}

impl Speaks for Hbot {
    fn hear(
        &mut self,
        now_ns: u64,
        bytes: &[u8],
        joints: &mut Joints,
        truth: &Truth<'_>,
        reply: &mut Vec<u8>,
    ) {
        if self.deaf {
            return;
        }
        let mut decoder = core::mem::replace(&mut self.decoder, Decoder::new());
        decoder.feed(bytes, |result| {
            let answer = match result {
                Ok(ToController::Describe) => Some(FromController::Description(self.describe(joints))),
                Ok(ToController::Command(command)) => {
                    self.command(now_ns, &command, joints, truth).map(FromController::Feedback)
                }
                Err(_) => {
                    self.refused += 1;
                    None
                }
            };
            if let Some(answer) = answer {
                let mut frame = [0; MAX_FEEDBACK_FRAME];
                // The buffer is as long as the longest message, so this cannot fail.
                if let Ok(length) = encode(&answer, &mut frame) {
                    reply.extend_from_slice(&frame[..length]);
                }
            }
        });
        self.decoder = decoder;
    }

    fn next_ns(&self) -> Option<u64> {
        self.deadline.filter(|_| !self.expired)
    }

    fn pass(&mut self, now_ns: u64, joints: &mut Joints, _: &Truth<'_>, _: &mut Vec<u8>) {
        self.watch(now_ns);
        self.push(joints);
    }

    fn inject(&mut self, fault: InjectedFault, joints: &mut Joints, angles: &[f64; MAX_JOINTS]) {
        match fault {
            InjectedFault::Reboot | InjectedFault::RebootOne(_) => {
                *self = Self { failed: self.failed, deaf: self.deaf, refused: self.refused, ..Self::new() };
                joints.reboot(0..MAX_JOINTS, angles);
            }
            InjectedFault::DeafOne { on, .. } => self.deaf = on,
            InjectedFault::Failed(on) | InjectedFault::FailedOne { on, .. } => {
                self.failed = on;
                self.push(joints);
            }
            _ => {}
        }
    }

    fn refused(&self) -> u64 {
        self.refused
    }
}
