//! What the driver knows of one moteus servo: its position, its torque, its faults, and whether it
//! may have restarted.

use std::f64::consts::TAU;

use hbot_core::inputs::Complaints;

use super::codec::State;
use super::talk::later_by;
use crate::bus::{ExpectedJoint, JointReading, Obedience, Telemetry, TelemetryLog};

/// A servo reports positions in steps of 1e-5 turns and velocities in steps of 1e-5 turns per
/// second. This is the number of steps in one turn.
pub(super) const STEPS: i64 = 100_000;
/// A servo reports torques in steps of 0.001 N m. This is the number of steps in 1 N m.
const TORQUE_STEPS: f32 = 1000.0;
/// A servo reports currents in steps of 0.001 A. This is the size of a step, A.
const CURRENT_STEP: f32 = 0.001;
/// A torque that a servo reports counts as too large if it exceeds the largest torque of its
/// commands by more than this, N m. The reported torque comes from the measured current, whose
/// noise must not cause a fault. With a motor of 0.1 N m/A, this is 5 A, far more than the noise.
const TOO_STRONG: f32 = 0.5;
/// Largest position of any servo, in steps: 16,000 turns. A servo beyond it is in a fault, because
/// the count wraps at 16,384 turns, which are no whole turns of a joint with another gear.
const TOO_FAR: i32 = 16_000 * STEPS as i32;
/// After a servo has restarted, its zero counts as lost until the servo has reported its motor off
/// in this many answers.
const MET_AGAIN: u32 = 100;
/// Tolerance for the time at which a servo got power, ms. The driver computes this time from each
/// answer: the loop's clock minus the servo's time since power-on. If it is later than before by
/// more than this tolerance, the servo has restarted. Late answers cause smaller differences.
const SLACK_MS: i64 = 500;
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

/// One servo: its constants from the rig file, and the state that its answers have shown.
pub(super) struct Servo {
    pub(super) id: u8,
    pub(super) gear: f64,
    counts_per_turn: i64,
    /// Largest torque that a command allows at the servo's output shaft, N m.
    pub(super) most: f32,
    /// Tick of the newest command that the servo has answered, or `None` before its first answer.
    pub(super) answered: Option<u32>,
    pub(super) reading: JointReading,
    /// The position that the servo last reported, in steps of 1e-5 turns.
    pub(super) position: i32,
    pub(super) turns_off: i64,
    /// Whole turns of the rotor that keep the angle of the joint, and so the zero that a program
    /// started later reads. `None` if no number does: a steer joint whose gear is a fraction.
    back: Option<i64>,
    /// The position near which the servo was asked to be by subtracting whole turns, in steps.
    /// `None` if it has done so.
    pub(super) rezeroing: Option<i64>,
    /// True if the servo reported its motor as off.
    pub(super) off: bool,
    /// Number of answers in a row in which the servo reported that it prepares to run its motor.
    enabling: u32,
    /// How long the servo had had power at bring-up, ms. One that has had it for less time in its
    /// first answer has restarted since then.
    pub(super) met_ms: i64,
    /// Time at which the servo got power, ms on the loop's clock. Negative if it got power before
    /// the loop started.
    pub(super) powered_ms: Option<i64>,
    home: i8,
    /// The temperature that the servo last reported, in degrees Celsius. `i8::MIN` means that it
    /// has no valid temperature.
    temperature: i8,
    /// The servo's zero counts as lost until the servo has reported its motor off in this many more
    /// answers. It is 0 while the zero is valid.
    pub(super) lost: u32,
    /// Current, temperature and complaints, to show them to people.
    log: TelemetryLog,
}

