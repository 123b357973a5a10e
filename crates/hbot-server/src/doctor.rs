//! What a machine must have for the loop to keep its time: looked up, and measured.
//!
//! Nothing here changes anything. Each finding has a mark, the numbers behind it, and where something is wanting, what to do.

use std::fs;
use std::path::Path;
use std::thread;
use std::time::Duration;

use hdrhistogram::Histogram;
use rustix::fs::{Access, access};
use rustix::process::{Resource, getrlimit};
use serde::Serialize;

use crate::clock::{now_ns, sleep_until_ns};
use crate::pace::Pace;
use crate::processor::Processor;
use crate::realtime::{LOOP_PRIORITY, lock_memory, real_time, touch_stack};
use crate::serial::LatencyTimer;

/// Memory that a server locks, with room to spare, bytes.
const MEMLOCK: u64 = 256 << 20;
/// Waking from a deeper sleep than this takes a share of a tick that can be felt, us.
const WAKE_US: u64 = 50;

/// Lateness beyond this is not told apart, ns.
const LONGEST_NS: u64 = 10_000_000_000;

/// How good what was found is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Mark {
    /// Nothing to mend.
    Good,
    /// The rig works; other work on the machine, or bad luck, can be felt.
    Usable,
    /// The rig does not work, or faults.
    NotSufficient,
}

/// One thing that was looked at.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// What was looked at: stable, for programs.
    pub id: &'static str,
    /// How good it is.
    pub mark: Mark,
    /// What was found, with its numbers.
    pub found: String,
    /// What to do about it.
    pub mend: Option<String>,
}

impl Finding {
    fn new(id: &'static str, mark: Mark, found: impl Into<String>, mend: &str) -> Self {
        let mend = (mark != Mark::Good).then(|| mend.to_owned());
        Self { id, mark, found: found.into(), mend }
    }
}

/// How late a bare loop of absolute sleeps wakes, us.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Punctuality {
    /// Ticks a second.
    pub rate_hz: u32,
    /// It ran under SCHED_FIFO.
    pub real_time: bool,
    /// Ticks that were measured.
    pub ticks: u64,
    /// Half were not later.
    pub p50_us: f64,
    /// 99 % were not later.
    pub p99_us: f64,
    /// 99.9 % were not later.
    pub p99_9_us: f64,
    /// 99.99 % were not later.
    pub p99_99_us: f64,
    /// None was later.
    pub max_us: f64,
    /// Ticks more than a quarter period late.
    pub late: u64,
    /// Ticks whose deadline passed before the one before them ended.
    pub skipped: u64,
}

/// What the files of the system say, under a root that tests replace.
pub struct Machine<'a> {
    root: &'a Path,
}

impl Default for Machine<'_> {
    fn default() -> Self {
        Self { root: Path::new("/") }
    }
}

impl<'a> Machine<'a> {
    /// A machine whose `/sys` and `/proc` are in `root`.
    #[must_use]
    pub fn at(root: &'a Path) -> Self {
        Self { root }
    }

    fn read(&self, path: &str) -> Option<String> {
        let text = fs::read_to_string(self.root.join(path)).ok()?;
        Some(text.trim().to_owned())
    }

    /// Each processor's file of this name, where it has one.
    fn of_processors(&self, file: &str) -> Vec<String> {
        (0..4096)
            .take_while(|k| self.root.join(format!("sys/devices/system/cpu/cpu{k}")).exists())
            .filter_map(|k| self.read(&format!("sys/devices/system/cpu/cpu{k}/{file}")))
            .collect()
    }

    /// Kernel, processors and their sleep.
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
            if number("disable") == Some(0) {
                longest = longest.max(number("latency").unwrap_or(0));
            }
        }
        let mark = if longest > WAKE_US { Mark::Usable } else { Mark::Good };
        let found = format!("waking from the deepest sleep takes up to {longest} us");
        let mend = "disable the deep ones (`cpupower idle-set -D 50`), or boot with intel_idle.max_cstate=1 processor.max_cstate=1";
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

