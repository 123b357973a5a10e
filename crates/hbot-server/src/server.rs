//! A complete server: the loop that drives a rig, and the service that offers the rig to clients.

use std::fmt;
use std::future::{Future, poll_fn};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::pin::pin;
use std::task::Poll;
use std::time::Duration;

use hbot_config::scene::Simulate;
use hbot_config::{RigConfig, RunningScene, SceneFile};
use hbot_host::bus::MotorBus;
use hbot_host::line::SimulatorCall;
use hbot_host::rig::attach::Simulator;
use hbot_host::rig::host::{self, Host};
use hbot_host::rig::last_word::Program;
use hbot_host::run_loop::Ended;
pub use hbot_host::run_loop::Time;
use hbot_host::run_loop::bridge::{EmergencyStop, ServiceEnd};
use hbot_host::run_loop::clock::now_ns;
use hbot_host::run_loop::engine::Recorder;
use hbot_sim::hand::HandTorque;
use hbot_sim::phenomena::{Hand, Phenomena};
use thiserror::Error;
use tokio::net::TcpListener;
use tokio::sync::{mpsc as async_mpsc, watch};

use crate::flight;
use crate::recording::{self, FilesWritten, RecordOptions, Recorded, Recording, SceneNote};
use crate::service::{self, Control, HandOrder, ServiceSetup, SetPhenomena, SimulatedHand, Status, Summary};
use crate::tls::{CertificateError, Encryption};
use crate::web::WebOptions;

/// Time between two looks whether the thread of the simulated rig still runs.
const LOOK_AT_SIMULATOR: Duration = Duration::from_millis(100);

/// The settings with which a [`Server`] is started.
pub struct ServerOptions {
    /// The configuration of the rig, including its ports and the settings of the service.
    pub rig: RigConfig,
    /// The rig file from which the simulated rig is built, if it is another one than `rig`, which
    /// the loop believes.
    pub built: Option<RigConfig>,
    /// The scene that the loop renders first.
    pub scene: SceneFile,
    /// Whether the loop runs in wall-clock time or in virtual time.
    pub time: Time,
    /// Duration of the run, measured in the time of the loop. With `None` the server runs until it
    /// is stopped.
    pub duration: Option<Duration>,
    /// The token that clients must send in their hello. With `None` no token is required.
    pub token: Option<String>,
    /// Motor buses to use instead of those in the rig file, if any.
    pub buses: Option<Vec<Box<dyn MotorBus>>>,
    /// The command that starts the helper process, which switches the motors off if the server
    /// dies. The helper is used only on real serial ports. With `None` no helper is started.
    pub last_word: Option<Program>,
    /// The folder for flight logs. With `None` no logs are written.
    pub flight_dir: Option<PathBuf>,
    /// A callback that receives the inputs and outputs of every tick, for tests and replay. It runs
    /// in the loop's thread.
    pub recorder: Option<Recorder>,
    /// What is recorded, and where.
    pub recording: RecordOptions,
    /// The port at which the public topics of a recording are served to live viewers, without
    /// authorization. With `None` none are served.
    pub live: Option<WebOptions>,
    /// The page and the API over WebSocket. With `None` they are not served.
    pub web: Option<WebOptions>,
}

impl ServerOptions {
    /// Returns the options of a server that runs `scene` on `rig` until it is stopped. It requires
    /// no token, opens no other port, and keeps neither flight logs nor a recording.
    #[must_use]
    pub fn new(rig: RigConfig, scene: SceneFile, time: Time) -> Self {
        Self {
            rig,
            built: None,
            scene,
            time,
            duration: None,
            token: None,
            buses: None,
            last_word: None,
            flight_dir: None,
            recorder: None,
            recording: RecordOptions::default(),
            live: None,
            web: None,
        }
    }
}

