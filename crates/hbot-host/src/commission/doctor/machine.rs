//! Checks of the kernel and the processors, from files of the operating system.

use std::fs;
use std::path::Path;

use super::{Finding, Mark};

/// Longest time that a processor can take to wake from sleep without a warning, µs. A longer time
/// is a noticeable part of a tick.
const WAKE_US: u64 = 50;

/// The computer that runs hbot, as the files of its operating system describe it. Tests read files
/// in another root directory.
pub struct Machine<'a> {
    root: &'a Path,
    /// Largest wake-up time of the processors that the server allows, µs, if it sets such a limit.
    /// Deeper sleep states are then not used.
    held_us: Option<u64>,
}

impl Default for Machine<'_> {
    fn default() -> Self {
        Self { root: Path::new("/"), held_us: None }
    }
}

impl<'a> Machine<'a> {
    /// Creates a machine whose `/sys` and `/proc` are in the directory `root`.
    #[must_use]
    pub fn at(root: &'a Path) -> Self {
        Self { root, held_us: None }
    }

    /// Returns this machine with the wake-up time of its processors limited to `wake_us`, µs.
    #[must_use]
    pub fn holding(self, wake_us: u32) -> Self {
        Self { held_us: Some(u64::from(wake_us)), ..self }
    }

    fn read(&self, path: &str) -> Option<String> {
        let text = fs::read_to_string(self.root.join(path)).ok()?;
        Some(text.trim().to_owned())
    }

    /// Returns the contents of `file` for each processor that has this file.
    fn of_processors(&self, file: &str) -> Vec<String> {
        (0..4096)
            .take_while(|k| self.root.join(format!("sys/devices/system/cpu/cpu{k}")).exists())
            .filter_map(|k| self.read(&format!("sys/devices/system/cpu/cpu{k}/{file}")))
            .collect()
    }

    /// Checks the kernel, the clock and sleep states of the processors, and the limits for
    /// real-time threads.
    #[must_use]
    pub fn findings(&self) -> Vec<Finding> {
        vec![self.kernel(), self.governor(), self.sleep(), self.isolation(), self.throttling()]
    }

    fn kernel(&self) -> Finding {
        let release = self.read("proc/sys/kernel/osrelease").unwrap_or_else(|| "unknown".to_owned());
        let preempt_rt = self.read("sys/kernel/realtime").is_some_and(|text| text == "1");
        let (mark, what) =
            if preempt_rt { (Mark::Good, "PREEMPT_RT") } else { (Mark::Usable, "without PREEMPT_RT") };
        let mend = "install a kernel with PREEMPT_RT (Debian: linux-image-rt-amd64; Ubuntu: the realtime kernel) and boot it";
        Finding::new("kernel", mark, format!("Linux {release}, {what}"), mend)
    }

    fn governor(&self) -> Finding {
        let governors = self.of_processors("cpufreq/scaling_governor");
        let other = governors.iter().find(|governor| *governor != "performance");
        let (mark, found) = match (governors.first(), other) {
            (None, _) => (Mark::Good, "the system does not scale the clock".to_owned()),
            (Some(_), None) => (Mark::Good, "performance".to_owned()),
            (_, Some(other)) => (Mark::Usable, format!("{other}: the clock rises only once there is work")),
        };
        Finding::new("governor", mark, found, "`cpupower frequency-set -g performance`, at every boot")
    }

    fn sleep(&self) -> Finding {
        let mut longest = 0;
        for state in 0..16 {
            let folder = format!("sys/devices/system/cpu/cpu0/cpuidle/state{state}");
            let number =
                |file: &str| self.read(&format!("{folder}/{file}")).and_then(|t| t.parse::<u64>().ok());
            let latency = number("latency").unwrap_or(0);
            if number("disable") == Some(0) && self.held_us.is_none_or(|held| latency <= held) {
                longest = longest.max(latency);
            }
        }
        let mark = if longest > WAKE_US { Mark::Usable } else { Mark::Good };
        let held = if self.held_us.is_some() { " that the server leaves" } else { "" };
        let found = format!("waking from the deepest sleep{held} takes up to {longest} us");
        let mend = "let the server hold them off (`wake_us` in the rig file's [loop]), disable the deep ones (`cpupower idle-set -D 50`), or boot with intel_idle.max_cstate=1 processor.max_cstate=1";
        Finding::new("idle_states", mark, found, mend)
    }

    fn isolation(&self) -> Finding {
        let isolated = self.read("sys/devices/system/cpu/isolated").filter(|list| !list.is_empty());
        let found = match isolated {
            Some(list) => format!("processors {list} are set aside (keep the loop there: `--cpu`)"),
            None => {
                "no processor is set aside; isolcpus= is worth it only where other work loads the machine"
                    .to_owned()
            }
        };
        Finding::new("isolation", Mark::Good, found, "")
    }

