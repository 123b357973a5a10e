//! Progress display of a running study.

use std::io::{IsTerminal as _, Write as _};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// The settings of a running study: how thorough it is, and where it shows its progress.
pub(crate) struct Context {
    /// Whether the study uses fewer samples, so that it takes less time.
    pub(crate) quick: bool,
    bar: ProgressBar,
    terminal: bool,
    started: Instant,
}

impl Context {
    /// Creates the context of the study called `name`. If standard error is a terminal, progress is
    /// shown as a bar, and otherwise as one line for each part of the study.
    pub(crate) fn new(name: &str, quick: bool) -> Self {
        let terminal = std::io::stderr().is_terminal();
        let target = if terminal { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(0), target);
        if let Ok(style) = ProgressStyle::with_template("{prefix} [{bar:30}] {pos}/{len} {msg} ({elapsed})") {
            bar.set_style(style);
        }
        bar.set_prefix(name.to_owned());
        if terminal {
            bar.enable_steady_tick(Duration::from_millis(200));
        }
        Self { quick, bar, terminal, started: Instant::now() }
    }

    /// Adds `parts` to the number of parts of the study that the progress bar expects.
    pub(crate) fn expect(&self, parts: usize) {
        self.bar.inc_length(parts as u64);
    }

    /// Shows that a part of the study begins. `what` describes it to the user.
    pub(crate) fn part(&self, what: &str) {
        self.bar.set_message(what.to_owned());
        self.bar.inc(1);
        if !self.terminal {
            // A progress line that cannot be written does not stop the study.
            let _ = writeln!(std::io::stderr(), "{:6.1} s  {what}", self.started.elapsed().as_secs_f64());
        }
    }

    /// Removes the progress bar from the terminal.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