/// The reason why a server did not start.
#[derive(Debug, Error)]
pub enum StartError {
    /// The rig could not be started.
    #[error(transparent)]
    Rig(#[from] host::HostError),
    /// The certificate or the key for encryption cannot be used.
    #[error(transparent)]
    Certificate(#[from] CertificateError),
}

/// A server whose control loop is running.
pub struct Server {
    setup: ServiceSetup,
    end: ServiceEnd,
    host: Host,
    notices: Vec<String>,
    period_ns: u64,
    time: Time,
    started_ns: u64,
    recording: Option<Recording>,
}

/// The outcome of a server that has ended.
#[derive(Debug)]
pub struct Finished {
    /// Statistics of the run. All values are zero if the service panicked.
    pub summary: Summary,
    /// The part that panicked, if any. The motors were switched off in that case too.
    pub failed: Option<Part>,
    /// The ratio of simulated time to elapsed wall-clock time. `None` unless the loop ran in
    /// virtual time.
    pub speed: Option<f64>,
    /// The outcome of the recording. `None` if nothing was recorded.
    pub recorded: Option<Recorded>,
    /// The files of the recording.
    pub files: FilesWritten,
}

/// A part of a server.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The thread of the control loop.
    Loop,
    /// The TCP service for clients.
    Service,
    /// The thread of the simulated rig, in wall-clock time. In virtual time the simulated rig is
    /// part of the loop.
    Simulator,
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Loop => "the loop",
            Self::Service => "the service",
            Self::Simulator => "the simulated rig",
        })
    }
}

impl Server {
    /// Connects to the rig's motors and starts the control loop.
    ///
    /// # Errors
    /// Fails if a port cannot be opened, if a motor controller does not answer as expected, if the
    /// operating system refuses a resource, or if the files for encryption cannot be used. Nothing
    /// is left running then.
    pub fn start(options: ServerOptions) -> Result<Self, StartError> {
        let ServerOptions {
            rig,
            built,
            scene,
            time,
            duration,
            token,
            buses,
            last_word,
            flight_dir,
            recorder,
            recording,
            live,
            web,
        } = options;
        let encryption = rig.api.tls.as_ref().map(Encryption::from_files).transpose()?;
        let phenomena = at_start(&scene);
        let mut running = RunningScene::new();
        let scene = Box::new(running.load(scene));
        let mut notices = notices(flight_dir.as_deref());
        let flights = flight_dir.is_some();
        let (recorder, prepared) = if flights || recording.path.is_some() || live.is_some() {
            let first = SceneNote::new(&scene, running.file());
            let waits = time == Time::Virtual;
            let (own, prepared) = recording::prepare(recording, flights, live, first, waits);
            (Some(both(recorder, own)), Some(prepared))
        } else {
            (recorder, None)
        };
        let ticks = duration.map(|d| (d.as_secs_f64() * f64::from(rig.rate_hz)).ceil() as u64);
        let (host, end) = Host::start(host::HostOptions {
            rig: rig.clone(),
            built,
            scene,
            phenomena,
            time,
            ticks,
            buses,
            last_word,
            recorder,
        })?;
        notices.extend_from_slice(host.notices());
        let period_ns = rig.rig.timing.period_ns;
        let accuracy = rig.accuracy.to_owned();
        let phenomena = host.simulator().cloned().map(replace_phenomena);
        let hand = host.simulator().cloned();
        let hand = hand.map(|simulator| simulated_hand(move |call| simulator.post(call)));
        let controllers = host.controllers().clone();
        let origin = host.origin();
        let recording = prepared.map(|prepared| prepared.start(&rig, origin)).transpose();
        let recording = recording.map_err(host::HostError::System)?;
        let notes = recording.as_ref().map(|recording| recording.notes.clone()).unwrap_or_default();
        let setup = ServiceSetup {
            rig,
            scene: running,
            phenomena,
            hand,
            token,
            encryption,
            flight_dir,
            controllers,
            accuracy,
            origin,
            time_waits: host.time_waits(),
            notes,
            web,
        };
        Ok(Self { setup, end, host, notices, period_ns, time, started_ns: now_ns(), recording })
    }

    /// Returns messages for the user about how the server runs, for example that flight logs cannot
    /// be written.
    #[must_use]
    pub fn notices(&self) -> &[String] {
        &self.notices
    }

    /// Returns the path of the file that is recorded first. Returns `None` if only flight logs are
    /// recorded.
    #[must_use]
    pub fn recording_file(&self) -> Option<&Path> {
        self.recording.as_ref().and_then(Recording::first)
    }

    /// Returns a handle that requests an emergency stop from any thread, without the help of the
    /// service.
    #[must_use]
    pub fn emergency_stop(&self) -> EmergencyStop {
        self.end.emergency_stop()
    }

    /// Returns a handle to the simulated rig, if there is one.
    #[cfg(test)]
    pub(crate) fn simulator(&self) -> Option<Simulator> {
        self.host.simulator().cloned()
    }

