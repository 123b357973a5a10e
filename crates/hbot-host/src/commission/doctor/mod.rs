//! Checks whether a machine meets the conditions for the loop to keep its deadlines. Some are
//! looked up, others are measured.
//!
//! The checks change nothing permanently. Each finding has a mark, the numbers behind it, and
//! advice if something needs to be corrected.

mod device;
mod machine;
mod punctuality;
mod rate;

use std::thread;

use rustix::process::{Resource, getrlimit};
use serde::Serialize;

pub use device::serial;
pub use machine::Machine;
pub use punctuality::{Punctuality, lead, punctuality, verdict};
pub use rate::{MOST_LOAD, highest_rate, line_rate, lines, machine_rate};

use crate::run_loop::processor::Processor;
use crate::run_loop::realtime::{LOOP_PRIORITY, WakeLatency, lock_memory, real_time};

/// Memory that a server needs to lock, with a margin, bytes.
const MEMLOCK: u64 = 256 << 20;

/// The grade of a finding: how well the machine meets one condition.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Mark {
    /// Nothing needs to be corrected.
    Good,
    /// The rig works, but other work on the machine can disturb it noticeably.
    Usable,
    /// The rig does not work, or goes into a fault.
    NotSufficient,
}

/// The result of one check.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Identifier of the check. It never changes, so that programs can rely on it.
    pub id: &'static str,
    /// The grade of the result.
    pub mark: Mark,
    /// What was found, with its numbers.
    pub found: String,
    /// Advice on how to correct the problem, unless the mark is good.
    pub mend: Option<String>,
}

impl Finding {
    fn new(id: &'static str, mark: Mark, found: impl Into<String>, mend: &str) -> Self {
        let mend = (mark != Mark::Good).then(|| mend.to_owned());
        Self { id, mark, found: found.into(), mend }
    }
}

/// Checks whether this process gets real-time priority and can lock enough memory. The priority is
/// tried out. Locking is tried out only if the limit on locked memory is too low.
#[must_use]
pub fn rights() -> Vec<Finding> {
    let shown = |limit: Option<u64>| limit.map_or_else(|| "unlimited".to_owned(), |n| n.to_string());
    // Tried in a separate thread, which ends together with the priority that it was given.
    let tried =
        thread::spawn(|| real_time(LOOP_PRIORITY)).join().unwrap_or_else(|_| Err("panicked".to_owned()));
    let limit = shown(getrlimit(Resource::Rtprio).current);
    let priority = match tried {
        Ok(()) => Finding::new("priority", Mark::Good, format!("SCHED_FIFO {LOOP_PRIORITY} is granted"), ""),
        Err(reason) => Finding::new(
            "priority",
            Mark::Usable,
            format!("SCHED_FIFO {LOOP_PRIORITY} is refused ({reason}); the limit rtprio is {limit}"),
            "copy contrib/99-hbot.conf to /etc/security/limits.d, join its group, and log in anew; or use contrib/hbot.service",
        ),
    };
    let limit = getrlimit(Resource::Memlock).current;
    let enough = limit.is_none_or(|bytes| bytes >= MEMLOCK) || lock_memory().is_ok();
    let memory = Finding::new(
        "memlock",
        if enough { Mark::Good } else { Mark::Usable },
        format!(
            "the limit of locked memory is {}",
            limit.map_or_else(|| shown(None), |b| format!("{} KiB", b >> 10))
        ),
        "as for the priority: contrib/99-hbot.conf raises memlock too",
    );
    vec![priority, memory]
}

/// Checks whether this process can limit the time that the processors take to wake, to `wake_us`
/// µs. Also returns the limit, which holds until it is dropped.
#[must_use]
pub fn wake_latency(wake_us: u32) -> (Finding, Option<WakeLatency>) {
    match WakeLatency::limit(wake_us) {
        Ok(held) => {
            let found = format!("a limit of {wake_us} us for waking is granted");
            (Finding::new("wake_latency", Mark::Good, found, ""), Some(held))
        }
        Err(reason) => {
            let found = format!("a limit of {wake_us} us for waking is refused ({reason})");
            let mend = "copy contrib/99-hbot.rules to /etc/udev/rules.d and join the group realtime, or boot with idle=poll";
            (Finding::new("wake_latency", Mark::Usable, found, mend), None)
        }
    }
}

/// Checks whether the loop can run on processor `number`, counted from 0, which the rig file names.
#[must_use]
pub fn processor(number: u32) -> Finding {
    match Processor::new(number) {
        Ok(_) => Finding::new("processor", Mark::Good, format!("the loop stays on processor {number}"), ""),
        Err(error) => {
            Finding::new("processor", Mark::NotSufficient, error.to_string(), "another one, or none")
        }
    }
}
