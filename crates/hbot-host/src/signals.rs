//! The signals by which somebody wants a program to end.

use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGTSTP};
use signal_hook::{flag, low_level};

use crate::run_loop::StopFlag;

/// SIGTSTP (Ctrl-Z) is one of them: a program that is suspended while motors push cannot stop them.
pub const STOPPING: [i32; 5] = [SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGTSTP];

/// A flag that each of the stopping signals sets from now on, in place of what it would do otherwise.
///
/// # Errors
/// The system refuses.
pub fn stop_flag() -> io::Result<StopFlag> {
    let stop = StopFlag::default();
    for signal in STOPPING {
        flag::register(signal, stop.shared())?;
    }
    Ok(stop)
}

/// Takes no notice of the stopping signals from now on.
///
/// # Errors
/// The system refuses.
pub(crate) fn ignore() -> io::Result<()> {
    let nobody_reads = Arc::new(AtomicBool::new(false));
    STOPPING.iter().try_for_each(|signal| flag::register(*signal, Arc::clone(&nobody_reads)).map(drop))
}

/// Ends this process as SIGINT does to a program that does not handle it, so that a shell ends the loop or script that started it.
///
/// # Errors
/// The system refuses; otherwise it does not return.
pub fn end_as_interrupted() -> io::Result<()> {
    low_level::emulate_default_handler(SIGINT)
}