    /// Serves clients on `listener` until `shutdown` completes, the loop ends, or a part of the
    /// server panics. Before this returns, the loop has sent zero torque to the motors. A panic of
    /// a part is reported in [`Finished::failed`].
    pub async fn serve(
        self,
        listener: TcpListener,
        control: async_mpsc::Receiver<Control>,
        status: watch::Sender<Status>,
        shutdown: impl Future<Output = ()>,
    ) -> Finished {
        let Self { setup, end, mut host, notices: _, period_ns, time, started_ns, recording } = self;
        // The loop stops, with zero torque, before the clients are notified.
        let stopping = {
            let (stop, simulator) = (host.stop_flag(), host.simulator().cloned());
            async move {
                tokio::select! {
                    () = shutdown => {}
                    () = failed(simulator) => {}
                }
                stop.stop();
            }
        };
        let mut serving = pin!(service::serve(listener, end, setup, control, status, stopping));
        // After a panic the future is not polled again. It is only dropped.
        let summary = poll_fn(|context| {
            catch_unwind(AssertUnwindSafe(|| serving.as_mut().poll(context)))
                .map_or(Poll::Ready(None), |polled| polled.map(Some))
        })
        .await;
        let simulator_failed = host.simulator().is_some_and(|simulator| simulator.failure().is_some());
        let ended = host.end();
        let counts = recording.as_ref().map(|recording| recording.notes.counts());
        let recorded = recording.and_then(Recording::end);
        let files = counts.map(|counts| counts.files()).unwrap_or_default();
        let failed = match (ended, &summary) {
            _ if simulator_failed => Some(Part::Simulator),
            (Ended::Panicked, _) => Some(Part::Loop),
            (Ended::Stopped, None) => Some(Part::Service),
            (Ended::Stopped, Some(_)) => None,
        };
        let summary = summary.unwrap_or_default();
        let simulated_ns = summary.ticks.saturating_mul(period_ns) as f64;
        let speed = (time == Time::Virtual).then(|| simulated_ns / (now_ns() - started_ns).max(1) as f64);
        Finished { summary, failed, speed, recorded, files }
    }
}

/// Completes when the thread of the simulated rig has failed, and logs why. Never completes if
/// there is no such thread.
async fn failed(simulator: Option<Simulator>) {
    let Some(simulator) = simulator else { return std::future::pending().await };
    let mut looks = tokio::time::interval(LOOK_AT_SIMULATOR);
    loop {
        looks.tick().await;
        if let Some(reason) = simulator.failure() {
            tracing::error!(reason, "the simulated rig has ended, so the server ends");
            return;
        }
    }
}

/// Returns a callback that calls `first`, if there is one, and then `second`.
fn both(first: Option<Recorder>, mut second: Recorder) -> Recorder {
    let Some(mut first) = first else { return second };
    Box::new(move |ticked| {
        first(ticked);
        second(ticked);
    })
}

/// Returns the phenomena of the simulated rig at the start: those of the scene. If the scene names
/// none, the rig is ideal and a simulated hand turns the sphere.
fn at_start(scene: &SceneFile) -> Phenomena {
    let otherwise = || Phenomena { hand: Some(Hand::default()), ..Phenomena::default() };
    scene.simulate().copied().unwrap_or_else(otherwise)
}

/// Returns notices for the user that are known before the first client connects.
fn notices(flight_dir: Option<&Path>) -> Vec<String> {
    let mut notices = Vec::from_iter(service::too_few_descriptors());
    if let Some(dir) = flight_dir
        && let Err(error) = flight::prepare(dir)
    {
        notices.push(format!("no flight logs can be written to {}: {error}", dir.display()));
    }
    notices
}

/// Returns a function that gives the simulated rig the phenomena of a scene.
fn replace_phenomena(simulator: Simulator) -> SetPhenomena {
    Box::new(move |simulate: &Simulate| simulator.show(*simulate))
}

/// Returns the hand of the simulated rig, for clients that move it. `post` runs a function on the
/// rig.
pub(crate) fn simulated_hand(post: impl Fn(SimulatorCall) + Send + 'static) -> SimulatedHand {
    let torque = HandTorque::default();
    let told = torque.clone();
    post(Box::new(move |rig| rig.tell_hand_torque(told)));
    let order = move |order: HandOrder| {
        post(Box::new(move |rig| match order {
            HandOrder::Turn(guide) => rig.guide_hand(&guide),
            HandOrder::Release => rig.release_hand(),
            HandOrder::Resume => rig.resume_hand(),
        }));
    };
    SimulatedHand { order: Box::new(order), torque }
}
