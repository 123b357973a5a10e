//! A whole server: a rig that runs and the service that offers it to clients.

use std::fmt;
use std::future::{Future, poll_fn};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::pin::pin;
use std::task::Poll;
use std::time::Duration;

use hbot_config::scene::Simulate;
use hbot_config::{RigConfig, RunningScene, SceneFile};
use hbot_host::attach::Simulator;
use hbot_host::bridge::{EmergencyStop, ServiceEnd};
use hbot_host::bus::MotorBus;
use hbot_host::clock::now_ns;
use hbot_host::engine::Recorder;
use hbot_host::host::{self, Host};
use hbot_host::last_word::Program;
use hbot_host::run_loop::Ended;
pub use hbot_host::run_loop::Time;
use hbot_sim::phenomena::{Hand, Phenomena};
use thiserror::Error;
use tokio::net::TcpListener;
use tokio::sync::{mpsc as async_mpsc, watch};

use crate::flight;
use crate::service::{self, Control, ServiceSetup, SetPhenomena, Status, Summary};
use crate::tls::{CertificateError, Encryption};

/// What a server is to be.
pub struct ServerOptions {
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
    /// Motor buses of your own, in place of those of the rig file.
    pub buses: Option<Vec<Box<dyn MotorBus>>>,
    /// How this program is started as the helper that switches motors off if the server dies; on real serial ports, and with `None`
    /// on none.
    pub last_word: Option<Program>,
    /// Where flight logs go; none are written without it.
    pub flight_dir: Option<PathBuf>,
    /// Sees what goes into and comes out of every tick, in the loop's thread. For tests and replay.
    pub recorder: Option<Recorder>,
}

/// Why a server did not start.
#[derive(Debug, Error)]
pub enum StartError {
    /// The rig.
    #[error(transparent)]
    Rig(#[from] host::HostError),
    /// The files of an encrypted service.
    #[error(transparent)]
    Certificate(#[from] CertificateError),
}

/// A server whose loop runs.
pub struct Server {
    setup: ServiceSetup,
    end: ServiceEnd,
    host: Host,
    notices: Vec<String>,
    period_ns: u64,
    time: Time,
    started_ns: u64,
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
    /// Attaches the rig's motors and starts the loop.
    ///
    /// # Errors
    /// The port, the controllers, or the system; nothing is left running.
    pub fn start(options: ServerOptions) -> Result<Self, StartError> {
        let ServerOptions { rig, scene, time, duration, token, buses, last_word, flight_dir, recorder } =
            options;
        let encryption = rig.api.tls.as_ref().map(Encryption::from_files).transpose()?;
        let phenomena = at_start(&scene);
        let mut running = RunningScene::new();
        let scene = Box::new(running.load(scene));
        let mut notices = notices(flight_dir.as_deref());
        let ticks = duration.map(|d| (d.as_secs_f64() * f64::from(rig.rate_hz)).ceil() as u64);
        let (host, end) = Host::start(host::HostOptions {
            rig: rig.clone(),
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
        let setup = ServiceSetup { rig, scene: running, phenomena, token, encryption, flight_dir, accuracy };
        Ok(Self { setup, end, host, notices, period_ns, time, started_ns: now_ns() })
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
        let Self { setup, end, mut host, notices: _, period_ns, time, started_ns } = self;
        // Zero torque first: the loop stops before the clients are told.
        let stopping = {
            let stop = host.stop_flag();
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
        let ended = host.end();
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

/// What the simulated rig shows at the start: it is ideal and in a hand that turns it about, unless
/// the scene says otherwise.
fn at_start(scene: &SceneFile) -> Phenomena {
    let otherwise = || Phenomena { hand: Some(Hand::default()), ..Phenomena::default() };
    scene.simulate().copied().unwrap_or_else(otherwise)
}

/// What a user should know before the first client comes.
fn notices(flight_dir: Option<&std::path::Path>) -> Vec<String> {
    let mut notices = Vec::from_iter(service::too_few_descriptors());
    if let Some(dir) = flight_dir
        && let Err(error) = flight::prepare(dir)
    {
        notices.push(format!("no flight logs can be written to {}: {error}", dir.display()));
    }
    notices
}

/// Replaces the phenomena of the simulated rig by those of a scene.
fn replace_phenomena(simulator: Simulator) -> SetPhenomena {
    Box::new(move |simulate: &Simulate| simulator.show(*simulate))
}
