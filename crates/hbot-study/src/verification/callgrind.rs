//! Counting of instructions by callgrind. The program starts itself under valgrind as a worker. The
//! worker runs one job after another, each with one short and one long call of [`counted`].

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::Value;

use super::jobs;

/// Number of ticks in the shorter of the two runs whose instructions are counted. The difference
/// between both runs gives the instructions per tick.
const FEW: usize = 20;
/// Number of ticks in the longer of the two runs whose instructions are counted. It exceeds the
/// shorter run by one period of the simulated rig's joint torques.
pub(crate) const MANY: usize = FEW + 128;
/// Full name of the function [`counted`], by which callgrind finds it.
const FUNCTION: &str = concat!(module_path!(), "::counted");

/// How to start this program again as a worker that runs under callgrind.
#[derive(Debug, Clone)]
pub struct Counter {
    /// Path of the program.
    pub program: PathBuf,
    /// Arguments for the worker. The list of jobs is appended as the last argument.
    pub arguments: Vec<String>,
}

/// Runs the jobs that the JSON list `all` describes, while callgrind counts the instructions. The
/// worker process that [`Counter`] starts calls this function. Callgrind writes the counts to
/// files.
///
/// # Errors
///
/// Fails if `all` is not a JSON list of jobs.
pub fn count_worker(all: &str) -> Result<(), String> {
    let value: Value = serde_json::from_str(all).map_err(|error| error.to_string())?;
    let all = value.as_array().and_then(|all| jobs(all)).ok_or("a list of jobs")?;
    for mut job in all {
        for ticks in [FEW, MANY] {
            std::hint::black_box(counted(&mut *job, ticks));
        }
    }
    Ok(())
}

/// Runs the ticks whose instructions are counted. It must not be inlined, because callgrind finds
/// it by its name.
#[inline(never)]
fn counted(job: &mut dyn FnMut(usize) -> f64, ticks: usize) -> f64 {
    job(ticks)
}

/// Returns the folder for what valgrind writes.
fn folder() -> PathBuf {
    std::env::temp_dir().join(format!("hbot-callgrind-{}", std::process::id()))
}

/// Removes the folder for what valgrind writes. Files that are left there do no harm.
pub(crate) fn clear() {
    let _ = std::fs::remove_dir_all(folder());
}

impl Counter {
    /// Returns the number of instructions per tick for each job, or the reason why they cannot be
    /// counted. The jobs are those that [`jobs`] understands.
    pub(super) fn count(&self, jobs: &[Value]) -> Result<Vec<f64>, String> {
        let folder = folder();
        std::fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
        let result = self.count_in(&folder, jobs);
        clear();
        result
    }

    fn count_in(&self, folder: &Path, jobs: &[Value]) -> Result<Vec<f64>, String> {
        let list = Value::from(jobs);
        let out = folder.join("out");
        let ended = Command::new("valgrind")
            .args(["--tool=callgrind", "--quiet"])
            .arg(format!("--callgrind-out-file={}", out.display()))
            .arg(format!("--toggle-collect={FUNCTION}"))
            .arg(format!("--dump-after={FUNCTION}"))
            .arg(&self.program)
            .args(&self.arguments)
            .arg(list.to_string())
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .status();
        match ended {
            Ok(status) if status.success() => {}
            Ok(_) => return Err("the worker under valgrind failed".to_owned()),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return Err("valgrind is not installed".to_owned());
            }
            Err(error) => return Err(format!("valgrind: {error}")),
        }
        let count = |k: usize| {
            let [few, many] = [1, 2].map(|call| total(&folder.join(format!("out.{}", 2 * k + call))));
            Some((many? - few?) / (MANY - FEW) as f64)
        };
        (0..jobs.len()).map(|k| count(k).ok_or(format!("callgrind left no count of job {k}"))).collect()
    }
}

/// Reads the total number of instructions from a file that callgrind has written. Returns `None` if
/// the file contains no total.
fn total(path: &Path) -> Option<f64> {
    let text = std::fs::read_to_string(path).ok()?;
    let line = text.lines().find(|line| line.starts_with("totals:"))?;
    line.split_whitespace().nth(1)?.parse().ok()
}
