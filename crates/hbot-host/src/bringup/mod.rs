//! Bringing a rig up, before any loop is closed over it: one joint at a time under a small torque ([`joint`]), and what the joints
//! say of each other while a person turns the sphere ([`calibrate`]). A wrong sign or zero in a closed loop is a runaway.

pub mod calibrate;
pub mod joint;

#[cfg(test)]
mod tests;

use std::time::Duration;

use hbot_config::{RigConfig, rig as config};
use hbot_core::inputs::{Complaints, JointFeedback};
use hbot_core::outputs::Drive;
use hbot_core::{MAX_JOINTS, Rig};
use hbot_sim::phenomena::Hand;
use thiserror::Error;

use crate::attach::{self, AttachError};
use crate::last_word::Program;
use crate::layout::Layout;
use crate::motors::{Motors, OFF};
use crate::run_loop::{StopFlag, Time};

/// How long a controller holds a torque that no other follows, ms.
const WATCHDOG_MS: u16 = 20;
/// Readings that may be missing in a row.
const PATIENCE: u32 = 50;

/// How many times motors are switched off at the end, in case a frame is lost.
const STOPS: u32 = 3;

/// Why there is no reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum Interrupted {
    /// The line says nothing any more.
    #[error("the motor controllers have stopped answering: motors are off by their own watchdog")]
    Silent,
    /// Somebody wants it to end.
    #[error("stopped by a signal: motors are off")]
    Stopped,
}

/// The rig's motors without a loop: one command, one reading. Motors are switched off when it is
/// dropped.
pub struct Bench {
    motors: Motors,
    rig: Rig,
    tick: u32,
    period: Duration,
    /// The motors are simulated: their time passes with the commands, not with the clock.
    simulated: bool,
    /// Looked at before each command with torque.
    stop: StopFlag,
    notices: Vec<String>,
}

/// Attaches the motors of `rig`. A hand holds the simulated rig and turns it about widely where
/// `turned` is set; otherwise it stands free. Once `stop` is set no further torque is written.
/// `helper` switches the motors off if this process dies.
///
/// # Errors
/// A port does not open, or its controllers are not those of the rig.
pub fn open(rig: &RigConfig, turned: bool, stop: StopFlag, helper: &Program) -> Result<Bench, AttachError> {
    let layout = Layout::of(rig);
    let mut notices = Vec::new();
    let (buses, simulated) = match &rig.link.port {
        config::Port::Sim => {
            let (bus, simulator) = attach::simulated(rig, &layout, Default::default(), Time::Virtual)?;
            let hand = turned.then(|| Hand { amplitude: 0.8, rate: 0.4, ..Hand::default() });
            simulator.post(Box::new(move |rig| rig.set_hand(hand)));
            (vec![bus], true)
        }
        config::Port::Devices(devices) => {
            (attach::serial(rig, devices, &layout, Some(helper), false, &mut notices)?, false)
        }
    };
    let motors = Motors::new(buses, &layout, WATCHDOG_MS);
    let mut bench = Bench::new(&rig.rig, motors, simulated);
    (bench.stop, bench.notices) = (stop, notices);
    Ok(bench)
}

impl Bench {
    /// A bench on motors whose controllers have been met.
    #[must_use]
    pub fn new(rig: &Rig, motors: Motors, simulated: bool) -> Self {
        Self {
            motors,
            rig: *rig,
            tick: 0,
            period: Duration::from_nanos(rig.timing.period_ns),
            simulated,
            stop: StopFlag::default(),
            notices: Vec::new(),
        }
    }

    /// What a user should know about how it runs.
    #[must_use]
    pub fn notices(&self) -> &[String] {
        &self.notices
    }

    /// The rig as its file has it.
    #[must_use]
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// The time between two exchanges, s.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        self.rig.timing.period_s()
    }

    /// One command, with torques in the controllers' own sense or motors off, and the reading that comes back. Waits a period.
    ///
    /// # Errors
    /// Nothing has come for many periods, or somebody wants it to end: then this command has not been written.
    pub fn exchange(&mut self, torque: Option<&[f64; MAX_JOINTS]>) -> Result<JointFeedback, Interrupted> {
        let drive = Drive { enable: torque.is_some(), torque: torque.copied().unwrap_or([0.0; MAX_JOINTS]) };
        let stop = self.stop.clone();
        self.converse(&drive, || stop.is_set())
    }

    /// Switches the motors off: three commands that have been answered.
    ///
    /// # Errors
    /// Nothing has come for many periods.
    pub fn switch_off(&mut self) -> Result<(), Interrupted> {
        (0..STOPS).try_for_each(|_| self.converse(&OFF, || false).map(drop))
    }

    /// Writes the same command until each line has answered it, unless it is to `stop`.
    fn converse(&mut self, drive: &Drive, stop: impl Fn() -> bool) -> Result<JointFeedback, Interrupted> {
        let mut complaints = Complaints::default();
        for _ in 0..PATIENCE {
            if stop() {
                return Err(Interrupted::Stopped);
            }
            let now_ns = self.now_ns();
            // A command that is not taken is missed by the reading that does not come.
            let _ = self.motors.command(now_ns, self.tick, drive);
            self.tick += 1;
            if !self.simulated {
                std::thread::sleep(self.period);
            }
            let news = self.motors.receive(now_ns, self.tick);
            complaints = complaints.or(news.feedback.map_or(complaints, |feedback| feedback.complaints));
            // A controller that has lost power meanwhile counts from another zero.
            complaints.fault |= news.zeros_lost;
            if let Some(feedback) = news.feedback.filter(|_| news.buses_with_reading == self.motors.buses()) {
                return Ok(JointFeedback { complaints, ..feedback });
            }
        }
        Err(Interrupted::Silent)
    }

    /// The time of the coming command, ns.
    fn now_ns(&self) -> u64 {
        u64::from(self.tick) * self.rig.timing.period_ns
    }

    /// The turn of a joint in its controller's sense for so many counts, rad.
    #[must_use]
    pub fn turned(&self, joint: usize, counts: i32) -> f64 {
        f64::from(counts) * self.rig.joints[joint].radians_per_count().abs()
    }
}

/// Whatever ends it, an error, a signal or a panic: motors are off. Commands are written that many times whether they are answered or not.
impl Drop for Bench {
    fn drop(&mut self) {
        for k in 0..STOPS {
            if k > 0 && !self.simulated {
                std::thread::sleep(self.period);
            }
            // The helper and the watchdog are left where a line does not take it.
            self.motors.switch_off(self.now_ns(), self.tick);
            self.tick = self.tick.wrapping_add(1);
        }
        self.motors.release();
    }
}
