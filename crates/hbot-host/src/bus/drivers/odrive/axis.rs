//! What the driver knows of one ODrive axis: its position, its state and errors, and whether it may
//! have restarted.
//!
//! An axis sends its position in turns as an `f32`, whose steps widen with its size. No message
//! tells that an axis has restarted. *Marking* solves both problems: while the motor is off, the
//! driver moves the position by whole turns of the joint until it is near the mark ([`mark`]).
//! After a restart a position is within [`BOOT_TURNS`] of 0. A marked position is further away.

mod command;

use hbot_core::inputs::Complaints;

use super::message::{Message, error, state};
use super::order::{Order, Times};
use super::trip::RoundTrip;
use crate::bus::{Telemetry, TelemetryLog};

/// Encoder counts per turn that the driver reports. Equals `counts_per_turn` of this protocol in
/// hbot-config.
pub(super) const COUNTS_PER_TURN: f64 = (1_u32 << 21) as f64;
/// Largest distance from 0 that the position of an axis can have soon after a restart, in turns. An
/// absolute encoder starts within one turn of 0, any other encoder at 0. Half a turn is added for
/// motion after the restart.
pub(super) const BOOT_TURNS: f64 = 1.5;
/// Distance of the first position from the mark above which the driver leaves whole turns of the
/// joint out of the count, in turns of the encoder. The count wraps at 1024.
const FAR_TURNS: f64 = 512.0;
/// Largest plausible difference between a position and the position that the velocities predict, in
/// turns. A larger difference counts as a jump, which can mean a restart.
const JUMP_TURNS: f64 = 0.5;
/// Longest time between two positions, in ns, for which any jump between them counts as a restart.
/// After a longer time, a jump counts only if it ends within [`BOOT_TURNS`] of 0.
const CLOSE_NS: u64 = 10_000_000;
/// Time without a position after which an axis can have restarted unnoticed, in ns. It counts as
/// restarted if its next position is within [`BOOT_TURNS`] of 0.
const SILENCE_NS: u64 = 250_000_000;
/// Longest time without a heartbeat before an axis counts as silent, in ns. Only heartbeats report
/// whether the motor is on.
const HEARTBEAT_NS: u64 = 300_000_000;
/// Velocity of the encoder below which a joint counts as standing still, in turns per second. A new
/// position is only set at standstill, because the motion during the few milliseconds of setting it
/// is lost.
const STILL: f64 = 0.01;
/// Widest accepted steps between neighbouring `f32` positions, as a fraction of a turn of the
/// joint. An axis whose steps are wider reports a fault.
const COARSEST: f64 = 1.0 / 8192.0;
/// Upper bound for the distance between neighbouring `f32` values, as a fraction of the value.
const STEP: f64 = 1.0 / 8_388_608.0;
/// Temperature of a motor or power stage above which the driver reports overtemperature, whatever
/// limit is set in the ODrive, in degrees Celsius.
const TOO_HOT: f32 = 150.0;
/// Current above which the driver reports overcurrent, in A. No motor of such a rig takes as much.
const TOO_STRONG: f32 = 1000.0;

/// Returns the mark of an axis with the gear ratio `gear`, in turns of the encoder. While its motor
/// is off, the driver keeps the position of the axis near the mark, so that a restart can be
/// detected. The mark is a whole number of turns of the joint. It is so far from 0 that no position
/// within three quarters of a turn of the joint from it is possible after a restart.
pub(super) fn mark(gear: f64) -> f64 {
    ((BOOT_TURNS + 0.5 + gear) / gear).ceil() * gear
}

/// Returns whether `position`, in turns, is near enough to 0 for an axis that has just restarted.
pub(super) fn may_be_booted(position: f64) -> bool {
    position.abs() <= BOOT_TURNS
}

/// What must happen before the driver trusts an axis that may have restarted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Trust {
    /// Nothing: the axis is trusted, because it has not restarted since bring-up.
    Met,
    /// The watchdog of the axis must expire once, to show that it works. After its motor is off,
    /// the axis gets no message until then.
    Proving,
    /// The watchdog did not expire while the motor was off, and neither did it at bring-up. The
    /// axis is switching its motor on, at zero torque, since this tick.
    Arming(u32),
    /// The motor is on at zero torque. The axis gets no message since this tick, so that its
    /// watchdog must switch the motor off.
    Armed(u32),
    /// The watchdog did not expire while the motor was on. The motor is kept off, and the axis is
    /// never trusted again.
    Unproven,
    /// The watchdog has expired. The position must still be marked.
    Marking,
}

