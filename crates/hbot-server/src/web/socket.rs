//! A WebSocket that reads and writes the bytes of the TCP service.

use std::future::Future as _;
use std::io;
use std::ops::Range;
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use hbot_api::Encoding;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::{Instant, Sleep, sleep};

use super::frames::{self, Close, Decoder};

/// Number of bytes that are read from the connection at once.
const PIECE: usize = 16 * 1024;
/// Number of bytes of messages that are put into frames at once, unless a message is longer.
const BATCH: usize = 16 * 1024;
/// Number of bytes that the decoder can give in addition to those it gets.
const MORE: usize = 8;

/// The server's end of a WebSocket. Reading it gives the messages of the client as TCP would bring
/// them, writing sends messages.
///
/// Each call of `poll_write` must begin where the one before it has ended, and `bytes` must end
/// with a whole message, as the batches of the writer do.
pub(crate) struct WebSocket<S> {
    stream: S,
    /// Returns the encoding of the connection, which the hello decides.
    encoding: Box<dyn Fn() -> Encoding + Send>,
    decoder: Decoder,
    /// Bytes of the client. Those of this range have not been decoded yet.
    raw: Box<[u8]>,
    waiting: Range<usize>,
    /// Frames that are being sent, and how many of their bytes have been sent.
    staged: Vec<u8>,
    sent: usize,
    /// Number of bytes of messages in `staged` of which the writer does not know yet that they are
    /// sent.
    unreported: usize,
    /// Time after which a silent client is disconnected. It is sent three pings in this time.
    silence: Duration,
    heard_at: Instant,
    /// The time of the next ping.
    next: Pin<Box<Sleep>>,
    ping_due: bool,
    /// True if the last frame, which closes the WebSocket, is among the staged ones.
    closed: bool,
}

impl<S: AsyncRead + AsyncWrite + Unpin> WebSocket<S> {
    /// Returns a WebSocket on `stream`, after the upgrade. `rest` are the bytes that the client has
    /// already sent. A client from which nothing comes for the time `silence` is disconnected.
    pub(crate) fn new(
        stream: S,
        rest: &[u8],
        silence: Duration,
        encoding: impl Fn() -> Encoding + Send + 'static,
    ) -> Self {
        let mut raw = rest.to_vec();
        raw.resize(PIECE.max(rest.len()), 0);
        let (raw, waiting) = (raw.into_boxed_slice(), 0..rest.len());
        Self {
            stream,
            encoding: Box::new(encoding),
            decoder: Decoder::new(),
            raw,
            waiting,
            staged: Vec::new(),
            sent: 0,
            unreported: 0,
            silence,
            heard_at: Instant::now(),
            next: Box::pin(sleep(silence / 3)),
            ping_due: false,
            closed: false,
        }
    }

    /// Sends pings, and ends the WebSocket of a client that is silent for too long.
    fn watch(&mut self, context: &mut Context<'_>) {
        while self.next.as_mut().poll(context).is_ready() {
            if self.heard_at.elapsed() >= self.silence {
                self.decoder.finish(Close::SILENT);
                return;
            }
            self.ping_due = true;
            self.next.as_mut().reset(Instant::now() + self.silence / 3);
        }
    }

    /// Sends the staged frames. Returns how many bytes of messages the writer can count as sent.
    /// That is at least one, unless there are none.
    fn poll_send(&mut self, context: &mut Context<'_>) -> Poll<io::Result<usize>> {
        while self.sent < self.staged.len() {
            let n = ready!(Pin::new(&mut self.stream).poll_write(context, &self.staged[self.sent..]))?;
            if n == 0 {
                return Poll::Ready(Err(io::ErrorKind::WriteZero.into()));
            }
            self.sent += n;
            // Progress is reported as it is made, so that a slow reader is not taken for one that
            // does not read. One byte is left for the moment at which all frames are sent.
            let progress = n.min(self.unreported.saturating_sub(1));
            if self.sent < self.staged.len() && progress > 0 {
                self.unreported -= progress;
                return Poll::Ready(Ok(progress));
            }
        }
        self.staged.clear();
        self.staged.shrink_to(4 * BATCH);
        self.sent = 0;
        Poll::Ready(Ok(std::mem::take(&mut self.unreported)))
    }

