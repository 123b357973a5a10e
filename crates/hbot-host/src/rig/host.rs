//! Starts and stops a rig: its motors, its loop and the connections to both.

use std::thread::JoinHandle;

use hbot_config::RigConfig;
use hbot_config::advice::RatePick;
use hbot_config::rig::Port;
use hbot_core::design::rig::Zero;
use hbot_core::{CompiledScene, Controller};
use hbot_sim::phenomena::Phenomena;
use thiserror::Error;

use crate::bus::{MotorBus, late_rates};
use crate::rig::attach::{AttachError, Simulator, serial, simulated};
use crate::rig::built;
use crate::rig::controllers::Controllers;
use crate::rig::last_word::Program;
use crate::rig::layout::Layout;
use crate::rig::motors::Motors;
use crate::run_loop::bridge::{ServiceEnd, bridge};
use crate::run_loop::clock::{Origin, now_ns};
use crate::run_loop::engine::{Engine, Recorder};
use crate::run_loop::processor::{NoProcessor, Processor};
use crate::run_loop::realtime::{WakeLatency, lock_memory};
use crate::run_loop::{Ended, Schedule, StopFlag, Time, lockstep, wall};

/// The options with which a rig and its control loop are started.
pub struct HostOptions {
    /// The configuration of the rig, including the ports to its motors.
    pub rig: RigConfig,
    /// The scene that the loop renders first.
    pub scene: Box<CompiledScene>,
    /// The rig file from which the simulated rig is built, if it is another one than `rig`.
    pub built: Option<RigConfig>,
    /// Phenomena of the simulated rig, such as play. They have no effect on a real rig.
    pub phenomena: Phenomena,
    /// Whether the loop runs in wall-clock or in virtual time.
    pub time: Time,
    /// Number of ticks after which the loop ends. With `None` it runs until it is stopped.
    pub ticks: Option<u64>,
    /// Motor buses to use instead of those in the rig file, if any.
    pub buses: Option<Vec<Box<dyn MotorBus>>>,
    /// The command that starts the helper process, which switches the motors off if this program
    /// dies. It is used on real serial ports. With `None` there is no helper.
    pub last_word: Option<Program>,
    /// A callback that receives the inputs and outputs of every tick, in the loop's thread, for
    /// tests and replay.
    pub recorder: Option<Recorder>,
}

