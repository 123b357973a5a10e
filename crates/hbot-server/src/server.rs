//! A whole server: the line, the loop's thread and the service, put together and taken apart again.

mod ports;

use std::fmt;
use std::future::{Future, poll_fn};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::pin::pin;
use std::sync::Arc;
use std::sync::mpsc;
use std::task::Poll;
use std::thread::JoinHandle;
use std::time::Duration;

use hbot_config::rig::Port;
use hbot_config::scene::Simulate;
use hbot_config::{RigConfig, RunningScene, SceneFile};
use hbot_core::Controller;
use hbot_core::rig::Zero;
use hbot_sim::phenomena::Phenomena;
use hbot_sim::pty::{PtyError, PtyOptions, PtyRig, spawn_pty};
use hbot_sim::rig::{RigConfig as SimulatedConfig, RigError, SimulatedRig};
use hbot_sim::scene::phenomena;
use thiserror::Error;
use tokio::net::TcpListener;
use tokio::sync::{mpsc as async_mpsc, watch};

use crate::bridge::{EmergencyStop, ServiceEnd, bridge};
use crate::clock::now_ns;
use crate::engine::{Engine, Line, Recorder};
use crate::flight;
use crate::handshake::{Expected, HandshakeError, handshake};
use crate::last_word::Program;
use crate::processor::{NoProcessor, Processor};
use crate::realtime::{SIMULATOR_PRIORITY, WakeLatency, lock_memory, real_time};
use crate::run_loop::{Ended, StopFlag, lockstep, wall};
use crate::serial::{OpenError, Serial};
use crate::service::{self, Control, SetPhenomena, Setup, Status, Summary};
use crate::tls::{CertificateError, Encryption};
use crate::wire::{Memory, SimulatorCall};

/// What a server is to be.
pub struct Options {
    /// The rig, with its line and service.
    pub rig: RigConfig,
    /// The scene to begin with.
    pub scene: SceneFile,
    /// Wall-clock or virtual time.
    pub time: Time,
    /// End after this time of the loop.
    pub duration: Option<Duration>,
    /// What clients must know.
    pub token: Option<String>,
    /// How this program is started as the helper that switches motors off if the server dies; on real serial ports, and with `None`
    /// on none.
    pub last_word: Option<Program>,
    /// Where flight logs go; none are written without it.
    pub flight_dir: Option<PathBuf>,
    /// Sees what goes into and comes out of every tick, in the loop's thread. For tests and replay.
    pub recorder: Option<Recorder>,
}

/// Which time a loop runs in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Time {
    /// The clock's.
    Wall,
    /// As fast as the machine goes, in lock-step with the simulated rig.
    Virtual,
}

