//! Sends the loop's commands to the moteus servos of one line, and makes readings of their answers.

use std::f64::consts::TAU;

use hbot_core::MAX_JOINTS;
use hbot_core::inputs::Complaints;
use moteus_protocol::command::PositionFormat;
use moteus_protocol::query::QueryFormat;

use super::codec::{self, State};
use super::text::{self, BREAK, Inbox, LONGEST, Said};
use crate::bus::{BusCommand, Expected, ExpectedJoint, Heard, JointReading, MotorBus, Obedience, Reading};
use crate::line::Line;

/// A servo reports positions in steps of 1e-5 turns and velocities in steps of 1e-5 turns per
/// second. This is the number of steps in one turn.
const STEPS: i64 = 100_000;
/// Largest position of a servo whose motor is off, in steps: 100 turns. Beyond it the driver asks
/// the servo to subtract whole turns. A servo stores its position as a 32-bit float, which no
/// longer resolves steps of 1e-5 turns above 168 turns.
const FAR: i32 = 100 * STEPS as i32;
/// Largest position of any servo, in steps: 20,000 turns. A servo beyond it is in a fault, because
/// a position that is sent as a 32-bit integer saturates at 21,474 turns.
const TOO_FAR: i32 = 20_000 * STEPS as i32;
/// Ticks between two requests to subtract whole turns from a servo's position. The driver sends
/// them while the motor is off and the position is large.
const EVERY: u32 = 100;
/// After a servo has restarted, its zero counts as lost until the servo has reported its motor off
/// in this many answers.
const MET_AGAIN: u32 = 100;
/// Tolerance for the time at which a servo got power, ms. The driver computes this time from each
/// answer: the loop's clock minus the servo's time since power-on. If it is later than before by
/// more than this tolerance, the servo has restarted. Late answers cause smaller differences.
const SLACK_MS: i64 = 500;
/// Largest age of an answer, in ticks. The driver cannot assign an older answer to a command, and
/// counts it as foreign.
const OLDEST: u32 = 1000;
/// Number of answers in a row in which a servo can report modes 2 to 4, in which it prepares to run
/// its motor. After that, it counts as disobeying the command to switch its motor on.
const ENABLING: u32 = 100;
/// Board temperature above which the driver reports a servo as too hot, in degrees Celsius. The
/// temperature limit that is set in the servo itself applies as well.
const TOO_HOT: i8 = 120;

/// The modes that a servo reports in register 0x000: in a fault, preparing to run its motor, and
/// stopped because its watchdog expired.
const FAULT: i8 = 1;
const ENABLING_MODES: std::ops::RangeInclusive<i8> = 2..=4;
const TIMEOUT: i8 = 11;

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
    query: QueryFormat,
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

/// One servo: its constants from the rig file, and the state that its answers have shown.
struct Servo {
    id: u8,
    gear: f64,
    counts_per_turn: i64,
    /// Largest torque that a command allows at the servo's output shaft, N m.
    most: f32,
    /// Tick of the newest command that the servo has answered, or `None` before its first answer.
    answered: Option<u32>,
    reading: JointReading,
    /// The position that the servo last reported, in steps of 1e-5 turns.
    position: i32,
    turns_off: i64,
    /// True if the servo was asked to subtract whole turns from its position and has not done so
    /// yet.
    rezeroing: bool,
    /// True if the servo reported its motor as off.
    off: bool,
    /// Number of answers in a row in which the servo reported that it prepares to run its motor.
    enabling: u32,
    /// Time at which the servo got power, ms on the loop's clock. Negative if it got power before
    /// the loop started.
    powered_ms: Option<i64>,
    home: i8,
    /// The servo's zero counts as lost until the servo has reported its motor off in this many more
    /// answers. It is 0 while the zero is valid.
    lost: u32,
}

