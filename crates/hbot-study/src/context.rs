//! How a study is shown while it runs, and stopped.

use std::io::{IsTerminal as _, Write as _};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A flag that whoever runs a study raises to have it stop.
#[derive(Debug, Clone, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Asks the study to stop. It does within a second, and writes nothing.
    pub fn raise(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether it was raised.
    #[must_use]
    pub fn raised(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// The study was asked to stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Interrupted;

/// What every part of a study needs: how thorough to be, where to show progress, when to stop.
pub(crate) struct Context {
    /// Fewer samples.
    pub(crate) quick: bool,
    interrupt: Interrupt,
    bar: ProgressBar,
    terminal: bool,
    started: Instant,
}

impl Context {
    /// A bar on standard error where that is a terminal, lines elsewhere.
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

    /// So many parts are to come, besides those that were said already.
    pub(crate) fn expect(&self, parts: usize) {
        self.bar.inc_length(parts as u64);
    }

    /// The next part begins.
    ///
    /// # Errors
    /// Where the study is to stop.
    pub(crate) fn part(&self, what: &str) -> Result<(), Interrupted> {
        self.go_on()?;
        self.bar.set_message(what.to_owned());
        self.bar.inc(1);
        if !self.terminal {
            // A report that nobody reads hinders no study.
            let _ = writeln!(std::io::stderr(), "{:6.1} s  {what}", self.started.elapsed().as_secs_f64());
        }
        Ok(())
    }

    /// Asked in every long loop.
    ///
    /// # Errors
    /// Where the study is to stop.
    pub(crate) fn go_on(&self) -> Result<(), Interrupted> {
        if self.interrupt.raised() { Err(Interrupted) } else { Ok(()) }
    }

    /// Takes the bar away.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