/// Why a server did not start.
#[derive(Debug, Error)]
pub enum StartError {
    /// The serial port.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The motor controllers.
    #[error(transparent)]
    Handshake(#[from] HandshakeError),
    /// The simulated rig.
    #[error(transparent)]
    Simulator(#[from] RigError),
    /// Its pseudo-terminal.
    #[error(transparent)]
    Pty(#[from] PtyError),
    /// The files of an encrypted service.
    #[error(transparent)]
    Certificate(#[from] CertificateError),
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

/// A server whose loop runs.
pub struct Server {
    setup: Setup,
    end: ServiceEnd,
    running: Running,
    /// Kept until the loop has said its last word, so declared after it.
    pty: Option<Arc<PtyRig>>,
    notices: Vec<String>,
    period_ns: u64,
    time: Time,
    started_ns: u64,
}

/// The loop's thread: whoever lets go of it has stopped it, so that no motor goes on without a service.
struct Running {
    stop: StopFlag,
    thread: Option<JoinHandle<Ended>>,
    /// Held as long as it runs.
    _wake_latency: Option<WakeLatency>,
}

impl Running {
    fn end(&mut self) -> Ended {
        self.stop.stop();
        self.thread.take().map_or(Ended::Stopped, |thread| thread.join().unwrap_or(Ended::Panicked))
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.end();
    }
}

/// How a server ended.
#[derive(Debug)]
pub struct Finished {
    /// What the service counted and measured; nothing where it was the service that failed.
    pub summary: Summary,
    /// What ended by a fault of its own, if anything did. Motors were switched off all the same.
    pub failed: Option<Part>,
    /// In virtual time: how many times faster than the clock it ran.
    pub speed: Option<f64>,
}

/// What a server is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The thread that ticks.
    Loop,
    /// What talks to clients.
    Service,
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Loop => "the loop",
            Self::Service => "the service",
        })
    }
}

impl Server {
    /// Opens the line, shakes hands and starts the loop. Call it on a tokio runtime.
    ///
    /// # Errors
    /// The port, the controllers, or the system; nothing is left running.
    pub fn start(options: Options) -> Result<Self, StartError> {
        let Options { rig, scene, time, duration, token, last_word, flight_dir, recorder } = options;
        let encryption = rig.api.tls.as_ref().map(Encryption::from_files).transpose()?;
        let processor = rig.cpu.map(Processor::new).transpose()?;
        let mut running = RunningScene::new();
        // At the start ideal and in a hand that turns it about, unless the scene says otherwise.
        let shown = scene.simulate().map_or_else(
            || Phenomena { hand: Some(hbot_sim::phenomena::Hand::default()), ..Phenomena::default() },
            phenomena,
        );
        let compiled = Box::new(running.load(scene));
        let (loop_end, end) = bridge()?;
        let stop = StopFlag::default();
        let ticks = duration.map(|d| (d.as_secs_f64() * f64::from(rig.rate_hz)).ceil() as u64);
        let (period_ns, early_ns) = (rig.rig.timing.period_ns, rig.early_ns);
        let mut notices = Vec::from_iter(service::too_few_descriptors());
        let simulated = rig.link.port == Port::Sim;
        for (wheel, name) in rig.wheels.iter().enumerate() {
            if rig.rig.joints[2 * wheel].zero == Zero::Calibrate {
                notices.push(format!(
                    "wheel {name}: its steering zero is left to a calibration: the rig stays unreferenced; run `hbot rig calibrate` and \
                     set wheel.steer.zero and zero_offset as it says"
                ));
            }
        }
        if let Some(dir) = &flight_dir
            && let Err(error) = flight::prepare(dir)
        {
            notices.push(format!("no flight logs can be written to {}: {error}", dir.display()));
        }
        let line = Line::of(&rig);

        let limit = rig.wake_us.filter(|_| time == Time::Wall).map(WakeLatency::limit).transpose();
        let wake_latency = limit.unwrap_or_else(|reason| {
            notices.push(format!(
                "processors may sleep deeply ({reason}): the loop wakes late; run as root, or take the udev rule of contrib/"
            ));
            None
        });
        let controller = Controller::new(rig.rig);
        let (thread, pty, set): (_, _, Option<SetPhenomena>) = match (time, &rig.link.port) {
            (Time::Virtual, Port::Devices(_)) => {
                return Err(StartError::VirtualHardware(rig.link.port.to_string()));
            }
            (Time::Virtual, Port::Sim) => {
                let (calls, inbox) = mpsc::channel::<SimulatorCall>();
                let mut wire = Memory::new(simulator(&rig, shown)?, inbox);
                handshake(&mut wire, &Expected::new("sim", &rig.rig, &line, 0))?;
                let call = move |call: SimulatorCall| {
                    // A loop that has ended needs none.
                    let _ = calls.send(call);
                };
                impair(shown, &call);
                let engine = Engine::new(vec![wire], &line, controller, compiled, loop_end, recorder)
                    .enabling(simulated);
                let stop = stop.clone();
                let thread = spawn(move || lockstep(engine, period_ns, ticks, &stop))?;
                (thread, None, Some(replace_by(call)))
            }
            (Time::Wall, port) => {
                if let Err(reason) = lock_memory() {
                    notices.push(format!("memory is not locked ({reason}): page faults may delay ticks; run as root, or raise the limit memlock"));
                }
                let (wires, pty) = match port {
                    Port::Sim => {
                        let pty = Arc::new(serve_pty(simulator(&rig, shown)?)?);
                        let mut wire = Serial::open(&pty.path().display().to_string(), rig.link.baud)?;
                        handshake(&mut wire, &Expected::new("sim", &rig.rig, &line, 0))?;
                        (vec![wire], Some(pty))
                    }
                    Port::Devices(devices) => {
                        (ports::open(devices, &rig, &line, last_word.as_ref(), &mut notices)?, None)
                    }
                };
                let set = pty.clone().map(|pty| {
                    let call = move |call: SimulatorCall| {
                        // A rig whose thread has ended shows in the loop as a lost link.
                        let _ = pty.post(call);
                    };
                    impair(shown, &call);
                    replace_by(call)
                });
                let engine =
                    Engine::new(wires, &line, controller, compiled, loop_end, recorder).enabling(simulated);
                let stop = stop.clone();
                let (settled, heard) = mpsc::sync_channel(1);
                let thread = spawn(move || {
                    let pinned = processor.map_or(Ok(()), Processor::keep);
                    wall(engine, period_ns, early_ns, ticks, &stop, move |outcome| {
                        let _ = settled.send((pinned, outcome));
                    })
                })?;
                let (pinned, urgent) = heard.recv().unwrap_or((Ok(()), Ok(())));
                if let Err(reason) = pinned {
                    notices.push(format!(
                        "the loop is not held on its processor ({reason}): the system may move it"
                    ));
                }
                if let Err(reason) = urgent {
                    notices.push(format!("no real-time priority ({reason}): other work may delay ticks; run as root, or raise the limit rtprio"));
                }
                (thread, pty, set)
            }
        };
        let accuracy = rig.accuracy.to_owned();
        let setup = Setup { rig, scene: running, phenomena: set, token, encryption, flight_dir, accuracy };
        let started_ns = now_ns();
        let running = Running { stop, thread: Some(thread), _wake_latency: wake_latency };
        Ok(Self { setup, end, running, pty, notices, period_ns, time, started_ns })
    }

