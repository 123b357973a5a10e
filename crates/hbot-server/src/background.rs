//! Threads that must not delay the service.

use rustix::process::setpriority_process;
use rustix::thread::gettid;

/// Niceness of a background thread. A positive value gives other threads priority.
pub(crate) const NICENESS: i32 = 10;

/// Lets the service's thread run before the calling thread.
pub(crate) fn give_way() {
    // If the system refuses, only the priority is lost.
    let _ = setpriority_process(Some(gettid()), NICENESS);
}
