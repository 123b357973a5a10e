//! The messages that are queued for one client: a bounded queue between the hub, which never waits,
//! and the connection.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Waker};

/// Largest number of bytes that wait to be sent to one client. The longest message, the answer to
/// `info`, is far less than a tenth of it. The service's memory for messages is at most this times
/// the number of clients.
const MAX_BYTES: usize = 1 << 20;
/// Largest buffer that a connection keeps after its messages are sent, bytes.
const KEPT_BYTES: usize = 64 * 1024;

/// The hub's end of the queue of messages for one client.
pub(super) struct Outbox {
    queue: Shared,
    /// True if no samples are queued until most of the queue is free again.
    congested: bool,
}

/// The connection's end of the queue of messages for one client.
pub(super) struct Inbox {
    queue: Shared,
}

#[derive(Clone)]
struct Shared(Arc<Mutex<Queue>>);

/// The encoded messages for one client, one after the other, and their number.
struct Queue {
    bytes: Vec<u8>,
    messages: usize,
    /// Number of bytes and number of messages that the connection has taken and not yet sent
    /// completely.
    sending: (usize, usize),
    most: usize,
    /// True if one of the two ends of the queue has been dropped.
    closed: bool,
    waker: Option<Waker>,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Queue> {
        // No code panics while it holds this lock, so the data of a poisoned lock is valid.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn close(&self) {
        let mut queue = self.lock();
        queue.closed = true;
        if let Some(waker) = queue.waker.take() {
            waker.wake();
        }
    }
}

/// Creates a queue of at most `messages` messages for one client. Returns the hub's end and the
/// connection's end.
pub(super) fn outbox(messages: usize) -> (Outbox, Inbox) {
    let queue =
        Queue { bytes: Vec::new(), messages: 0, sending: (0, 0), most: messages, closed: false, waker: None };
    let queue = Shared(Arc::new(Mutex::new(queue)));
    (Outbox { queue: queue.clone(), congested: false }, Inbox { queue })
}

impl Outbox {
    /// Queues the message that `write` appends to a buffer. Returns `Ok(false)` if there is no room
    /// or the connection is gone.
    ///
    /// # Errors
    /// Returns the errors of `write`. Nothing is queued then.
    pub(super) fn send_with<E>(&self, write: impl FnOnce(&mut Vec<u8>) -> Result<(), E>) -> Result<bool, E> {
        let mut queue = self.queue.lock();
        let before = queue.bytes.len();
        if queue.closed || queue.messages + queue.sending.1 >= queue.most {
            return Ok(false);
        }
        let written = write(&mut queue.bytes);
        let fits = queue.bytes.len() + queue.sending.0 <= MAX_BYTES;
        if written.is_err() || !fits {
            queue.bytes.truncate(before);
            return written.map(|()| false);
        }
        queue.messages += 1;
        if let Some(waker) = queue.waker.take() {
            waker.wake();
        }
        Ok(true)
    }

    /// Queues an encoded message. Returns false if there is no room or the connection is gone. An
    /// empty message, which results from a failed encoding, is ignored and returns true.
    #[must_use]
    pub(super) fn send(&self, message: &[u8]) -> bool {
        if message.is_empty() {
            return true;
        }
        let written: Result<bool, std::convert::Infallible> = self.send_with(|bytes| {
            bytes.extend_from_slice(message);
            Ok(())
        });
        written.is_ok_and(|placed| placed)
    }

    /// Returns whether the connection has dropped its end of the queue.
    pub(super) fn is_closed(&self) -> bool {
        self.queue.lock().closed
    }

    /// Returns whether a sample may be queued. Samples take at most half of the queue, so that
    /// there is room for answers. After a sample was refused, samples are accepted again when three
    /// quarters of the queue are free.
    pub(super) fn takes_samples(&mut self) -> bool {
        let queue = self.queue.lock();
        let (free, all) = (queue.most.saturating_sub(queue.messages + queue.sending.1), queue.most);
        let enough = if self.congested { 3 * all / 4 } else { all / 2 };
        self.congested = free < enough || queue.bytes.len() + queue.sending.0 > MAX_BYTES / 2;
        !self.congested
    }
}

