//! Sends the loop's commands to the moteus servos of one line, and makes readings of their answers.

use std::sync::atomic::Ordering;

use hbot_core::MAX_JOINTS;
use moteus_protocol::command::PositionFormat;
use moteus_protocol::query::QueryFormat;

use super::UPTIME;
use super::codec::{self, Turn};
use super::servo::{STEPS, Servo, complaints};
use super::text::{self, BREAK, Inbox, LONGEST, Said};
use crate::bus::{BusCommand, Expected, Heard, JointReading, MotorBus, Obedience, Reading, Telemetry};
use crate::line::Line;

/// Largest position of a servo whose motor is off, in steps: 100 turns. Beyond it the driver asks
/// the servo to subtract whole turns. A servo stores its position as a 32-bit float, which no
/// longer resolves steps of 1e-5 turns above 168 turns.
const FAR: i32 = 100 * STEPS as i32;
/// Ticks between two requests to subtract whole turns from a servo's position. The driver sends
/// them while the motor is off and the position is large.
const EVERY: u32 = 100;
/// Largest age of an answer, in ticks. The driver cannot assign an older answer to a command, and
/// counts it as foreign.
const OLDEST: u32 = 1000;
/// Half of the time between two queries for a current, ms. Each query asks one servo, in turn.
const HALF_TURN_MS: u32 = 50;

/// The bus of the moteus servos on one line. The control loop sends torques and receives readings
/// through it.
pub(super) struct MoteusBus {
    line: Box<dyn Line>,
    servos: Vec<Servo>,
    /// Assembles the received bytes into lines of text. It expects checksums if the connection
    /// check before the first tick has found them.
    inbox: Inbox,
    expected: Expected,
    received: [u8; 4096],
    outbox: Vec<u8>,
    format: PositionFormat,
    /// The query of the commands of even ticks, and of odd ticks.
    queries: [QueryFormat; 2],
    /// The query for a servo's current.
    current_query: QueryFormat,
    /// Ticks between two queries for a current. The number is even, so that these queries take the
    /// place of those of even ticks, and queries for the time since power-on stay as frequent.
    current_every: u32,
    obedience: Obedience,
    /// The last command sent, or `None` before the first one.
    last: Option<Sent>,
    /// Tick of the command that the newest reading answers, or `None` before the first reading.
    answered: Option<u32>,
    /// True if the line accepted only the first bytes of the last command.
    cut: bool,
}

#[derive(Debug, Clone, Copy)]
struct Sent {
    tick: u32,
    watchdog_ms: u16,
    now_ns: u64,
}

impl MoteusBus {
    pub(super) fn new(line: Box<dyn Line>, expected: Expected) -> Self {
        let joints = (0..expected.joints()).filter_map(|at| expected.joint(at));
        let mut bus = Self {
            line,
            servos: joints.map(Servo::new).collect(),
            inbox: Inbox::new(super::dialect(&expected)),
            received: [0; 4096],
            outbox: Vec::with_capacity(BREAK.len() + expected.joints() * LONGEST),
            format: codec::torque_format(),
            queries: [0, 1].map(|tick| codec::state_query(Turn::of(tick))),
            current_query: codec::state_query(Turn::Current),
            current_every: 2 * expected.ticks(HALF_TURN_MS),
            obedience: Obedience::default(),
            last: None,
            answered: None,
            cut: false,
            expected,
        };
        bus.met();
        bus
    }

    /// Takes over what bring-up, at the start or after the line was lost, has noted of the servos.
    fn met(&mut self) {
        for (at, servo) in self.servos.iter_mut().enumerate() {
            servo.met_ms = self.expected.note(UPTIME + at).load(Ordering::Relaxed);
            (servo.powered_ms, servo.lost) = (None, 0);
        }
    }

    /// Handles the content of one line of text from a servo or the adapter. It arrived at `now_ns`.
    /// Stores the state that a servo's answer contains. Counts damaged and foreign frames in
    /// `heard`.
    fn take(&mut self, now_ns: u64, said: Said, heard: &mut Heard) {
        let frame = match said {
            Said::Taken => return,
            // The adapter or servo refused a command, so the command was damaged on its way.
            Said::Refused | Said::Damaged => {
                heard.damaged = heard.damaged.saturating_add(1);
                return;
            }
            Said::Frame(frame) => frame,
        };
        let Some(state) = codec::state(frame.payload()) else {
            heard.damaged = heard.damaged.saturating_add(1);
            return;
        };
        let from = codec::sender(&frame);
        let servo = self.servos.iter_mut().find(|servo| Some(servo.id) == from);
        let (Some(servo), Some(sent), Some(echo)) = (servo, self.last, state.watchdog) else {
            heard.foreign += 1;
            return;
        };
        let Some(answers) = codec::stamped(echo, sent.watchdog_ms, sent.tick)
            .filter(|answers| sent.tick.wrapping_sub(*answers) <= OLDEST)
        else {
            heard.foreign += 1;
            return;
        };
        let complaints = complaints(&state, servo, answers, &self.obedience);
        heard.complaints = heard.complaints.or(complaints);
        let newer = servo.answered.is_none_or(|last| answers.wrapping_sub(last) as i32 > 0);
        // The time of the last command stands in for the time of the command that was answered. A
        // late answer makes the servo seem to have got power later, by its delay, which `SLACK_MS`
        // tolerates.
        if newer {
            match servo.take(&state, answers, (sent.now_ns / 1_000_000) as i64) {
                Some(()) => servo.log(now_ns, &state, complaints),
                None => heard.damaged = heard.damaged.saturating_add(1),
            }
        }
    }

