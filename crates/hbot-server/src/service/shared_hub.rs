//! Shared access to the hub for connections and the service's task.

use std::panic::resume_unwind;
use std::sync::{Arc, Mutex, MutexGuard};

use hbot_api::{Id, Request, RequestRefusal};

use super::hub::{First, Gone, Hub};

/// Shared access to the hub. Tasks use the hub one at a time, and none of them waits meanwhile. All
/// run on the service's single thread, so they never block each other.
#[derive(Clone)]
pub(super) struct SharedHub(Arc<Mutex<Hub>>);

impl SharedHub {
    pub(super) fn new(hub: Hub) -> Self {
        Self(Arc::new(Mutex::new(hub)))
    }

    /// Returns exclusive access to the hub.
    ///
    /// # Panics
    /// Panics if an earlier use of the hub has panicked, because the hub's state may be
    /// inconsistent. This ends the service, and with it the torque.
    pub(super) fn lock(&self) -> MutexGuard<'_, Hub> {
        self.0.lock().unwrap_or_else(|_| resume_unwind(Box::new("a turn of the hub has panicked")))
    }

    /// Runs `act` on the hub. First sends waiting states to subscribers. Afterwards closes the
    /// connections of clients that do not read.
    ///
    /// # Panics
    /// Panics like [`lock`](Self::lock).
    pub(super) fn turn<R>(&self, act: impl FnOnce(&mut Hub) -> R) -> R {
        let mut hub = self.lock();
        if hub.is_watched() {
            hub.drain();
        }
        let result = act(&mut hub);
        hub.close_unresponsive();
        result
    }

    /// Passes the first message of a connection to the hub. Returns how the connection continues.
    pub(super) fn first(&self, session: u64, message: Result<Request, RequestRefusal>) -> First {
        self.turn(|hub| hub.first(session, message))
    }

    /// Sends the refusal of a connection's first message, which was delayed because its token was
    /// wrong.
    pub(super) fn refuse_first(&self, session: u64, refusal: RequestRefusal) {
        self.turn(|hub| hub.refuse_first(session, refusal));
    }

    /// Passes a message that follows the hello to the hub. Returns whether the hub accepts more
    /// messages from this connection.
    pub(super) fn message(&self, session: u64, message: Result<Request, RequestRefusal>) -> bool {
        self.turn(|hub| hub.message(session, message))
    }

    /// Answers an `estop` request, which already stopped the loop when its bytes arrived. Returns
    /// whether the hub accepts more messages from this connection.
    pub(super) fn stopped(&self, session: u64, id: Option<Id>) -> bool {
        self.turn(|hub| hub.stopped(session, id))
    }

    /// Informs the hub that the connection has ended, or that the client will send no more.
    pub(super) fn gone(&self, session: u64, why: Gone) {
        self.turn(|hub| hub.leave(session, why));
    }
}
