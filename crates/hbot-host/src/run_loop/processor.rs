//! Keeps the loop's thread on one processor.

use rustix::io::Errno;
use rustix::thread::{CpuSet, sched_setaffinity};
use thiserror::Error;

/// A processor that this program is allowed to run on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Processor(u32);

/// The error for a processor that this program cannot run on.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error(
    "loop.cpu: processor {number} {reason}; legal: one of {online}, which this machine has (count from 0)"
)]
pub struct NoProcessor {
    number: u32,
    reason: String,
    online: String,
}

impl Processor {
    /// Checks that the program can run on processor `number`, counted from 0, by pinning a
    /// short-lived thread to it. The list of processors that the system gives a program would not
    /// suffice: it omits processors that are kept free with `isolcpus`.
    ///
    /// # Errors
    /// Fails if the processor does not exist, or if this program must not use it.
    pub fn new(number: u32) -> Result<Self, NoProcessor> {
        let tried = std::thread::spawn(move || pin(number)).join().unwrap_or(Err(Errno::INVAL));
        tried.map(|()| Self(number)).map_err(|errno| NoProcessor {
            number,
            reason: match errno {
                Errno::INVAL => "is not there, or not for this program (taskset, container)".to_owned(),
                _ => format!("is refused by the system: {errno}"),
            },
            online: std::fs::read_to_string("/sys/devices/system/cpu/online")
                .map_or_else(|_| "those".to_owned(), |online| online.trim().to_owned()),
        })
    }

    /// Pins the calling thread to this processor.
    ///
    /// # Errors
    /// Returns the reason that the system gives.
    pub fn keep(self) -> Result<(), String> {
        pin(self.0).map_err(|errno| errno.to_string())
    }
}

fn pin(number: u32) -> Result<(), Errno> {
    let number = usize::try_from(number).map_err(|_| Errno::INVAL)?;
    if number >= CpuSet::MAX_CPU {
        return Err(Errno::INVAL);
    }
    let mut only = CpuSet::new();
    only.set(number);
    sched_setaffinity(None, &only)
}

#[cfg(test)]
mod tests {
    use rustix::thread::sched_getaffinity;

    use super::*;

    #[test]
    fn a_thread_stays_where_it_is_put_and_others_do_not() {
        let before = sched_getaffinity(None).unwrap();
        let number = (0..1024).find(|n| before.is_set(*n)).unwrap();
        let processor = Processor::new(number as u32).unwrap();
        let after = std::thread::spawn(move || processor.keep().map(|()| sched_getaffinity(None).unwrap()));
        let after = after.join().unwrap().unwrap();
        assert!(after.is_set(number) && after.count() == 1);
        assert_eq!(sched_getaffinity(None).unwrap(), before, "this thread is as free as it was");
    }

    #[test]
    fn one_that_is_not_there_is_told_in_words() {
        for number in [1023, 4096, u32::MAX] {
            let said = Processor::new(number).unwrap_err().to_string();
            assert!(said.contains(&format!("processor {number} is not there")), "{said}");
            assert!(said.contains("legal: one of 0"), "{said}");
        }
    }
}
