//! The TCP service: clients on one side, the loop's rings on the other.
//!
//! The `hub` owns everything that clients share: the way to the loop, the scene, the lease, subscriptions, statistics, the flight
//! recorder. It never waits. Who has something for it to do comes to its `desk` and does it in a turn of its own, on the
//! service's one thread: the task of each `connection`, whose `reader` turns bytes into requests and whose `writer` turns what
//! waits for the client into bytes, and the service's own task (`run`), which lets clients in and hears the loop.
//!
//! ```text
//! socket -> reader -> desk -> hub -> orders, scenes -> loop
//! socket <- writer <- outbox (each client, 256) <- hub <- samples <- loop
//! ```
//!
//! A request is done as soon as it is read, and its answer is on the socket before anything else is looked at. Where a client asks
//! faster than it may, its requests wait; its connection reads on for a while, so that a stop behind them is found. Where it reads slower than the hub writes, it loses states first
//! (`outbox`), which a `dropped` event counts; when an answer finds no place either, or nothing has moved for seconds, it loses
//! its connection. Blocking work (measuring what effects cost, writing flight logs) is done on other threads.
//!
//! Where somebody watches, the loop wakes the service at every sample. Where nobody does, at what is notable: another mode, cause
//! or scene, an answer, or many samples (`bridge`).

mod bell;
mod bucket;
mod connection;
pub(crate) mod convert;
mod cost;
mod desk;
mod flights;
mod hub;
mod incidents;
mod info;
mod lease;
mod orders;
mod outbox;
mod peer;
mod publisher;
mod reader;
mod refusals;
mod run;
mod scenes;
mod stats;
mod strangers;
mod writer;

#[cfg(test)]
mod tests;

use std::future::Future;
use std::path::PathBuf;
use std::time::Duration;

/// How a run went: what `stats` answers.
pub use hbot_api::StatsOk as Summary;

use hbot_api::ErrorCode;
use hbot_config::scene::Simulate;
use hbot_config::{RigConfig, RunningScene};
use tokio::net::TcpListener;
use tokio::sync::{mpsc, oneshot, watch};

pub(crate) use self::strangers::too_few_descriptors;
use crate::tls::Encryption;
use hbot_host::bridge::ServiceEnd;
use hbot_host::sample::Sample;

/// Gives the simulated rig other phenomena.
pub type SetPhenomena = Box<dyn FnMut(&Simulate) + Send>;

/// What the service needs to know.
pub struct ServiceSetup {
    /// The rig that the loop drives.
    pub rig: RigConfig,
    /// The scene that the loop already runs.
    pub scene: RunningScene,
    /// Called where a scene that is loaded names phenomena; `None` with a real port, where they are ignored.
    pub phenomena: Option<SetPhenomena>,
    /// The secret that clients must show; `None` where none is asked for.
    pub token: Option<String>,
    /// Encrypts connections; `None` for plain TCP.
    pub encryption: Option<Encryption>,
    /// Where flight logs go; `None` for none.
    pub flight_dir: Option<PathBuf>,
    /// What people call the methods in use, for `info`.
    pub accuracy: String,
}

/// What others than clients ask of the service.
#[derive(Debug)]
pub enum Control {
    /// Tell how the run goes.
    Summarize(oneshot::Sender<Box<Summary>>),
    /// Count a refusal of somebody's who is no client of the API.
    Refused(ErrorCode),
}

/// What is going on, for a line in a terminal.
#[derive(Debug, Clone, Default)]
pub struct Status {
    /// The newest sample; `None` before the first.
    pub sample: Option<Sample>,
    /// Clients that have said hello.
    pub clients: usize,
    /// The name of who holds the lease.
    pub holder: Option<String>,
    /// The name of the scene.
    pub scene: String,
}

impl Status {
    /// What the rig does, as messages say it; the cause where it is in fault.
    #[must_use]
    pub fn mode(&self) -> &'static str {
        let Some(sample) = &self.sample else { return "starting" };
        match sample.state.cause {
            Some(cause) => convert::fault(cause).as_str(),
            None => convert::mode(sample.state.mode).as_str(),
        }
    }
}

/// How much of everything a service bears.
#[derive(Debug, Clone, Copy)]
struct Bounds {
    /// Connections at a time.
    connections: usize,
    /// Of these, places that only programs on this machine may take.
    local: usize,
    /// Connections at a time that have not said hello. Of these, too, `local` are for programs on this machine.
    strangers: usize,
    /// How long a client may take to say hello.
    hello: Duration,
    /// How long the answer to a wrong token takes.
    wrong_token: Duration,
    /// How long a client may take no byte before it counts as gone.
    stuck: Duration,
    /// Messages on their way to one client.
    outgoing: usize,
    /// Ordinary requests a second of one client; those that take longer count as several.
    requests_per_s: u32,
}

impl Default for Bounds {
    fn default() -> Self {
        Self {
            connections: 64,
            local: 8,
            strangers: 32,
            hello: Duration::from_secs(2),
            wrong_token: Duration::from_millis(500),
            stuck: Duration::from_secs(5),
            outgoing: 256,
            requests_per_s: 100_000,
        }
    }
}

/// Serves clients of `listener` until `shutdown` is ready, or until the loop has ended and its samples are fetched. Clients
/// are then told so, which takes at most 200 ms. Needs a tokio runtime with I/O and time; one thread is enough.
pub async fn serve(
    listener: TcpListener,
    end: ServiceEnd,
    setup: ServiceSetup,
    control: mpsc::Receiver<Control>,
    status: watch::Sender<Status>,
    shutdown: impl Future<Output = ()>,
) -> Summary {
    serve_within(Bounds::default(), listener, end, setup, control, status, shutdown).await
}

/// Serves likewise, within other bounds.
async fn serve_within(
    bounds: Bounds,
    listener: TcpListener,
    end: ServiceEnd,
    setup: ServiceSetup,
    control: mpsc::Receiver<Control>,
    status: watch::Sender<Status>,
    shutdown: impl Future<Output = ()>,
) -> Summary {
    let desk = desk::Desk::new(hub::Hub::new(bounds, end, setup, status));
    run::run(desk, listener, control, shutdown).await
}
