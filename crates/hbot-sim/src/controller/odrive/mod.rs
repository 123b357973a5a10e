//! Simulated ODrives behind a simulated slcan adapter. There is one axis for each joint. Its id is
//! the index of the joint, unless a test changes it.
//!
//! They were written from the vendor's CAN protocol page, the DBC of firmware 0.6.10, and the
//! source code of firmware 0.5.6. Every message to an axis restarts its watchdog, which runs
//! whether the motor is on or off, unless a test has it otherwise. Errors stay until they are
//! cleared. Positions and heartbeats are
//! sent without being asked for.

mod axis;

use hbot_core::design::device::MAX_JOINTS;

use super::joints::{Joints, Truth};
use super::{InjectedFault, Lags, Speaks};

use self::axis::Axis;

/// Message number of the emergency stop. It is the only command without data bytes. Any other frame
/// without data bytes is a request.
const ESTOP: u16 = 0x02;

/// The simulated axes of one line, with their adapter.
#[derive(Debug, Clone)]
pub(super) struct Odrive {
    axes: Vec<Axis>,
    /// The line of text that is being received.
    line: Vec<u8>,
    /// Whether the CAN channel of the adapter is open.
    open: bool,
    /// Number of lines of text that the adapter has refused.
    refused: u64,
}

/// Largest number of bytes that the adapter stores of a line. It drops further bytes.
const LONGEST: usize = 32;

impl Odrive {
    pub(super) fn new(lags: Lags, joints: &mut Joints) -> Self {
        let axes: Vec<Axis> = (0..joints.count()).map(|j| Axis::new(j, lags)).collect();
        for (j, axis) in axes.iter().enumerate() {
            joints.set_filter(j, axis.filter());
        }
        Self { axes, line: Vec::with_capacity(LONGEST), open: false, refused: 0 }
    }

    /// Changes the setting of the axis of `joint` that the vendor's tools call `name`. Returns
    /// false if no setting has this name.
    pub(super) fn set(&mut self, joint: usize, name: &str, value: f64, joints: &mut Joints) -> bool {
        let Some(axis) = self.axes.get_mut(joint) else { return false };
        let found = axis.set(name, value);
        joints.set_filter(joint, axis.filter());
        found
    }

    /// Changes the id of the axis of `joint`.
    pub(super) fn set_id(&mut self, joint: usize, id: u8) {
        if let Some(axis) = self.axes.get_mut(joint) {
            axis.id = id;
        }
    }

    /// Carries out a whole line of text that the adapter has received, and appends the answers to
    /// `reply`.
    fn command(&mut self, now_ns: u64, joints: &mut Joints, truth: &Truth<'_>, reply: &mut Vec<u8>) {
        let line = core::mem::take(&mut self.line);
        let taken = match line.first() {
            None => true,
            Some(b'O') if !self.open => {
                self.open = true;
                true
            }
            Some(b'C') if self.open => {
                self.open = false;
                true
            }
            Some(b'S') => !self.open && matches!(line[1..], [b'0'..=b'8']),
            Some(b't' | b'r') if self.open => match frame(&line) {
                Some(frame) => {
                    reply.extend(b"z\r");
                    self.deliver(now_ns, &frame, joints, truth, reply);
                    self.line = line;
                    self.line.clear();
                    return;
                }
                None => false,
            },
            _ => false,
        };
        reply.push(if taken { b'\r' } else { 7 });
        self.refused += u64::from(!taken);
        self.line = line;
        self.line.clear();
    }

    /// Delivers a frame to every axis with its id, and appends the answers to `reply`.
    fn deliver(
        &mut self,
        now_ns: u64,
        frame: &Frame,
        joints: &mut Joints,
        truth: &Truth<'_>,
        reply: &mut Vec<u8>,
    ) {
        let (node, message) = ((frame.id >> 5) as u8, frame.id & 0x1f);
        for (j, axis) in self.axes.iter_mut().enumerate() {
            if axis.id != node || axis.deaf {
                continue;
            }
            axis.feed(now_ns, message);
            // An axis also treats a frame without data bytes as a request. The emergency stop is
            // the exception.
            if frame.asks || frame.bytes.is_empty() && message != ESTOP {
                axis.say((j, message), joints, truth, reply);
            } else {
                axis.hear(j, message, &frame.bytes, joints, truth);
            }
            axis.watch(now_ns);
            axis.push(j, joints);
        }
    }
}

/// A standard CAN frame.
struct Frame {
    id: u16,
    /// True for a remote request: the frame asks for the message with this id.
    asks: bool,
    bytes: Vec<u8>,
}

/// Returns the standard frame in a line of text, or `None` if the line is not valid.
fn frame(line: &[u8]) -> Option<Frame> {
    let text = core::str::from_utf8(line).ok()?;
    let id = u16::from_str_radix(text.get(1..4)?, 16).ok().filter(|id| *id < 0x800)?;
    let length: usize = text.get(4..5)?.parse().ok().filter(|length| *length <= 8)?;
    let digits = text.get(5..)?;
    if line[0] == b'r' {
        return digits.is_empty().then_some(Frame { id, asks: true, bytes: Vec::new() });
    }
    let byte = |k: usize| u8::from_str_radix(digits.get(2 * k..2 * k + 2)?, 16).ok();
    let bytes: Option<Vec<u8>> = (0..length).map(byte).collect();
    bytes.filter(|_| digits.len() == 2 * length).map(|bytes| Frame { id, asks: false, bytes })
}

impl Speaks for Odrive {
    fn hear(
        &mut self,
        now_ns: u64,
        bytes: &[u8],
        joints: &mut Joints,
        truth: &Truth<'_>,
        reply: &mut Vec<u8>,
    ) {
        for byte in bytes {
            match byte {
                b'\r' => self.command(now_ns, joints, truth, reply),
                _ if self.line.len() < LONGEST => self.line.push(*byte),
                _ => {}
            }
        }
    }

    fn next_ns(&self) -> Option<u64> {
        self.axes.iter().map(Axis::next_ns).min().filter(|ns| *ns < u64::MAX)
    }

    fn next_word_ns(&self) -> Option<u64> {
        self.axes.iter().map(Axis::next_word_ns).min().filter(|ns| *ns < u64::MAX)
    }

    fn pass(&mut self, now_ns: u64, joints: &mut Joints, truth: &Truth<'_>, reply: &mut Vec<u8>) {
        let before = reply.len();
        for (j, axis) in self.axes.iter_mut().enumerate() {
            axis.pass((j, now_ns), joints, truth, reply);
        }
        if !self.open {
            reply.truncate(before);
        }
    }

    fn inject(&mut self, fault: InjectedFault, joints: &mut Joints, angles: &[f64; MAX_JOINTS]) {
        let every = 0..self.axes.len();
        match fault {
            InjectedFault::Reboot => {
                self.axes.iter_mut().for_each(Axis::reboot);
                joints.reboot(0..MAX_JOINTS, angles);
            }
            InjectedFault::RebootOne(j) if every.contains(&j) => {
                self.axes[j].reboot();
                joints.reboot(j..j + 1, angles);
            }
            InjectedFault::DeafOne { joint, on } if every.contains(&joint) => self.axes[joint].deaf = on,
            InjectedFault::Failed(on) => every.for_each(|j| self.axes[j].fail(j, on, joints)),
            InjectedFault::FailedOne { joint, on } if every.contains(&joint) => {
                self.axes[joint].fail(joint, on, joints)
            }
            _ => {}
        }
    }

    fn refused(&self) -> u64 {
        self.refused
    }
}
