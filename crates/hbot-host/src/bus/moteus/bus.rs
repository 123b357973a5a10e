//! The bus of a line of moteus servos.

use std::f64::consts::TAU;

use hbot_core::MAX_JOINTS;
use hbot_core::inputs::Complaints;
use moteus_protocol::command::PositionFormat;
use moteus_protocol::query::QueryFormat;

use super::codec::{self, State};
use super::text::{self, BREAK, Inbox, LONGEST, Said};
use crate::bus::{BusCommand, Expected, ExpectedJoint, Heard, JointReading, MotorBus, Obedience, Reading};
use crate::line::Line;

/// Steps of a position or velocity in a turn.
const STEPS: i64 = 100_000;
/// An idle servo further from 0 than this has whole turns taken off its position, which is a 32-bit
/// float in the servo and coarsens: steps of 1e-5 turns end at 168 turns.
const FAR: i32 = 100 * STEPS as i32;
/// Positions end at 21474 turns. A servo further than this is a fault.
const TOO_FAR: i32 = 20_000 * STEPS as i32;
/// An idle servo is asked this often to take turns off, ticks.
const EVERY: u32 = 100;
/// Of a servo that has got power anew the zero counts as lost for this long after, readings.
const MET_AGAIN: u32 = 100;
/// By how much the time since power-on may seem to jump back in a run, ms: answers are late by
/// less.
const SLACK_MS: i64 = 500;
/// An answer older than this is none to a command of this bus, ticks.
const OLDEST: u32 = 1000;
/// Readings in which a servo may prepare to operate (modes 2 to 4) without having disobeyed.
const ENABLING: u32 = 100;
/// A board at this temperature is too hot whatever its own limit, degrees Celsius.
const TOO_HOT: i8 = 120;

/// Modes of a servo.
const FAULT: i8 = 1;
const ENABLING_MODES: std::ops::RangeInclusive<i8> = 2..=4;
const TIMEOUT: i8 = 11;

/// A line of servos.
pub(super) struct MoteusBus {
    line: Box<dyn Line>,
    servos: Vec<Servo>,
    /// What is read of the line; its dialect is that of the meeting.
    inbox: Inbox,
    expected: Expected,
    received: [u8; 4096],
    outbox: Vec<u8>,
    format: PositionFormat,
    query: QueryFormat,
    obedience: Obedience,
    /// The last command: its tick, watchdog time and when it was sent.
    last: Option<Sent>,
    /// The oldest of the newest answers of all servos, as the last reading had it.
    answered: Option<u32>,
    /// The line took only a part of the last command.
    cut: bool,
}

#[derive(Debug, Clone, Copy)]
struct Sent {
    tick: u32,
    watchdog_ms: u16,
    now_ns: u64,
}

/// One servo.
struct Servo {
    id: u8,
    gear: f64,
    counts_per_turn: i64,
    /// The most that its output may give, N m.
    most: f32,
    /// The newest command that it has answered.
    answered: Option<u32>,
    reading: JointReading,
    /// Its position, steps, and the whole turns that were taken off it.
    position: i32,
    turns_off: i64,
    /// It was asked to take turns off, and has not done so yet.
    rezeroing: bool,
    /// It is off.
    off: bool,
    /// Readings in a row in which it prepared to operate.
    enabling: u32,
    /// When it got power, ms of the loop; and how its zero is known.
    powered_ms: Option<i64>,
    home: i8,
    /// Readings until its zero no longer counts as lost.
    lost: u32,
}

impl Servo {
    fn new(joint: &ExpectedJoint) -> Self {
        Self {
            id: joint.id,
            gear: joint.gear,
            counts_per_turn: i64::from(joint.counts_per_turn),
            // A little more than the peak, so that the peak itself is not at the limit.
            most: (1.05 * joint.peak / joint.gear) as f32,
            answered: None,
            reading: JointReading::default(),
            position: 0,
            turns_off: 0,
            rezeroing: false,
            off: false,
            enabling: 0,
            powered_ms: None,
            home: 0,
            lost: 0,
        }
    }

    /// Takes a state in that answers the command of `answers`, sent `sent_ms` after the start.
    fn take(&mut self, state: &State, answers: u32, sent_ms: i64) -> Option<()> {
        let uptime_ms = i64::from(state.uptime_ms? as u32);
        let (mode, home) = (state.mode?, state.home?);
        let (position, velocity) = (state.position?, state.velocity?);
        self.answered = Some(answers);
        self.off = mode == 0;
        self.enabling = if ENABLING_MODES.contains(&mode) { self.enabling + 1 } else { 0 };
        self.look_for_reboot(sent_ms - uptime_ms, home);
        if position != i32::MIN {
            self.follow(position);
        }
        if velocity != i32::MIN {
            self.reading.rate = f64::from(velocity) / STEPS as f64 * TAU / self.gear;
        }
        Some(())
    }

    /// Sees when the servo got power, and how its zero is known.
    fn look_for_reboot(&mut self, powered_ms: i64, home: i8) {
        let before = *self.powered_ms.get_or_insert(powered_ms);
        if powered_ms > before + SLACK_MS || home < self.home {
            (self.lost, self.powered_ms) = (MET_AGAIN, Some(powered_ms));
            (self.turns_off, self.rezeroing) = (0, false);
        } else {
            self.lost = self.lost.saturating_sub(u32::from(self.off));
            // Its clock is not the host's.
            self.powered_ms = Some(powered_ms.min(before + 1));
        }
        self.home = home;
    }