    /// Stages a ping that is due, and the answer to a ping of the client. Only after the frames
    /// before have been sent, so their number stays bounded.
    fn stage_control(&mut self) {
        if !self.staged.is_empty() || self.closed {
            return;
        }
        if std::mem::take(&mut self.ping_due) {
            frames::ping(&mut self.staged);
        }
        if let Some(payload) = self.decoder.take_ping() {
            frames::pong(&payload, &mut self.staged);
        }
    }

    /// Stages the frames of the first messages in `bytes`.
    fn stage(&mut self, bytes: &[u8]) -> io::Result<()> {
        while self.unreported < bytes.len() && (self.unreported == 0 || self.staged.len() < BATCH) {
            let Some(n) = frames::message(&bytes[self.unreported..], &mut self.staged) else {
                return Err(io::ErrorKind::InvalidInput.into());
            };
            self.unreported += n;
        }
        Ok(())
    }

    /// Decodes what has arrived into `buffer`. Returns whether that gave at least one byte.
    fn decode(&mut self, buffer: &mut ReadBuf<'_>) -> bool {
        let encoding = (self.encoding)();
        let raw = &self.raw[self.waiting.clone()];
        // Frames become shorter, apart from the bytes that wait from the frame before.
        let room = buffer.initialize_unfilled_to(buffer.remaining().min(raw.len() + MORE));
        let (from, to) = self.decoder.decode(raw, room, encoding);
        self.waiting.start += from;
        buffer.advance(to);
        to > 0
    }

