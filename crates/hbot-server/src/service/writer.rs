//! Sends the queued messages of a client over its socket.

use std::future::{Future as _, poll_fn};
use std::io;
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use tokio::io::{AsyncWrite, WriteHalf};
use tokio::time::{Sleep, sleep};

use super::outbox::Inbox;

/// Sends the messages in a client's queue over its socket.
pub(super) struct Writer<S> {
    half: WriteHalf<S>,
    inbox: Inbox,
    /// The bytes taken from the queue that are being sent.
    batch: Vec<u8>,
    /// Number of the bytes in `batch` that have been sent.
    sent: usize,
    flushed: bool,
    stuck: Duration,
    /// A timer that ends when a client that accepts no bytes is considered gone. `None` while
    /// sending makes progress.
    deadline: Option<Pin<Box<Sleep>>>,
}

impl<S: AsyncWrite> Writer<S> {
    /// Creates a writer. A client that accepts no byte for the time `stuck` is considered gone.
    pub(super) fn new(half: WriteHalf<S>, inbox: Inbox, stuck: Duration) -> Self {
        Self { half, inbox, batch: Vec::new(), sent: 0, flushed: true, stuck, deadline: None }
    }

    /// Sends messages until the hub drops its end of the queue. Fails if the connection is broken,
    /// or if the client has accepted no byte for too long. Cancel safe.
    pub(super) async fn run(&mut self) -> io::Result<()> {
        poll_fn(|context| self.poll(context)).await
    }

    /// Suppresses wake-ups by new messages until `run` is polled again.
    pub(super) fn hush(&mut self) {
        self.inbox.hush();
    }

    fn poll(&mut self, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        loop {
            while self.sent < self.batch.len() {
                let written = Pin::new(&mut self.half).poll_write(context, &self.batch[self.sent..]);
                match ready!(self.in_time(context, written))? {
                    0 => return Poll::Ready(Err(io::ErrorKind::WriteZero.into())),
                    n => self.sent += n,
                }
            }
            if !self.flushed {
                // Flush the bytes that the encryption has taken and the socket has not.
                let flushed = Pin::new(&mut self.half).poll_flush(context);
                ready!(self.in_time(context, flushed))?;
                self.flushed = true;
            }
            if !ready!(self.inbox.poll_take(context, &mut self.batch)) {
                return Poll::Ready(Ok(()));
            }
            (self.sent, self.flushed) = (0, false);
        }
    }

    /// Returns the result `polled` of sending, or an error if sending has made no progress for too
    /// long. Most results are ready at once, and then no timer is started.
    fn in_time<T>(&mut self, context: &mut Context<'_>, polled: Poll<io::Result<T>>) -> Poll<io::Result<T>> {
        if polled.is_ready() {
            self.deadline = None;
            return polled;
        }
        let stuck = self.stuck;
        let deadline = self.deadline.get_or_insert_with(|| Box::pin(sleep(stuck)));
        deadline.as_mut().poll(context).map(|()| Err(io::ErrorKind::TimedOut.into()))
    }
}