    /// Follows the position, from which whole turns may have been taken off.
    fn follow(&mut self, position: i32) {
        if self.rezeroing && position.abs() < STEPS as i32 {
            let taken = i64::from(self.position) - i64::from(position);
            self.turns_off += (taken + STEPS / 2).div_euclid(STEPS);
            self.rezeroing = false;
        }
        self.position = position;
        let steps = i64::from(position) + self.turns_off * STEPS;
        // At most 2^31 turns of at most 2^30 counts: 96 bits, of which a count keeps the low 32.
        let counts = (i128::from(steps) * i128::from(self.counts_per_turn)).div_euclid(i128::from(STEPS));
        self.reading.count = counts as i32;
    }
}

impl MoteusBus {
    pub(super) fn new(line: Box<dyn Line>, expected: Expected) -> Self {
        let joints = (0..expected.joints()).filter_map(|at| expected.joint(at));
        Self {
            line,
            servos: joints.map(Servo::new).collect(),
            inbox: Inbox::new(super::dialect(&expected)),
            received: [0; 4096],
            outbox: Vec::with_capacity(BREAK.len() + expected.joints() * LONGEST),
            format: codec::torque_format(),
            query: codec::state_query(),
            obedience: Obedience::default(),
            last: None,
            answered: None,
            cut: false,
            expected,
        }
    }

    /// Takes what a line says.
    fn take(&mut self, said: Said, heard: &mut Heard) {
        let frame = match said {
            Said::Taken => return,
            // A command was damaged on its way.
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
        heard.complaints = heard.complaints.or(complaints(&state, servo, answers, &self.obedience));
        let newer = servo.answered.is_none_or(|last| answers.wrapping_sub(last) as i32 > 0);
        // The time of the last command stands in for that of the one answered: a late answer makes
        // the servo seem younger by its delay, which is within the slack.
        if newer && servo.take(&state, answers, (sent.now_ns / 1_000_000) as i64).is_none() {
            heard.damaged = heard.damaged.saturating_add(1);
        }
    }

    /// The reading of all servos, as old as the oldest answer, where that is newer than before.
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
            // The thread that reopens lines has met these servos already.
            self.inbox = Inbox::new(super::dialect(&self.expected));
            // It has also switched them off, so the commands of before say nothing about their
            // modes.
            (self.cut, self.obedience) = (false, Obedience::default());
            for servo in &mut self.servos {
                (servo.powered_ms, servo.lost) = (None, 0);
                if renewed.rebooted {
                    (servo.turns_off, servo.rezeroing) = (0, false);
                }
            }
        }
        // At most 4 x 4096 bytes; the rest waits for the next tick.
        for _ in 0..4 {
            let n = self.line.read(now_ns, &mut self.received).unwrap_or(0);
            for at in 0..n {
                if let Some((said, _)) = self.inbox.take(self.received[at]) {
                    self.take(said, &mut heard);
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
        for (servo, torque) in self.servos.iter_mut().zip(&command.torque) {
            let mut frame = if enable {
                let torque = (torque / servo.gear) as f32;
                codec::torque_frame(servo.id, torque, servo.most, watchdog, &self.format)
            } else {
                codec::stop_frame(servo.id, watchdog)
            };
            if !enable && servo.off && servo.position.saturating_abs() > FAR && tick.is_multiple_of(EVERY) {
                servo.rezeroing = true;
                codec::write_nearest_zero(&mut frame);
            }
            self.query.serialize(&mut frame);
            text::push(&mut self.outbox, &frame, dialect);
        }
        let wrote = self.line.write(now_ns, &self.outbox);
        let whole = wrote.is_ok_and(|written| written == self.outbox.len());
        self.cut = !whole;
        whole
    }

    fn release(&mut self) {
        self.line.release();
    }
}

/// What a state complains of. It is the servo's before the command that it answers, so it agrees
/// with the command of the tick before.
fn complaints(state: &State, servo: &Servo, answers: u32, obedience: &Obedience) -> Complaints {
    let mode = state.mode.unwrap_or(0);
    let fault = state.fault.unwrap_or(0);
    let enabling = ENABLING_MODES.contains(&mode) && servo.enabling < ENABLING;
    let on = mode > *ENABLING_MODES.end() && mode != TIMEOUT;
    let explained = mode == FAULT || mode == TIMEOUT || enabling;
    Complaints {
        fault: mode == FAULT
            || state.position.is_some_and(|at| at.unsigned_abs() > TOO_FAR as u32 && at != i32::MIN),
        watchdog: mode == TIMEOUT,
        // Limits, not faults: the motor gives less than it is asked for.
        overcurrent: on && matches!(fault, 96..=99 | 102),
        overtemperature: on && matches!(fault, 100 | 101) || state.temperature.is_some_and(|t| t > TOO_HOT),
        disobeyed: obedience.is_broken(answers.wrapping_sub(1), on, explained),
        not_finite: state.position == Some(i32::MIN)
            || state.velocity == Some(i32::MIN)
            || state.temperature == Some(i8::MIN),
    }
}