/// What this process may do: real-time priority and locked memory, tried rather than read.
#[must_use]
pub fn rights() -> Vec<Finding> {
    let shown = |limit: Option<u64>| limit.map_or_else(|| "unlimited".to_owned(), |n| n.to_string());
    // Tried in a thread of its own, which ends with what it was given.
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

/// A serial device: there, allowed, and quick.
#[must_use]
pub fn serial(port: &str) -> Vec<Finding> {
    let path = Path::new(port);
    if !path.exists() {
        let found = format!("{port} is not there");
        let mend =
            "plug the controllers in and switch them on; `ls /dev/serial/by-id` shows what the system sees";
        return vec![Finding::new("serial_device", Mark::NotSufficient, found, mend)];
    }
    let allowed = access(path, Access::READ_OK | Access::WRITE_OK).is_ok();
    let (mark, found) = if allowed {
        (Mark::Good, format!("{port} may be read and written"))
    } else {
        (Mark::NotSufficient, format!("{port} may not be read and written by this user"))
    };
    let mend = "`sudo usermod -aG dialout $USER` and log in anew, or contrib/99-hbot.rules";
    let mut findings = vec![Finding::new("serial_device", mark, found, mend)];
    findings.push(match LatencyTimer::of(path) {
        None => Finding::new(
            "latency_timer",
            Mark::Good,
            format!("the driver of {port} has no latency timer"),
            "",
        ),
        Some(timer) => Finding::new(
            "latency_timer",
            if timer.ms <= 1 { Mark::Good } else { Mark::NotSufficient },
            format!("{port} holds readings back for up to {} ms", timer.ms),
            &format!("`echo 1 | sudo tee {}`, or contrib/99-hbot.rules for good", timer.path.display()),
        ),
    });
    findings
}

/// The processor that the rig file gives the loop, from 0.
#[must_use]
pub fn processor(number: u32) -> Finding {
    match Processor::new(number) {
        Ok(_) => Finding::new("processor", Mark::Good, format!("the loop stays on processor {number}"), ""),
        Err(error) => {
            Finding::new("processor", Mark::NotSufficient, error.to_string(), "another one, or none")
        }
    }
}

/// Measures a bare loop of absolute sleeps, under SCHED_FIFO where that is granted, on the processor `cpu` where one is named and
/// there: the best that this machine can do.
#[must_use]
pub fn punctuality(rate_hz: u32, cpu: Option<u32>, time: Duration) -> Punctuality {
    let period_ns = 1_000_000_000 / u64::from(rate_hz.max(1));
    let ticks = (time.as_nanos() / u128::from(period_ns)) as u64;
    let processor = cpu.and_then(|number| Processor::new(number).ok());
    let measured = thread::spawn(move || {
        // One that is there can be stayed on; where it is taken away meanwhile, the measurement is of the others.
        let _ = processor.map(Processor::keep);
        let granted = real_time(LOOP_PRIORITY).is_ok();
        touch_stack();
        let mut lateness = Histogram::<u64>::new_with_bounds(1, LONGEST_NS, 3).ok();
        let (mut late, mut skipped) = (0, 0);
        let mut pace = Pace::new(now_ns() + period_ns, period_ns);
        for _ in 0..ticks {
            sleep_until_ns(pace.deadline_ns());
            let beat = pace.beat(now_ns());
            late += u64::from(beat.late);
            if let Some(lateness) = &mut lateness {
                lateness.saturating_record(beat.lateness_ns);
            }
            skipped += pace.end(now_ns());
        }
        (granted, lateness, late, skipped)
    });
    let (real_time, lateness, late, skipped) = measured.join().unwrap_or((false, None, ticks, 0));
    let at = |quantile| lateness.as_ref().map_or(f64::MAX, |h| h.value_at_quantile(quantile) as f64 * 1e-3);
    Punctuality {
        rate_hz,
        real_time,
        ticks,
        p50_us: at(0.5),
        p99_us: at(0.99),
        p99_9_us: at(0.999),
        p99_99_us: at(0.9999),
        max_us: at(1.0),
        late,
        skipped,
    }
}

/// What a measurement says of the machine: good where one tick in 10,000 at most is late (by a quarter period) and none by a whole
/// one; usable where one in 100 is and none so late that it is a fault (20 ms).
#[must_use]
pub fn verdict(measured: &Punctuality) -> Finding {
    let period_us = 1.0e6 / f64::from(measured.rate_hz);
    let mark = if measured.p99_99_us <= period_us / 4.0 && measured.max_us <= period_us {
        Mark::Good
    } else if measured.p99_us <= period_us / 4.0 && measured.max_us <= 20_000.0 {
        Mark::Usable
    } else {
        Mark::NotSufficient
    };
    let found = format!(
        "at {} Hz{}: median {:.0} us late, 99 % {:.0}, 99.9 % {:.0}, 99.99 % {:.0}, most {:.0}; {} of {} ticks late, {} \
         skipped; a tick is late from {:.0} us on",
        measured.rate_hz,
        if measured.real_time { " under SCHED_FIFO" } else { "" },
        measured.p50_us,
        measured.p99_us,
        measured.p99_9_us,
        measured.p99_99_us,
        measured.max_us,
        measured.late,
        measured.ticks,
        measured.skipped,
        period_us / 4.0,
    );
    let mend = "mend what stands above, close other programs, and measure again for longer (`--seconds 60`); docs/realtime.md";
    Finding::new("punctuality", mark, found, mend)
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

    #[test]
    fn the_verdict_follows_the_numbers() {
        let measured = Punctuality {
            rate_hz: 1000,
            real_time: true,
            ticks: 10_000,
            p50_us: 5.0,
            p99_us: 20.0,
            p99_9_us: 40.0,
            p99_99_us: 250.0,
            max_us: 1000.0,
            late: 1,
            skipped: 0,
        };
        assert_eq!(verdict(&measured).mark, Mark::Good);
        assert_eq!(verdict(&Punctuality { p99_99_us: 251.0, ..measured }).mark, Mark::Usable);
        assert_eq!(verdict(&Punctuality { max_us: 1001.0, ..measured }).mark, Mark::Usable);
        assert_eq!(verdict(&Punctuality { max_us: 20_001.0, ..measured }).mark, Mark::NotSufficient);
        assert_eq!(
            verdict(&Punctuality { p99_us: 251.0, p99_99_us: 251.0, ..measured }).mark,
            Mark::NotSufficient
        );
        // A quarter period at 4 kHz is a quarter of that at 1 kHz.
        assert_eq!(verdict(&Punctuality { rate_hz: 4000, ..measured }).mark, Mark::Usable);
    }

    #[test]
    fn a_loop_is_measured_and_none_of_its_ticks_is_lost() {
        let measured = punctuality(1000, None, Duration::from_millis(200));
        assert_eq!(measured.ticks, 200);
        let rising =
            [measured.p50_us, measured.p99_us, measured.p99_9_us, measured.p99_99_us, measured.max_us];
        assert!(rising.is_sorted() && measured.max_us < f64::MAX, "{measured:?}");
        // No machine wakes in no time, and what counts as late is late by that much.
        assert!(measured.p50_us > 0.0 && (measured.late == 0 || measured.max_us > 250.0), "{measured:?}");
    }

    #[test]
    fn a_port_that_is_not_there_is_told() {
        let findings = serial("/dev/no-such-port");
        assert_eq!((findings.len(), findings[0].mark), (1, Mark::NotSufficient));
    }
}
