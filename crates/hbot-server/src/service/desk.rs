//! The way from connections to the hub, which they share.

use std::panic::resume_unwind;
use std::sync::{Arc, Mutex, MutexGuard};

use hbot_api::{Id, Request, RequestRefusal};

use super::hub::{First, Gone, Hub};

/// The hub, for whoever has something for it to do. One turn at a time, and none waits for anything: on the one thread of the
/// service they never wait for each other either.
#[derive(Clone)]
pub(super) struct Desk(Arc<Mutex<Hub>>);

impl Desk {
    pub(super) fn new(hub: Hub) -> Self {
        Self(Arc::new(Mutex::new(hub)))
    }

    /// A look at the hub.
    ///
    /// # Panics
    /// Where a turn has panicked: what it leaves behind is not used. That ends the service, and with it the torque.
    pub(super) fn hub(&self) -> MutexGuard<'_, Hub> {
        self.0.lock().unwrap_or_else(|_| resume_unwind(Box::new("a turn of the hub has panicked")))
    }

    /// Has the hub do something: first the states that are there for subscribers, and at the end those go who do not read.
    ///
    /// # Panics
    /// As [`hub`](Self::hub).
    pub(super) fn turn<R>(&self, act: impl FnOnce(&mut Hub) -> R) -> R {
        let mut hub = self.hub();
        if hub.is_watched() {
            hub.drain();
        }
        let result = act(&mut hub);
        hub.bury();
        result
    }

    /// The first message of a connection, hello or not.
    pub(super) fn first(&self, session: u64, message: Result<Request, RequestRefusal>) -> First {
        self.turn(|hub| hub.first(session, message))
    }

    /// The first message of a connection is refused at last.
    pub(super) fn refuse_first(&self, session: u64, refusal: RequestRefusal) {
        self.turn(|hub| hub.refuse_first(session, refusal));
    }

    /// A later message: whether the hub takes others of this connection.
    pub(super) fn message(&self, session: u64, message: Result<Request, RequestRefusal>) -> bool {
        self.turn(|hub| hub.message(session, message))
    }

    /// An `estop` whose bytes have stopped the loop already: whether the hub takes others of this connection.
    pub(super) fn stopped(&self, session: u64, id: Option<Id>) -> bool {
        self.turn(|hub| hub.stopped(session, id))
    }

    /// The connection has ended, or the client will say no more.
    pub(super) fn gone(&self, session: u64, why: Gone) {
        self.turn(|hub| hub.leave(session, why));
    }
}
