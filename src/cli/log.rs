//! What a running server says on standard error, written by a thread of its own.
//!
//! Whoever says something never waits and never fails. A terminal that is held (Ctrl-S), a pipe that nobody reads or that is gone
//! would otherwise hold up or end the service, and with it everybody who wants the rig to stop.

use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::{Duration, Instant};

use super::style;

/// Lines that may wait to be written; further ones are left out and counted.
const WAITING: usize = 1024;
/// How long the end waits for them.
const FLUSH: Duration = Duration::from_millis(200);
/// Where nobody has asked for more, so many log lines at once and then so many a second are written: a client that has a line logged by
/// all that it does fills no disk.
const BURST: f64 = 500.0;
const PER_S: f64 = 20.0;

/// What the thread is to write.
enum Said {
    /// A log line; in a terminal it takes the place of the status line.
    Line(Vec<u8>),
    /// The status line.
    Status(Vec<u8>),
    /// Everything before has been written.
    End(SyncSender<()>),
}

/// Where to say it.
#[derive(Clone)]
pub(crate) struct Log {
    to: SyncSender<Said>,
    /// Log lines that found no place.
    lost: Arc<AtomicU64>,
}

impl Log {
    /// Writes to standard error from now on; `terminal`: it is one, so log lines make room for themselves. `all`: every line is wanted,
    /// however many there are.
    ///
    /// # Errors
    /// The system gives no thread.
    pub(crate) fn start(terminal: bool, all: bool) -> io::Result<Self> {
        let (to, said) = sync_channel(WAITING);
        let lost = Arc::new(AtomicU64::new(0));
        let log = Self { to, lost: Arc::clone(&lost) };
        let rate = if all { None } else { Some(Rate { left: BURST, at: Instant::now() }) };
        std::thread::Builder::new()
            .name("hbot-log".to_owned())
            .spawn(move || write(&mut io::stderr(), &said, &lost, terminal, rate))?;
        Ok(log)
    }

    /// Draws something that is not a log line; not at all where there is no place for it.
    pub(crate) fn draw(&self, bytes: Vec<u8>) {
        let _ = self.to.try_send(Said::Status(bytes));
    }

    /// Has panics told the same way. A loop that panics must not wait for a terminal before it switches the motors off.
    pub(crate) fn tell_panics(&self) {
        let log = self.clone();
        std::panic::set_hook(Box::new(move |panic| {
            let thread = std::thread::current();
            let trace = std::backtrace::Backtrace::capture();
            let text = format!("thread {:?}: {panic}\n{trace}\n", thread.name().unwrap_or("without a name"));
            // It never fails.
            let _ = log.clone().write(text.as_bytes());
        }));
    }

    /// Calls [`end`](Self::end) when it is dropped.
    pub(crate) fn last_words(&self) -> impl Drop {
        LastWords(self.clone())
    }

    /// Waits until all has been written, but not for long.
    pub(crate) fn end(&self) {
        let (done, written) = sync_channel(1);
        let deadline = Instant::now() + FLUSH;
        while self.to.try_send(Said::End(done.clone())).is_err() {
            if Instant::now() > deadline {
                return;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        // Where it takes longer the process ends without it.
        let _ = written.recv_timeout(FLUSH);
    }
}

struct LastWords(Log);

impl Drop for LastWords {
    fn drop(&mut self) {
        self.0.end();
    }
}

impl Write for Log {
    /// Takes a whole line.
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        if self.to.try_send(Said::Line(line.to_vec())).is_err() {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// How many log lines may be written: a bucket that fills.
struct Rate {
    left: f64,
    at: Instant,
}

impl Rate {
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

/// Writes until nobody can say anything any more. What cannot be written is nobody's to hear of.
fn write(
    out: &mut impl Write,
    said: &Receiver<Said>,
    lost: &AtomicU64,
    terminal: bool,
    mut rate: Option<Rate>,
) {
    let mut left_out = 0;
    for said in said {
        match said {
            Said::Line(line) => {
                left_out += lost.swap(0, Ordering::Relaxed);
                if rate.as_mut().is_some_and(|rate| !rate.allows(Instant::now())) {
                    left_out += 1;
                    continue;
                }
                if terminal {
                    let _ = out.write_all(style::CLEAR_LINE.as_bytes());
                }
                if left_out > 0 {
                    let _ = writeln!(out, "({left_out} log lines were left out; HBOT_LOG=warn shows all)");
                    left_out = 0;
                }
                let _ = out.write_all(&line);
            }
            Said::Status(bytes) => _ = out.write_all(&bytes),
            // Who no longer waits needs no answer.
            Said::End(done) => _ = done.try_send(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_of_lines_is_left_out_and_counted() {
        let mut rate = Rate { left: BURST, at: Instant::now() };
        let start = rate.at;
        let allowed = |rate: &mut Rate, at| (0..10_000).filter(|_| rate.allows(at)).count();
        assert_eq!(allowed(&mut rate, start), BURST as usize);
        assert_eq!(allowed(&mut rate, start + Duration::from_secs(1)), PER_S as usize);
        assert_eq!(allowed(&mut rate, start + Duration::from_secs(3600)), BURST as usize);
    }

    #[test]
    fn what_was_left_out_is_told_with_the_next_line() {
        let (to, said) = sync_channel(8);
        let lost = AtomicU64::new(7);
        to.send(Said::Line(b"one\n".to_vec())).unwrap();
        to.send(Said::Status(b"status".to_vec())).unwrap();
        to.send(Said::Line(b"two\n".to_vec())).unwrap();
        drop(to);
        let mut out = Vec::new();
        write(&mut out, &said, &lost, false, None);
        let text = String::from_utf8(out).unwrap();
        assert_eq!(text, "(7 log lines were left out; HBOT_LOG=warn shows all)\none\nstatustwo\n");
    }
}
