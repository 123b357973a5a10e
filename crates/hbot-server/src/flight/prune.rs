//! The choice of flight logs to remove when there are too many.

use std::collections::{HashMap, HashSet};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use hbot_api::Mode;
use hbot_record::flight::Name;

/// Largest number of flight logs that are kept in a folder.
pub const MAX_FILES: usize = 20;

/// The word in the file name that marks the flight log of an emergency stop.
const ESTOP: &str = Mode::Estop.as_str();

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
    let ended = Name::parse(&log).is_some_and(|name| !is_of_running_process(&name));
    ended && !files.contains(&log) && !files.contains(&part)
}

fn is_of_running_process(name: &Name) -> bool {
    Path::new("/proc").join(name.process.to_string()).exists()
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
    names.retain(|name| !(name.part && is_of_running_process(name)));
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
        for path in [&alone, &mine] {
            std::fs::write(path, "").unwrap();
        }
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
