//! The service's own task. It accepts connections, takes samples from the loop, and handles events
//! that belong to no connection.

use std::collections::HashMap;
use std::future::{Future, poll_fn};
use std::io;
use std::net::SocketAddr;
use std::pin::pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use hbot_api::{ErrorBody, ErrorCode};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::mpsc;
use tokio::task::{Id, JoinError, JoinSet, yield_now};
use tokio::time::{Instant, MissedTickBehavior, interval, sleep, sleep_until, timeout};

use super::flights::Written;
use super::hub::Hub;
use super::outbox::outbox;
use super::peer::{Peer, ServicePort};
use super::scenes::Examined;
use super::shared_hub::SharedHub;
use super::unauthenticated::Taken;
use super::wakeups::Wakeups;
use super::{Control, Summary, connection};
use crate::web::{AllowedHosts, WebOptions};

/// Period of the service's regular work, such as updating its status, which no event triggers.
const HEARTBEAT: Duration = Duration::from_millis(50);
/// Pause before the next attempt after the operating system has failed to accept a connection.
const ACCEPT_PAUSE: Duration = Duration::from_millis(200);
/// Time limit for sending the remaining messages when the service ends.
const FLUSH: Duration = Duration::from_millis(200);
/// Time limit for the last samples when the service ends: two periods of the slowest loop, 50 Hz,
/// and some time for its end.
const LAST_SAMPLES: Duration = Duration::from_millis(60);
/// Pause before the service looks again whether the loop has ended.
const PAUSE: Duration = Duration::from_millis(1);

/// The sockets at which clients connect.
pub(super) struct Listeners {
    tcp: TcpListener,
    /// The web port, and the names by which browsers may reach it.
    web: Option<(TcpListener, Arc<AllowedHosts>)>,
}

impl Listeners {
    /// Needs a tokio runtime. A web port that cannot be used is logged and not served.
    pub(super) fn new(tcp: TcpListener, web: Option<WebOptions>) -> Self {
        let web = web.and_then(|WebOptions { listener, hosts }| {
            let listener = listener.set_nonblocking(true).and_then(|()| TcpListener::from_std(listener));
            match listener {
                Ok(listener) => Some((listener, hosts)),
                Err(error) => {
                    tracing::warn!(%error, "the page is not served");
                    None
                }
            }
        });
        Self { tcp, web }
    }

    /// Accepts the next connection, but not before `after`. Cancel safe.
    async fn accept(&self, after: Option<Instant>) -> io::Result<Arrival> {
        if let Some(after) = after {
            sleep_until(after).await;
        }
        let (accepted, hosts) = match &self.web {
            None => (self.tcp.accept().await, None),
            Some((web, hosts)) => tokio::select! {
                accepted = self.tcp.accept() => (accepted, None),
                accepted = web.accept() => (accepted, Some(Arc::clone(hosts))),
            },
        };
        accepted.map(|(stream, address)| Arrival { stream, address, hosts })
    }
}

/// A new connection.
struct Arrival {
    stream: TcpStream,
    address: SocketAddr,
    /// The names by which browsers may reach this server. `None` at the TCP port.
    hosts: Option<Arc<AllowedHosts>>,
}

impl Arrival {
    const fn port(&self) -> ServicePort {
        if self.hosts.is_some() { ServicePort::Web } else { ServicePort::Tcp }
    }
}

/// The tasks of all connections.
struct Connections {
    hub: SharedHub,
    serving: JoinSet<()>,
    /// The client that each task serves.
    sessions: HashMap<Id, Session>,
    turned_away: JoinSet<()>,
}

/// The client whose connection a task serves.
struct Session {
    number: u64,
    /// True if the client runs on this machine.
    local: bool,
    port: ServicePort,
}

/// An event that has woken the service's task.
enum Wake {
    Shutdown,
    Control(Option<Control>),
    Accepted(io::Result<Arrival>),
    Ended(Option<Result<(Id, ()), JoinError>>),
    TurnedAway,
    Examined(Result<Examined, JoinError>),
    Written(Written),
    Changed,
    Samples(io::Result<()>),
    Heartbeat,
}

