//! The output of `hbot server`: messages at its start and end, its log, and the status line of a
//! terminal.
//!
//! A separate thread writes the output. It takes the lines from a queue that nobody waits for. A
//! pipe without a reader, a terminal stopped by Ctrl-S or a full device therefore delays neither
//! clients nor signals. Lines that do not fit into the queue are dropped and counted.

use std::ffi::OsStr;
use std::io::{IsTerminal as _, Result, Write as _};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, channel, sync_channel};
use std::time::{Duration, Instant};

use hbot_server::service::Status;
use tokio::sync::watch;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::prelude::*;

use super::{status, style, terminal};

/// The environment variable that selects what is logged.
const HBOT_LOG: &str = "HBOT_LOG";
/// Capacity of the queue, lines.
const WAITING: usize = 1024;
/// How often the status line is redrawn.
const BEAT: Duration = Duration::from_millis(200);
/// How long a server that has ended waits for its last lines to be written.
const PATIENCE: Duration = Duration::from_secs(2);
/// Unless `HBOT_LOG` selects what is logged, a token bucket limits the log: this many lines at
/// once, then `PER_S` lines per second. A client that causes a log line with every request then
/// cannot fill a disk.
const BURST: f64 = 500.0;
const PER_S: f64 = 20.0;

/// The output of a server.
pub(crate) struct Console {
    lines: Lines,
    /// A channel that carries no values. It closes after everything has been written.
    written: Receiver<()>,
}

/// One entry of the queue.
enum Line {
    /// A line for standard output, with colours.
    Out(String),
    /// A line for standard error, formatted by the log.
    Log(Vec<u8>),
    /// Sets the status that the status line shows. `None` removes the line.
    Status(Option<watch::Receiver<Status>>),
    End,
}

/// The sending end of the queue to the thread that writes.
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

/// A writer for tracing-subscriber, which calls it once for each line of the log.
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
    /// Starts the thread that writes, and the log. By default the log has warnings and errors;
    /// `HBOT_LOG` selects something else.
    pub(crate) fn start() -> Result<Self> {
        let (asked, mistake) = match std::env::var_os(HBOT_LOG).map(|text| filter(&text)) {
            None => (None, None),
            Some(Ok(asked)) => (asked, None),
            Some(Err(mistake)) => (None, Some(mistake)),
        };
        let rate = asked.is_none().then(Rate::full);
        let (queue, inbox) = sync_channel(WAITING);
        let lines = Lines { queue, lost: Arc::default() };
        let lost = lines.lost.clone();
        let (done, written) = channel();
        std::thread::Builder::new().name("hbot-console".to_owned()).spawn(move || {
            let terminal = std::io::stderr().is_terminal();
            Writer { lost, terminal, drawn: false, failed: false, rate, left_out: 0 }.run(&inbox);
            drop(done);
        })?;
        let log = lines.clone();
        let lines_of_log = tracing_subscriber::fmt::layer()
            .with_writer(move || Log(log.clone()))
            .with_ansi(std::io::stderr().is_terminal())
            // Otherwise it would report errors directly on standard error, and panic if that fails.
            .log_internal_errors(false);
        let asked = asked.unwrap_or_else(|| Targets::new().with_default(LevelFilter::WARN));
        tracing_subscriber::registry().with(asked).with(lines_of_log).init();
        tell_panics(lines.clone());
        if let Some(mistake) = mistake {
            tracing::warn!("{HBOT_LOG}: {mistake}; warnings and errors are logged");
        }
        Ok(Self { lines, written })
    }

    /// Writes a line to standard output.
    pub(crate) fn say(&self, text: String) {
        self.lines.put(Line::Out(text));
    }

    /// Shows the status line from now on, if standard error is a terminal. `None` removes it.
    pub(crate) fn status(&self, status: Option<watch::Receiver<Status>>) {
        self.lines.put(Line::Status(status));
    }

    /// Waits until everything has been written, but at most [`PATIENCE`].
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
        // If the channel closes, everything has been written. If the time runs out, nobody reads
        // the output.
        let _ = self.written.recv_timeout(until.saturating_duration_since(Instant::now()));
    }
}

/// Parses the value of `HBOT_LOG`. Returns `None` if it is empty.
fn filter(text: &OsStr) -> std::result::Result<Option<Targets>, String> {
    let Some(text) = text.to_str() else { return Err("it is not UTF-8".to_owned()) };
    if text.trim().is_empty() {
        return Ok(None);
    }
    let mut targets = Targets::new();
    for part in text.split(',').map(str::trim).filter(|part| !part.is_empty()) {
        let (module, level) =
            part.split_once('=').map_or((None, part), |(module, level)| (Some(module), level));
        let level = level.parse::<LevelFilter>().ok();
        targets = match (module, level) {
            (None, Some(level)) => targets.with_default(level),
            (Some(module), Some(level)) if is_module(module) => targets.with_target(module, level),
            _ => {
                return Err(format!(
                    "{part:?} is no level (off, error, warn, info, debug, trace) and no MODULE=LEVEL"
                ));
            }
        };
    }
    Ok(Some(targets))
}

/// Returns whether a text can be the name of a module or of a part of one.
fn is_module(text: &str) -> bool {
    !text.is_empty() && text.chars().all(|c| c.is_ascii_alphanumeric() || "_:".contains(c))
}