impl Drop for Outbox {
    fn drop(&mut self) {
        self.queue.close();
    }
}

impl Inbox {
    /// Moves all queued messages into `bytes`, whose old content has been sent. Returns false when
    /// the hub has dropped its end of the queue and everything has been sent.
    pub(super) fn poll_take(&mut self, context: &Context<'_>, bytes: &mut Vec<u8>) -> Poll<bool> {
        let mut queue = self.queue.lock();
        queue.sending = (queue.bytes.len(), queue.messages);
        if queue.bytes.is_empty() {
            if queue.closed {
                return Poll::Ready(false);
            }
            if !queue.waker.as_ref().is_some_and(|waker| waker.will_wake(context.waker())) {
                queue.waker = Some(context.waker().clone());
            }
            return Poll::Pending;
        }
        bytes.clear();
        bytes.shrink_to(KEPT_BYTES);
        std::mem::swap(bytes, &mut queue.bytes);
        queue.messages = 0;
        Poll::Ready(true)
    }

    /// Suppresses wake-ups by new messages until the next poll.
    pub(super) fn hush(&mut self) {
        self.queue.lock().waker = None;
    }
}

impl Drop for Inbox {
    fn drop(&mut self) {
        self.queue.lock().closed = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Calls `poll_take` once. Returns its result and the bytes that it took.
    fn take(inbox: &mut Inbox) -> (Poll<bool>, Vec<u8>) {
        let mut bytes = Vec::new();
        let taken = inbox.poll_take(&Context::from_waker(Waker::noop()), &mut bytes);
        (taken, bytes)
    }

    #[test]
    fn samples_give_way_before_answers_do() {
        let (mut out, mut inbox) = outbox(8);
        let mut samples = 0;
        while out.takes_samples() {
            assert!(out.send(b"s"));
            samples += 1;
        }
        assert_eq!(samples, 5);
        assert!(out.send(b"a") && out.send(b"a") && out.send(b"a"));
        assert!(!out.send(b"a"), "a ninth message");
        // There is room again after the messages have been sent, not yet when they have been taken.
        assert_eq!(take(&mut inbox), (Poll::Ready(true), b"sssssaaa".to_vec()));
        assert!(!out.takes_samples() && !out.send(b"a"));
        assert_eq!(take(&mut inbox).0, Poll::Pending);
        assert!(out.takes_samples() && out.send(b"s"));
    }

    #[test]
    fn bytes_are_bounded_as_well() {
        let (out, mut inbox) = outbox(8);
        assert!(out.send(&vec![0; MAX_BYTES - 1]));
        assert!(!out.send(&[0; 2]));
        assert_eq!(take(&mut inbox).1.len(), MAX_BYTES - 1, "nothing is left of what found no place");
        assert!(!out.send(&[0; 2]), "what is being sent counts");
        assert_eq!(take(&mut inbox).0, Poll::Pending);
        assert!(out.send(&[0; 2]));
    }

    #[test]
    fn what_cannot_be_written_leaves_nothing() {
        let (out, mut inbox) = outbox(8);
        let half = out.send_with(|bytes| {
            bytes.extend_from_slice(b"half");
            Err("no more")
        });
        assert_eq!((half, take(&mut inbox).0), (Err("no more"), Poll::Pending));
    }

    #[test]
    fn what_could_not_be_said_takes_no_place() {
        let (out, _inbox) = outbox(2);
        assert!((0..10).all(|_| out.send(b"")));
        assert!(out.send(b"a") && out.send(b"b") && !out.send(b"c"));
    }

    #[test]
    fn either_end_learns_that_the_other_is_gone() {
        let (out, mut inbox) = outbox(8);
        assert!(out.send(b"last") && !out.is_closed());
        drop(out);
        assert_eq!(take(&mut inbox), (Poll::Ready(true), b"last".to_vec()));
        assert_eq!(take(&mut inbox).0, Poll::Ready(false));
        let (out, inbox) = outbox(8);
        drop(inbox);
        assert!(out.is_closed() && !out.send(b"a"));
    }
}
