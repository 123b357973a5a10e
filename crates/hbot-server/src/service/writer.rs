//! From a client's queue to its socket.

use std::future::{Future as _, poll_fn};
use std::io;
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use tokio::io::{AsyncWrite, WriteHalf};
use tokio::time::{Sleep, sleep};

use super::outbox::Inbox;

/// Sends what waits for a client.
pub(super) struct Writer<S> {
    half: WriteHalf<S>,
    inbox: Inbox,
    /// Taken from there, and sent up to `sent`.
    batch: Vec<u8>,
    sent: usize,
    flushed: bool,
    stuck: Duration,
    /// When a client that takes nothing counts as gone; `None` while it takes what it gets.
    deadline: Option<Pin<Box<Sleep>>>,
}

impl<S: AsyncWrite> Writer<S> {
    /// One for a client that may take no byte for `stuck`.
    pub(super) fn new(half: WriteHalf<S>, inbox: Inbox, stuck: Duration) -> Self {
        Self { half, inbox, batch: Vec::new(), sent: 0, flushed: true, stuck, deadline: None }
    }

    /// Sends until the hub lets go. Fails where the connection is broken, or has taken no byte for so long that it counts as such.
    /// Cancel safe.
    pub(super) async fn run(&mut self) -> io::Result<()> {
        poll_fn(|context| self.poll(context)).await
    }

    /// What comes until it runs again need not wake it.
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
                // What encryption has taken and the socket has not yet.
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

    /// The same, but an error where it takes too long. There is no timer where it happens at once, as nearly everything does.
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
