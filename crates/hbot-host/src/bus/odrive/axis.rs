//! What is known of one axis: where it is, how it is, and whether it may have lost power.
//!
//! An axis says its position in turns as an `f32`, which coarsens with its size, and nothing that
//! tells a restart. Both are settled by *marking*: while the motor is off, the driver sets the
//! position so that it differs from the boot's by whole turns of the joint ([`mark`]). After a
//! restart the position is within [`BOOT_TURNS`] of 0, where a marked one is not.

use hbot_core::inputs::Complaints;

use super::message::{Command, Message, error, state};

/// Counts that the driver makes of a turn: `counts_per_turn` of hbot-config.
pub(super) const COUNTS_PER_TURN: f64 = (1_u32 << 21) as f64;
/// After a restart a position is at most this far from 0, turns: an absolute encoder says where it
/// is in its turn, any other begins at 0. Half a turn is added for what it turns meanwhile.
pub(super) const BOOT_TURNS: f64 = 1.5;
/// No motor is further from where its rates have it after at most [`CLOSE_NS`], turns.
const JUMP_TURNS: f64 = 0.5;
const CLOSE_NS: u64 = 10_000_000;
/// An axis that was silent for longer may have restarted, ns.
const SILENCE_NS: u64 = 250_000_000;
/// An axis without a heartbeat for this time is taken for silent: nobody knows whether it is on,
/// ns.
const HEARTBEAT_NS: u64 = 300_000_000;
/// A joint stands still below this rate of its encoder, turns a second: setting a position costs
/// what it turns within some milliseconds.
const STILL: f64 = 0.01;
/// A position is too coarse where its steps are more than this part of a turn of the joint.
const COARSEST: f64 = 1.0 / 8192.0;
/// Steps of an `f32` are at most this part of it.
const STEP: f64 = 1.0 / 8_388_608.0;
/// How long an axis may take to do what its state was commanded, ticks.
const OFF_TICKS: u32 = 20;
const ON_TICKS: u32 = 300;
/// How long a watchdog that has expired while nobody was there is excused, ticks.
const EXCUSED_TICKS: u32 = 100;
/// Commands that were lost are repeated this often, ticks.
const AGAIN_TICKS: u32 = 100;
/// Closed loop is asked for this often until it is there, ticks.
const ON_AGAIN_TICKS: u32 = 10;
/// A motor or power stage at this temperature is too hot whatever its own limit, degrees Celsius.
const TOO_HOT: f32 = 150.0;
/// A current beyond this is no motor's of such a rig, A.
const TOO_STRONG: f32 = 1000.0;

/// Where a position is set to while the motor is off, turns: whole turns of a joint behind `gear`,
/// so far from 0 that no position within three quarters of a joint's turn of it is one after a
/// restart.
pub(super) fn mark(gear: f64) -> f64 {
    ((BOOT_TURNS + 0.5 + gear) / gear).ceil() * gear
}

/// Whether a position, turns, can be one after a restart.
pub(super) fn may_be_booted(position: f64) -> bool {
    position.abs() <= BOOT_TURNS
}

/// What has to happen before an axis that may have restarted is trusted again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Trust {
    /// It is the one that was met.
    Met,
    /// Its watchdog must expire once: nothing is said to it until it has.
    Proving,
    /// Its position must be marked.
    Marking,
}

/// One axis.
#[derive(Debug, Clone)]
pub(super) struct Axis {
    pub(super) id: u8,
    gear: f64,
    mark: f64,
    /// Turns by which its position was set back since it was met.
    base: f64,
    position: Option<f64>,
    velocity: f64,
    heard_ns: u64,
    heartbeat_ns: u64,
    /// The tick of the newest command before its newest position.
    pub(super) answers: Option<u32>,
    error: u32,
    state: u8,
    /// Its position was set back by this many turns, and does not show it yet.
    set_back: Option<f64>,
    trust: Trust,
    /// It has been in closed loop since motors were switched on.
    was_on: bool,
    /// An expired watchdog is no complaint until this tick, or until it is seen mended.
    excused_until: Option<u32>,
    /// When its errors were cleared last.
    cleared: Option<u32>,
    /// Its last position was no number.
    broken: bool,
    /// Complaints of currents and temperatures.
    measured: Complaints,
}

