//! The signals by which a user or a service manager ends a program.

use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGTSTP, SIGXFSZ};
use signal_hook::{flag, low_level};

use crate::run_loop::StopFlag;

/// The signals that end a program. SIGTSTP (Ctrl-Z) is one of them, because a suspended program
/// could not stop motors that are on.
pub const STOPPING: [i32; 5] = [SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGTSTP];

/// Returns a flag that is set by any of the [`STOPPING`] signals from now on. The signals no longer
/// have their default effect.
///
/// # Errors
/// Fails if the system refuses to install a signal handler.
pub fn stop_flag() -> io::Result<StopFlag> {
    let stop = StopFlag::default();
    for signal in STOPPING {
        flag::register(signal, stop.shared())?;
    }
    Ok(stop)
}

/// Ignores the [`STOPPING`] signals from now on.
///
/// # Errors
/// Fails if the system refuses to install a signal handler.
pub(crate) fn ignore() -> io::Result<()> {
    let nobody_reads = Arc::new(AtomicBool::new(false));
    STOPPING.iter().try_for_each(|signal| flag::register(*signal, Arc::clone(&nobody_reads)).map(drop))
}

/// Lets this process go on when a file reaches a limit of its size (`ulimit -f`, `LimitFSIZE=`).
/// Without this call the signal SIGXFSZ ends the process. With it, the write fails with the error
/// EFBIG, as on a full disk.
///
/// # Errors
/// Fails if the system refuses to install a signal handler.
pub fn outlive_file_limits() -> io::Result<()> {
    flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false))).map(drop)
}

/// Gives the [`STOPPING`] signals their default effect again: they end this process, or suspend it.
/// For a program that has switched its motors off and only computes from now on.
///
/// # Errors
/// Fails if the system refuses to install a signal handler.
pub fn default_again() -> io::Result<()> {
    let always = Arc::new(AtomicBool::new(true));
    STOPPING
        .iter()
        .try_for_each(|signal| flag::register_conditional_default(*signal, Arc::clone(&always)).map(drop))
}

/// Ends this process as an unhandled SIGINT would. A shell then also ends the loop or script that
/// started the process.
///
/// # Errors
/// Fails if the system refuses. Otherwise it does not return.
pub fn end_as_interrupted() -> io::Result<()> {
    low_level::emulate_default_handler(SIGINT)
}
