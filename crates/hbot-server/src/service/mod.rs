//! The TCP service. It connects clients to the loop through the loop's lock-free rings.
//!
//! The `hub` owns everything that clients share: the channels to the loop, the scene, the lease,
//! subscriptions, statistics and the flight recorder. It never waits. All tasks run on the
//! service's single thread and use the hub through a `SharedHub`, one at a time:
//!
//! - the task of each `connection`. Its `reader` turns bytes into requests, and its `writer` sends
//!   the messages that are queued for the client.
//! - the service's own task (`run`), which accepts connections and takes samples from the loop.
//!
//! ```text
//! socket -> reader -> hub -> orders, scenes -> loop
//! socket <- writer <- outbox (each client, 256) <- hub <- samples <- loop
//! ```
//!
//! A request is executed as soon as it is read, and its answer is written to the socket before the
//! connection does anything else.
//!
//! If a client exceeds its request rate, its requests wait. Its connection still reads ahead for a
//! while, so that a stop behind the waiting requests is found.
//!
//! If a client reads more slowly than the hub writes, it first loses states (`outbox`), which a
//! `dropped` event counts. If there is no room for an answer either, or if no byte can be sent for
//! several seconds, the connection is closed.
//!
//! Blocking work, such as measuring the cost of effects and writing flight logs, is done on other
//! threads.
//!
//! If a client is subscribed to states, the loop wakes the service at every sample. Otherwise the
//! loop wakes it only at notable events: a new mode, cause or scene, an answer, or many waiting
//! samples (see the module `bridge` of hbot-host).

mod bucket;
mod connection;
mod controllers;
pub(crate) mod convert;
mod cost;
mod flights;
mod hand;
mod hub;
mod incidents;
mod info;
mod lease;
mod models;
mod orders;
mod outbox;
mod outlook;
mod peer;
mod publisher;
mod reader;
mod refusals;
mod run;
mod scenes;
mod shakes;
mod shared_hub;
mod stats;
mod unauthenticated;
mod wakeups;
mod writer;

#[cfg(test)]
mod tests;

use std::future::Future;
use std::path::PathBuf;
use std::time::Duration;

/// The statistics of a run, as the op `stats` returns them.
pub use hbot_api::StatsOk as Summary;

use hbot_api::ErrorCode;
use hbot_config::scene::Simulate;
use hbot_config::{RigConfig, RunningScene};
use tokio::net::TcpListener;
use tokio::sync::{mpsc, oneshot, watch};

pub use self::hand::{HandOrder, MoveHand, SimulatedHand};
pub use self::scenes::set_refusal;
pub(crate) use self::unauthenticated::too_few_descriptors;
use crate::recording::Notes;
use crate::tls::Encryption;
use crate::web::WebOptions;
use hbot_host::rig::controllers::Controllers;
use hbot_host::run_loop::bridge::ServiceEnd;
use hbot_host::run_loop::clock::Origin;
use hbot_host::run_loop::sample::Sample;

/// A function that gives the simulated rig the phenomena of a scene.
pub type SetPhenomena = Box<dyn FnMut(&Simulate) + Send>;

/// The settings with which the service is started.
pub struct ServiceSetup {
    /// The configuration of the rig that the loop drives.
    pub rig: RigConfig,
    /// The scene that the loop is already running.
    pub scene: RunningScene,
    /// The function that receives the phenomena that a newly loaded scene names. `None` with a real
    /// rig, which ignores phenomena.
    pub phenomena: Option<SetPhenomena>,
    /// The simulated hand. `None` with a real rig.
    pub hand: Option<SimulatedHand>,
    /// The token that clients must send. With `None` no token is required.
    pub token: Option<String>,
    /// The TLS encryption of connections. With `None` connections are plain TCP.
    pub encryption: Option<Encryption>,
    /// The folder for flight logs. With `None` no logs are written.
    pub flight_dir: Option<PathBuf>,
    /// The motor controllers of the rig's joints, for the answer to `controllers`.
    pub controllers: Controllers,
    /// Name of the preset of numerical methods in use, for the answer to `info`.
    pub accuracy: String,
    /// The time of tick 0 on the system's clocks.
    pub origin: Origin,
    /// Whether the loop's time waits instead of skipping ticks ([`Host::time_waits`]).
    ///
    /// [`Host::time_waits`]: hbot_host::rig::host::Host::time_waits
    pub time_waits: bool,
    /// Passes scenes and events to the recorder.
    pub(crate) notes: Notes,
    /// The page and the API over WebSocket. With `None` they are not served.
    pub web: Option<WebOptions>,
}