/// Sends panic messages through the queue as well. A loop that panics must not wait for a terminal
/// before it switches the motors off.
fn tell_panics(lines: Lines) {
    std::panic::set_hook(Box::new(move |panic| {
        let thread = std::thread::current();
        let trace = std::backtrace::Backtrace::capture();
        let text = format!("thread {:?}: {panic}\n{trace}\n", thread.name().unwrap_or("without a name"));
        lines.put(Line::Log(text.into_bytes()));
    }));
}

/// A token bucket that limits the lines of the log.
struct Rate {
    left: f64,
    at: Instant,
}

impl Rate {
    fn full() -> Self {
        Self { left: BURST, at: Instant::now() }
    }

    fn allows(&mut self, now: Instant) -> bool {
        let gained = now.duration_since(self.at).as_secs_f64() * PER_S;
        self.at = now;
        self.left = (self.left + gained).min(BURST);
        let allowed = self.left >= 1.0;
        if allowed {
            self.left -= 1.0;
        }
        allowed
    }
}

/// The state of the thread that writes.
struct Writer {
    lost: Arc<AtomicU64>,
    rate: Option<Rate>,
    /// Number of log lines that were left out because they came too fast.
    left_out: u64,
    terminal: bool,
    /// True if the terminal shows a status line.
    drawn: bool,
    /// True after a failure of standard output has been reported.
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
                Ok(Line::Log(_)) if self.rate.as_mut().is_some_and(|rate| !rate.allows(Instant::now())) => {
                    self.left_out += 1;
                }
                Ok(Line::Log(text)) => {
                    self.tell_left_out();
                    self.log(&text);
                }
                Ok(Line::Status(shown)) => {
                    status = shown.filter(|_| self.terminal);
                    self.clear();
                }
                Err(RecvTimeoutError::Timeout) => self.draw(status.as_ref()),
                Ok(Line::End) | Err(RecvTimeoutError::Disconnected) => {
                    self.tell_left_out();
                    return self.clear();
                }
            }
            let lost = self.lost.swap(0, Ordering::Relaxed);
            if lost > 0 {
                self.log(format!("{lost} lines are lost: they were not read in time\n").as_bytes());
            }
        }
    }

    fn out(&mut self, text: &str) {
        self.clear();
        let text = terminal::columns(std::io::stdout())
            .map_or_else(|| text.to_owned(), |columns| terminal::wrapped(text, columns));
        let mut out = anstream::stdout().lock();
        let Err(error) = writeln!(out, "{text}").and_then(|()| out.flush()) else { return };
        if !std::mem::replace(&mut self.failed, true) {
            tracing::warn!(%error, "standard output cannot be written; the server goes on");
        }
    }

    fn tell_left_out(&mut self) {
        let left_out = std::mem::take(&mut self.left_out);
        if left_out > 0 {
            self.log(
                format!("{left_out} lines of the log were left out; HBOT_LOG=warn shows all\n").as_bytes(),
            );
        }
    }

    /// Writes a line of the log. The status line is removed first and is redrawn a moment later.
    fn log(&mut self, text: &[u8]) {
        self.clear();
        error_out(text);
    }

    fn draw(&mut self, status: Option<&watch::Receiver<Status>>) {
        let Some(status) = status else { return };
        // A terminal that does not tell its width is taken to be as narrow as usual ones.
        let columns = terminal::columns(std::io::stderr()).unwrap_or(80);
        let line = status::line(&status.borrow(), columns);
        error_out(style::SAME_LINE.as_bytes());
        // A failure cannot be reported anywhere.
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

/// Writes bytes to standard error without changes.
fn error_out(bytes: &[u8]) {
    // A failure cannot be reported anywhere.
    let _ = std::io::stderr().write_all(bytes);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filter_that_says_nothing_legal_is_a_mistake() {
        let read = |text: &str| filter(OsStr::new(text)).map(|asked| asked.map(|asked| asked.to_string()));
        assert_eq!(read(""), Ok(None));
        assert_eq!(read("info"), Ok(Some("info".to_owned())));
        assert_eq!(read("WARN").unwrap().unwrap(), "warn");
        for legal in ["hbot_server=debug", "warn,hbot_server::service=trace", "off", "info,"] {
            assert!(read(legal).is_ok_and(|asked| asked.is_some()), "{legal}");
        }
        for (wrong, why) in [
            ("garbage", "\"garbage\" is no level"),
            ("inof", "\"inof\" is no level"),
            ("hbot_server", "\"hbot_server\" is no level"),
            ("warn,loud", "\"loud\" is no level"),
            ("hbot_server=loud", "\"hbot_server=loud\" is no level"),
            ("=debug", "\"=debug\" is no level"),
            ("a=b=c", "a=b=c"),
            ("info,[{request}]=info", "\"[{request}]=info\" is no level"),
        ] {
            let mistake = read(wrong).unwrap_err();
            assert!(mistake.contains(why), "{wrong}: {mistake}");
        }
    }

    #[test]
    fn a_flood_of_lines_is_left_out_beyond_its_rate() {
        let mut rate = Rate::full();
        let start = rate.at;
        let allowed = |rate: &mut Rate, at| (0..10_000).filter(|_| rate.allows(at)).count();
        assert_eq!(allowed(&mut rate, start), BURST as usize);
        assert_eq!(allowed(&mut rate, start + Duration::from_secs(1)), PER_S as usize);
        assert_eq!(allowed(&mut rate, start + Duration::from_secs(3600)), BURST as usize);
    }
}
