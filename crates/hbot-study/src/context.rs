//! Progress display and interruption of a running study.

use std::io::{IsTerminal as _, Write as _};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A flag that asks a running study to stop. All clones of a flag share one value.
#[derive(Debug, Clone, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Asks the study to stop. The study stops within a second and writes nothing.
    pub fn raise(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Returns whether [`raise`](Self::raise) was called on this flag or a clone of it.
    #[must_use]
    pub fn raised(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// The error that a study returns when it was asked to stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Interrupted;

/// The settings of a running study: how thorough it is, where it shows its progress, and whether it
/// was asked to stop.
pub(crate) struct Context {
    /// Whether the study uses fewer samples, so that it takes less time.
    pub(crate) quick: bool,
    interrupt: Interrupt,
    bar: ProgressBar,
    terminal: bool,
    started: Instant,
}

impl Context {
    /// Creates the context of the study called `name`. If standard error is a terminal, progress is
    /// shown as a bar, and otherwise as one line for each part of the study.
    pub(crate) fn new(name: &str, quick: bool, interrupt: &Interrupt) -> Self {
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
        Self { quick, interrupt: interrupt.clone(), bar, terminal, started: Instant::now() }
    }

    /// Adds `parts` to the number of parts of the study that the progress bar expects.
    pub(crate) fn expect(&self, parts: usize) {
        self.bar.inc_length(parts as u64);
    }

    /// Shows that a part of the study begins. `what` describes it to the user.
    ///
    /// # Errors
    ///
    /// Fails if the study was asked to stop.
    pub(crate) fn part(&self, what: &str) -> Result<(), Interrupted> {
        self.go_on()?;
        self.bar.set_message(what.to_owned());
        self.bar.inc(1);
        if !self.terminal {
            // A progress line that cannot be written does not stop the study.
            let _ = writeln!(std::io::stderr(), "{:6.1} s  {what}", self.started.elapsed().as_secs_f64());
        }
        Ok(())
    }

    /// Checks that the study was not asked to stop. Every long loop calls this function.
    ///
    /// # Errors
    ///
    /// Fails if the study was asked to stop.
    pub(crate) fn go_on(&self) -> Result<(), Interrupted> {
        if self.interrupt.raised() { Err(Interrupted) } else { Ok(()) }
    }

    /// Removes the progress bar from the terminal.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
