//! The service's own task: it lets clients in, hears the loop, and waits for what nobody else waits for.

use std::collections::HashMap;
use std::future::{Future, poll_fn};
use std::io;
use std::net::SocketAddr;
use std::pin::pin;
use std::task::{Context, Poll};
use std::time::Duration;

use hbot_api::{ErrorBody, ErrorCode};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::mpsc;
use tokio::task::{Id, JoinError, JoinSet, yield_now};
use tokio::time::{Instant, MissedTickBehavior, interval, sleep_until, timeout};

use super::bell::Ringing;
use super::desk::Desk;
use super::flights::Written;
use super::hub::Hub;
use super::outbox::outbox;
use super::peer::Peer;
use super::scenes::Measured;
use super::strangers::Taken;
use super::{Control, Summary, connection};

/// How often what nobody else brings up is looked at.
const HEARTBEAT: Duration = Duration::from_millis(50);
/// How long nothing is accepted after the system has refused to.
const ACCEPT_PAUSE: Duration = Duration::from_millis(200);
/// How long messages may take to leave at the end.
const FLUSH: Duration = Duration::from_millis(200);

/// The tasks of connections.
struct Connections {
    desk: Desk,
    serving: JoinSet<()>,
    /// Which client a task belongs to.
    sessions: HashMap<Id, Session>,
    turned_away: JoinSet<()>,
}

/// Whom a task serves.
struct Session {
    number: u64,
    /// A program on this machine.
    local: bool,
}

/// What woke the service's task.
enum Wake {
    Shutdown,
    Control(Option<Control>),
    Accepted(io::Result<(TcpStream, SocketAddr)>),
    Ended(Option<Result<(Id, ()), JoinError>>),
    TurnedAway,
    Measured(Result<Measured, JoinError>),
    Written(Written),
    Changed,
    Rung(io::Result<()>),
    Heartbeat,
}

/// Serves until `shutdown`, or until the loop has ended.
pub(super) async fn run(
    desk: Desk,
    listener: TcpListener,
    mut control: mpsc::Receiver<Control>,
    shutdown: impl Future<Output = ()>,
) -> Summary {
    let mut shutdown = pin!(shutdown);
    let mut heartbeat = interval(HEARTBEAT);
    heartbeat.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut controlled = true;
    let mut accept_after = None;
    let (bell, changed) = desk.turn(|hub| {
        hub.tell_status();
        (hub.bell(), hub.changed())
    });
    let mut connections = Connections::new(desk.clone());
    // Without it the service cannot go on: it ends as by any other fault of its own, with zero torque.
    let bell = Ringing::of(bell).unwrap_or_else(|error| panic!("the loop cannot be heard: {error}"));
    let why = loop {
        let (more, over) = desk.turn(|hub| {
            hub.drain();
            (hub.has_samples(), hub.is_over())
        });
        if over {
            break "the loop has ended";
        }
        if more {
            // Connections have their turn between.
            yield_now().await;
        }
        let wake = tokio::select! {
            () = &mut shutdown => Wake::Shutdown,
            wanted = control.recv(), if controlled => Wake::Control(wanted),
            accepted = accept(&listener, accept_after) => Wake::Accepted(accepted),
            ended = connections.serving.join_next_with_id(), if !connections.serving.is_empty() => Wake::Ended(ended),
            _ = connections.turned_away.join_next(), if !connections.turned_away.is_empty() => Wake::TurnedAway,
            measured = next_of(&desk, Hub::poll_measured) => Wake::Measured(measured),
            written = next_of(&desk, Hub::poll_written) => Wake::Written(written),
            () = changed.notified() => Wake::Changed,
            _ = heartbeat.tick() => Wake::Heartbeat,
            rung = samples(&desk, &bell) => Wake::Rung(rung),
        };
        match wake {
            Wake::Shutdown => break "the server stops",
            Wake::Rung(Err(_)) => break "the loop is not heard",
            Wake::Control(Some(Control::Summarize(wanted))) => {
                // Who no longer waits for it needs none.
                let _ = wanted.send(Box::new(desk.turn(Hub::summary)));
            }
            Wake::Control(Some(Control::Refused(code))) => desk.turn(|hub| hub.refused(code)),
            Wake::Control(None) => controlled = false,
            Wake::Accepted(Ok((stream, address))) => {
                accept_after = None;
                connections.accept(stream, address);
            }
            Wake::Accepted(Err(error)) => {
                // Out of descriptors or memory: trying again at once would only spin.
                tracing::warn!(%error, "a connection could not be accepted");
                accept_after = Some(Instant::now() + ACCEPT_PAUSE);
            }
            Wake::Ended(ended) => connections.ended(ended),
            Wake::Measured(measured) => desk.turn(|hub| hub.measured(measured)),
            Wake::Written(written) => desk.turn(|hub| hub.written(written)),
            Wake::Heartbeat => desk.turn(Hub::heartbeat),
            // The next turn takes the samples, and what is waited for is another.
            Wake::Rung(Ok(())) | Wake::TurnedAway | Wake::Changed => {}
        }
    };
    close(desk, connections, why).await
}

