//! The file names of flight logs, and the choice of logs to remove when there are too many.

use std::collections::{HashMap, HashSet};
use std::fmt;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use hbot_api::{Fault, Mode};

/// Largest number of flight logs that are kept in a folder.
pub const MAX_FILES: usize = 20;

/// The word in the file name that marks the flight log of an emergency stop.
const ESTOP: &str = Mode::Estop.as_str();
/// Pattern of the time in the file name of a flight log. Each 0 stands for any digit.
const TIME: &str = "00000000T000000.000Z";

/// The file name of a flight log, such as `flight-20260131T235959.123Z-4711-001-thermal.csv`. The
/// extension is `.part` while the file is being written.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Name {
    /// Time of the fault in UTC, in a format whose alphabetical order is the order of time.
    time: String,
    /// Number of the process that writes the log, so that two servers with a fault in the same
    /// millisecond do not write the same file.
    process: u32,
    /// Number of the log within its process, from 1, modulo 1000. It is always written with three
    /// digits.
    number: u16,
    /// Name of the fault, or `estop` for an emergency stop.
    what: String,
    part: bool,
}

impl Name {
    pub(super) fn new(time: &str, process: u32, number: u64, what: &str) -> Self {
        let number = (number % 1000) as u16;
        Self { time: time.to_owned(), process, number, what: what.to_owned(), part: false }
    }

    /// Parses the file name of a flight log. Returns `None` for a name that this program does not
    /// write.
    pub(super) fn parse(name: &str) -> Option<Self> {
        let (rest, extension) = name.strip_prefix("flight-")?.rsplit_once('.')?;
        let mut fields = rest.split('-');
        let (time, process) = (fields.next()?, fields.next()?.parse().ok()?);
        let (number, what) = (fields.next()?.parse().ok()?, fields.next()?);
        let part = extension == "part";
        let read = Self { time: time.to_owned(), process, number, what: what.to_owned(), part };
        let like = |(a, b): (u8, u8)| if b == b'0' { a.is_ascii_digit() } else { a == b };
        let is_time = time.len() == TIME.len() && time.bytes().zip(TIME.bytes()).all(like);
        let known = what == ESTOP || what.parse::<Fault>().is_ok();
        // Writing the name again and comparing detects leading zeros, signs and extra fields.
        (is_time && known && read.to_string() == name).then_some(read)
    }

    fn is_of_running_process(&self) -> bool {
        Path::new("/proc").join(self.process.to_string()).exists()
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { time, process, number, what, part } = self;
        write!(f, "flight-{time}-{process}-{number:03}-{what}.{}", if *part { "part" } else { "csv" })
    }
}

/// Removes flight logs beyond [`MAX_FILES`] from the folder of `newest`. The file `newest` always
/// stays, even if a wrong clock makes it look old.
///
/// Files are removed in this order, oldest first within each group:
///
/// 1. incomplete files whose process has ended,
/// 2. logs of emergency stops,
/// 3. logs of faults that were not the first fault of a server's run,
/// 4. logs of the first fault of a server's run.
///
/// The recording beside a log is removed with it. A recording without a log is removed if its
/// process has ended. Files with names that this program does not write stay and do not count.
///
/// # Errors
/// Returns the operating system's error if the folder cannot be read or a file cannot be removed.
pub fn prune(newest: &Path) -> io::Result<()> {
    let dir = newest.parent().unwrap_or(Path::new("."));
    let entries = fs::read_dir(dir)?.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let files: HashSet<String> = entries.collect();
    for file in files.iter().filter(|file| is_alone(file, &files)) {
        remove(&dir.join(file))?;
    }
    let names = files.iter().filter_map(|name| Name::parse(name)).collect();
    let paths = in_order_of_removal(names).into_iter().map(|name| dir.join(name.to_string()));
    let others: Vec<PathBuf> = paths.filter(|path| path != newest).collect();
    let surplus = (others.len() + 1).saturating_sub(MAX_FILES);
    others[..surplus].iter().try_for_each(|log| {
        remove(log)?;
        remove(&log.with_extension("mcap"))
    })
}

/// Returns whether `file` is the recording of a log that is not among `files`, and that no process
/// writes.
fn is_alone(file: &str, files: &HashSet<String>) -> bool {
    let Some(stem) = file.strip_suffix("mcap") else { return false };
    let [log, part] = ["csv", "part"].map(|extension| format!("{stem}{extension}"));
    let ended = Name::parse(&log).is_some_and(|name| !name.is_of_running_process());
    ended && !files.contains(&log) && !files.contains(&part)
}

/// Removes a file, unless another server has already removed it.
fn remove(file: &Path) -> io::Result<()> {
    match fs::remove_file(file) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        result => result,
    }
}