/// State of one ODrive axis, as far as its messages show it.
#[derive(Debug, Clone)]
pub(super) struct Axis {
    pub(super) id: u8,
    gear: f64,
    times: Times,
    mark: f64,
    /// Turns of the encoder by which the driver has moved the position of the axis back since
    /// bring-up. The reported encoder count includes them.
    base: f64,
    position: Option<f64>,
    velocity: f64,
    heard_ns: u64,
    heartbeat_ns: u64,
    /// The tick of the last command that was sent before the newest position arrived.
    arrived: Option<u32>,
    /// The tick of the oldest command that the newest position can answer. `None` until the round
    /// trip is known.
    pub(super) answers: Option<u32>,
    /// The round trip of questions to the axis.
    pub(super) trip: RoundTrip,
    error: u32,
    state: u8,
    /// Turns of the encoder by which the driver has just moved the position of the axis back.
    /// `None` after a position has arrived that includes the move.
    set_back: Option<f64>,
    trust: Trust,
    /// Whether bring-up has seen the watchdog expire only while the motor was on.
    proved_armed: bool,
    /// Tick since which the axis gets no message, so that its watchdog expires.
    quiet_since: Option<u32>,
    /// Whether the axis has been in closed loop since the motors were last commanded on.
    was_on: bool,
    /// Tick until which an expired watchdog is not a complaint. `None` after a heartbeat has shown,
    /// while motors are on, that the error is gone.
    excused_until: Option<u32>,
    /// Tick at which the errors of this axis were last cleared.
    cleared: Option<u32>,
    /// Whether the last position or velocity was not a finite number.
    broken: bool,
    /// Complaints from the last measured current and temperatures.
    measured: Complaints,
    /// Current, temperature and complaints, to show them to people.
    log: TelemetryLog,
}

impl Axis {
    /// Returns the state of axis `id` after bring-up, before any message has arrived. `gear` is the
    /// number of turns of the encoder for one turn of the joint. `proved_armed` is true if bring-up
    /// has seen the watchdog expire only while the motor was on.
    pub(super) fn new(id: u8, gear: f64, times: Times, proved_armed: bool) -> Self {
        Self {
            id,
            gear,
            times,
            mark: mark(gear),
            base: 0.0,
            position: None,
            velocity: 0.0,
            heard_ns: 0,
            heartbeat_ns: 0,
            arrived: None,
            answers: None,
            trip: RoundTrip::default(),
            error: 0,
            state: state::UNDEFINED,
            set_back: None,
            trust: Trust::Met,
            proved_armed,
            quiet_since: None,
            was_on: false,
            excused_until: None,
            cleared: None,
            broken: false,
            measured: Complaints::default(),
            log: TelemetryLog::default(),
        }
    }

    /// Resets the state after a lost line has been reopened. The encoder count continues.
    pub(super) fn met_again(&mut self) {
        let Self { id, gear, times, base, answers, proved_armed, .. } = *self;
        *self = Self { base, answers, ..Self::new(id, gear, times, proved_armed) };
    }

    /// Returns the encoder count: the turns of the encoder from the mark, multiplied by
    /// [`COUNTS_PER_TURN`]. It includes the turns by which the driver has moved the position back.
    pub(super) fn count(&self) -> i32 {
        let turns = self.position.unwrap_or(self.mark) - self.mark + self.base;
        // Wraps around like any counter.
        (turns * COUNTS_PER_TURN).round() as i64 as i32
    }

    /// Returns the rate of the joint, in rad/s, from the last velocity of its encoder.
    pub(super) fn rate(&self) -> f64 {
        self.velocity * std::f64::consts::TAU / self.gear
    }

    /// Returns whether the axis may have restarted and so may have lost its zero.
    pub(super) fn is_lost(&self) -> bool {
        self.trust != Trust::Met
    }

    /// Updates the state with a message that arrived before the command of `tick`. `order` tells
    /// whether the motors are commanded on, and since when.
    pub(super) fn hear(&mut self, now_ns: u64, tick: u32, order: Order, message: &Message) {
        if self.trip.hear(tick, message) && self.arrived == Some(tick.wrapping_sub(1)) {
            // The position came just before the first answer.
            self.date(tick);
        }
        match *message {
            Message::Estimates { position, velocity } => {
                self.estimate(now_ns, tick, f64::from(position), f64::from(velocity));
            }
            Message::Heartbeat { error, state, .. } => self.heartbeat(now_ns, tick, order, error, state),
            Message::Current { measured, setpoint } => {
                let current = measured.abs().max(setpoint.abs());
                self.measured.not_finite = !(measured.is_finite() && setpoint.is_finite());
                self.measured.overcurrent = current > TOO_STRONG;
                self.log.current(now_ns, measured);
            }
            Message::Temperature { inverter, motor } => {
                self.measured.overtemperature = inverter > TOO_HOT || motor > TOO_HOT;
                // The larger of the two that are numbers: a motor without a sensor reports none.
                self.log.temperature(now_ns, inverter.max(motor));
            }
            Message::Version { .. } | Message::Errors { .. } | Message::Supply { .. } => {}
        }
        let complaints = self.complaints(tick, order);
        self.log.hear(now_ns, complaints);
        if self.is_lost() {
            self.log.restarted(now_ns);
        }
    }

    /// Returns what the axis last reported about itself.
    pub(super) fn telemetry(&self, now_ns: u64) -> Telemetry {
        self.log.at(now_ns)
    }

