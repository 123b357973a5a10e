//! The flight log: a file with every tick of the loop from 1 s before a fault or emergency stop
//! until 100 ms after it.
//!
//! Samples go into a ring whose memory is allocated at the start. After a trigger, the ring is
//! filled for another 100 ms. Then its contents are returned as a [`Flight`], which a blocking
//! thread writes, so recording never waits for the disk. A second trigger within 100 ms of the
//! first extends the first log until 100 ms after the second trigger.

mod prune;

use std::collections::VecDeque;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use rustix::fs::{Access, access};

pub use self::prune::{MAX_FILES, prune};
use crate::service::convert;
use hbot_host::run_loop::sample::Sample;
use hbot_record::flight::Name;

/// How long before a fault its flight log begins.
const BEFORE: Duration = Duration::from_secs(1);
/// How long after a fault its flight log ends.
const AFTER: Duration = Duration::from_millis(100);
/// Keeps the samples of the last second in memory. After a fault or an emergency stop, it returns
/// the samples before and after it as a flight log.
pub struct FlightRecorder {
    dir: PathBuf,
    ring: Vec<Sample>,
    capacity: usize,
    /// Index at which the next sample is written, after the ring has filled up.
    next: usize,
    before_ticks: u64,
    after_ticks: u64,
    /// Flight logs in progress. There are at most two, because one ends before a third can begin.
    triggers: VecDeque<Trigger>,
    /// Number of flight logs begun. It is part of the file name, so that two logs of the same
    /// millisecond have different names.
    begun: u64,
}

struct Trigger {
    /// The tick of the fault.
    tick: u64,
    /// The last tick of the log.
    until: u64,
    path: PathBuf,
}

impl FlightRecorder {
    /// Creates a recorder for a loop with period `period_ns`, ns. Its logs go into the folder
    /// `dir`. Allocates all of its memory now.
    #[must_use]
    pub fn new(dir: PathBuf, period_ns: u64) -> Self {
        let ticks =
            |time: Duration| u64::try_from(time.as_nanos()).unwrap_or(u64::MAX).div_ceil(period_ns.max(1));
        let (before_ticks, after_ticks) = (ticks(BEFORE), ticks(AFTER));
        let capacity = usize::try_from(before_ticks + 2 * after_ticks + 1).unwrap_or(usize::MAX);
        Self {
            dir,
            ring: Vec::with_capacity(capacity),
            capacity,
            next: 0,
            before_ticks,
            after_ticks,
            triggers: VecDeque::with_capacity(2),
            begun: 0,
        }
    }

    /// Records the next sample. Returns a flight log if this sample completes one.
    #[inline]
    pub fn push(&mut self, sample: &Sample) -> Option<Flight> {
        if self.ring.len() < self.capacity {
            self.ring.push(*sample);
        } else {
            self.ring[self.next] = *sample;
            self.next = if self.next + 1 == self.capacity { 0 } else { self.next + 1 };
        }
        let done = self.triggers.front().is_some_and(|trigger| sample.state.tick >= trigger.until);
        if done { self.finish() } else { None }
    }

    /// Begins a flight log for the fault or stop `what` in `tick`, whose sample has already been
    /// recorded. Returns the path that the log will have. If another log began at most 100 ms
    /// before, that log is extended instead.
    pub fn trigger(&mut self, tick: u64, what: &str) -> &Path {
        let until = tick + self.after_ticks;
        match self.triggers.back_mut() {
            Some(begun) if tick <= begun.tick + self.after_ticks => begun.until = until,
            _ => {
                self.begun += 1;
                let now = utc(SystemTime::now());
                let name = Name::new(&now, std::process::id(), self.begun, what);
                self.triggers.push_back(Trigger { tick, until, path: self.dir.join(name.to_string()) });
            }
        }
        self.triggers.back().map_or(&self.dir, |trigger| &trigger.path)
    }

    /// Ends the oldest flight log in progress and returns it, complete or not. Returns `None` if
    /// there is none.
    pub fn finish(&mut self) -> Option<Flight> {
        let Trigger { tick, until, path } = self.triggers.pop_front()?;
        let wanted = tick.saturating_sub(self.before_ticks)..=until;
        let (newer, older) = self.ring.split_at(self.next);
        let samples = older.iter().chain(newer).filter(|s| wanted.contains(&s.state.tick)).copied().collect();
        Some(Flight { path, samples })
    }
}

/// Creates the folder for flight logs and checks that files can be written there.
///
/// # Errors
/// Returns the operating system's error if the folder cannot be created or written.
pub fn prepare(dir: &Path) -> io::Result<()> {
    fs::create_dir_all(dir)?;
    Ok(access(dir, Access::WRITE_OK | Access::EXEC_OK)?)
}

