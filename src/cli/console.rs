//! What `hbot server` writes: what it says at start and at its end, its log, and the status line of a terminal.
//!
//! A thread of its own writes, behind a queue that nobody waits for: a pipe that nobody reads, a terminal that was told to
//! hold still (Ctrl-S) and a device that is full hold up neither clients nor signals. What does not fit the queue is lost and
//! counted.

use std::io::{IsTerminal as _, Result, Write as _};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, channel, sync_channel};
use std::time::{Duration, Instant};

use hbot_server::service::Status;
use tokio::sync::watch;

use super::{status, style};

/// Lines that wait for a slow reader.
const WAITING: usize = 1024;
/// The status line is drawn so often.
const BEAT: Duration = Duration::from_millis(200);
/// How long a server that has ended waits for its last lines to be written.
const PATIENCE: Duration = Duration::from_secs(2);

/// Where a server writes.
pub(crate) struct Console {
    lines: Lines,
    /// Nothing ever comes; it closes once all is written.
    written: Receiver<()>,
}

/// One write to be done.
enum Line {
    /// To standard output, in colours.
    Out(String),
    /// To standard error, as the log has it.
    Log(Vec<u8>),
    /// What the status line shows from now on.
    Status(Option<watch::Receiver<Status>>),
    End,
}

/// The way to the thread that writes.
#[derive(Clone)]
struct Lines {
    queue: SyncSender<Line>,
    lost: Arc<AtomicU64>,
}

impl Lines {
    fn put(&self, line: Line) {
        if self.queue.try_send(line).is_err() {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// One line of the log at a time, as tracing-subscriber hands them over.
struct Log(Lines);

impl std::io::Write for Log {
    fn write(&mut self, line: &[u8]) -> Result<usize> {
        self.0.put(Line::Log(line.to_vec()));
        Ok(line.len())
    }

    fn flush(&mut self) -> Result<()> {
        Ok(())
    }
}

impl Console {
    /// Starts to write, log lines too: by default warnings and what is worse; `HBOT_LOG` says otherwise.
    pub(crate) fn start() -> Result<Self> {
        let (queue, inbox) = sync_channel(WAITING);
        let lines = Lines { queue, lost: Arc::default() };
        let lost = lines.lost.clone();
        let (done, written) = channel();
        std::thread::Builder::new().name("hbot-console".to_owned()).spawn(move || {
            Writer { lost, terminal: std::io::stderr().is_terminal(), drawn: false, failed: false }
                .run(&inbox);
            drop(done);
        })?;
        let filter = tracing_subscriber::EnvFilter::try_from_env("HBOT_LOG")
            .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new("warn"));
        let log = lines.clone();
        tracing_subscriber::fmt()
            .with_env_filter(filter)
            .with_writer(move || Log(log.clone()))
            .with_ansi(std::io::stderr().is_terminal())
            // It would complain on standard error itself, and panic where it cannot.
            .log_internal_errors(false)
            .init();
        Ok(Self { lines, written })
    }

    /// Writes a line to standard output.
    pub(crate) fn say(&self, text: String) {
        self.lines.put(Line::Out(text));
    }

    /// Draws the status line from now on, where there is a terminal to draw it on, or takes it away.
    pub(crate) fn status(&self, status: Option<watch::Receiver<Status>>) {
        self.lines.put(Line::Status(status));
    }

    /// Waits until all is written, but not for ever.
    pub(crate) fn end(self) {
        let until = Instant::now() + PATIENCE;
        let mut end = Line::End;
        while let Err(TrySendError::Full(back)) = self.lines.queue.try_send(end) {
            if Instant::now() > until {
                return;
            }
            end = back;
            std::thread::sleep(Duration::from_millis(10));
        }
        // Closed: written. Time is up: nobody reads.
        let _ = self.written.recv_timeout(until.saturating_duration_since(Instant::now()));
    }
}

/// The thread that writes.
struct Writer {
    lost: Arc<AtomicU64>,
    terminal: bool,
    /// A status line stands in the terminal.
    drawn: bool,
    /// It was said that standard output fails.
    failed: bool,
}

impl Writer {
    fn run(mut self, inbox: &Receiver<Line>) {
        let mut status = None;
        loop {
            let line = match &status {
                None => inbox.recv().map_err(|_| RecvTimeoutError::Disconnected),
                Some(_) => inbox.recv_timeout(BEAT),
            };
            match line {
                Ok(Line::Out(text)) => self.out(&text),
                Ok(Line::Log(text)) => self.log(&text),
                Ok(Line::Status(shown)) => {
                    status = shown.filter(|_| self.terminal);
                    self.clear();
                }
                Err(RecvTimeoutError::Timeout) => self.draw(status.as_ref()),
                Ok(Line::End) | Err(RecvTimeoutError::Disconnected) => return self.clear(),
            }
            let lost = self.lost.swap(0, Ordering::Relaxed);
            if lost > 0 {
                self.log(format!("{lost} lines are lost: they were not read in time\n").as_bytes());
            }
        }
    }

    fn out(&mut self, text: &str) {
        self.clear();
        let mut out = anstream::stdout().lock();
        let Err(error) = writeln!(out, "{text}").and_then(|()| out.flush()) else { return };
        if !std::mem::replace(&mut self.failed, true) {
            tracing::warn!(%error, "standard output cannot be written; the server goes on");
        }
    }

    /// Makes room for a line of the log; the status line is drawn again a moment later.
    fn log(&mut self, text: &[u8]) {
        self.clear();
        error_out(text);
    }

    fn draw(&mut self, status: Option<&watch::Receiver<Status>>) {
        let Some(status) = status else { return };
        let line = status::line(&status.borrow());
        error_out(style::SAME_LINE.as_bytes());
        // Nowhere is left to say that it failed.
        let _ = write!(anstream::stderr(), "{line}");
        error_out(style::LINE_END.as_bytes());
        self.drawn = true;
    }

    fn clear(&mut self) {
        if std::mem::take(&mut self.drawn) {
            error_out(style::CLEAR_LINE.as_bytes());
        }
    }
}

/// To standard error as it stands.
fn error_out(bytes: &[u8]) {
    // Nowhere is left to say that it failed.
    let _ = std::io::stderr().write_all(bytes);
}