impl Servo {
    pub(super) fn new(joint: &ExpectedJoint) -> Self {
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
            back: match joint.gear {
                gear if gear.fract() == 0.0 => Some(gear as i64),
                _ => (joint.number % 2 == 1).then_some(1),
            },
            rezeroing: None,
            off: false,
            enabling: 0,
            met_ms: 0,
            powered_ms: None,
            home: 0,
            temperature: 0,
            lost: 0,
            log: TelemetryLog::default(),
        }
    }

    /// Stores the state that the servo reported. The parameter `answers` is the number of the tick
    /// whose command the servo answered. The servo reports how long it has had power; subtracting
    /// this from `sent_ms`, the time of the last command on the loop's clock in ms, gives the time
    /// at which it got power. Returns `None` if the state lacks a value that this driver needs.
    pub(super) fn take(&mut self, state: &State, answers: u32, sent_ms: i64) -> Option<()> {
        let uptime_ms = state.uptime_ms.map(|uptime_ms| i64::from(uptime_ms as u32));
        let powered_ms = uptime_ms.map(|uptime_ms| sent_ms - uptime_ms);
        let (mode, position, velocity) = (state.mode?, state.position?, state.velocity?);
        // `complaints` judges the torque.
        state.torque?;
        // Each answer has the registers of one turn, see `Turn`.
        let at_home = state.home.is_some() && state.temperature.is_some();
        if powered_ms.is_none() && !at_home && state.current.is_none() {
            return None;
        }
        self.temperature = state.temperature.unwrap_or(self.temperature);
        self.answered = Some(answers);
        self.off = mode == 0;
        self.enabling = if ENABLING_MODES.contains(&mode) { self.enabling + 1 } else { 0 };
        let since_met = self.powered_ms.is_none() && uptime_ms.is_some_and(|ms| ms < self.met_ms);
        self.look_for_reboot(powered_ms, state.home.unwrap_or(self.home), since_met);
        if position != i32::MIN {
            self.follow(position);
        }
        if velocity != i32::MIN {
            self.reading.rate = f64::from(velocity) / STEPS as f64 * TAU / self.gear;
        }
        Some(())
    }

    /// Records the current, the temperature and the complaints of an answer that arrived at
    /// `now_ns`.
    pub(super) fn log(&mut self, now_ns: u64, state: &State, complaints: Complaints) {
        self.log.hear(now_ns, complaints);
        if self.lost > 0 {
            self.log.restarted(now_ns);
        }
        if let Some(steps) = state.current {
            let current = if steps == i32::MIN { f32::NAN } else { steps as f32 * CURRENT_STEP };
            self.log.current(now_ns, current);
        }
        if let Some(degrees) = state.temperature {
            let temperature = if degrees == i8::MIN { f32::NAN } else { f32::from(degrees) };
            self.log.temperature(now_ns, temperature);
        }
    }

    /// Returns what the servo last reported about itself.
    pub(super) fn telemetry(&self, now_ns: u64) -> Telemetry {
        self.log.at(now_ns)
    }

    /// Checks whether the servo has restarted and so has lost its zero. It has if it got power
    /// later than its earlier answers showed, or if its home state is lower than before. The home
    /// state says how the servo's zero is known. `powered_ms` is the time at which the servo got
    /// power according to its newest answer, in ms on the loop's clock. It is `None` if the answer
    /// does not contain the time since power-on. `since_met` is true if the servo has restarted
    /// since bring-up.
    fn look_for_reboot(&mut self, powered_ms: Option<i64>, home: i8, since_met: bool) {
        let before = self.powered_ms.or(powered_ms);
        let later_by = powered_ms.zip(before).map_or(0, |(now, before)| later_by(now, before));
        if later_by > SLACK_MS || home < self.home || since_met {
            (self.lost, self.powered_ms) = (MET_AGAIN, powered_ms);
            (self.turns_off, self.rezeroing) = (0, None);
        } else {
            self.lost = self.lost.saturating_sub(u32::from(self.off));
            // The clocks of the servo and of the host drift apart, so the stored time follows
            // slowly.
            self.powered_ms = before.map(|before| before + later_by.min(1));
        }
        self.home = home;
    }

    /// Returns the position that the servo must take by subtracting whole turns, in steps. `None`
    /// if there are none to subtract.
    pub(super) fn set_back(&mut self) -> Option<i64> {
        let (position, back) = (i64::from(self.position), self.back? * STEPS);
        let turns = (position + back / 2).div_euclid(back);
        self.rezeroing = (turns != 0).then_some(position - turns * back);
        self.rezeroing
    }

    /// Updates the encoder count from the position that the servo has just reported. If the servo
    /// was asked to subtract whole turns and has now done so, these turns are added again, so that
    /// the count has no jump.
    fn follow(&mut self, position: i32) {
        if self.rezeroing.is_some_and(|near| (i64::from(position) - near).abs() < STEPS) {
            let taken = i64::from(self.position) - i64::from(position);
            self.turns_off += (taken + STEPS / 2).div_euclid(STEPS);
            self.rezeroing = None;
        }
        self.position = position;
        let steps = i64::from(position) + self.turns_off * STEPS;
        // Up to 2^31 turns of up to 2^30 counts need 96 bits. The count keeps the low 32 bits.
        let counts = (i128::from(steps) * i128::from(self.counts_per_turn)).div_euclid(i128::from(STEPS));
        self.reading.count = counts as i32;
    }
}

/// Returns the complaints that follow from the state that a servo reported, such as a fault or a
/// command that was not obeyed. The parameter `answers` is the number of the tick whose command the
/// servo answered. The servo reports its state before it carries out this command, so its mode is
/// compared with the command of one tick earlier.
pub(super) fn complaints(state: &State, servo: &Servo, answers: u32, obedience: &Obedience) -> Complaints {
    let mode = state.mode.unwrap_or(0);
    let fault = state.fault.unwrap_or(0);
    let enabling = ENABLING_MODES.contains(&mode) && servo.enabling < ENABLING;
    let on = mode > *ENABLING_MODES.end() && mode != TIMEOUT;
    let temperature = state.temperature.unwrap_or(servo.temperature);
    let too_strong = state.torque.is_some_and(|torque| {
        torque != i32::MIN && torque.unsigned_abs() as f32 > TORQUE_STEPS * (servo.most + TOO_STRONG)
    });
    let explained = mode == FAULT || mode == TIMEOUT || enabling;
    Complaints {
        fault: mode == FAULT
            || state.position.is_some_and(|at| at.unsigned_abs() > TOO_FAR as u32 && at != i32::MIN),
        watchdog: mode == TIMEOUT,
        // These codes are limits and not faults: the motor gives less torque than commanded.
        overcurrent: on && matches!(fault, 96..=99 | 102) || too_strong,
        overtemperature: on && matches!(fault, 100 | 101) || temperature > TOO_HOT,
        disobeyed: obedience.is_broken(answers.wrapping_sub(1), on, explained),
        not_finite: state.position == Some(i32::MIN)
            || state.velocity == Some(i32::MIN)
            || state.torque == Some(i32::MIN)
            || temperature == i8::MIN,
    }
}
