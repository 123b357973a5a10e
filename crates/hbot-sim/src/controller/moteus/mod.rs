//! Simulated moteus servos on one line: a servo for each joint, and the adapter that connects them.
//!
//! They were written from the vendor's documents (registers, subframes, UART) and firmware, not
//! from hbot's driver.
//!
//! | module | what it does |
//! |---|---|
//! | `line` | lines of text of an fdcanusb adapter, and checksums of a UART |
//! | `registers` | subframes, and the conversion of values to integers |
//! | `servo` | modes, watchdog, faults, and the contents of each register |
//! | `console` | the text console with the settings, carried inside frames |
//! | `telemetry` | what the console tells about the servo's firmware |
//!
//! They differ from the vendor's servos in four ways. Position gains are always 0, so that only the
//! feedforward torque acts. A servo is enabled at once. When its watchdog expires it gives no
//! torque, whatever `servo.timeout_mode` is. Several servos can share a line with checksums.

mod command;
mod console;
mod line;
mod registers;
mod servo;
mod telemetry;

use hbot_core::design::device::MAX_JOINTS;

use self::console::Console;
use self::line::{Adapter, Asked, CanFrame, say, say_frame};
use self::servo::{Scene, Servo};
use super::joints::{Joints, Truth};
use super::{InjectedFault, Lags, Speaks};

/// The CAN destination id with which a frame is sent to all servos.
const BROADCAST: u32 = 0x7f;
/// The bit of a CAN id with which the host asks a servo for an answer.
const ANSWER: u32 = 0x8000;

/// The simulated servos of one line.
#[derive(Debug, Clone)]
pub(super) struct Moteus {
    adapter: Adapter,
    servos: Vec<Servo>,
    refused: u64,
    /// The time of the last call, ns. It serves as the present time for faults, which are injected
    /// without a time.
    now_ns: u64,
}

impl Moteus {
    /// Creates one servo for each joint. The servos' ids count up from `first_id`. `checksums` is
    /// true if the lines of text have checksums, as on the UART of a servo.
    pub(super) fn new(
        (first_id, checksums): (u8, bool),
        lags: Lags,
        joints: &mut Joints,
        angles: &[f64; MAX_JOINTS],
    ) -> Self {
        let servo = |joint| Servo::new(Console::new(first_id + joint as u8, lags), joint, joints, angles);
        let servos: Vec<Servo> = (0..joints.count()).map(servo).collect();
        for (joint, servo) in servos.iter().enumerate() {
            joints.set_filter(joint, servo.console.filter());
        }
        Self { adapter: Adapter::new(checksums), servos, refused: 0, now_ns: 0 }
    }

    /// Gives the servo of one joint a different id, to simulate a builder's mistake.
    pub(super) fn set_id(&mut self, joint: usize, id: u8) {
        if let Some(servo) = self.servos.get_mut(joint) {
            servo.id = id;
        }
    }

    /// Changes a setting of the servo of a joint. Returns false if there is no such setting.
    pub(super) fn set(&mut self, joint: usize, name: &str, value: f64, joints: &mut Joints) -> bool {
        let Some(servo) = self.servos.get_mut(joint) else { return false };
        let found = servo.console.set(name, value);
        joints.set_filter(joint, servo.console.filter());
        found
    }

    fn send(&mut self, frame: &CanFrame, joints: &mut Joints, truth: &Truth<'_>, reply: &mut Vec<u8>) {
        say(reply, "OK", self.adapter.checksums);
        let (to, from) = (frame.id & 0xff, frame.id >> 8 & 0x7f);
        let answers = frame.id & ANSWER != 0;
        for (joint, servo) in self.servos.iter_mut().enumerate() {
            if servo.deaf || to != BROADCAST && to != u32::from(servo.id) {
                continue;
            }
            let mut scene = Scene { now_ns: self.now_ns, joint, joints, truth };
            let mut data = Vec::new();
            servo.hear(&mut scene, &frame.data, answers.then_some(&mut data));
            if answers {
                let id = u32::from(servo.id) << 8 | from;
                say_frame(reply, &CanFrame { id, data: padded(data) }, self.adapter.checksums);
            }
        }
    }
}

/// Fills `data` with no-operation bytes up to the next length that a CAN-FD frame can have.
fn padded(mut data: Vec<u8>) -> Vec<u8> {
    let lengths = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];
    let length = lengths.into_iter().find(|length| *length >= data.len()).unwrap_or(64);
    data.resize(length, 0x50);
    data
}

impl Speaks for Moteus {
    fn hear(
        &mut self,
        now_ns: u64,
        bytes: &[u8],
        joints: &mut Joints,
        truth: &Truth<'_>,
        reply: &mut Vec<u8>,
    ) {
        self.now_ns = now_ns;
        for byte in bytes {
            match self.adapter.take(*byte) {
                None => {}
                Some(Asked::Refused(reason)) => {
                    self.refused += 1;
                    say(reply, reason, self.adapter.checksums);
                }
                Some(Asked::Send(frame)) => self.send(&frame, joints, truth, reply),
            }
        }
    }

    fn next_ns(&self) -> Option<u64> {
        self.servos.iter().filter_map(|servo| servo.deadline).min()
    }

    fn pass(&mut self, now_ns: u64, joints: &mut Joints, _: &Truth<'_>, _: &mut Vec<u8>) {
        self.now_ns = now_ns;
        for (joint, servo) in self.servos.iter_mut().enumerate() {
            servo.watch(now_ns, joint, joints);
        }
    }

    fn inject(&mut self, fault: InjectedFault, joints: &mut Joints, angles: &[f64; MAX_JOINTS]) {
        if fault == InjectedFault::Reboot {
            self.adapter.reboot();
        }
        let now_ns = self.now_ns;
        for (joint, servo) in self.servos.iter_mut().enumerate() {
            match fault {
                InjectedFault::Reboot => {}
                InjectedFault::RebootOne(one) if one == joint => {}
                InjectedFault::DeafOne { joint: one, on } if one == joint => servo.deaf = on,
                InjectedFault::Failed(on) => servo.failed = on,
                InjectedFault::FailedOne { joint: one, on } if one == joint => servo.failed = on,
                _ => continue,
            }
            if matches!(fault, InjectedFault::Reboot | InjectedFault::RebootOne(_)) {
                joints.reboot(joint..joint + 1, angles);
                servo.reboot(now_ns, joint, joints, angles);
            }
            servo.watch(now_ns, joint, joints);
        }
    }

    fn refused(&self) -> u64 {
        self.refused
    }
}
