//! A rig that runs: its motors, its loop, and the way to both.

use std::thread::JoinHandle;

use hbot_config::RigConfig;
use hbot_config::rig::Port;
use hbot_core::rig::Zero;
use hbot_core::{CompiledScene, Controller};
use hbot_sim::phenomena::Phenomena;
use thiserror::Error;

use crate::attach::{AttachError, Simulator, serial, simulated};
use crate::bridge::{ServiceEnd, bridge};
use crate::bus::MotorBus;
use crate::engine::{Engine, Recorder};
use crate::last_word::Program;
use crate::layout::Layout;
use crate::motors::Motors;
use crate::processor::{NoProcessor, Processor};
use crate::realtime::{WakeLatency, lock_memory};
use crate::run_loop::{Ended, StopFlag, Time, lockstep, wall};

/// What a host is to run.
pub struct HostOptions {
    /// The rig, with its line.
    pub rig: RigConfig,
    /// The scene that the loop begins with.
    pub scene: Box<CompiledScene>,
    /// What the simulated rig shows. A real one takes no notice of it.
    pub phenomena: Phenomena,
    /// Wall-clock or virtual time.
    pub time: Time,
    /// Ticks after which the loop ends; `None`: when it is stopped.
    pub ticks: Option<u64>,
    /// Motor buses of your own, in place of those of the rig file.
    pub buses: Option<Vec<Box<dyn MotorBus>>>,
    /// How this program is started as the helper that switches motors off if it dies. Used on real
    /// serial ports; without it there is no helper.
    pub last_word: Option<Program>,
    /// Sees what goes into and comes out of every tick, in the loop's thread. For tests and replay.
    pub recorder: Option<Recorder>,
}

/// Why a rig does not run.
#[derive(Debug, Error)]
pub enum HostError {
    /// The motors.
    #[error(transparent)]
    Attach(#[from] AttachError),
    /// Motor buses of another number than the rig file's ports.
    #[error("{given} motor buses were given, the rig file has joints on {ours}")]
    Buses {
        /// Given.
        given: usize,
        /// In the rig file.
        ours: usize,
    },
    /// The processor that the loop is to stay on.
    #[error(transparent)]
    Processor(#[from] NoProcessor),
    /// Virtual time on a real rig.
    #[error("virtual time needs the simulated rig: use `--port sim`, or `--time wall` for {0}")]
    VirtualHardware(String),
    /// The system gives no thread or no event descriptor.
    #[error("the system refuses: {0}")]
    System(#[from] std::io::Error),
}

/// A rig whose loop runs. Dropping it stops the loop, so that no motor runs without an owner that can
/// stop it.
pub struct Host {
    stop: StopFlag,
    thread: Option<JoinHandle<Ended>>,
    notices: Vec<String>,
    /// Held as long as the loop runs, and so declared after its thread.
    simulator: Option<Simulator>,
    _wake_latency: Option<WakeLatency>,
}

impl Host {
    /// Attaches the motors, meets their controllers and starts the loop.
    ///
    /// # Errors
    /// The port, the controllers or the system; nothing is left running then.
    pub fn start(options: HostOptions) -> Result<(Self, ServiceEnd), HostError> {
        let HostOptions { rig, scene, phenomena, time, ticks, buses, last_word, recorder } = options;
        let processor = rig.cpu.map(Processor::new).transpose()?;
        let mut notices = uncalibrated(&rig);
        let wake_latency = limit_wake_latency(&rig, time, &mut notices);
        if time == Time::Wall {
            lock(&mut notices);
        }
        let layout = Layout::of(&rig);
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
                (serial(&rig, devices, &layout, last_word.as_ref(), true, &mut notices)?, None)
            }
            (None, Port::Sim) => {
                let (bus, simulator) = simulated(&rig, &layout, phenomena, time)?;
                (vec![bus], Some(simulator))
            }
        };
        let (loop_end, end) = bridge()?;
        let motors = Motors::new(buses, &layout, rig.link.watchdog_ms);
        let engine = Engine::new(motors, Controller::new(rig.rig), scene, loop_end, recorder)
            .enabling(simulator.is_some());
        let stop = StopFlag::default();
        let thread = match time {
            Time::Virtual => in_virtual_time(engine, &rig, ticks, stop.clone())?,
            Time::Wall => by_the_clock(engine, &rig, processor, ticks, stop.clone(), &mut notices)?,
        };
        let host = Self { stop, thread: Some(thread), notices, simulator, _wake_latency: wake_latency };
        Ok((host, end))
    }

    /// What a user should know about how it runs.
    #[must_use]
    pub fn notices(&self) -> &[String] {
        &self.notices
    }

    /// The simulated rig; `None` with real motors.
    #[must_use]
    pub fn simulator(&self) -> Option<&Simulator> {
        self.simulator.as_ref()
    }

    /// What asks the loop to end after its next tick.
    #[must_use]
    pub fn stop_flag(&self) -> StopFlag {
        self.stop.clone()
    }

    /// Ends the loop, if it has not ended yet. Motors are off when this returns.
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

/// Starts a loop in lock-step with the simulated rig.
fn in_virtual_time(
    engine: Engine,
    rig: &RigConfig,
    ticks: Option<u64>,
    stop: StopFlag,
) -> std::io::Result<JoinHandle<Ended>> {
    let period_ns = rig.rig.timing.period_ns;
    spawn(move || lockstep(engine, period_ns, ticks, &stop))
}

/// Starts a loop that keeps the clock's time, and waits until it has the rights that it gets.
fn by_the_clock(
    engine: Engine,
    rig: &RigConfig,
    processor: Option<Processor>,
    ticks: Option<u64>,
    stop: StopFlag,
    notices: &mut Vec<String>,
) -> std::io::Result<JoinHandle<Ended>> {
    let (period_ns, early_ns) = (rig.rig.timing.period_ns, rig.early_ns);
    let (settled, heard) = std::sync::mpsc::sync_channel(1);
    let thread = spawn(move || {
        let pinned = processor.map_or(Ok(()), Processor::keep);
        wall(engine, period_ns, early_ns, ticks, &stop, move |outcome| {
            let _ = settled.send((pinned, outcome));
        })
    })?;
    let (pinned, urgent) = heard.recv().unwrap_or((Ok(()), Ok(())));
    if let Err(reason) = pinned {
        notices.push(format!("the loop is not held on its processor ({reason}): the system may move it"));
    }
    if let Err(reason) = urgent {
        notices.push(format!(
            "no real-time priority ({reason}): other work may delay ticks; run as root, or raise the limit rtprio"
        ));
    }
    Ok(thread)
}

fn spawn(body: impl FnOnce() -> Ended + Send + 'static) -> std::io::Result<JoinHandle<Ended>> {
    std::thread::Builder::new().name("hbot-loop".to_owned()).spawn(body)
}

/// Wheels whose steering zero nobody knows yet.
fn uncalibrated(rig: &RigConfig) -> Vec<String> {
    let wheels = rig.wheels.iter().enumerate();
    wheels
        .filter(|(wheel, _)| rig.rig.joints[2 * wheel].zero == Zero::Calibrate)
        .map(|(_, name)| {
            format!(
                "wheel {name}: its steering zero is left to a calibration: the rig stays unreferenced; run `hbot rig calibrate` and \
                 set wheel.steer.zero and zero_offset as it says"
            )
        })
        .collect()
}

/// Keeps processors out of deep sleep as the rig file says, for as long as the result is kept.
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