/// Minimum time between two reports that flight logs could not be written.
const TELL_EVERY: Duration = Duration::from_secs(60);

/// Limits the reports about flight logs that could not be written: at most one per minute is due.
#[derive(Debug, Default)]
pub(crate) struct Failures {
    told: Option<Instant>,
    untold: u64,
}

impl Failures {
    /// Counts one more flight log that could not be written. If a report is due, returns the number
    /// of failures since the last report.
    pub(crate) fn failed(&mut self, now: Instant) -> Option<u64> {
        self.untold += 1;
        if self.told.is_some_and(|told| now.duration_since(told) < TELL_EVERY) {
            return None;
        }
        self.told = Some(now);
        Some(std::mem::take(&mut self.untold))
    }
}

/// A flight log in memory: the samples around a fault, which have not been written to a file yet.
pub struct Flight {
    /// Path of the file to write.
    pub path: PathBuf,
    /// The samples of the log, oldest first.
    pub samples: Vec<Sample>,
}

impl Flight {
    /// Writes the log to its file, either completely or not at all. Then removes old logs beyond
    /// [`MAX_FILES`], as [`prune`] describes. Blocks until the file is written.
    ///
    /// # Errors
    /// Returns the operating system's error if the file cannot be created or written.
    pub fn write(&self) -> io::Result<()> {
        let dir = self.path.parent().unwrap_or(Path::new("."));
        fs::create_dir_all(dir)?;
        let part = self.path.with_extension("part");
        let table = File::create_new(&part)?;
        let written = self.write_to(table).and_then(|()| fs::rename(&part, &self.path));
        if written.is_err() {
            // An incomplete file is useless. The error to report is the failed write, not a failed
            // removal.
            let _ = fs::remove_file(&part);
        }
        written?;
        if let Err(error) = prune(&self.path) {
            tracing::warn!(%error, "old flight logs cannot be removed");
        }
        Ok(())
    }

    fn write_to(&self, file: File) -> io::Result<()> {
        let mut table = csv::Writer::from_writer(BufWriter::new(file));
        let joints = self.samples.first().map_or(0, |sample| sample.state.joints);
        table.write_record(header(joints))?;
        let mut row = Vec::new();
        for sample in &self.samples {
            row.clear();
            fields(sample, joints, &mut row);
            table.write_record(&row)?;
        }
        table.into_inner().map_err(|error| io::Error::other(error.to_string()))?.flush()
    }
}

/// Returns the column names of a flight log, with units. Vectors are in frame N.
fn header(joints: usize) -> Vec<String> {
    let names = |list: &str| list.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
    let mut all = names(
        "tick t_s mode fault q_w q_x q_y q_z omega_x_rad_s omega_y_rad_s omega_z_rad_s torque_x_nm torque_y_nm torque_z_nm",
    );
    for joint in 1..=joints {
        all.extend([
            format!("joint{joint}_angle_rad"),
            format!("joint{joint}_rate_rad_s"),
            format!("joint{joint}_torque_nm"),
        ]);
    }
    all.extend(names(
        "slip_m_s scale deficient traction energy_j client_seq client_age_ticks fresh scene lateness_us compute_us link_us \
         age_us lead_us late_ticks skipped_ticks missed_ticks corrupt_frames foreign_frames send_failures dropped_samples",
    ));
    all
}

fn fields(sample: &Sample, joints: usize, row: &mut Vec<String>) {
    let Sample { state, timing, counters, .. } = sample;
    let optional = |value: Option<u64>| value.map(|v| v.to_string()).unwrap_or_default();
    let us = |ns: u64| (ns as f64 * 1.0e-3).to_string();
    row.extend([state.tick.to_string(), (sample.t_ns as f64 * 1.0e-9).to_string()]);
    row.push(convert::mode(state.mode).to_string());
    row.push(state.cause.map(|cause| convert::fault(cause).to_string()).unwrap_or_default());
    row.extend([state.q.w, state.q.x, state.q.y, state.q.z].map(|x| x.to_string()));
    row.extend(state.omega.to_array().map(|x| x.to_string()));
    row.extend(state.torque.to_array().map(|x| x.to_string()));
    for j in 0..joints {
        row.extend([state.angle[j], state.rate[j], state.joint_torque[j]].map(|x| x.to_string()));
    }
    row.extend([state.slip.to_string(), state.scale.to_string(), state.deficient.to_string()]);
    row.extend([state.traction.to_string(), state.energy.to_string()]);
    row.push(optional(state.client.and_then(|client| client.seq)));
    row.push(optional(state.client.map(|client| client.age_ticks)));
    row.extend([state.fresh.to_string(), sample.scene.to_string()]);
    row.extend([us(timing.lateness_ns), us(timing.compute_ns), us(timing.line_ns)]);
    row.push(timing.age_ns.map(us).unwrap_or_default());
    row.push(state.lead_us.to_string());
    row.extend(
        [
            counters.late,
            counters.skipped,
            counters.missed,
            counters.corrupt_frames,
            counters.foreign_frames,
            counters.send_failures,
            counters.dropped_samples,
        ]
        .map(|n| n.to_string()),
    );
}

