//! The one owner of what clients share, and its loop.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::future::Future;
use std::io;
use std::net::SocketAddr;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use hbot_api::{Event, StoppingEvent};
use hbot_core::inputs::Command;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Semaphore, mpsc, watch};
use tokio::task::{JoinError, JoinSet};
use tokio::time::{Instant, MissedTickBehavior, interval, sleep_until, timeout};

use super::connection::{FromClient, ToHub};
use super::info::Info;
use super::orders::{Asker, Orders};
use super::peer::Peer;
use super::samples::{Publisher, Watch};
use super::scenes::{Loading, Measured};
use super::stats::{Stats, Summary};
use super::{Bounds, Control, Setup, Status};
use crate::bridge::ServiceEnd;
use crate::flight::{Flight, FlightRecorder};
use crate::sample::Sample;

/// Samples taken before clients have their turn again.
const SAMPLES_A_TURN: usize = 512;
/// Requests taken before samples have their turn again.
const REQUESTS_A_TURN: usize = 64;
/// Requests of all clients that wait for the hub.
const REQUESTS: usize = 256;
/// Bytes of them, read and not yet done.
const REQUEST_BYTES: usize = 4 * hbot_api::MAX_REQUEST_BYTES;
/// How often what nobody else brings up is looked at.
const HEARTBEAT: Duration = Duration::from_millis(50);
/// How long nothing is accepted after the system has refused to.
const ACCEPT_PAUSE: Duration = Duration::from_millis(200);
/// How long messages may take to leave at the end.
const FLUSH: Duration = Duration::from_millis(200);

/// The one owner of what clients share.
pub(super) struct Hub {
    pub(super) bounds: Bounds,
    pub(super) setup: Setup,
    pub(super) end: ServiceEnd,
    pub(super) info: Info,
    pub(super) stats: Stats,
    pub(super) peers: BTreeMap<u64, Peer>,
    /// The session that holds the lease.
    pub(super) holder: Option<u64>,
    pub(super) orders: Orders,
    pub(super) loading: VecDeque<Loading>,
    pub(super) measuring: JoinSet<Measured>,
    pub(super) recorder: Option<FlightRecorder>,
    pub(super) writing: JoinSet<(Flight, io::Result<()>)>,
    pub(super) publisher: Publisher,
    pub(super) watch: Watch,
    pub(super) latest: Option<Sample>,
    pub(super) scratch: Vec<u8>,
    /// Clients to be cut at the end of the turn.
    pub(super) doomed: Vec<u64>,
    pub(super) connections: JoinSet<()>,
    /// Which client a connection's task belongs to.
    pub(super) tasks: HashMap<tokio::task::Id, u64>,
    pub(super) turned_away: JoinSet<()>,
    pub(super) next_session: u64,
    status: watch::Sender<Status>,
    pub(super) to_hub: ToHub,
    from_clients: Option<mpsc::Receiver<FromClient>>,
}

/// What woke the hub.
#[expect(
    clippy::large_enum_variant,
    reason = "there is one at a time, on the stack; a box would take memory for each sample"
)]
enum Wake {
    Shutdown,
    Control(Option<Control>),
    Accepted(io::Result<(TcpStream, SocketAddr)>),
    Message(Option<FromClient>),
    Ended(Option<Result<(tokio::task::Id, ()), JoinError>>),
    TurnedAway,
    Measured(Option<Result<Measured, JoinError>>),
    Written(Option<Result<(Flight, io::Result<()>), JoinError>>),
    Sample(Option<Sample>),
    Heartbeat,
}

impl Hub {
    pub(super) fn new(bounds: Bounds, end: ServiceEnd, setup: Setup, status: watch::Sender<Status>) -> Self {
        let (queue, from_clients) = mpsc::channel(REQUESTS);
        let to_hub = ToHub { queue, room: Arc::new(Semaphore::new(REQUEST_BYTES)) };
        let period_ns = setup.rig.rig.timing.period_ns;
        let simulated = setup.phenomena.is_some();
        Self {
            bounds,
            end,
            info: Info::new(&setup.rig, &setup.accuracy, simulated),
            stats: Stats::new(),
            peers: BTreeMap::new(),
            holder: None,
            orders: Orders::default(),
            loading: VecDeque::new(),
            measuring: JoinSet::new(),
            recorder: setup.flight_dir.clone().map(|dir| FlightRecorder::new(dir, period_ns)),
            writing: JoinSet::new(),
            publisher: Publisher::new(),
            watch: Watch::default(),
            latest: None,
            scratch: Vec::new(),
            doomed: Vec::new(),
            connections: JoinSet::new(),
            tasks: HashMap::new(),
            turned_away: JoinSet::new(),
            next_session: 1,
            status,
            to_hub,
            from_clients: Some(from_clients),
            setup,
        }
    }

