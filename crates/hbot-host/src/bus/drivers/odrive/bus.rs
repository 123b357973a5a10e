//! The bus of a line of ODrives. Torques are sent in every tick. Positions arrive without being
//! asked for.

use std::sync::atomic::Ordering;

use hbot_core::MAX_JOINTS;

use super::axis::Axis;
use super::message::{Command, decode, state};
use super::order::{Order, Times};
use super::proof::PROVED_ARMED;
use super::slcan::{Decoder, Word};
use crate::bus::{BusCommand, Expected, Heard, JointReading, MotorBus, Reading, Telemetry};
use crate::line::Line;

/// Capacity of the buffer for the commands of one tick, in bytes.
const OUTBOX: usize = 4096;
/// Largest number of bytes that one read takes from the line.
const INBOX: usize = 4096;

/// Motor bus of one line of ODrives.
pub(super) struct OdriveBus {
    line: Box<dyn Line>,
    /// The axes, in the order of the joints on this bus.
    axes: Vec<Axis>,
    decoder: Decoder,
    inbox: [u8; INBOX],
    outbox: Vec<u8>,
    times: Times,
    /// Whether the motors are commanded on or off, and since which tick.
    order: Order,
    /// True until the bus has sent its first command on a new or reopened line.
    fresh: bool,
    /// True if the line accepted only a part of the last command. The next command must then first
    /// end the half line.
    cut: bool,
    /// The tick of the command that the last reading answers.
    answered: Option<u32>,
    /// Index of the axis that was asked last.
    turn: usize,
    /// Time of the last command, ns.
    now_ns: u64,
}

impl OdriveBus {
    /// Returns the bus of a line whose axes have passed bring-up.
    pub(super) fn new(line: Box<dyn Line>, expected: &Expected) -> Self {
        let times = Times::new(expected);
        let axis = |at| {
            let armed = expected.note(PROVED_ARMED + at).load(Ordering::Relaxed) != 0;
            expected.joint(at).map(|joint| Axis::new(joint.id, joint.gear, times, armed))
        };
        let axes = (0..expected.joints()).filter_map(axis).collect();
        Self {
            line,
            axes,
            decoder: Decoder::default(),
            inbox: [0; INBOX],
            outbox: Vec::with_capacity(OUTBOX),
            times,
            order: Order::default(),
            fresh: true,
            cut: false,
            answered: None,
            turn: 0,
            now_ns: 0,
        }
    }

    /// Decodes the first `n` bytes of the inbox, which arrived before the command of `tick`, and
    /// updates the axes. Counts foreign and damaged frames in `heard`.
    fn take(&mut self, now_ns: u64, tick: u32, n: usize, heard: &mut Heard) {
        let Self { decoder, inbox, axes, order, .. } = self;
        for word in inbox[..n].iter().filter_map(|byte| decoder.push(*byte)) {
            match word {
                Ok(Word::Frame(frame)) => {
                    let id = (frame.id >> 5) as u8;
                    match axes.iter_mut().find(|axis| axis.id == id && !frame.extended) {
                        Some(axis) => {
                            if let Some((_, message)) = decode(&frame) {
                                axis.hear(now_ns, tick, *order, &message);
                            }
                        }
                        None => heard.foreign += 1,
                    }
                }
                Ok(Word::Taken) => {}
                // The adapter has refused a command, or a line of text is damaged.
                Ok(Word::Refused) | Err(_) => heard.damaged = heard.damaged.saturating_add(1),
            }
        }
    }

    /// Appends the questions of `tick` to the command: to all axes on a new line, and later to one
    /// axis in turn, or sooner to one whose round trip is in doubt.
    fn ask(&mut self, tick: u32, fresh: bool) {
        let Self { axes, outbox, times, turn, .. } = self;
        let count = axes.len();
        let mut put = |axis: &mut Axis| {
            // An axis whose watchdog must expire gets no message.
            if !axis.is_lost() {
                Command::Ask(axis.trip.ask(tick, times.ask)).write(axis.id, outbox);
            }
        };
        if fresh {
            axes.iter_mut().for_each(put);
        } else if tick.is_multiple_of(times.ask) && count > 0 {
            *turn = (*turn + 1) % count;
            put(&mut axes[*turn]);
        } else if tick.is_multiple_of(times.ask_soon) {
            let from = *turn + 1;
            let mut turns = (from..from + count).map(|at| at % count);
            if let Some(at) = turns.find(|at| axes[*at].trip.is_in_doubt(tick, times.ask)) {
                *turn = at;
                put(&mut axes[at]);
            }
        }
    }