    /// Returns the index of the servo whose current the command of tick `tick` asks for, if any.
    pub(super) fn asked_for_current(&self, tick: u32) -> Option<usize> {
        let turn = (tick / self.current_every) as usize;
        tick.is_multiple_of(self.current_every).then(|| turn.checked_rem(self.servos.len())).flatten()
    }

    /// Returns the newest states of all servos as one reading, which is as old as the oldest of
    /// their answers. Returns `None` if a servo has not answered yet, or if the oldest answer still
    /// belongs to the same command as in the last reading.
    fn reading(&mut self) -> Option<Reading> {
        let age = |answers: u32| self.last.map_or(0, |sent| sent.tick.wrapping_sub(answers));
        let all = self.servos.iter().map(|servo| servo.answered);
        let oldest = all.reduce(|a, b| a.zip(b).map(|(a, b)| if age(a) > age(b) { a } else { b }))??;
        if self.answered.is_some_and(|last| oldest.wrapping_sub(last) as i32 <= 0) {
            return None;
        }
        self.answered = Some(oldest);
        let mut joints = [JointReading::default(); MAX_JOINTS];
        for (joint, servo) in joints.iter_mut().zip(&self.servos) {
            *joint = servo.reading;
        }
        Some(Reading { answers: oldest, joints })
    }
}

impl MotorBus for MoteusBus {
    fn receive(&mut self, now_ns: u64, _: u32) -> Heard {
        let mut heard = Heard::default();
        if let Some(renewed) = self.line.renewed() {
            (heard.reopened, heard.zeros_lost) = (true, renewed.rebooted);
            // The thread that reopened the line has already met these servos.
            self.inbox = Inbox::new(super::dialect(&self.expected));
            // That thread has also switched the motors off, so earlier commands do not tell which
            // modes to expect.
            (self.cut, self.obedience) = (false, Obedience::default());
            self.met();
            if renewed.rebooted {
                self.servos.iter_mut().for_each(|servo| (servo.turns_off, servo.rezeroing) = (0, None));
            }
        }
        // Reads at most 4 x 4096 bytes. The rest waits for the next tick.
        for _ in 0..4 {
            let n = self.line.read(now_ns, &mut self.received).unwrap_or(0);
            for at in 0..n {
                if let Some((said, _)) = self.inbox.take(self.received[at]) {
                    self.take(now_ns, said, &mut heard);
                }
            }
            if n < self.received.len() {
                break;
            }
        }
        heard.reading = self.reading();
        heard.zeros_lost |= self.servos.iter().any(|servo| servo.lost > 0);
        heard
    }

    fn command(&mut self, now_ns: u64, command: &BusCommand) -> bool {
        let BusCommand { tick, enable, watchdog_ms, .. } = *command;
        self.obedience.note(tick, enable);
        self.last = Some(Sent { tick, watchdog_ms, now_ns });
        let (dialect, watchdog) = (super::dialect(&self.expected), codec::stamp(watchdog_ms, tick));
        self.outbox.clear();
        if self.cut {
            self.outbox.extend_from_slice(BREAK);
        }
        let asked = self.asked_for_current(tick);
        for (at, (servo, torque)) in self.servos.iter_mut().zip(&command.torque).enumerate() {
            let mut frame = if enable {
                let torque = (torque / servo.gear) as f32;
                codec::torque_frame(servo.id, torque, servo.most, watchdog, &self.format)
            } else {
                codec::stop_frame(servo.id, watchdog)
            };
            if !enable
                && servo.off
                && servo.position.saturating_abs() > FAR
                && tick.is_multiple_of(EVERY)
                && let Some(near) = servo.set_back()
            {
                codec::write_nearest(&mut frame, near as f32 / STEPS as f32);
            }
            let query =
                if asked == Some(at) { &self.current_query } else { &self.queries[tick as usize % 2] };
            query.serialize(&mut frame);
            text::push(&mut self.outbox, &frame, dialect);
        }
        let wrote = self.line.write(now_ns, &self.outbox);
        let whole = wrote.is_ok_and(|written| written == self.outbox.len());
        self.cut = !whole;
        whole
    }

    fn telemetry(&self, now_ns: u64, at: usize) -> Telemetry {
        self.servos.get(at).map_or_else(Telemetry::default, |servo| servo.telemetry(now_ns))
    }

    fn release(&mut self) {
        self.line.release();
    }
}
