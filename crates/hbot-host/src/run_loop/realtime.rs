//! Real-time priority and locked memory, which a thread needs to keep its deadlines.

use std::fs::File;
use std::io::Write as _;

use rustix::mm::{MlockAllFlags, mlockall};
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

/// SCHED_FIFO priority of the loop: above everything except the kernel's own threads, which have 50
/// and more.
pub const LOOP_PRIORITY: u8 = 49;
/// SCHED_FIFO priority of the simulated rig's thread: just below the loop.
pub const SIMULATOR_PRIORITY: u8 = 48;

/// Size of the stack that a real-time thread touches before its first tick, bytes.
const STACK: usize = 256 * 1024;

/// Gives the calling thread the scheduling policy SCHED_FIFO at `priority`.
///
/// # Errors
/// Returns the reason in words if the system refuses, usually a missing permission.
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

/// Locks the process's present and future memory, so that no page fault delays the loop.
///
/// # Errors
/// Returns the reason if the system refuses, usually a missing permission.
pub fn lock_memory() -> Result<(), String> {
    mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE).map_err(|e| e.to_string())
}

/// The system file that sets a limit on how long processors can take to wake (PM QoS, kernel
/// documentation power/pm_qos_interface).
const WAKE_LATENCY: &str = "/dev/cpu_dma_latency";

/// A limit on how long processors can take to wake from sleep. It lasts for as long as this value
/// exists.
#[derive(Debug)]
pub struct WakeLatency {
    /// The open file: the system applies the limit until it is closed.
    _file: File,
}

impl WakeLatency {
    /// Limits the wake-up time of all processors to `us`, µs. With 0 no processor sleeps.
    ///
    /// # Errors
    /// Returns the reason if the system refuses, usually a missing permission.
    pub fn limit(us: u32) -> Result<Self, String> {
        let mut file = File::options().write(true).open(WAKE_LATENCY).map_err(in_words)?;
        file.write_all(&us.to_ne_bytes()).map_err(in_words)?;
        Ok(Self { _file: file })
    }
}

fn in_words(error: std::io::Error) -> String {
    format!("{WAKE_LATENCY}: {error}")
}

/// Writes to the stack that the calling thread will use, so that its first use causes no page fault
/// later.
#[inline(never)]
pub fn touch_stack() {
    let mut pages = [0_u8; STACK];
    for byte in pages.iter_mut().step_by(4096) {
        *byte = 1;
    }
    std::hint::black_box(&mut pages);
}

#[cfg(test)]
mod tests {
    use rustix::io::Errno;

    use super::*;

    /// Number of the policy SCHED_FIFO in /proc (sched(7)).
    const FIFO: u64 = 1;

    /// Returns the scheduling policy and the real-time priority of the calling thread, as the
    /// system shows them: fields 41 and 40 of proc_pid_stat(5).
    fn schedule() -> (u64, u64) {
        let text = std::fs::read_to_string("/proc/thread-self/stat").expect("a thread");
        // The first field after the name in parentheses is number 3.
        let (_, fields) = text.rsplit_once(')').expect("a name");
        let field = |number: usize| {
            let text = fields.split_whitespace().nth(number - 3).expect("a field");
            text.parse().expect("a number")
        };
        (field(41), field(40))
    }

    /// Whether the system grants the priority depends on the machine.
    #[test]
    fn a_thread_has_the_priority_that_it_asked_for_or_the_reason_why_not() {
        let asks = || (schedule(), real_time(SIMULATOR_PRIORITY), schedule());
        let (before, told, after) = std::thread::spawn(asks).join().expect("no panic");
        match told {
            Ok(()) => assert_eq!(after, (FIFO, 48)),
            Err(reason) => assert!(after == before && !reason.is_empty(), "{after:?}: {reason:?}"),
        }
        assert!(real_time(100).is_err_and(|reason| reason.contains("99")), "99 is the highest");
    }

    /// Whether the system grants it depends on the machine. Tests of the loop in wall-clock time
    /// lock the memory of this process, too.
    #[test]
    fn memory_is_locked_or_there_is_a_reason_why_not() {
        match lock_memory() {
            Ok(()) => {
                let status = std::fs::read_to_string("/proc/self/status").expect("a process");
                let locked = status.lines().find_map(|line| line.strip_prefix("VmLck:")).expect("a line");
                let kib = locked.trim().trim_end_matches(" kB").parse::<u64>().expect("a number");
                assert!(kib > 0, "{locked}");
            }
            Err(reason) => {
                let refusals = [Errno::PERM, Errno::NOMEM, Errno::AGAIN].map(|errno| errno.to_string());
                assert!(refusals.contains(&reason), "{reason}");
            }
        }
    }

    #[test]
    fn a_limit_of_the_wake_up_time_that_is_refused_names_its_file_and_the_reason() {
        let told = in_words(std::io::Error::from(std::io::ErrorKind::PermissionDenied));
        assert_eq!(told, "/dev/cpu_dma_latency: permission denied");
    }
}