/// Waits until there are samples to be taken, or the loop has ended. Cancel safe.
async fn samples(desk: &Desk, bell: &Ringing) -> io::Result<()> {
    let there = || {
        let hub = desk.hub();
        hub.has_samples() || hub.is_over()
    };
    while !there() {
        let every = desk.hub().is_watched();
        bell.set(every);
        if there() {
            break;
        }
        bell.rung().await?;
    }
    Ok(())
}

/// The end of the next of the hub's works on other threads; never where there are none. Cancel safe.
async fn next_of<T>(desk: &Desk, poll: fn(&mut Hub, &mut Context<'_>) -> Poll<T>) -> T {
    poll_fn(|context| poll(&mut desk.hub(), context)).await
}

/// The next connection, not before `after`. Cancel safe.
async fn accept(listener: &TcpListener, after: Option<Instant>) -> io::Result<(TcpStream, SocketAddr)> {
    if let Some(after) = after {
        sleep_until(after).await;
    }
    listener.accept().await
}

/// Says goodbye and lets everything go.
async fn close(desk: Desk, mut connections: Connections, why: &str) -> Summary {
    let flights = desk.turn(|hub| hub.farewell(why));
    let _ = timeout(FLUSH, async { while connections.serving.join_next().await.is_some() {} }).await;
    connections.serving.shutdown().await;
    let flights = flights.finish().await;
    desk.hub().last_summary(&flights)
}

impl Connections {
    fn new(desk: Desk) -> Self {
        Self { desk, serving: JoinSet::new(), sessions: HashMap::new(), turned_away: JoinSet::new() }
    }

    /// Takes a connection in, or turns it away.
    fn accept(&mut self, stream: TcpStream, address: SocketAddr) {
        let mut hub = self.desk.hub();
        let local = address.ip().to_canonical().is_loopback();
        let mut placed = self.taken(&hub).place(hub.bounds(), local);
        if placed.is_err() && hub.cut_a_guess() {
            placed = self.taken(&hub).place(hub.bounds(), local);
        }
        if let Err(full) = placed {
            hub.turned_away();
            tracing::warn!(%address, "turned away: {full}");
            // Those who come even faster get no answer at all, and neither do those who would have to decrypt it.
            if hub.encryption().is_none() && self.turned_away.len() < hub.bounds().connections {
                let error = ErrorBody::new(ErrorCode::Busy, format!("{full}; try again later"));
                self.turned_away.spawn(connection::turn_away(stream, error));
            }
            return;
        }
        // Without it a small answer may wait for the acknowledgement of the one before; a connection works all the same.
        let _ = stream.set_nodelay(true);
        // Nor without this, but then it lasts for ever where the client's machine or the cable is gone.
        if let Err(error) = connection::watch_over(&stream) {
            tracing::debug!(%address, %error, "no keepalive");
        }
        let session = hub.next_session();
        tracing::debug!(session, %address, "connected");
        let (outbox, inbox) = outbox(hub.bounds().outgoing);
        let task = self.serving.spawn(connection::serve(
            stream,
            hub.encryption().cloned(),
            session,
            self.desk.clone(),
            inbox,
            *hub.bounds(),
        ));
        self.sessions.insert(task.id(), Session { number: session, local });
        hub.admit(session, Peer::new(outbox, task, address.ip()));
    }

    /// The places that are taken.
    fn taken(&self, hub: &Hub) -> Taken {
        Taken {
            // Tasks rather than clients: one that has been refused may still be on its way out.
            all: self.serving.len(),
            remote: self.sessions.values().filter(|session| !session.local).count(),
            strangers: hub.strangers(),
        }
    }

    /// A connection's task has ended. What it had to say came before, unless it was cut or panicked.
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
            self.desk.turn(|hub| hub.gone(session));
        }
    }
}