    fn throttling(&self) -> Finding {
        let number =
            |file: &str| self.read(&format!("proc/sys/kernel/{file}")).and_then(|t| t.parse::<i64>().ok());
        let (runtime, period) = (number("sched_rt_runtime_us"), number("sched_rt_period_us"));
        let (mark, found) = match (runtime, period) {
            (Some(runtime), Some(period)) if runtime >= 0 && 2 * runtime < period => {
                (Mark::NotSufficient, format!("real-time threads may run {runtime} of {period} us"))
            }
            (Some(-1), _) => (Mark::Good, "real-time threads are not throttled".to_owned()),
            (Some(runtime), Some(period)) => {
                (Mark::Good, format!("real-time threads may run {runtime} of {period} us"))
            }
            _ => (Mark::Good, "the system has no such limit".to_owned()),
        };
        Finding::new("rt_throttling", mark, found, "`sysctl kernel.sched_rt_runtime_us=950000`")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn machine(files: &[(&str, &str)]) -> tempfile::TempDir {
        let root = tempfile::tempdir().expect("a folder");
        for (path, text) in files {
            let path = root.path().join(path);
            fs::create_dir_all(path.parent().expect("a parent")).expect("made");
            fs::write(path, text).expect("written");
        }
        root
    }

    fn marks(files: &[(&str, &str)]) -> Vec<(&'static str, Mark)> {
        let root = machine(files);
        let findings = Machine::at(root.path()).findings();
        assert!(findings.iter().all(|f| f.mend.is_some() == (f.mark != Mark::Good)), "{findings:?}");
        findings.iter().map(|f| (f.id, f.mark)).collect()
    }

    #[test]
    fn a_machine_set_up_for_it_is_good() {
        let cpu = "sys/devices/system/cpu";
        let all = marks(&[
            ("sys/kernel/realtime", "1\n"),
            (&format!("{cpu}/cpu0/cpufreq/scaling_governor"), "performance\n"),
            (&format!("{cpu}/cpu0/cpuidle/state1/latency"), "2\n"),
            (&format!("{cpu}/cpu0/cpuidle/state1/disable"), "0\n"),
            (&format!("{cpu}/cpu0/cpuidle/state3/latency"), "900\n"),
            (&format!("{cpu}/cpu0/cpuidle/state3/disable"), "1\n"),
            ("proc/sys/kernel/sched_rt_runtime_us", "950000\n"),
            ("proc/sys/kernel/sched_rt_period_us", "1000000\n"),
        ]);
        assert!(all.iter().all(|(_, mark)| *mark == Mark::Good), "{all:?}");
    }

    #[test]
    fn sleeps_that_the_server_holds_off_are_not_counted() {
        let cpu = "sys/devices/system/cpu/cpu0/cpuidle";
        let root = machine(&[
            (&format!("{cpu}/state1/latency"), "2\n"),
            (&format!("{cpu}/state1/disable"), "0\n"),
            (&format!("{cpu}/state2/latency"), "130\n"),
            (&format!("{cpu}/state2/disable"), "0\n"),
        ]);
        let sleep = |machine: Machine<'_>| {
            let Finding { mark, found, .. } = machine.sleep();
            (mark, found)
        };
        let found = |text: &str| text.to_owned();
        let free = sleep(Machine::at(root.path()));
        assert_eq!(free, (Mark::Usable, found("waking from the deepest sleep takes up to 130 us")));
        let held = sleep(Machine::at(root.path()).holding(20));
        assert_eq!(
            held,
            (Mark::Good, found("waking from the deepest sleep that the server leaves takes up to 2 us"))
        );
    }

    #[test]
    fn what_is_wanting_is_named() {
        let cpu = "sys/devices/system/cpu";
        let all = marks(&[
            (&format!("{cpu}/cpu0/cpufreq/scaling_governor"), "performance\n"),
            (&format!("{cpu}/cpu1/cpufreq/scaling_governor"), "powersave\n"),
            (&format!("{cpu}/cpu0/cpuidle/state3/latency"), "900\n"),
            (&format!("{cpu}/cpu0/cpuidle/state3/disable"), "0\n"),
            ("proc/sys/kernel/sched_rt_runtime_us", "100000\n"),
            ("proc/sys/kernel/sched_rt_period_us", "1000000\n"),
        ]);
        let expected = [
            ("kernel", Mark::Usable),
            ("governor", Mark::Usable),
            ("idle_states", Mark::Usable),
            ("isolation", Mark::Good),
            ("rt_throttling", Mark::NotSufficient),
        ];
        assert_eq!(all, expected);
    }
}