    /// Reads bytes from the connection, after all others have been decoded. Returns their number.
    fn poll_raw(&mut self, context: &mut Context<'_>) -> Poll<io::Result<usize>> {
        let mut piece = ReadBuf::new(&mut self.raw);
        ready!(Pin::new(&mut self.stream).poll_read(context, &mut piece))?;
        self.waiting = 0..piece.filled().len();
        Poll::Ready(Ok(self.waiting.end))
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin> AsyncRead for WebSocket<S> {
    fn poll_read(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let this = self.get_mut();
        if this.closed {
            // After the end, the client's bytes are only removed, until it closes the connection. A
            // client that has closed the WebSocket waits for the server to do so.
            let by_client = this.decoder.end().is_some_and(|how| how.by_client);
            return if by_client {
                Poll::Ready(Ok(()))
            } else {
                Pin::new(&mut this.stream).poll_read(context, buffer)
            };
        }
        this.watch(context);
        // The writer sends frames only when there is a message.
        this.stage_control();
        if this.unreported == 0
            && let Poll::Ready(Err(error)) = this.poll_send(context)
        {
            return Poll::Ready(Err(error));
        }
        for read in [false, true] {
            if this.decode(buffer) || this.decoder.end().is_some() || buffer.remaining() == 0 {
                return Poll::Ready(Ok(()));
            }
            if !read {
                if ready!(this.poll_raw(context))? == 0 {
                    return Poll::Ready(Ok(()));
                }
                this.heard_at = Instant::now();
            }
        }
        // These bytes have brought no message. Other connections get their turn before more are
        // read.
        context.waker().wake_by_ref();
        Poll::Pending
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin> AsyncWrite for WebSocket<S> {
    fn poll_write(self: Pin<&mut Self>, context: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        let this = self.get_mut();
        if this.unreported == 0 {
            if this.closed {
                return Poll::Ready(Err(io::ErrorKind::BrokenPipe.into()));
            }
            this.stage_control();
            this.stage(bytes)?;
        }
        this.poll_send(context)
    }

    fn poll_flush(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        let this = self.get_mut();
        while !this.staged.is_empty() {
            ready!(this.poll_send(context))?;
        }
        Pin::new(&mut this.stream).poll_flush(context)
    }

    fn poll_shutdown(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        let this = self.get_mut();
        if !std::mem::replace(&mut this.closed, true) {
            this.decoder.end().unwrap_or(Close::NORMAL).frame(&mut this.staged);
        }
        while !this.staged.is_empty() {
            ready!(this.poll_send(context))?;
        }
        Pin::new(&mut this.stream).poll_shutdown(context)
    }
}

#[cfg(test)]
mod tests {
    use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, duplex};

    use super::*;

    const LONG: Duration = Duration::from_secs(3600);

    /// A client that reads slowly takes some bytes of a long message at a time. The writer must see
    /// that, or it would take the client for one that does not read.
    #[tokio::test]
    async fn a_writer_sees_the_progress_of_a_long_message() {
        let (mut client, server) = duplex(100);
        let mut socket = WebSocket::new(server, b"", LONG, || Encoding::Json);
        let messages = format!("{{{}\n{{\"b\"}}\n", "a".repeat(1000));
        let (mut sent, mut writes, mut read) = (0, 0, Vec::new());
        while sent < messages.len() {
            sent += socket.write(&messages.as_bytes()[sent..]).await.unwrap();
            writes += 1;
            let mut piece = [0; 100];
            let n = client.read(&mut piece).await.unwrap();
            read.extend_from_slice(&piece[..n]);
        }
        assert_eq!(sent, messages.len());
        assert!(writes >= 10, "{writes} writes");
        drop(socket);
        client.read_to_end(&mut read).await.unwrap();
        let right = [&[0x81, 126, 3, 0xe9, b'{'][..], &[b'a'; 1000], &[0x81, 5], b"{\"b\"}"].concat();
        assert_eq!(read, right);
    }

    #[tokio::test]
    async fn either_side_can_end_a_websocket() {
        // A client closes: the answers that wait are sent before the server's last frame.
        let (mut client, server) = duplex(1000);
        let mut socket = WebSocket::new(server, &[0x88, 0x82, 0, 0, 0, 0, 3, 0xe8], LONG, || Encoding::Json);
        let mut came = Vec::new();
        socket.read_to_end(&mut came).await.unwrap();
        assert_eq!(came.trim_ascii(), b"", "nothing but what is skipped");
        socket.write_all(b"{}\n").await.unwrap();
        socket.shutdown().await.unwrap();
        let mut rest = Vec::new();
        client.read_to_end(&mut rest).await.unwrap();
        assert_eq!(rest, [0x81, 2, b'{', b'}', 0x88, 2, 3, 0xe8]);
        // The server closes: what the client still sends is only removed.
        let (mut client, server) = duplex(1000);
        let mut socket = WebSocket::new(server, b"", LONG, || Encoding::Json);
        socket.shutdown().await.unwrap();
        client.write_all(b"whatever").await.unwrap();
        drop(client);
        came.clear();
        socket.read_to_end(&mut came).await.unwrap();
        assert_eq!(came, b"whatever");
    }

    #[tokio::test]
    async fn a_silent_client_is_sent_pings_and_then_the_end() {
        let (mut client, server) = duplex(1000);
        let mut socket = WebSocket::new(server, b"", Duration::from_millis(90), || Encoding::Json);
        let mut came = Vec::new();
        socket.read_to_end(&mut came).await.unwrap();
        assert_eq!(came, b"");
        socket.shutdown().await.unwrap();
        let mut rest = Vec::new();
        client.read_to_end(&mut rest).await.unwrap();
        let (pings, end) = rest.split_at(4);
        assert_eq!(pings, [0x89, 0, 0x89, 0]);
        assert_eq!(end[..4], [0x88, 2 + 18, 3, 0xf0]);
    }
}