    /// Returns a reading of all axes, if each has sent a newer position since the last reading. The
    /// reading is as old as the oldest of its positions.
    fn reading(&mut self, tick: u32) -> Option<Reading> {
        if self.fresh {
            return None;
        }
        let age = |answers: u32| tick.wrapping_sub(answers);
        let oldest = self.axes.iter().try_fold(0, |oldest, axis| Some(age(axis.answers?).max(oldest)))?;
        let answers = tick.wrapping_sub(oldest);
        if self.answered.is_some_and(|last| answers.wrapping_sub(last) as i32 <= 0) {
            return None;
        }
        self.answered = Some(answers);
        let mut joints = [JointReading::default(); MAX_JOINTS];
        for (joint, axis) in joints.iter_mut().zip(&self.axes) {
            *joint = JointReading { count: axis.count(), rate: axis.rate(), index_seen: false };
        }
        Some(Reading { answers, joints })
    }
}

impl MotorBus for OdriveBus {
    fn receive(&mut self, now_ns: u64, tick: u32) -> Heard {
        let mut heard = Heard::default();
        if let Some(renewed) = self.line.renewed() {
            (heard.reopened, heard.zeros_lost) = (true, renewed.rebooted);
            (self.decoder, self.cut, self.fresh) = (Decoder::default(), false, true);
            self.axes.iter_mut().for_each(Axis::met_again);
        }
        // At most 4 x 4096 bytes are read. The rest waits for the next tick.
        for _ in 0..4 {
            let n = self.line.read(now_ns, &mut self.inbox).unwrap_or(0);
            self.take(now_ns, tick, n, &mut heard);
            if n < self.inbox.len() {
                break;
            }
        }
        for axis in &self.axes {
            heard.zeros_lost |= axis.is_lost();
            heard.complaints = heard.complaints.or(axis.complaints(tick, self.order));
        }
        heard.reading = self.reading(tick);
        heard
    }

    fn command(&mut self, now_ns: u64, command: &BusCommand) -> bool {
        let BusCommand { tick, enable, torque, .. } = *command;
        self.now_ns = now_ns;
        if self.fresh || enable != self.order.on {
            self.order = Order { on: enable, since: tick };
        }
        let fresh = std::mem::take(&mut self.fresh);
        if fresh {
            self.axes.iter_mut().for_each(|axis| axis.excuse(tick));
        }
        self.outbox.clear();
        if self.cut {
            // Ends the half line that the adapter has received.
            self.outbox.push(b'\r');
        }
        for (axis, torque) in self.axes.iter_mut().zip(torque) {
            axis.command(tick, self.order, torque, &mut self.outbox);
        }
        self.ask(tick, fresh);
        let taken = self.line.write(now_ns, &self.outbox);
        self.cut = !taken.is_ok_and(|written| written == self.outbox.len());
        !self.cut
    }

    fn telemetry(&self, now_ns: u64, at: usize) -> Telemetry {
        self.axes.get(at).map_or_else(Telemetry::default, |axis| axis.telemetry(now_ns))
    }

    fn release(&mut self) {
        // An axis that proves its watchdog after a restart is not told to be idle before.
        self.outbox.clear();
        self.outbox.push(b'\r');
        for axis in &self.axes {
            Command::AxisState(state::IDLE).write(axis.id, &mut self.outbox);
        }
        let taken = self.line.write(self.now_ns, &self.outbox);
        if taken.is_ok_and(|written| written == self.outbox.len()) {
            self.line.release();
        }
    }
}
