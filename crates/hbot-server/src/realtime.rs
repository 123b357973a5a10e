//! What a thread needs of the system to keep its time: a real-time priority, and memory that stays.

use rustix::mm::{MlockAllFlags, mlockall};
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

/// SCHED_FIFO priority of the loop: above everything but the kernel's own threads (which have 50 and more).
pub const LOOP_PRIORITY: u8 = 49;
/// SCHED_FIFO priority of the simulated rig's thread: just below the loop.
pub const SIMULATOR_PRIORITY: u8 = 48;

/// Stack that a real-time thread touches before it starts, bytes.
const STACK: usize = 256 * 1024;

/// Gives the calling thread SCHED_FIFO at `priority`; the reason in words where the system refuses.
///
/// # Errors
/// Why not: usually a missing right.
pub fn real_time(priority: u8) -> Result<(), String> {
    let value = ThreadPriorityValue::try_from(priority).map_err(|e| e.to_string())?;
    set_thread_priority_and_policy(
        thread_native_id(),
        ThreadPriority::Crossplatform(value),
        ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo),
    )
    .map_err(|error| match error {
        thread_priority::Error::OS(code) => std::io::Error::from_raw_os_error(code).to_string(),
        other => other.to_string(),
    })
}

/// Locks the process's memory, now and later, so that no page fault meets the loop.
///
/// # Errors
/// Why not: usually a missing right.
pub fn lock_memory() -> Result<(), String> {
    mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE).map_err(|e| e.to_string())
}

/// Touches the stack that the thread will use.
#[inline(never)]
pub fn touch_stack() {
    let mut pages = [0_u8; STACK];
    for byte in pages.iter_mut().step_by(4096) {
        *byte = 1;
    }
    std::hint::black_box(&mut pages);
}
