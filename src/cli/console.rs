//! What `hbot server` writes: what it says at start and at its end, its log, and the status line of a terminal.
//!
//! A thread of its own writes, behind a queue that nobody waits for: a pipe that nobody reads, a terminal that was told to
//! hold still (Ctrl-S) and a device that is full hold up neither clients nor signals. What does not fit the queue is lost and
//! counted.

use std::ffi::OsStr;
use std::io::{IsTerminal as _, Result, Write as _};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, channel, sync_channel};
use std::time::{Duration, Instant};

use hbot_server::service::Status;
use tokio::sync::watch;
use tracing_subscriber::EnvFilter;
use tracing_subscriber::filter::LevelFilter;

use super::{status, style};

/// The environment variable that says what is logged.
const HBOT_LOG: &str = "HBOT_LOG";
/// Lines that wait for a slow reader.
const WAITING: usize = 1024;
/// The status line is drawn so often.
const BEAT: Duration = Duration::from_millis(200);
/// How long a server that has ended waits for its last lines to be written.
const PATIENCE: Duration = Duration::from_secs(2);
/// Where nobody has asked for more, so many lines of the log are written at once and then so many a second: a client that has one
/// written by all that it does fills no disk.
const BURST: f64 = 500.0;
const PER_S: f64 = 20.0;

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
        tracing_subscriber::fmt()
            .with_env_filter(asked.unwrap_or_else(|| EnvFilter::new("warn")))
            .with_writer(move || Log(log.clone()))
            .with_ansi(std::io::stderr().is_terminal())
            // It would complain on standard error itself, and panic where it cannot.
            .log_internal_errors(false)
            .init();
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

/// What `HBOT_LOG` asks for: nothing where it is empty.
fn filter(text: &OsStr) -> std::result::Result<Option<EnvFilter>, String> {
    let Some(text) = text.to_str() else { return Err("it is not UTF-8".to_owned()) };
    if text.trim().is_empty() {
        return Ok(None);
    }
    // A filter takes any other word for the name of a module, of which it then shows all, and of others nothing.
    let word = |part: &&str| part.chars().all(|c| c.is_ascii_alphanumeric() || "_:-".contains(c));
    let level = |part: &&str| part.is_empty() || part.parse::<LevelFilter>().is_ok();
    if let Some(part) = text.split(',').map(str::trim).filter(word).find(|part| !level(part)) {
        return Err(format!(
            "{part:?} is no level (off, error, warn, info, debug, trace) and no MODULE=LEVEL"
        ));
    }
    EnvFilter::builder().parse(text).map(Some).map_err(|error| format!("{text:?}: {error}"))
}

/// Has panics told the same way. A loop that panics must not wait for a terminal before it switches the motors off.
fn tell_panics(lines: Lines) {
    std::panic::set_hook(Box::new(move |panic| {
        let thread = std::thread::current();
        let trace = std::backtrace::Backtrace::capture();
        let text = format!("thread {:?}: {panic}\n{trace}\n", thread.name().unwrap_or("without a name"));
        lines.put(Line::Log(text.into_bytes()));
    }));
}

/// How many lines of the log may be written: a bucket that fills.
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

/// The thread that writes.
struct Writer {
    lost: Arc<AtomicU64>,
    rate: Option<Rate>,
    /// Lines of the log that came too fast.
    left_out: u64,
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filter_that_says_nothing_legal_is_a_mistake() {
        let read = |text: &str| filter(OsStr::new(text)).map(|asked| asked.map(|asked| asked.to_string()));
        assert_eq!(read(""), Ok(None));
        assert_eq!(read("info"), Ok(Some("info".to_owned())));
        assert_eq!(read("WARN").unwrap().unwrap(), "warn");
        for legal in
            ["hbot_server=debug", "warn,hbot_server::service=trace", "off", "info,", "[{request}]=info"]
        {
            assert!(read(legal).is_ok_and(|asked| asked.is_some()), "{legal}");
        }
        for (wrong, why) in [
            ("garbage", "\"garbage\" is no level"),
            ("inof", "\"inof\" is no level"),
            ("hbot_server", "\"hbot_server\" is no level"),
            ("warn,loud", "\"loud\" is no level"),
            ("hbot_server=loud", "hbot_server=loud"),
            ("a=b=c", "a=b=c"),
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
