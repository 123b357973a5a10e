//! What clients share, in one place. Whoever has something for it to do comes to its `desk`.

use std::collections::{BTreeMap, VecDeque};
use std::io;
use std::sync::Arc;

use hbot_api::{Event, StoppingEvent};
use hbot_core::inputs::Command;
use tokio::sync::{Notify, watch};
use tokio::task::JoinSet;
use tokio::time::Instant;

use super::bucket::LongMessages;
use super::info::Info;
use super::orders::{Asker, Orders};
use super::peer::{Frames, Peer};
use super::samples::{Publisher, Watch};
use super::scenes::{Loading, Measured};
use super::stats::Stats;
use super::strangers::WrongTokens;
use super::{Bounds, Setup, Status, Summary};
use crate::bridge::ServiceEnd;
use crate::flight::{Flight, FlightRecorder};
use crate::sample::Sample;

/// Samples taken before others have their turn again.
const SAMPLES_A_TURN: usize = 512;

/// What clients share.
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
    /// Told when what the service's task waits for has changed: works on other threads have begun, or others watch.
    pub(super) changed: Arc<Notify>,
    pub(super) publisher: Publisher,
    pub(super) watch: Watch,
    pub(super) latest: Option<Sample>,
    pub(super) frames: Frames,
    /// Clients to be cut at the end of the turn.
    pub(super) doomed: Vec<u64>,
    /// When the next message that takes long may be read.
    pub(super) long_messages: LongMessages,
    /// Who has stopped the rig last.
    pub(super) stopper: Option<String>,
    pub(super) wrong_tokens: WrongTokens,
    sessions: u64,
    status: watch::Sender<Status>,
}

impl Hub {
    pub(super) fn new(bounds: Bounds, end: ServiceEnd, setup: Setup, status: watch::Sender<Status>) -> Self {
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
            changed: Arc::new(Notify::new()),
            publisher: Publisher::new(),
            watch: Watch::default(),
            latest: None,
            frames: Frames::default(),
            doomed: Vec::new(),
            long_messages: LongMessages::default(),
            stopper: None,
            wrong_tokens: WrongTokens::default(),
            sessions: 0,
            status,
            setup,
        }
    }

    /// The number of one more connection.
    pub(super) fn next_session(&mut self) -> u64 {
        self.stats.counts.connections += 1;
        self.sessions += 1;
        self.sessions
    }

    /// Whether anybody wants states as they come. Where nobody does, samples wait until something notable happens.
    pub(super) fn is_watched(&self) -> bool {
        self.publisher.is_watched()
    }

    /// How the run goes until now.
    pub(super) fn summary(&mut self) -> Summary {
        self.drain();
        self.stats.summary()
    }

    /// Takes the samples that are there, at most so many a turn.
    pub(super) fn drain(&mut self) {
        for _ in 0..SAMPLES_A_TURN {
            let Some(sample) = self.end.try_sample() else { break };
            self.take(&sample);
        }
        self.orders.retry(&mut self.end);
    }

    pub(super) fn order_internally(&mut self, what: &'static str, command: Command) {
        self.orders.insist(&mut self.end, Asker::Service(what), command);
    }

    /// Looks at what nobody else brings up.
    pub(super) fn heartbeat(&mut self) {
        let now = Instant::now();
        let mut events = Vec::new();
        for (session, peer) in self.peers.iter_mut().filter(|(_, peer)| peer.listens()) {
            events.extend(peer.dropped_event().map(|event| (*session, event)));
            events.extend(peer.refused_event(now).map(|event| (*session, event)));
        }
        for (session, event) in events {
            self.tell(session, &event);
        }
        self.wrong_tokens.tell(now);
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

    /// Says goodbye. Connections end once all that waits for their clients has been sent.
    pub(super) fn farewell(&mut self, why: &str) {
        self.broadcast(&Event::Stopping(StoppingEvent { message: why.to_owned() }));
        self.peers.clear();
    }
}