/// What the driver has commanded last.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Order {
    pub(super) on: bool,
    /// The tick since which it holds.
    pub(super) since: u32,
}

impl Order {
    fn age(self, tick: u32) -> u32 {
        tick.wrapping_sub(self.since)
    }
}

impl Axis {
    /// An axis that has just been met.
    pub(super) fn new(id: u8, gear: f64) -> Self {
        Self {
            id,
            gear,
            mark: mark(gear),
            base: 0.0,
            position: None,
            velocity: 0.0,
            heard_ns: 0,
            heartbeat_ns: 0,
            answers: None,
            error: 0,
            state: state::UNDEFINED,
            set_back: None,
            trust: Trust::Met,
            was_on: false,
            excused_until: None,
            cleared: None,
            broken: false,
            measured: Complaints::default(),
        }
    }

    /// The line was gone, and the axis has been met again. Its count goes on.
    pub(super) fn met_again(&mut self) {
        let Self { id, gear, base, answers, .. } = *self;
        *self = Self { base, answers, ..Self::new(id, gear) };
    }

    /// The count of its encoder.
    pub(super) fn count(&self) -> i32 {
        let turns = self.position.unwrap_or(self.mark) - self.mark + self.base;
        // Wraps as any counter does.
        (turns * COUNTS_PER_TURN).round() as i64 as i32
    }

    /// The rate of the joint, rad/s.
    pub(super) fn rate(&self) -> f64 {
        self.velocity * std::f64::consts::TAU / self.gear
    }

    /// It may have lost its zero.
    pub(super) fn is_lost(&self) -> bool {
        self.trust != Trust::Met
    }

