//! The progress of a command that takes its time: on a terminal in one line, and elsewhere in a
//! line from time to time.

use std::io::{IsTerminal as _, Write as _, stderr};
use std::time::{Duration, Instant};

use super::out::note;
use super::style;

/// How often the progress is shown on a terminal, and how often elsewhere.
const SHOWN_EVERY: Duration = Duration::from_secs(1);
const NOTED_EVERY: Duration = Duration::from_secs(10);

/// What has been shown. The line is cleared at its end, so that an error that ends the command
/// begins on an empty line.
pub(crate) struct Progress {
    terminal: bool,
    begun: Instant,
    next: Instant,
}

impl Progress {
    pub(crate) fn new() -> Self {
        let (terminal, begun) = (stderr().is_terminal(), Instant::now());
        Self { terminal, begun, next: begun + if terminal { SHOWN_EVERY } else { NOTED_EVERY } }
    }

    /// Shows what `line` says of the time since the beginning, s, if it is time for that.
    pub(crate) fn show(&mut self, line: impl FnOnce(f64) -> String) {
        let now = Instant::now();
        if now < self.next {
            return;
        }
        let line = line((now - self.begun).as_secs_f64());
        if self.terminal {
            self.next = now + SHOWN_EVERY;
            let (begin, end) = (style::SAME_LINE, style::LINE_END);
            // Like all text on standard error, it is lost if it cannot be written.
            let _ = write!(stderr(), "{begin}{line}; Ctrl-C ends{end}");
        } else {
            self.next = now + NOTED_EVERY;
            note!("{line}");
        }
    }

    /// Removes the line from the terminal.
    pub(crate) fn clear(&self) {
        if self.terminal {
            let _ = write!(stderr(), "{}", style::CLEAR_LINE);
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.clear();
    }
}