/// Serves clients until `shutdown` completes or the loop has ended. Returns the statistics of the
/// run.
pub(super) async fn run(
    hub: SharedHub,
    listeners: Listeners,
    mut control: mpsc::Receiver<Control>,
    shutdown: impl Future<Output = ()>,
) -> Summary {
    let mut shutdown = pin!(shutdown);
    let mut heartbeat = interval(HEARTBEAT);
    heartbeat.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut controlled = true;
    let mut accept_after = None;
    let (wakeup, changed) = hub.turn(|hub| {
        hub.tell_status();
        (hub.wakeup(), hub.changed())
    });
    let mut connections = Connections::new(hub.clone());
    // Without wake-ups the service cannot run. A panic ends it like any other internal failure,
    // with zero torque.
    let wakeups = Wakeups::of(wakeup).unwrap_or_else(|error| panic!("the loop cannot be heard: {error}"));
    let why = loop {
        let (more, over) = hub.turn(|hub| {
            hub.drain();
            (hub.has_samples(), hub.is_over())
        });
        if over {
            break "the loop has ended";
        }
        if more {
            // Let the connections run between batches of samples.
            yield_now().await;
        }
        let wake = tokio::select! {
            () = &mut shutdown => Wake::Shutdown,
            wanted = control.recv(), if controlled => Wake::Control(wanted),
            accepted = listeners.accept(accept_after) => Wake::Accepted(accepted),
            ended = connections.serving.join_next_with_id(), if !connections.serving.is_empty() => Wake::Ended(ended),
            _ = connections.turned_away.join_next(), if !connections.turned_away.is_empty() => Wake::TurnedAway,
            examined = next_of(&hub, Hub::poll_examined) => Wake::Examined(examined),
            written = next_of(&hub, Hub::poll_written) => Wake::Written(written),
            () = changed.notified() => Wake::Changed,
            _ = heartbeat.tick() => Wake::Heartbeat,
            woken = samples(&hub, &wakeups) => Wake::Samples(woken),
        };
        match wake {
            Wake::Shutdown => break "the server stops",
            Wake::Samples(Err(_)) => break "the loop is not heard",
            Wake::Control(Some(Control::Summarize(wanted))) => {
                // The send fails if the requester no longer waits, which does no harm.
                let _ = wanted.send(Box::new(hub.turn(Hub::summary)));
            }
            Wake::Control(Some(Control::Refused(code))) => hub.turn(|hub| hub.refused(code)),
            Wake::Control(None) => controlled = false,
            Wake::Accepted(Ok(arrival)) => {
                accept_after = None;
                connections.accept(arrival);
            }
            Wake::Accepted(Err(error)) => {
                // The system has run out of descriptors or memory. Retrying at once would only
                // spin.
                tracing::warn!(%error, "a connection could not be accepted");
                accept_after = Some(Instant::now() + ACCEPT_PAUSE);
            }
            Wake::Ended(ended) => connections.ended(ended),
            Wake::Examined(examined) => hub.turn(|hub| hub.examined(examined)),
            Wake::Written(written) => hub.turn(|hub| hub.written(written)),
            Wake::Heartbeat => hub.turn(Hub::heartbeat),
            // The next pass of this loop takes the samples and waits for the changed events.
            Wake::Samples(Ok(())) | Wake::TurnedAway | Wake::Changed => {}
        }
    };
    close(hub, connections, why).await
}

/// Waits until samples from the loop are waiting or the loop has ended. Cancel safe.
async fn samples(hub: &SharedHub, wakeups: &Wakeups) -> io::Result<()> {
    let there = || {
        let hub = hub.lock();
        hub.has_samples() || hub.is_over()
    };
    while !there() {
        let every = hub.lock().is_watched();
        wakeups.arm(every);
        if there() {
            break;
        }
        wakeups.wait().await?;
    }
    Ok(())
}