    /// Takes in what it has said before the command of `tick`.
    pub(super) fn hear(&mut self, now_ns: u64, tick: u32, order: Order, message: &Message) {
        match *message {
            Message::Estimates { position, velocity } => {
                self.estimate(now_ns, tick, f64::from(position), f64::from(velocity));
            }
            Message::Heartbeat { error, state, .. } => self.heartbeat(now_ns, tick, order, error, state),
            Message::Current { measured, setpoint } => {
                let current = measured.abs().max(setpoint.abs());
                self.measured.not_finite = !(measured.is_finite() && setpoint.is_finite());
                self.measured.overcurrent = current > TOO_STRONG;
            }
            Message::Temperature { inverter, motor } => {
                self.measured.overtemperature = inverter > TOO_HOT || motor > TOO_HOT;
            }
            Message::Version { .. } | Message::Errors { .. } | Message::Supply { .. } => {}
        }
    }

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
        }
        if self.trust == Trust::Marking && !may_be_booted(position) {
            self.trust = Trust::Met;
        }
        (self.position, self.velocity, self.heard_ns) = (Some(position), velocity, now_ns);
        if now_ns.saturating_sub(self.heartbeat_ns) <= HEARTBEAT_NS {
            self.answers = Some(tick.wrapping_sub(1));
        }
    }

    fn heartbeat(&mut self, now_ns: u64, tick: u32, order: Order, error: u32, state: u8) {
        self.heartbeat_ns = now_ns;
        (self.error, self.state) = (error, state);
        if error & error::WATCHDOG_TIMER_EXPIRED == 0 {
            // While motors are off nobody is hurt by it, and a command may still be missing.
            self.excused_until = self.excused_until.filter(|_| !order.on);
        } else if self.trust == Trust::Proving {
            self.trust = Trust::Marking;
        }
        let on = state == state::CLOSED_LOOP;
        if on && order.on {
            self.was_on = true;
        }
        // Off without a reason: it has restarted, or somebody else commands it.
        let dropped = order.on && self.was_on && !on && error == 0;
        let starting = state == state::UNDEFINED || error & error::INITIALIZING != 0;
        if self.trust == Trust::Met && (dropped && order.age(tick) > OFF_TICKS || starting) {
            self.distrust();
        }
    }

    fn distrust(&mut self) {
        (self.trust, self.base, self.set_back) = (Trust::Proving, 0.0, None);
    }

    /// What it complains of at `tick`.
    pub(super) fn complaints(&self, tick: u32, order: Order) -> Complaints {
        let has = |bits: u32| self.error & bits != 0;
        let excused =
            self.is_lost() || self.excused_until.is_some_and(|until| until.wrapping_sub(tick) as i32 > 0);
        let on = self.state == state::CLOSED_LOOP;
        let disobeyed = if order.on {
            let late = order.age(tick) > ON_TICKS;
            !on && self.error == 0 && !self.is_lost() && (self.was_on || late)
        } else {
            on && order.age(tick) > OFF_TICKS
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

    /// Appends the command of `tick` with a torque of the joint, N m.
    pub(super) fn command(&mut self, tick: u32, order: Order, torque: f64, line: &mut Vec<u8>) {
        let age = order.age(tick);
        if age == 0 {
            self.was_on = false;
        }
        if !order.on || self.is_lost() {
            return self.command_off(tick, age, line);
        }
        Command::InputTorque((torque / self.gear) as f32).write(self.id, line);
        if age == 0 {
            Command::TorqueMode.write(self.id, line);
        }
        let waits = !self.was_on && self.state != state::CLOSED_LOOP;
        if age == 0 || waits && age < ON_TICKS && age.is_multiple_of(ON_AGAIN_TICKS) {
            Command::AxisState(state::CLOSED_LOOP).write(self.id, line);
        }
    }

    /// Appends the command of `tick` that leaves the motor off, or switches it off. `age`: ticks
    /// since it was asked for.
    fn command_off(&mut self, tick: u32, age: u32, line: &mut Vec<u8>) {
        let is_off = self.state == state::IDLE && age > OFF_TICKS;
        if self.trust == Trust::Proving && is_off {
            // Its watchdog is to expire.
            return;
        }
        // Every other tick: a message of either kind feeds the watchdog, so that each takes as much
        // of the bus.
        if age == 0 || !is_off && tick.is_multiple_of(2) {
            Command::AxisState(state::IDLE).write(self.id, line);
        }
        if age == 0 || is_off || !tick.is_multiple_of(2) {
            Command::InputTorque(0.0).write(self.id, line);
        }
        let again = self.cleared.is_none_or(|cleared| tick.wrapping_sub(cleared) >= AGAIN_TICKS);
        if self.error != 0 && self.trust != Trust::Proving && again {
            self.cleared = Some(tick);
            self.excuse(tick);
            Command::ClearErrors.write(self.id, line);
        } else if tick.wrapping_add(u32::from(self.id)).is_multiple_of(AGAIN_TICKS) {
            // The axes of a line after one another.
            self.set_back(line);
        }
    }

    /// Its watchdog may have expired while nobody commanded it.
    pub(super) fn excuse(&mut self, tick: u32) {
        self.excused_until = Some(tick.wrapping_add(EXCUSED_TICKS));
    }

    /// Sets the position back to where it is marked, or fine again, where the motor is off and
    /// stands still.
    fn set_back(&mut self, line: &mut Vec<u8>) {
        self.set_back = None;
        let Some(position) = self.position else { return };
        let turns = if self.trust == Trust::Marking {
            -self.mark
        } else {
            // Whole turns of the joint: its angle is also known to a program that is started later.
            ((position - self.mark) / self.gear).round() * self.gear
        };
        let near = (position - self.mark).abs() <= 0.75 * self.gear;
        let marked = self.trust == Trust::Met && near;
        if marked || self.state != state::IDLE || self.velocity.abs() > STILL {
            return;
        }
        let there = (position - turns) as f32;
        if self.trust == Trust::Met {
            self.set_back = Some(position - f64::from(there));
        } else {
            Command::TorqueMode.write(self.id, line);
        }
        Command::AbsolutePosition(there).write(self.id, line);
    }
}