impl Servo {
    fn new(joint: &ExpectedJoint) -> Self {
        Self {
            id: joint.id,
            gear: joint.gear,
            counts_per_turn: i64::from(joint.counts_per_turn),
            // 5 % above the peak, so that a command of exactly the peak does not reach the servo's
            // limit.
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

    /// Stores the state that the servo reported. The parameter `answers` is the number of the tick
    /// whose command the servo answered. The servo reports how long it has had power; subtracting
    /// this from `sent_ms`, the time of the last command on the loop's clock in ms, gives the time
    /// at which it got power. Returns `None` if the state lacks a value that this driver needs.
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

    /// Checks whether the servo has restarted and so has lost its zero. It has if it got power
    /// later than its earlier answers showed, or if its home state is lower than before. The home
    /// state says how the servo's zero is known. `powered_ms` is the time at which the servo got
    /// power according to its newest answer, in ms on the loop's clock.
    fn look_for_reboot(&mut self, powered_ms: i64, home: i8) {
        let before = *self.powered_ms.get_or_insert(powered_ms);
        if powered_ms > before + SLACK_MS || home < self.home {
            (self.lost, self.powered_ms) = (MET_AGAIN, Some(powered_ms));
            (self.turns_off, self.rezeroing) = (0, false);
        } else {
            self.lost = self.lost.saturating_sub(u32::from(self.off));
            // The clocks of the servo and of the host drift apart, so the stored time follows
            // slowly.
            self.powered_ms = Some(powered_ms.min(before + 1));
        }
        self.home = home;
    }

    /// Updates the encoder count from the position that the servo has just reported. If the servo
    /// was asked to subtract whole turns and has now done so, these turns are added again, so that
    /// the count has no jump.
    fn follow(&mut self, position: i32) {
        if self.rezeroing && position.abs() < STEPS as i32 {
            let taken = i64::from(self.position) - i64::from(position);
            self.turns_off += (taken + STEPS / 2).div_euclid(STEPS);
            self.rezeroing = false;
        }
        self.position = position;
        let steps = i64::from(position) + self.turns_off * STEPS;
        // Up to 2^31 turns of up to 2^30 counts need 96 bits. The count keeps the low 32 bits.
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

    /// Handles the content of one line of text from a servo or the adapter. Stores the state that a
    /// servo's answer contains. Counts damaged and foreign frames in `heard`.
    fn take(&mut self, said: Said, heard: &mut Heard) {
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
        heard.complaints = heard.complaints.or(complaints(&state, servo, answers, &self.obedience));
        let newer = servo.answered.is_none_or(|last| answers.wrapping_sub(last) as i32 > 0);
        // The time of the last command stands in for the time of the command that was answered. A
        // late answer makes the servo seem to have got power later, by its delay, which `SLACK_MS`
        // tolerates.
        if newer && servo.take(&state, answers, (sent.now_ns / 1_000_000) as i64).is_none() {
            heard.damaged = heard.damaged.saturating_add(1);
        }
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
            for servo in &mut self.servos {
                (servo.powered_ms, servo.lost) = (None, 0);
                if renewed.rebooted {
                    (servo.turns_off, servo.rezeroing) = (0, false);
                }
            }
        }
        // Reads at most 4 x 4096 bytes. The rest waits for the next tick.
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

/// Returns the complaints that follow from the state that a servo reported, such as a fault or a
/// command that was not obeyed. The parameter `answers` is the number of the tick whose command the
/// servo answered. The servo reports its state before it carries out this command, so its mode is
/// compared with the command of one tick earlier.
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
        // These codes are limits and not faults: the motor gives less torque than commanded.
        overcurrent: on && matches!(fault, 96..=99 | 102),
        overtemperature: on && matches!(fault, 100 | 101) || state.temperature.is_some_and(|t| t > TOO_HOT),
        disobeyed: obedience.is_broken(answers.wrapping_sub(1), on, explained),
        not_finite: state.position == Some(i32::MIN)
            || state.velocity == Some(i32::MIN)
            || state.temperature == Some(i8::MIN),
    }
}
