//! What a thread needs of the system to keep its time: a real-time priority, and memory that stays.

use std::fs::File;
use std::io::Write as _;

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

/// Where the system takes how long processors may take to wake (PM QoS, kernel documentation power/pm_qos_interface).
const WAKE_LATENCY: &str = "/dev/cpu_dma_latency";

/// Keeps processors out of sleeps that take long to wake from, as long as it is there.
#[derive(Debug)]
pub struct WakeLatency {
    /// The system heeds the limit until this is closed.
    _file: File,
}

impl WakeLatency {
    /// A limit of so many us; 0: no processor sleeps.
    ///
    /// # Errors
    /// Why not: usually a missing right.
    pub fn limit(us: u32) -> Result<Self, String> {
        let mut file = File::options().write(true).open(WAKE_LATENCY).map_err(in_words)?;
        file.write_all(&us.to_ne_bytes()).map_err(in_words)?;
        Ok(Self { _file: file })
    }
}

fn in_words(error: std::io::Error) -> String {
    format!("{WAKE_LATENCY}: {error}")
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