    /// Serves until `shutdown`, or until the loop has ended.
    pub(super) async fn run(
        mut self,
        listener: TcpListener,
        mut control: mpsc::Receiver<Control>,
        shutdown: impl Future<Output = ()>,
    ) -> Summary {
        let mut shutdown = pin!(shutdown);
        let Some(mut from_clients) = self.from_clients.take() else { return self.stats.summary() };
        let mut heartbeat = interval(HEARTBEAT);
        heartbeat.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut controlled = true;
        let mut accept_after = None;
        self.tell_status();
        let why = loop {
            if self.drain() {
                // There are more: connections have their turn between.
                tokio::task::yield_now().await;
            }
            let wake = tokio::select! {
                () = &mut shutdown => Wake::Shutdown,
                wanted = control.recv(), if controlled => Wake::Control(wanted),
                message = from_clients.recv() => Wake::Message(message),
                accepted = accept(&listener, accept_after) => Wake::Accepted(accepted),
                ended = self.connections.join_next_with_id(), if !self.connections.is_empty() => Wake::Ended(ended),
                _ = self.turned_away.join_next(), if !self.turned_away.is_empty() => Wake::TurnedAway,
                measured = self.measuring.join_next(), if !self.measuring.is_empty() => Wake::Measured(measured),
                written = self.writing.join_next(), if !self.writing.is_empty() => Wake::Written(written),
                _ = heartbeat.tick() => Wake::Heartbeat,
                sample = self.end.sample() => Wake::Sample(sample),
            };
            match wake {
                Wake::Shutdown => break "the server stops",
                Wake::Sample(None) => break "the loop has ended",
                Wake::Control(Some(Control::Estop)) => {
                    self.order_internally("estop by signal", Command::Estop)
                }
                Wake::Control(Some(Control::Summarize(wanted))) => {
                    // Who no longer waits for it needs none.
                    let _ = wanted.send(Box::new(self.stats.summary()));
                }
                Wake::Control(Some(Control::Refused(code))) => self.stats.refused(code),
                #[cfg(test)]
                Wake::Control(Some(Control::Fail)) => panic!("as a test asks"),
                Wake::Control(None) => controlled = false,
                Wake::Message(Some(message)) => {
                    self.message(message);
                    for _ in 1..REQUESTS_A_TURN {
                        let Ok(message) = from_clients.try_recv() else { break };
                        self.message(message);
                    }
                    // The answers leave first, before everything else is looked at again.
                    tokio::task::yield_now().await;
                }
                // The hub itself keeps a sender.
                Wake::Message(None) | Wake::TurnedAway => {}
                Wake::Accepted(Ok((stream, address))) => {
                    accept_after = None;
                    self.accept(stream, address);
                }
                Wake::Accepted(Err(error)) => {
                    // Out of descriptors or memory: trying again at once would only spin.
                    tracing::warn!(%error, "a connection could not be accepted");
                    accept_after = Some(Instant::now() + ACCEPT_PAUSE);
                }
                Wake::Ended(ended) => self.ended(ended),
                Wake::Measured(measured) => self.measured(measured),
                Wake::Written(written) => self.written(written),
                Wake::Sample(Some(sample)) => self.take(&sample),
                Wake::Heartbeat => self.heartbeat(),
            }
            self.bury();
        };
        // Connections that have more to say learn that nobody listens.
        drop(from_clients);
        self.close(why).await
    }

    /// Takes the samples that are there; true where there may be more.
    fn drain(&mut self) -> bool {
        let mut more = true;
        for _ in 0..SAMPLES_A_TURN {
            let Some(sample) = self.end.try_sample() else {
                more = false;
                break;
            };
            self.take(&sample);
        }
        self.orders.retry(&mut self.end);
        more
    }

    pub(super) fn order_internally(&mut self, what: &'static str, command: Command) {
        self.orders.insist(&mut self.end, Asker::Service(what), command);
    }

    fn heartbeat(&mut self) {
        let now = Instant::now();
        let mut events = Vec::new();
        for (session, peer) in self.peers.iter_mut().filter(|(_, peer)| peer.listens()) {
            events.extend(peer.dropped_event().map(|event| (*session, event)));
            events.extend(peer.refused_event(now).map(|event| (*session, event)));
        }
        for (session, event) in events {
            self.tell(session, &event);
        }
        self.status.send_modify(|status| status.sample = self.latest);
    }

    pub(super) fn tell_status(&self) {
        self.status.send_modify(|status| {
            status.sample = self.latest;
            status.clients = self.peers.values().filter(|peer| peer.listens()).count();
            status.holder = self.holder_name();
            self.setup.scene.file().name().clone_into(&mut status.scene);
        });
    }

    /// Says goodbye and lets everything go.
    async fn close(mut self, why: &str) -> Summary {
        self.broadcast(&Event::Stopping(StoppingEvent { message: why.to_owned() }));
        // Connections end once all that waits for their clients has been sent.
        self.peers.clear();
        let Self { mut connections, mut writing, mut recorder, mut stats, .. } = self;
        let _ = timeout(FLUSH, async { while connections.join_next().await.is_some() {} }).await;
        connections.shutdown().await;
        while let Some(flight) = recorder.as_mut().and_then(FlightRecorder::finish) {
            writing.spawn_blocking(move || {
                let result = flight.write();
                (flight, result)
            });
        }
        while let Some(written) = writing.join_next().await {
            stats.written(written);
        }
        stats.summary()
    }
}

/// The next connection, not before `after`. Cancel safe.
async fn accept(listener: &TcpListener, after: Option<Instant>) -> io::Result<(TcpStream, SocketAddr)> {
    if let Some(after) = after {
        sleep_until(after).await;
    }
    listener.accept().await
}