/// A request to the service from another part of the program, such as the metrics page.
#[derive(Debug)]
pub enum Control {
    /// Asks for the statistics of the run, which are sent through this channel.
    Summarize(oneshot::Sender<Box<Summary>>),
    /// Asks the service to count a refusal that happened outside of the TCP service, such as at the
    /// metrics page.
    Refused(ErrorCode),
}

/// A summary of the service's present state, for display in a terminal.
#[derive(Debug, Clone, Default)]
pub struct Status {
    /// The newest sample of the loop. `None` before the first.
    pub sample: Option<Sample>,
    /// Number of connected clients that have sent their hello.
    pub clients: usize,
    /// Name of the client that holds the lease, if any.
    pub holder: Option<String>,
    /// Name of the running scene.
    pub scene: String,
}

impl Status {
    /// Returns the mode of the rig as it is called in messages. In mode `fault`, returns the cause
    /// instead. Before the first sample, returns `"starting"`.
    #[must_use]
    pub fn mode(&self) -> &'static str {
        let Some(sample) = &self.sample else { return "starting" };
        match sample.state.cause {
            Some(cause) => convert::fault(cause).as_str(),
            None => convert::mode(sample.state.mode).as_str(),
        }
    }
}

/// The limits that the service sets for its clients.
#[derive(Debug, Clone, Copy)]
struct Bounds {
    /// Largest number of simultaneous connections.
    connections: usize,
    /// Number of places, among `connections` and among `unauthenticated`, that are reserved for
    /// programs on this machine.
    local: usize,
    /// Largest number of simultaneous connections that have not sent their hello yet. Of these,
    /// `local` places are reserved for programs on this machine.
    unauthenticated: usize,
    /// Time within which a client must send its hello.
    hello: Duration,
    /// Delay before the answer to a wrong token, which slows down guessing.
    wrong_token: Duration,
    /// Time after which a client over WebSocket from which nothing comes, not even answers to
    /// pings, is considered gone.
    silence: Duration,
    /// Time without progress in sending to a client after which the client is considered gone.
    stuck: Duration,
    /// Largest number of messages that wait to be sent to one client.
    outgoing: usize,
    /// Ordinary requests per second that one client can make. A request that takes longer counts as
    /// several.
    requests_per_s: u32,
}

impl Default for Bounds {
    fn default() -> Self {
        Self {
            connections: 64,
            local: 8,
            unauthenticated: 32,
            hello: Duration::from_secs(2),
            wrong_token: Duration::from_millis(500),
            silence: Duration::from_secs(30),
            stuck: Duration::from_secs(5),
            outgoing: 256,
            requests_per_s: 100_000,
        }
    }
}

/// Serves the clients of `listener`, and those of the web port, until `shutdown` completes, or
/// until the loop has ended and all its samples are taken. Then notifies the clients, which takes
/// at most 200 ms, finishes the flight logs and returns the statistics of the run. Needs a tokio
/// runtime with I/O and time. One thread is enough.
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

/// Serves clients like [`serve`], with the limits `bounds` instead of the default ones.
async fn serve_within(
    bounds: Bounds,
    listener: TcpListener,
    end: ServiceEnd,
    setup: ServiceSetup,
    control: mpsc::Receiver<Control>,
    status: watch::Sender<Status>,
    shutdown: impl Future<Output = ()>,
) -> Summary {
    let mut setup = setup;
    let listeners = run::Listeners::new(listener, setup.web.take());
    let hub = shared_hub::SharedHub::new(hub::Hub::new(bounds, end, setup, status));
    run::run(hub, listeners, control, shutdown).await
}
