//! Bringing a rig up, before any loop is closed over it: who answers on its lines ([`scan`]), one
//! joint at a time under a small torque ([`joint`]), and a gentle motion by all motors, once the
//! signs are known ([`excite`]). A wrong sign or zero in a closed loop is a runaway.

pub mod excite;
pub mod joint;
pub mod scan;

#[cfg(test)]
mod tests;

use std::time::{Duration, Instant};

use hbot_config::{RigConfig, rig as config};
use hbot_core::controller::DISOBEDIENCE_S;
use hbot_core::design::rig::OdometryMethod;
use hbot_core::inputs::{Complaints, JointReadings};
use hbot_core::motion::odometry;
use hbot_core::outputs::Drive;
use hbot_core::{MAX_JOINTS, MAX_WHEELS, Quat, Rig};
use hbot_sim::phenomena::{Hand, Phenomena};
use thiserror::Error;

use crate::rig::attach::{self, AttachError, Attached};
use crate::rig::built;
use crate::rig::last_word::Program;
use crate::rig::layout::Layout;
use crate::rig::motors::{Motors, OFF};
use crate::run_loop::{StopFlag, Time};

/// Least watchdog time of the commands, ms: how long a motor controller holds a torque if no other
/// command follows. A slow rig has a longer one in its rig file.
const WATCHDOG_MS: u16 = 20;
/// Number of consecutive commands without an answer after which the line counts as silent.
const PATIENCE: u32 = 50;

/// How many times the command to switch the motors off is sent at the end, in case a frame is lost.
const STOPS: u32 = 3;

/// The reason why an exchange with the motor controllers gave no reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum Interrupted {
    /// The motor controllers no longer answer.
    #[error(
        "the motor controllers have stopped answering; their watchdogs should have switched the motors off: check that no wheel pushes"
    )]
    Silent,
    /// A signal asked the program to stop.
    #[error("stopped by a signal: motors are off")]
    Stopped,
    /// A motor is on although it was commanded off.
    #[error(
        "a motor is on although it was commanded off: CUT THE SUPPLY, then check the controller's settings and firmware"
    )]
    StaysOn,
}

/// Access to the motors of a rig without a control loop, for the first tests of a new rig. Each
/// exchange sends one command and receives one reading. The motors are switched off when this value
/// is dropped.
pub struct Bench {
    motors: Motors,
    rig: Rig,
    tick: u32,
    period: Duration,
    /// True if the motors are simulated. Their time advances with each command, independently of
    /// the clock.
    simulated: bool,
    /// When the bench was created, and when the last answered command was sent, s after that.
    begun: Instant,
    sent_s: f64,
    /// Orientation of the sphere relative to that at the first reading, and the counts of the last
    /// reading.
    orientation: Quat,
    counts: Option<[i32; MAX_JOINTS]>,
    /// Whether the motors were last asked to be on, and since when after that one is on or off
    /// against the command, s.
    on: bool,
    disobeyed_s: Option<f64>,
    /// If this flag is set, no further command with torque is sent.
    stop: StopFlag,
    /// Delay of the rates that the controllers report, s.
    rate_lag: f64,
    notices: Vec<String>,
}

/// What a simulated rig is truly like. Real rigs are as they are.
#[derive(Debug, Clone, Copy, Default)]
pub struct Truth<'a> {
    /// The rig file from which the rig is built, if it is another one than that which is believed.
    pub built: Option<&'a RigConfig>,
    /// Phenomena of a real rig that the rig shows.
    pub phenomena: Phenomena,
}

impl Truth<'_> {
    /// Returns a rig that is as its file says, and whose sphere a simulated hand turns widely.
    #[must_use]
    pub fn turned() -> Self {
        let hand = Hand { amplitude: 0.8, rate: 0.4, ..Hand::default() };
        Self { built: None, phenomena: Phenomena { hand: Some(hand), ..Phenomena::default() } }
    }
}

