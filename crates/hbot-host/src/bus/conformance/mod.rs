//! A test suite for drivers of motor buses, independent of their protocol. Run it against your
//! driver.
//!
//! The suite needs the driver's [`Protocol`] and virtual [`Controllers`] that speak it. It stands
//! between the two: it loses, delays, doubles, cuts and garbles bytes, lets the line vanish and
//! come back, and looks at what the bus says and what the motors do. See `docs/drivers.md`.
//!
//! ```
//! use hbot_host::bus::conformance::{CASES, Subject};
//!
//! /// Returns the cases that a driver fails, with what it does instead.
//! fn broken(driver: &Subject) -> Vec<(&'static str, String)> {
//!     CASES
//!         .iter()
//!         .filter_map(|case| case.run(driver).err().map(|what| (case.name, what)))
//!         .collect()
//! }
//! ```

mod cases;
mod wire;

use crate::bus::{BusCommand, Expected, Heard, MotorBus, Protocol, Reports};
use crate::line::Renewed;
use hbot_core::MAX_JOINTS;

pub use self::cases::CASES;
use self::wire::{Tap, Wire};

/// Virtual motor controllers at the far end of a line, against which the suite tests a driver.
pub trait Controllers: Send {
    /// Passes `bytes` to the controllers at `now_ns`. Appends to `answer` first what they have sent
    /// unasked until then, and then all their answers at once. It is also called without any bytes.
    fn hear(&mut self, now_ns: u64, bytes: &[u8], answer: &mut Vec<u8>);

    /// Returns the torque that each motor gives at `now_ns`, N m, in the order of the bus and with
    /// its controller's sign. It is zero for a motor that is off or whose watchdog has expired.
    fn torque(&mut self, now_ns: u64) -> Vec<f64>;

    /// Simulates a loss of power that ends at once.
    fn lose_power(&mut self);
}

/// A driver under test, with virtual controllers that use its protocol.
pub struct Subject {
    /// The driver under test.
    pub protocol: &'static dyn Protocol,
    /// The controllers that the driver must expect on the line.
    pub expected: Expected,
    /// Creates new controllers in their state after power-on.
    pub controllers: fn() -> Box<dyn Controllers>,
    /// Torques that the motors can give, N m: one for each joint, none of them zero.
    pub torque: Vec<f64>,
}

/// One requirement that every driver must meet, with its test.
pub struct Case {
    /// The requirement in words.
    pub name: &'static str,
    run: fn(&Subject) -> Result<(), String>,
}

impl Case {
    /// Tests whether a driver meets the requirement.
    ///
    /// # Errors
    /// Returns what the driver did instead.
    pub fn run(&self, subject: &Subject) -> Result<(), String> {
        (self.run)(subject)
    }
}

/// Runs all cases of the conformance suite on a driver.
///
/// # Panics
/// Panics if the driver fails a case. The message lists all failed cases and what the driver did.
pub fn assert_conforms(subject: &Subject) {
    let failed: Vec<String> = CASES
        .iter()
        .filter_map(|case| case.run(subject).err().map(|what| format!("{}: {what}", case.name)))
        .collect();
    assert!(failed.is_empty(), "{} of {} cases:\n{}", failed.len(), CASES.len(), failed.join("\n"));
}

/// Period of the suite's ticks, ns.
const PERIOD_NS: u64 = 1_000_000;
/// Watchdog time of the suite's commands, ms.
const WATCHDOG_MS: u16 = 20;

/// A bus, its virtual controllers, and the line between them.
struct Bench {
    bus: Box<dyn MotorBus>,
    tap: Tap,
    torque: [f64; MAX_JOINTS],
    joints: usize,
    tick: u32,
    reports: Reports,
}

impl Bench {
    /// Creates virtual controllers, lets the driver identify them, and creates the driver's bus.
    fn new(subject: &Subject) -> Result<Self, String> {
        let (mut wire, tap) = Wire::new((subject.controllers)());
        let met = subject.protocol.meet(&mut wire, &subject.expected);
        met.map_err(|error| format!("meeting good controllers: {error}"))?;
        tap.begin();
        let mut torque = [0.0; MAX_JOINTS];
        torque[..subject.torque.len()].copy_from_slice(&subject.torque);
        let bus = subject.protocol.bus(Box::new(wire), subject.expected.clone());
        let (joints, reports) = (subject.torque.len(), subject.protocol.reports());
        Ok(Self { bus, tap, torque, joints, tick: 1, reports })
    }

    /// Creates a bus and commands torque for 20 ticks, so that its motors are on.
    fn pushing(subject: &Subject) -> Result<Self, String> {
        let mut bench = Self::new(subject)?;
        for _ in 0..20 {
            bench.tick(true);
        }
        bench.expect_torque(true)?;
        Ok(bench)
    }

    fn now_ns(&self) -> u64 {
        u64::from(self.tick) * PERIOD_NS
    }

    /// Returns the command of the next tick, with the subject's torques if `enable` is true and
    /// with zero torque otherwise.
    fn order(&self, enable: bool) -> BusCommand {
        let torque = if enable { self.torque } else { [0.0; MAX_JOINTS] };
        BusCommand { tick: self.tick, enable, watchdog_ms: WATCHDOG_MS, torque }
    }

    /// Runs one tick: reads, then writes a command. Returns what was received and whether the
    /// command was accepted.
    fn tick_taken(&mut self, enable: bool) -> (Heard, bool) {
        let heard = self.bus.receive(self.now_ns(), self.tick);
        let taken = self.bus.command(self.now_ns(), &self.order(enable));
        self.tick += 1;
        (heard, taken)
    }

    fn tick(&mut self, enable: bool) -> Heard {
        self.tick_taken(enable).0
    }

    /// Returns the torque that each virtual motor gives now, N m.
    fn motors(&self) -> Vec<f64> {
        self.tap.torque(self.now_ns())
    }

    /// Checks that the motors give the commanded torque, or none if `on` is false.
    fn expect_torque(&self, on: bool) -> Result<(), String> {
        let motors = self.motors();
        let asked = if on { self.torque } else { [0.0; MAX_JOINTS] };
        let near = |(is, asked): (&f64, &f64)| (is - asked).abs() <= 0.01 * asked.abs();
        let right = motors.len() == self.joints && motors.iter().zip(&asked).all(near);
        let words = if on { "as asked" } else { "off" };
        expect(right, || format!("motors give {motors:?} N m in tick {}, not {words}", self.tick))
    }

    /// Runs one tick, and checks that its reading answers the previous command without complaints.
    fn expect_good(&mut self, enable: bool) -> Result<(), String> {
        let last = self.tick - 1;
        let heard = self.tick(enable);
        let answers = heard.reading.map(|reading| reading.answers);
        let good = answers == Some(last)
            && heard.complaints == Default::default()
            && !(heard.zeros_lost || heard.reopened);
        expect(good, || format!("the answer to tick {last} was heard as {heard:?}"))
    }

    /// Runs up to `ticks` + 1 ticks, and checks that one of them has a good reading.
    fn expect_recovery(&mut self, enable: bool, ticks: u32) -> Result<(), String> {
        let mut outcome = Ok(());
        for _ in 0..=ticks {
            outcome = self.expect_good(enable);
            if outcome.is_ok() {
                return Ok(());
            }
        }
        outcome.map_err(|what| format!("after {ticks} ticks there is no good reading again: {what}"))
    }
}

fn expect(right: bool, otherwise: impl FnOnce() -> String) -> Result<(), String> {
    if right { Ok(()) } else { Err(otherwise()) }
}
