//! How busy other programs kept the processors while a study ran. Times of a busy machine are too
//! long.

/// Processor time since the machine started, in ticks of the kernel's clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Used {
    /// Time of all processors, busy or not.
    all: u64,
    /// Time in which a processor worked for anybody, or was taken away by the host.
    busy: u64,
    /// Time in which a processor worked for this program and the programs that it started.
    own: u64,
}

impl Used {
    /// Reads the times from the first line of /proc/stat, `machine`, and from /proc/self/stat,
    /// `program` (proc(5)).
    fn read(machine: &str, program: &str) -> Option<Self> {
        let line = machine.lines().next()?.strip_prefix("cpu ")?;
        let times: Vec<u64> = line.split_whitespace().map_while(|word| word.parse().ok()).collect();
        // user, nice, system, idle, iowait, irq, softirq, steal. Times of guests are in user.
        let times = times.get(..8)?;
        let all = times.iter().sum::<u64>();
        // The name of the program stands in parentheses and may contain anything.
        let (_, fields) = program.rsplit_once(')')?;
        // utime, stime, cutime and cstime.
        let own = fields.split_whitespace().skip(11).take(4).map(|word| word.parse::<u64>().ok());
        let own = own.collect::<Option<Vec<u64>>>()?;
        (own.len() == 4).then(|| Self { all, busy: all - times[3] - times[4], own: own.iter().sum() })
    }

    fn now() -> Option<Self> {
        let read = |path| std::fs::read_to_string(path).ok();
        Self::read(&read("/proc/stat")?, &read("/proc/self/stat")?)
    }

    /// Returns the share of all processors that other programs used since `before`, 0 to 1. Returns
    /// `None` if no time has passed.
    fn others_since(&self, before: &Self) -> Option<f64> {
        let all = self.all.checked_sub(before.all).filter(|all| *all > 0)?;
        let others = (self.busy.checked_sub(before.busy)?).saturating_sub(self.own.checked_sub(before.own)?);
        Some(others as f64 / all as f64)
    }
}

/// Measures how busy other programs keep the processors from its creation on.
pub(crate) struct Load(Option<Used>);

impl Load {
    pub(crate) fn begin() -> Self {
        Self(Used::now())
    }

    /// Returns the share of all processors that other programs have used since the beginning, 0 to
    /// 1. Returns `None` if the kernel does not say.
    pub(crate) fn of_others(&self) -> Option<f64> {
        Used::now()?.others_since(&self.0?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two processors for 10 s: this program and its worker use 9 s of the 20, others 4 s, and the
    /// host takes 1 s away.
    #[test]
    fn work_of_others_is_what_neither_this_program_nor_its_workers_did() {
        let before = Used::read("cpu  100 0 50 1000 20 0 0 5 0 0\ncpu0 1 2 3 4\n", &program([10, 5, 0, 0]));
        let after =
            Used::read("cpu  1300 50 100 1580 40 5 0 100 0 0\ncpu0 1 2 3 4\n", &program([510, 105, 300, 0]));
        let (Some(before), Some(after)) = (before, after) else { panic!("{before:?} {after:?}") };
        assert_eq!(after.all - before.all, 2000);
        assert_eq!(after.others_since(&before), Some(0.25));
        assert_eq!(before.others_since(&before), None);
    }

    fn program([user, system, children, children_system]: [u64; 4]) -> String {
        format!("7 (a ) b) R 1 1 1 0 -1 4 0 0 0 0 {user} {system} {children} {children_system} 20 0 3 0")
    }

    #[test]
    fn texts_that_are_something_else_give_no_load() {
        let program = program([1; 4]);
        for machine in ["", "cpu 1 2 3", "intr 1 2 3 4 5 6 7 8"] {
            assert_eq!(Used::read(machine, &program), None, "{machine:?}");
        }
        assert_eq!(Used::read("cpu 1 2 3 4 5 6 7 8", "7 (name) R 1 2"), None);
        assert!(Load::begin().0.is_some(), "Linux says so");
    }
}