/// Waits until `poll` reports that the hub's work on another thread is done, and returns its
/// result. Stays pending while there is no such work. Cancel safe.
async fn next_of<T>(hub: &SharedHub, poll: fn(&mut Hub, &mut Context<'_>) -> Poll<T>) -> T {
    poll_fn(|context| poll(&mut hub.lock(), context)).await
}

/// Informs the clients that the service ends, waits up to [`FLUSH`] for their messages to be sent,
/// finishes the flight logs, takes the last samples of the loop, and returns the final statistics.
async fn close(hub: SharedHub, mut connections: Connections, why: &str) -> Summary {
    let flights = hub.turn(|hub| hub.farewell(why));
    let _ = timeout(FLUSH, async { while connections.serving.join_next().await.is_some() {} }).await;
    connections.serving.shutdown().await;
    let flights = flights.finish().await;
    // Samples can still wait in the ring, because the loop does not wake the service for each.
    // Without them, fewer ticks would be counted than recorded.
    let _ = timeout(LAST_SAMPLES, async {
        while !hub.turn(|hub| {
            hub.drain();
            hub.is_over()
        }) {
            sleep(PAUSE).await;
        }
    })
    .await;
    hub.lock().last_summary(&flights)
}

impl Connections {
    fn new(hub: SharedHub) -> Self {
        Self { hub, serving: JoinSet::new(), sessions: HashMap::new(), turned_away: JoinSet::new() }
    }

    /// Accepts a connection, or turns it away if there is no place for it.
    fn accept(&mut self, arrival: Arrival) {
        let mut hub = self.hub.lock();
        let (port, address) = (arrival.port(), arrival.address);
        let Arrival { stream, hosts, .. } = arrival;
        let local = address.ip().to_canonical().is_loopback();
        let mut placed = self.taken(&hub, port).place(hub.bounds(), local);
        if placed.is_err()
            && let Some(closed) = hub.close_wrong_token(port)
        {
            self.sessions.retain(|_, session| session.number != closed);
            placed = self.taken(&hub, port).place(hub.bounds(), local);
        }
        if let Err(full) = placed {
            hub.turned_away();
            tracing::warn!(%address, "turned away: {full}");
            // If very many connections are being turned away, further ones get no answer. With
            // encryption none gets one, because a client could not decrypt it.
            if hub.encryption().is_none() && self.turned_away.len() < hub.bounds().connections {
                let error = ErrorBody::new(ErrorCode::Busy, format!("{full}; try again later"));
                match port {
                    ServicePort::Tcp => self.turned_away.spawn(connection::turn_away(stream, error)),
                    ServicePort::Web => self.turned_away.spawn(connection::turn_away_visitor(stream, error)),
                };
            }
            return;
        }
        // With Nagle's algorithm, a small answer could wait for the acknowledgement of the previous
        // one. The connection works even if this call fails.
        let _ = stream.set_nodelay(true);
        // If this fails, the connection works, but it never ends when the client's machine or the
        // cable is gone.
        if let Err(error) = connection::watch_over(&stream) {
            tracing::debug!(%address, %error, "no keepalive");
        }
        let session = hub.next_session();
        tracing::debug!(session, %address, "connected");
        let (outbox, inbox) = outbox(hub.bounds().outgoing);
        let shared = self.hub.clone();
        let task = match hosts {
            None => {
                let (encryption, bounds) = (hub.encryption().cloned(), *hub.bounds());
                self.serving.spawn(connection::serve(stream, encryption, session, shared, inbox, bounds))
            }
            Some(hosts) => self.serving.spawn(connection::serve_web(stream, hosts, session, shared, inbox)),
        };
        self.sessions.insert(task.id(), Session { number: session, local, port });
        hub.admit(session, Peer::new(outbox, task, address.ip()).at(port));
    }

    /// Returns how many of the places for connections to `port` are taken.
    fn taken(&self, hub: &Hub, port: ServicePort) -> Taken {
        // Count tasks and not clients, because the task of a refused client can still be running.
        let mut there = self.sessions.values().filter(|session| session.port == port);
        let remote = there.clone().filter(|session| !session.local).count();
        Taken { all: there.by_ref().count(), remote, unauthenticated: hub.unauthenticated(port) }
    }

    /// Handles the end of a connection's task. Unless the task has panicked, the hub already knows
    /// that the client is gone. After a panic, this function informs the hub.
    fn ended(&mut self, ended: Option<Result<(Id, ()), JoinError>>) {
        let id = match &ended {
            Some(Ok((id, ()))) => *id,
            Some(Err(error)) => error.id(),
            None => return,
        };
        let Some(Session { number: session, .. }) = self.sessions.remove(&id) else { return };
        if let Some(Err(error)) = ended
            && error.is_panic()
        {
            tracing::error!(session, "the task of a connection has panicked");
            self.hub.turn(|hub| hub.gone(session));
        }
    }
}