/// Formats a time in UTC as `20260131T235959.123Z`.
#[must_use]
pub fn utc(time: SystemTime) -> String {
    let since = time.duration_since(UNIX_EPOCH).unwrap_or_default();
    let (days, s) = (since.as_secs() / 86_400, since.as_secs() % 86_400);
    let (year, month, day) = civil(days);
    let (h, m, s, ms) = (s / 3600, s / 60 % 60, s % 60, since.subsec_millis());
    format!("{year:04}{month:02}{day:02}T{h:02}{m:02}{s:02}.{ms:03}Z")
}

/// Converts days since 1970-01-01 to year, month and day in the Gregorian calendar.
///
/// Source: Howard Hinnant, "chrono-Compatible Low-Level Date Algorithms", `civil_from_days`, for
/// days from 1970 on.
fn civil(days: u64) -> (u64, u64, u64) {
    // Count days from 0000-03-01, so that a leap day is the last day of its year.
    let shifted = days + 719_468;
    let (era, day_of_era) = (shifted / 146_097, shifted % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 { month_from_march + 3 } else { month_from_march - 9 };
    let year = year_of_era + era * 400 + u64::from(month <= 2);
    (year, month, day)
}

#[cfg(test)]
mod tests {

    use super::*;

    /// Returns the first and last tick of each flight log that a recorder produces in `ticks`
    /// ticks, if faults occur in the ticks `faults`. Asserts that no log has gaps.
    fn logs(faults: &[u64], ticks: u64) -> Vec<(u64, u64)> {
        let mut recorder = FlightRecorder::new(PathBuf::from("flights"), 1_000_000);
        let mut flights = Vec::new();
        let mut like = crate::still::still(0);
        for tick in 0..ticks {
            like.state.tick = tick;
            flights.extend(recorder.push(&like));
            if faults.contains(&tick) {
                recorder.trigger(tick, "estop");
            }
        }
        let ends = flights.iter().map(|flight| {
            let ticks: Vec<u64> = flight.samples.iter().map(|sample| sample.state.tick).collect();
            assert!(ticks.windows(2).all(|pair| pair[1] == pair[0] + 1), "{ticks:?}");
            (ticks[0], ticks[ticks.len() - 1])
        });
        ends.collect()
    }

    #[test]
    fn faults_in_quick_succession_each_have_their_second_before_and_tenth_after() {
        assert_eq!(logs(&[2000], 5000), [(1000, 2100)]);
        // A second fault within 100 ms of the first extends the first log.
        assert_eq!(logs(&[2000, 2099], 5000), [(1000, 2199)]);
        assert_eq!(logs(&[2000, 2050, 2100], 5000), [(1000, 2200)]);
        // A fault more than 100 ms after the first one begins its own log, even while the extended
        // first log is still in progress.
        assert_eq!(logs(&[2000, 2090, 2110, 2190], 5000), [(1000, 2190), (1110, 2290)]);
        assert_eq!(logs(&[2000, 2101], 5000), [(1000, 2100), (1101, 2201)]);
        // A fault in every tick for half a second.
        let all: Vec<u64> = (2000..2500).collect();
        let logs = logs(&all, 5000);
        assert!(logs.len() == 5 && logs[0] == (1000, 2200) && logs[4].1 == 2599, "{logs:?}");
    }

    #[test]
    fn failures_are_told_once_a_minute_with_their_number() {
        let (start, mut failures) = (Instant::now(), Failures::default());
        let at = |s| start + Duration::from_secs(s);
        let told: Vec<_> = [0, 1, 59, 60, 61, 500].map(|s| failures.failed(at(s))).into();
        assert_eq!(told, [Some(1), None, None, Some(3), None, Some(2)]);
    }

    #[test]
    fn days_have_their_dates() {
        assert_eq!(civil(0), (1970, 1, 1));
        assert_eq!(civil(11_016), (2000, 2, 29));
        assert_eq!(civil(11_017), (2000, 3, 1));
        assert_eq!(civil(20_818), (2026, 12, 31));
        let time = UNIX_EPOCH + Duration::from_millis(951_868_799_123);
        assert_eq!(utc(time), "20000229T235959.123Z");
    }
}