/// The reason why a rig could not be started.
#[derive(Debug, Error)]
pub enum HostError {
    /// The program could not connect to the motors.
    #[error(transparent)]
    Attach(#[from] AttachError),
    /// The number of motor buses differs from the number of ports in the rig file.
    #[error("{given} motor buses were given, the rig file has joints on {ours}")]
    Buses {
        /// Number of motor buses given in [`HostOptions::buses`].
        given: usize,
        /// Number of buses in the rig file.
        ours: usize,
    },
    /// The loop cannot run on the processor that was chosen for it.
    #[error(transparent)]
    Processor(#[from] NoProcessor),
    /// Virtual time was requested for a real rig.
    #[error("virtual time needs the simulated rig: use `--port sim`, or `--time wall` for {0}")]
    VirtualHardware(String),
    /// The operating system could not provide a thread or an event descriptor.
    #[error("the system refuses: {0}")]
    System(#[from] std::io::Error),
}

/// A rig whose loop is running. Dropping it stops the loop, so that the motors never run without a
/// program that can stop them.
pub struct Host {
    stop: StopFlag,
    thread: Option<JoinHandle<Ended>>,
    notices: Vec<String>,
    controllers: Controllers,
    origin: Origin,
    time_waits: bool,
    /// The simulated rig, if any. This field comes after `thread`, so that the rig is dropped after
    /// the loop's thread has ended.
    simulator: Option<Simulator>,
    _wake_latency: Option<WakeLatency>,
}

impl Host {
    /// Connects to the motors, checks their controllers and starts the loop. Returns the running
    /// rig and the service's end of the bridge to its loop.
    ///
    /// # Errors
    /// Fails if a port cannot be opened, the controllers are not accepted, or the system refuses.
    /// Nothing is left running then.
    pub fn start(options: HostOptions) -> Result<(Self, ServiceEnd), HostError> {
        let HostOptions { rig, scene, built, phenomena, time, ticks, buses, last_word, recorder } = options;
        if let Some(built) = &built {
            built::check(&rig, built).map_err(AttachError::from)?;
        }
        let processor = rig.cpu.map(Processor::new).transpose()?;
        let mut notices: Vec<String> = late_rates(&rig).into_iter().collect();
        notices.extend(rig.rate_pick.as_ref().map(RatePick::sentence));
        let wake_latency = limit_wake_latency(&rig, time, &mut notices);
        if time == Time::Wall {
            lock(&mut notices);
        }
        let layout = Layout::of(&rig);
        let mut shared = None;
        let mut controllers = Controllers::default();
        let (buses, simulator) = match (buses, &rig.link.port) {
            (Some(buses), _) => {
                let ours = layout.buses();
                if buses.len() != ours {
                    return Err(HostError::Buses { given: buses.len(), ours });
                }
                (buses, None)
            }
            (None, Port::Devices(_)) if time == Time::Virtual => {
                return Err(HostError::VirtualHardware(rig.link.port.to_string()));
            }
            (None, Port::Devices(devices)) => {
                let met = serial(&rig, devices, &layout, last_word.as_ref(), true, &mut notices)?;
                let (lines, buses) = met.into_iter().unzip();
                controllers = Controllers::new(rig.link.protocol, lines);
                (buses, None)
            }
            (None, Port::Sim | Port::SimPty) => {
                let attached = simulated(&rig, built.as_ref(), &layout, phenomena, time)?;
                shared = attached.shared;
                controllers = Controllers::new(rig.link.protocol, vec![attached.expected]);
                (vec![attached.bus], Some(attached.simulator))
            }
        };
        let (loop_end, mut end) = bridge()?;
        let motors = Motors::new(buses, &layout, rig.link.watchdog_ms);
        let engine = Engine::new(
            motors,
            Controller::new(rig.rig)
                .with_shaking_guard(rig.shaking_guard)
                .with_named_commands(rig.link.protocol.names_commands()),
            scene,
            loop_end,
            recorder,
        )
        .enabling(simulator.is_some())
        .waiting(shared.is_some());
        let time_waits = shared.is_some();
        let stop = StopFlag::default();
        let (thread, origin) = match time {
            Time::Virtual => {
                let (thread, origin) = in_virtual_time(engine, &rig, ticks, stop.clone())?;
                end.in_virtual_time(thread.thread().clone());
                (thread, origin)
            }
            Time::Wall => {
                let (period_ns, early_ns) = (rig.rig.timing.period_ns, rig.early_ns);
                let schedule = Schedule { period_ns, early_ns, ticks, shared };
                by_the_clock(engine, schedule, processor, stop.clone(), &mut notices)?
            }
        };
        let thread = Some(thread);
        let host = Self {
            stop,
            thread,
            notices,
            controllers,
            origin,
            time_waits,
            simulator,
            _wake_latency: wake_latency,
        };
        Ok((host, end))
    }

    /// Returns notices for the user, such as a missing real-time priority.
    #[must_use]
    pub fn notices(&self) -> &[String] {
        &self.notices
    }

    /// Returns the motor controllers of the rig's joints. If the buses were given in
    /// [`HostOptions::buses`], nothing is known of them.
    #[must_use]
    pub fn controllers(&self) -> &Controllers {
        &self.controllers
    }

    /// Returns the time of tick 0 on the system's clocks. In virtual time it is the time at which
    /// the loop started, and the time of later ticks does not follow those clocks.
    #[must_use]
    pub fn origin(&self) -> Origin {
        self.origin
    }

    /// Returns whether the loop's time waits instead of skipping ticks, because a simulated rig
    /// shares it. Each skipped tick then moves all later ticks one period away from the origin.
    #[must_use]
    pub fn time_waits(&self) -> bool {
        self.time_waits
    }

    /// Returns a handle to the simulated rig, or `None` if the motors are real.
    #[must_use]
    pub fn simulator(&self) -> Option<&Simulator> {
        self.simulator.as_ref()
    }

    /// Returns a flag that asks the loop to end. At most one more tick begins after it is set.
    #[must_use]
    pub fn stop_flag(&self) -> StopFlag {
        self.stop.clone()
    }

    /// Ends the loop, if it has not ended yet. The motors are off when this returns.
    pub fn end(&mut self) -> Ended {
        self.stop.stop();
        self.thread.take().map_or(Ended::Stopped, |thread| thread.join().unwrap_or(Ended::Panicked))
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        self.end();
    }
}

/// Starts the loop in virtual time, in lock-step with the simulated rig.
fn in_virtual_time(
    engine: Engine,
    rig: &RigConfig,
    ticks: Option<u64>,
    stop: StopFlag,
) -> std::io::Result<(JoinHandle<Ended>, Origin)> {
    let period_ns = rig.rig.timing.period_ns;
    let origin = Origin::at(now_ns());
    Ok((spawn(move || lockstep(engine, period_ns, ticks, &stop))?, origin))
}

/// Starts the loop in wall-clock time, and waits until its thread has requested its processor and
/// its real-time priority. Returns the thread and the time of tick 0. Adds a notice for the user
/// for each refusal.
fn by_the_clock(
    engine: Engine,
    schedule: Schedule,
    processor: Option<Processor>,
    stop: StopFlag,
    notices: &mut Vec<String>,
) -> std::io::Result<(JoinHandle<Ended>, Origin)> {
    let (settled, heard) = std::sync::mpsc::sync_channel(1);
    let thread = spawn(move || {
        let pinned = processor.map_or(Ok(()), Processor::keep);
        wall(engine, &schedule, &stop, move |outcome, origin| {
            let _ = settled.send((pinned, outcome, origin));
        })
    })?;
    // A thread that panics before it sends has run no tick. Its end is reported when it is joined.
    let (pinned, urgent, origin) = heard.recv().unwrap_or_else(|_| (Ok(()), Ok(()), Origin::at(now_ns())));
    if let Err(reason) = pinned {
        notices.push(format!("the loop is not held on its processor ({reason}): the system may move it"));
    }
    if let Err(reason) = urgent {
        notices.push(format!(
            "no real-time priority ({reason}): other work may delay ticks; run as root, or raise the limit rtprio"
        ));
    }
    Ok((thread, origin))
}

fn spawn(body: impl FnOnce() -> Ended + Send + 'static) -> std::io::Result<JoinHandle<Ended>> {
    std::thread::Builder::new().name("hbot-loop".to_owned()).spawn(body)
}

/// Returns a warning for each wheel whose steering zero is not known yet.
#[must_use]
pub fn uncalibrated(rig: &RigConfig) -> Vec<String> {
    let wheels = rig.wheels.iter().enumerate();
    wheels
        .filter(|(wheel, _)| rig.rig.joints[2 * wheel].zero == Zero::Calibrate)
        .map(|(wheel, name)| {
            format!(
                "wheel {name} (wheel[{wheel}]) leaves its steering zero to a calibration: the rig stays unreferenced until \
                 `hbot rig calibrate` has measured zero_offset and `zero` has another value (docs/files.md)"
            )
        })
        .collect()
}

/// Limits the time that processors take to wake from sleep, as the rig file asks. The limit lasts
/// for as long as the result exists. Adds a notice for the user if the system refuses.
fn limit_wake_latency(rig: &RigConfig, time: Time, notices: &mut Vec<String>) -> Option<WakeLatency> {
    let limit = rig.wake_us.filter(|_| time == Time::Wall).map(WakeLatency::limit).transpose();
    limit.unwrap_or_else(|reason| {
        notices.push(format!(
            "processors may sleep deeply ({reason}): the loop wakes late; run as root, or take the udev rule of contrib/"
        ));
        None
    })
}

fn lock(notices: &mut Vec<String>) {
    if let Err(reason) = lock_memory() {
        notices.push(format!(
            "memory is not locked ({reason}): page faults may delay ticks; run as root, or raise the limit memlock"
        ));
    }
}
