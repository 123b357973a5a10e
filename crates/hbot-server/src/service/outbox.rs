//! What is on its way to one client: a bounded queue between the hub, which never waits, and the connection.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use tokio::sync::mpsc;

/// A message as it goes over the wire, shared by all who get it.
pub(super) type Frame = Arc<[u8]>;

/// Bytes that may wait for a client; an answer to `info` is the longest message, well below a tenth of it. All clients together may have
/// the service hold so much for each.
const MAX_BYTES: usize = 1 << 20;

/// The hub's end.
pub(super) struct Outbox {
    queue: mpsc::Sender<Frame>,
    bytes: Arc<AtomicUsize>,
    /// Samples are being lost until the queue is short again.
    congested: bool,
}

/// The connection's end.
pub(super) struct Inbox {
    queue: mpsc::Receiver<Frame>,
    bytes: Arc<AtomicUsize>,
}

/// Both ends of a queue of at most `messages`.
pub(super) fn outbox(messages: usize) -> (Outbox, Inbox) {
    let (queue, outgoing) = mpsc::channel(messages);
    let bytes = Arc::new(AtomicUsize::new(0));
    let inbox = Inbox { queue: outgoing, bytes: Arc::clone(&bytes) };
    (Outbox { queue, bytes, congested: false }, inbox)
}

impl Outbox {
    /// Queues an answer or event: false where it found no place, or the connection is gone.
    #[must_use]
    pub(super) fn send(&self, frame: Frame) -> bool {
        let length = frame.len();
        // Counted first, so that the other end never takes away what has not been added.
        let waiting = self.bytes.fetch_add(length, Ordering::Relaxed);
        let placed = waiting + length <= MAX_BYTES && self.queue.try_send(frame).is_ok();
        if !placed {
            self.bytes.fetch_sub(length, Ordering::Relaxed);
        }
        placed
    }

    /// Whether the connection has ended by itself.
    pub(super) fn is_closed(&self) -> bool {
        self.queue.is_closed()
    }

    /// Whether a sample may be queued. Samples take at most half of the queue, so answers find a place; once they have
    /// been refused one, they are until three quarters of it are free.
    pub(super) fn takes_samples(&mut self) -> bool {
        let (free, all) = (self.queue.capacity(), self.queue.max_capacity());
        let enough = if self.congested { 3 * all / 4 } else { all / 2 };
        self.congested = free < enough || self.bytes.load(Ordering::Relaxed) > MAX_BYTES / 2;
        !self.congested
    }
}

impl Inbox {
    /// The next message; `None` once the hub has let go and all is taken.
    pub(super) async fn next(&mut self) -> Option<Frame> {
        let frame = self.queue.recv().await?;
        self.bytes.fetch_sub(frame.len(), Ordering::Relaxed);
        Some(frame)
    }

    /// The next message, if there is one.
    pub(super) fn try_next(&mut self) -> Option<Frame> {
        let frame = self.queue.try_recv().ok()?;
        self.bytes.fetch_sub(frame.len(), Ordering::Relaxed);
        Some(frame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(bytes: usize) -> Frame {
        vec![0; bytes].into()
    }

    #[test]
    fn samples_give_way_before_answers_do() {
        let (mut out, mut inbox) = outbox(8);
        let mut samples = 0;
        while out.takes_samples() {
            assert!(out.send(frame(1)));
            samples += 1;
        }
        assert_eq!(samples, 5);
        assert!(out.send(frame(1)) && out.send(frame(1)) && out.send(frame(1)));
        assert!(!out.send(frame(1)), "a ninth message");
        // Not at once, but when most of it has been taken.
        assert!(inbox.try_next().is_some());
        assert!(!out.takes_samples());
        while inbox.try_next().is_some() {}
        assert!(out.takes_samples());
    }

    #[test]
    fn bytes_are_bounded_as_well() {
        let (out, mut inbox) = outbox(8);
        assert!(out.send(frame(MAX_BYTES - 1)));
        assert!(!out.send(frame(2)));
        assert!(inbox.try_next().is_some());
        assert!(out.send(frame(2)));
    }
}