    /// What a user should know about how it runs.
    #[must_use]
    pub fn notices(&self) -> &[String] {
        &self.notices
    }

    /// What stops the loop from any thread, past the service.
    #[must_use]
    pub fn emergency_stop(&self) -> EmergencyStop {
        self.end.emergency_stop()
    }

    /// Serves clients on `listener` until `shutdown`, until the loop ends, or until either fails. Zero torque is on the line
    /// before it returns.
    ///
    /// # Errors
    /// The service cannot go on.
    pub async fn serve(
        self,
        listener: TcpListener,
        control: async_mpsc::Receiver<Control>,
        status: watch::Sender<Status>,
        shutdown: impl Future<Output = ()>,
    ) -> std::io::Result<Finished> {
        // Dropped in reverse order: should this future be dropped, the loop ends before its line.
        let Self { pty, setup, end, mut running, notices: _, period_ns, time, started_ns } = self;
        // Zero torque first: the loop stops before the clients are told.
        let stopping = {
            let stop = running.stop.clone();
            async move {
                shutdown.await;
                stop.stop();
            }
        };
        let mut serving = pin!(service::serve(listener, end, setup, control, status, stopping));
        // What a panic leaves behind is dropped without being used again.
        let summary = poll_fn(|context| {
            catch_unwind(AssertUnwindSafe(|| serving.as_mut().poll(context)))
                .map_or(Poll::Ready(None), |polled| polled.map(Some))
        })
        .await;
        let ended = running.end();
        // The simulated rig's thread ends with its last owner, after the loop's last word.
        drop(pty);
        let failed = match (ended, &summary) {
            (Ended::Panicked, _) => Some(Part::Loop),
            (Ended::Stopped, None) => Some(Part::Service),
            (Ended::Stopped, Some(_)) => None,
        };
        let summary = summary.unwrap_or_default();
        let simulated_ns = summary.ticks.saturating_mul(period_ns) as f64;
        let speed = (time == Time::Virtual).then(|| simulated_ns / (now_ns() - started_ns).max(1) as f64);
        Ok(Finished { summary, failed, speed })
    }
}

fn spawn(body: impl FnOnce() -> Ended + Send + 'static) -> std::io::Result<JoinHandle<Ended>> {
    std::thread::Builder::new().name("hbot-loop".to_owned()).spawn(body)
}

/// The simulated rig, but for what it shows on its line.
fn simulator(rig: &RigConfig, phenomena: Phenomena) -> Result<SimulatedRig, RigError> {
    let mut config = SimulatedConfig::new(&rig.rig);
    config.phenomena = Phenomena { link: None, ..phenomena };
    SimulatedRig::new(&config)
}

/// Has the line impaired where it is to be: after the handshake, which stands in a time of its own.
fn impair(phenomena: Phenomena, call: &dyn Fn(SimulatorCall)) {
    if phenomena.link.is_some() {
        call(Box::new(move |rig| rig.set_link(phenomena.link)));
    }
}

/// Replaces phenomena by calls on the simulated rig.
fn replace_by(call: impl Fn(SimulatorCall) + Send + 'static) -> SetPhenomena {
    Box::new(move |simulate: &Simulate| {
        let phenomena = phenomena(simulate);
        call(Box::new(move |rig| rig.set_phenomena(phenomena)));
    })
}

fn serve_pty(rig: SimulatedRig) -> Result<PtyRig, PtyError> {
    let on_start = || {
        // Without the right to it the loop has none either, and says so.
        let _ = real_time(SIMULATOR_PRIORITY);
    };
    spawn_pty(rig, PtyOptions { on_start: Box::new(on_start), ..PtyOptions::default() })
}