/// Connects to the motors of `rig`. After `stop` is set, no further torque is sent. `helper` is the
/// program that switches the motors off if this process dies. `truth` says what the rig is like if
/// it is simulated.
///
/// # Errors
/// Fails if a port cannot be opened, or if its controllers are not those of the rig.
pub fn open(
    rig: &RigConfig,
    truth: Truth<'_>,
    stop: StopFlag,
    helper: &Program,
) -> Result<Bench, AttachError> {
    let layout = Layout::of(rig);
    if let Some(built) = truth.built {
        built::check(rig, built)?;
    }
    let mut notices = Vec::new();
    let (buses, simulated) = match &rig.link.port {
        config::Port::Sim | config::Port::SimPty => {
            let Attached { bus, .. } =
                attach::simulated(rig, truth.built, &layout, truth.phenomena, Time::Virtual)?;
            (vec![bus], true)
        }
        config::Port::Devices(devices) => {
            let met = attach::serial(rig, devices, &layout, Some(helper), false, &mut notices)?;
            (met.into_iter().map(|(_, bus)| bus).collect(), false)
        }
    };
    let motors = Motors::new(buses, &layout, WATCHDOG_MS.max(rig.link.watchdog_ms));
    let mut bench = Bench::new(&rig.rig, motors, simulated);
    (bench.stop, bench.rate_lag, bench.notices) = (stop, rig.rate_lag, notices);
    Ok(bench)
}

impl Bench {
    /// Creates a bench for motors whose controllers have already been checked.
    #[must_use]
    pub fn new(rig: &Rig, motors: Motors, simulated: bool) -> Self {
        Self {
            motors,
            rig: *rig,
            tick: 0,
            period: Duration::from_nanos(rig.timing.period_ns),
            simulated,
            begun: Instant::now(),
            sent_s: 0.0,
            orientation: Quat::IDENTITY,
            counts: None,
            on: false,
            disobeyed_s: None,
            stop: StopFlag::default(),
            rate_lag: 0.0,
            notices: Vec::new(),
        }
    }

    /// Returns notices for the user, such as a missing helper process.
    #[must_use]
    pub fn notices(&self) -> &[String] {
        &self.notices
    }

    /// Returns whether the motors are simulated.
    #[must_use]
    pub fn is_simulated(&self) -> bool {
        self.simulated
    }

