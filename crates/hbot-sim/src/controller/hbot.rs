//! The simulated firmware of docs/link.md. One controller has all joints of the line.
//!
//! hbot-device is the firmware, as it is flashed to real controllers. This module is the hardware
//! under it: encoders, motors and a clock of microseconds.

use hbot_core::design::device::MAX_JOINTS;
use hbot_device::{Condition, Device, Identity, Joint, JointFlags, JointReading};

use super::joints::{Joints, Truth};
use super::{InjectedFault, Speaks};

/// Temperature that the simulated motors report, in degrees Celsius.
const TEMPERATURE: f32 = 25.0;

/// The name of the simulated firmware, as the controller reports it in its description.
pub const FIRMWARE: &str = concat!("hbot-sim ", env!("CARGO_PKG_VERSION"));

/// A simulated motor controller with hbot's own protocol, which controls all joints of a line.
#[derive(Debug, Clone)]
pub(super) struct Hbot {
    device: Device,
    identity: Identity,
    /// Latest time that was passed to the device, in µs of a clock that does not wrap.
    now_us: u64,
    failed: bool,
    /// True if a test makes the controller ignore all commands and send no answers.
    deaf: bool,
    /// Number of frames that were refused before the last reboot.
    refused: u64,
}

impl Hbot {
    /// Creates a controller that has just powered up. Returns `None` if the protocol cannot
    /// describe the joints.
    pub(super) fn new(joints: &mut Joints) -> Option<Self> {
        let each = joints.axes[..joints.count()].iter();
        let joint = |axis: &super::joint::Axis| Joint {
            counts_per_turn: axis.joint.counts_per_turn,
            peak: axis.peak,
            // The simulated motors limit their heat themselves.
            max_temperature: f32::INFINITY,
        };
        let all: Vec<Joint> = each.map(joint).collect();
        let identity = Identity::new(FIRMWARE, &all)?;
        let device = Device::boot(identity, 0, &mut Hardware { joints, truth: None, failed: false });
        Some(Self { device, identity, now_us: 0, failed: false, deaf: false, refused: 0 })
    }

    /// Sets the device's clock, which counts microseconds and wraps at 32 bits.
    fn set_clock(&mut self, now_ns: u64) -> u32 {
        self.now_us = now_ns / 1000;
        self.now_us as u32
    }

    fn poll(&mut self, joints: &mut Joints) {
        let mut hardware = Hardware { joints, truth: None, failed: self.failed };
        self.device.poll(self.now_us as u32, &mut hardware);
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
        let now_us = self.set_clock(now_ns);
        let mut hardware = Hardware { joints, truth: Some(truth), failed: self.failed };
        for byte in bytes {
            if let Some(answer) = self.device.receive(now_us, *byte, &mut hardware) {
                reply.extend_from_slice(&answer);
            }
        }
    }

    fn next_ns(&self) -> Option<u64> {
        let left_us = self.device.watchdog_us(self.now_us as u32)?;
        Some((self.now_us + u64::from(left_us)) * 1000)
    }

    fn pass(&mut self, now_ns: u64, joints: &mut Joints, _: &Truth<'_>, _: &mut Vec<u8>) {
        self.set_clock(now_ns);
        self.poll(joints);
    }

    fn inject(&mut self, fault: InjectedFault, joints: &mut Joints, angles: &[f64; MAX_JOINTS]) {
        match fault {
            InjectedFault::Reboot | InjectedFault::RebootOne(_) => {
                self.refused = self.refused();
                joints.reboot(0..MAX_JOINTS, angles);
                let mut hardware = Hardware { joints, truth: None, failed: self.failed };
                self.device = Device::boot(self.identity, self.now_us as u32, &mut hardware);
            }
            InjectedFault::DeafOne { on, .. } => self.deaf = on,
            InjectedFault::Failed(on) | InjectedFault::FailedOne { on, .. } => {
                self.failed = on;
                self.poll(joints);
            }
            _ => {}
        }
    }

    fn refused(&self) -> u64 {
        self.refused + u64::from(self.device.refused())
    }
}

/// The encoders and motors of all joints, as the firmware reaches them.
struct Hardware<'a> {
    joints: &'a mut Joints,
    /// `None` while no command arrives: the firmware then reads no encoder.
    truth: Option<&'a Truth<'a>>,
    failed: bool,
}

impl hbot_device::Joints for Hardware<'_> {
    fn read(&mut self, readings: &mut [JointReading]) {
        let Some(truth) = self.truth else { return };
        for (j, reading) in readings.iter_mut().enumerate() {
            let mut flags = self.joints.axes[j].flags;
            let hot = self.joints.is_hot(j) || self.joints.derates(j);
            flags.set(JointFlags::OVERTEMPERATURE, hot);
            *reading = JointReading {
                count: self.joints.count_at(j, truth),
                rate: self.joints.rate_at(j, truth),
                current: 0.0,
                temperature: TEMPERATURE,
                flags,
            };
        }
    }

    fn drive(&mut self, torque: &[f32], on: bool) {
        for (j, torque) in torque.iter().enumerate() {
            self.joints.ask(j, if on { self.joints.within_peak(j, *torque) } else { 0.0 });
        }
    }

    fn condition(&mut self) -> Condition {
        if self.failed { Condition::Fault } else { Condition::Ready }
    }
}