    /// Updates the state with a position and a velocity, in turns and turns per second, and checks
    /// whether they show a restart.
    fn estimate(&mut self, now_ns: u64, tick: u32, position: f64, velocity: f64) {
        self.broken = !(position.is_finite() && velocity.is_finite());
        if self.broken {
            return;
        }
        if let (Some(turns), Some(last)) = (self.set_back, self.position)
            && (position - (last - turns)).abs() < turns.abs() / 2.0
        {
            (self.set_back, self.base) = (None, self.base + turns);
        } else if let Some(last) = self.position {
            let silent_ns = now_ns.saturating_sub(self.heard_ns);
            let turned = 0.5 * (self.velocity + velocity) * silent_ns as f64 * 1e-9;
            let jumped = (position - last - turned).abs() > JUMP_TURNS;
            let booted = may_be_booted(position) && (jumped || silent_ns > SILENCE_NS);
            if self.trust == Trust::Met && (booted || jumped && silent_ns <= CLOSE_NS) {
                self.distrust();
            }
        } else if self.trust == Trust::Met && may_be_booted(position) {
            // Bring-up has marked it.
            self.distrust();
        } else if self.answers.is_none() && (position - self.mark).abs() > FAR_TURNS {
            // Without these whole turns of the joint the count would wrap.
            self.base = -((position - self.mark) / self.gear).round() * self.gear;
        }
        if self.trust == Trust::Marking && !may_be_booted(position) {
            self.trust = Trust::Met;
        }
        (self.position, self.velocity, self.heard_ns) = (Some(position), velocity, now_ns);
        if now_ns.saturating_sub(self.heartbeat_ns) <= HEARTBEAT_NS {
            self.arrived = Some(tick.wrapping_sub(1));
            self.date(tick);
        }
    }

    /// Dates the position that has arrived before the command of `tick`: it can be as old as the
    /// round trip.
    fn date(&mut self, tick: u32) {
        self.answers = self.trip.ticks().map(|ticks| tick.wrapping_sub(ticks)).or(self.answers);
    }

    /// Updates the state with a heartbeat, and checks whether it shows a restart.
    fn heartbeat(&mut self, now_ns: u64, tick: u32, order: Order, error: u32, state: u8) {
        self.heartbeat_ns = now_ns;
        (self.error, self.state) = (error, state);
        if error & error::WATCHDOG_TIMER_EXPIRED == 0 {
            // While motors are off, an expired watchdog does no harm and the next command can still
            // be late. The excuse therefore stays.
            self.excused_until = self.excused_until.filter(|_| !order.on);
        } else if self.trust == Trust::Proving {
            self.trust = Trust::Marking;
        }
        let on = state == state::CLOSED_LOOP;
        match self.trust {
            Trust::Arming(_) if on => self.trust = Trust::Armed(tick),
            Trust::Armed(_) if !on => {
                let expired = error & error::WATCHDOG_TIMER_EXPIRED != 0;
                self.trust = if expired { Trust::Marking } else { Trust::Unproven };
            }
            _ => {}
        }
        if on && order.on {
            self.was_on = true;
        }
        // The motor is off without an error: the axis has restarted, or another program commands
        // it.
        let dropped = order.on && self.was_on && !on && error == 0;
        let starting = state == state::UNDEFINED || error & error::INITIALIZING != 0;
        if self.trust == Trust::Met && (dropped && order.age(tick) > self.times.off || starting) {
            self.distrust();
        }
    }

    /// Treats the axis as restarted: its zero is lost until its watchdog has expired and its
    /// position is marked.
    fn distrust(&mut self) {
        (self.trust, self.base, self.set_back) = (Trust::Proving, 0.0, None);
        self.quiet_since = None;
    }

    /// Returns the complaints of the axis at `tick`. `order` tells whether the motors are commanded
    /// on, and since when.
    pub(super) fn complaints(&self, tick: u32, order: Order) -> Complaints {
        let has = |bits: u32| self.error & bits != 0;
        let excused =
            self.is_lost() || self.excused_until.is_some_and(|until| until.wrapping_sub(tick) as i32 > 0);
        let on = self.state == state::CLOSED_LOOP;
        let disobeyed = if order.on {
            let late = order.age(tick) > self.times.on;
            !on && self.error == 0 && !self.is_lost() && (self.was_on || late)
        } else {
            let tried = matches!(self.trust, Trust::Arming(_) | Trust::Armed(_));
            on && order.age(tick) > self.times.off && !tried
        };
        let coarse = self.position.is_some_and(|position| position.abs() * STEP > COARSEST * self.gear);
        let own = Complaints {
            fault: has(!error::WATCHDOG_TIMER_EXPIRED) || coarse,
            watchdog: has(error::WATCHDOG_TIMER_EXPIRED) && !excused,
            overcurrent: has(error::CURRENT_LIMIT_VIOLATION | error::DC_BUS_OVER_CURRENT),
            overtemperature: has(error::MOTOR_OVER_TEMP | error::INVERTER_OVER_TEMP),
            disobeyed,
            not_finite: self.broken,
        };
        own.or(self.measured)
    }
}