    /// Returns the properties of the rig that its file describes.
    #[must_use]
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// Returns the time between two exchanges, s.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        self.rig.timing.period_s()
    }

    /// Sends one command, waits one period, and returns the reading that answers the command.
    /// `torque` has the sign of the motor controllers, N m; `None` switches the motors off.
    ///
    /// # Errors
    /// Fails if no reading arrives for many periods, if a motor stays on against the command, or if
    /// a stop was requested. In the last case the command was not written.
    pub fn exchange(&mut self, torque: Option<&[f64; MAX_JOINTS]>) -> Result<JointReadings, Interrupted> {
        let drive = Drive { enable: torque.is_some(), torque: torque.copied().unwrap_or([0.0; MAX_JOINTS]) };
        let stop = self.stop.clone();
        self.converse(&drive, || stop.is_set())
    }

    /// Switches the motors off with three commands, and waits for the answer to each, and until no
    /// motor says that it is on.
    ///
    /// # Errors
    /// Fails if no reading arrives for many periods, or if a motor stays on.
    pub fn switch_off(&mut self) -> Result<(), Interrupted> {
        (0..STOPS).try_for_each(|_| self.converse(&OFF, || false).map(drop))?;
        while self.disobeyed_s.is_some() {
            self.converse(&OFF, || false)?;
        }
        Ok(())
    }

    /// Sends `asked` in every period until each line has answered, at most [`PATIENCE`] times.
    /// Gives up if `stop` returns true.
    fn converse(&mut self, asked: &Drive, stop: impl Fn() -> bool) -> Result<JointReadings, Interrupted> {
        if std::mem::replace(&mut self.on, asked.enable) != asked.enable {
            self.disobeyed_s = None;
        }
        let mut complaints = Complaints::default();
        for tries in 0..PATIENCE {
            if stop() {
                return Err(Interrupted::Stopped);
            }
            // That of the command that is answered: readings before it are lost.
            self.sent_s = self.time_s();
            let now_ns = self.now_ns();
            // Nothing pushes on while a line is silent for long, or another one complains. A motor
            // that is off has its time to come.
            let others = Complaints { disobeyed: false, ..complaints };
            let waits = tries < self.rig.timing.timeout_ticks && others == Complaints::default();
            let drive = if waits { asked } else { &OFF };
            // The result is ignored: if a command is not accepted, its reading does not arrive,
            // which is noticed.
            let _ = self.motors.command(now_ns, self.tick, drive);
            self.tick += 1;
            if !self.simulated {
                std::thread::sleep(self.period);
            }
            let news = self.motors.receive(now_ns, self.tick);
            complaints = complaints.or(news.feedback.map_or(complaints, |feedback| feedback.complaints));
            // A controller that has lost power counts from another zero.
            complaints.fault |= news.zeros_lost;
            if let Some(feedback) = news.feedback.filter(|_| news.buses_with_reading == self.motors.buses()) {
                self.follow(&feedback.counts);
                // A power stage has its time to switch.
                let since = complaints.disobeyed.then(|| self.disobeyed_s.unwrap_or(self.sent_s));
                self.disobeyed_s = since;
                complaints.disobeyed = since.is_some_and(|since| self.sent_s - since > DISOBEDIENCE_S);
                if complaints.disobeyed && !asked.enable {
                    return Err(Interrupted::StaysOn);
                }
                return Ok(JointReadings { complaints, ..feedback });
            }
        }
        Err(Interrupted::Silent)
    }

    /// Advances the orientation of the sphere to the counts of a new reading.
    fn follow(&mut self, counts: &[i32; MAX_JOINTS]) {
        let last = self.counts.replace(*counts).unwrap_or(*counts);
        let (device, joints) = (&self.rig.device, &self.rig.joints);
        let n = device.joints();
        let steer: [f64; MAX_WHEELS] =
            std::array::from_fn(|i| f64::from(last[2 * i]) * joints[2 * i].radians_per_count());
        let moved: [f64; MAX_JOINTS] = std::array::from_fn(|j| {
            f64::from(counts[j].wrapping_sub(last[j])) * joints[j].radians_per_count()
        });
        let turn = odometry::turn(device, OdometryMethod::Midpoint, &steer[..n / 2], &moved[..n]);
        self.orientation = odometry::advance(self.orientation, turn);
    }

    /// Returns the orientation of the sphere at the last reading, relative to that at the first
    /// one.
    #[must_use]
    pub fn orientation(&self) -> Quat {
        self.orientation
    }

    /// Returns the time since the bench was created, s: that of the clock, or of the simulation.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        if self.simulated { self.now_ns() as f64 * 1.0e-9 } else { self.begun.elapsed().as_secs_f64() }
    }

    /// Returns the time at which the last answered command was sent, s.
    #[must_use]
    pub fn sent_s(&self) -> f64 {
        self.sent_s
    }

    /// Returns the nominal time of the next command since the first one, ns.
    fn now_ns(&self) -> u64 {
        u64::from(self.tick) * self.rig.timing.period_ns
    }

    /// Converts a difference of encoder counts of a joint to its turn, rad, with the sign of its
    /// motor controller.
    #[must_use]
    pub fn turned(&self, joint: usize, counts: i32) -> f64 {
        f64::from(counts) * self.rig.joints[joint].radians_per_count().abs()
    }
}

/// Switches the motors off when the bench is dropped, even after an error, a signal or a panic. The
/// command is written several times, whether it is answered or not.
impl Drop for Bench {
    fn drop(&mut self) {
        for k in 0..STOPS {
            if k > 0 && !self.simulated {
                std::thread::sleep(self.period);
            }
            // If a line does not accept the command, the helper process or the watchdog switches
            // the motors off.
            self.motors.switch_off(self.now_ns(), self.tick);
            self.tick = self.tick.wrapping_add(1);
        }
        self.motors.release();
    }
}