/// Returns those of the flight logs `names` that can be removed, in the order of removal.
fn in_order_of_removal(mut names: Vec<Name>) -> Vec<Name> {
    // Keep incomplete files whose process is still running.
    names.retain(|name| !(name.part && name.is_of_running_process()));
    names.sort();
    // For each process number: the number of its last log, and whether its current run has had a
    // fault. Processes of different boots can share a process number, so a log number that does not
    // increase marks a new run.
    let mut runs: HashMap<u32, (u16, bool)> = HashMap::new();
    let mut ranked: Vec<(u8, Name)> = names
        .into_iter()
        .map(|name| {
            if name.part {
                return (0, name);
            }
            let (last, faulted) = runs.get(&name.process).copied().unwrap_or_default();
            let faulted = faulted && name.number > last;
            let fault = name.what != ESTOP;
            runs.insert(name.process, (name.number, faulted || fault));
            (1 + u8::from(fault) + u8::from(fault && !faulted), name)
        })
        .collect();
    // The sort is stable, so the oldest log of each rank stays first.
    ranked.sort_by_key(|(rank, _)| *rank);
    ranked.into_iter().map(|(_, name)| name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::FlightRecorder;

    #[test]
    fn only_names_that_this_program_writes_are_read() {
        for name in [
            "flight-20260131T235959.123Z-4711-001-thermal.csv",
            "flight-20260131T235959.123Z-1-999-estop.csv",
            "flight-20260131T235959.123Z-1-000-link_lost.part",
        ] {
            assert_eq!(Name::parse(name).map(|name| name.to_string()).as_deref(), Some(name));
        }
        for name in [
            "flight-plan.csv",
            "flight-2026.csv",
            "flight-20260131T235959.123Z-4711-001-thermal.csv.bak",
            "flight-20260131T235959.123Z-4711-001-thermal.txt",
            "flight-20260131T235959.123Z-4711-001-thermal-2.csv",
            "flight-20260131T235959.123Z-4711-001-holiday.csv",
            "flight-20260131T235959.123Z-4711-1-thermal.csv",
            "flight-20260131T235959.123Z-+4711-001-thermal.csv",
            "flight-20260131T235959.123Z-001-thermal.csv",
            "flight-20260131T235959.1234-4711-001-thermal.csv",
            "my-flight-20260131T235959.123Z-4711-001-thermal.csv",
        ] {
            assert_eq!(Name::parse(name), None, "{name}");
        }
    }

    /// Returns file names of flight logs, each given as (second, process, number, what).
    fn logs(order: &[(u32, u32, u64, &str)]) -> Vec<Name> {
        let name = |(s, process, number, what): &(u32, u32, u64, &str)| {
            Name::new(&format!("20260131T2359{s:02}.000Z"), *process, *number, what)
        };
        order.iter().map(name).collect()
    }

    #[test]
    fn stops_go_before_faults_and_the_first_fault_of_a_run_goes_last() {
        let expected = logs(&[
            (0, 7, 1, "estop"),
            (4, 7, 5, "estop"),
            (2, 7, 3, "link_lost"),
            (3, 7, 4, "link_lost"),
            (6, 7, 2, "overspeed"),
            (1, 7, 2, "thermal"),
            // After a reboot another process has this process number.
            (5, 7, 1, "deadline"),
            (7, 8, 1, "slip"),
        ]);
        let mut shuffled = expected.clone();
        shuffled.reverse();
        assert_eq!(in_order_of_removal(shuffled), expected);
    }

    #[test]
    fn two_servers_with_faults_in_one_millisecond_and_what_a_killed_one_left_behind() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        // The process number in the name distinguishes this process from others.
        let mut recorder = FlightRecorder::new(dir.path().to_owned(), 1_000_000);
        recorder.push(&crate::still::still(5));
        let name = recorder.trigger(5, "estop").to_str().unwrap().to_owned();
        assert!(name.contains(&format!("-{}-001-estop.csv", std::process::id())), "{name}");
        // This process number is above the kernel's limit, so no process has it.
        let gone = 4_194_304 + 1;
        for i in 0..30 {
            let name = format!("flight-20000101T0000{i:02}.000Z-{gone}-001-estop.part");
            std::fs::write(at(&name), "cut").unwrap();
        }
        // These names have a time in the future, as if a clock had been wrong.
        for i in 0..MAX_FILES {
            std::fs::write(at(&format!("flight-99990101T0000{i:02}.000Z-1-001-estop.csv")), "").unwrap();
        }
        // The recording of a log that could not be written, and one that may still be written.
        let alone = at(&format!("flight-20000101T000030.000Z-{gone}-001-estop.mcap"));
        let mine = at(&name.replace("-001-estop.csv", "-002-estop.mcap"));
        [&alone, &mine].map(|path| std::fs::write(path, "").unwrap());
        let flight = recorder.finish().unwrap();
        flight.write().unwrap();
        assert!(!alone.exists() && mine.exists());
        std::fs::remove_file(mine).unwrap();
        let left = std::fs::read_dir(dir.path()).unwrap().count();
        assert!(flight.path.exists() && left == MAX_FILES, "{left} files");
        let part = format!("flight-20000101T000029.000Z-{gone}-001-estop.part");
        assert!(!at(&part).exists(), "half a log is none");
        // Two writers never write the same file.
        std::fs::write(flight.path.with_extension("part"), "another's").unwrap();
        assert!(flight.write().is_err());
    }

    #[test]
    fn what_others_keep_in_the_folder_stays_and_so_does_the_first_fault_of_a_run() {
        let dir = tempfile::tempdir().unwrap();
        let keep = ["flight-plan.csv", "flight-2026-notes.csv", "flight-x.part", "old-flight.csv"];
        for name in keep {
            fs::write(dir.path().join(name), "mine").unwrap();
        }
        let write = |s: u32, what: &str| {
            let name = Name::new(&format!("20260131T2359{s:02}.000Z"), 9, u64::from(s) + 1, what);
            let path = dir.path().join(name.to_string());
            fs::write(&path, "").unwrap();
            prune(&path).unwrap();
            path
        };
        let first = write(0, "thermal");
        // Many emergency stops must not push out the log of a fault.
        let second = write(1, "slip");
        (2..40).for_each(|s| _ = write(s, "estop"));
        assert!(first.exists() && second.exists());
        (40..60).for_each(|s| _ = write(s, "link_lost"));
        assert!(first.exists() && !second.exists(), "what has begun it all");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), MAX_FILES + keep.len());
    }
}
