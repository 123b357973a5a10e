//! Counting of instructions by callgrind. The program starts itself under valgrind as a worker. The
//! worker runs one job after another, each with one short and one long call of [`counted`].

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use serde_json::Value;

use super::jobs;
use crate::context::{Context, Interrupted};

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

impl Counter {
    /// Returns the number of instructions per tick for each job, or the reason why they cannot be
    /// counted. The jobs are those that [`jobs`] understands.
    pub(super) fn count(
        &self,
        context: &Context,
        jobs: &[Value],
    ) -> Result<Result<Vec<f64>, String>, Interrupted> {
        let folder = std::env::temp_dir().join(format!("hbot-callgrind-{}", std::process::id()));
        if let Err(error) = std::fs::create_dir_all(&folder) {
            return Ok(Err(format!("{}: {error}", folder.display())));
        }
        let result = self.count_in(context, &folder, jobs);
        // Leftover files in the temporary folder do no harm.
        let _ = std::fs::remove_dir_all(&folder);
        result
    }

    fn count_in(
        &self,
        context: &Context,
        folder: &Path,
        jobs: &[Value],
    ) -> Result<Result<Vec<f64>, String>, Interrupted> {
        let list = Value::from(jobs);
        let out = folder.join("out");
        let child = Command::new("valgrind")
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
            .spawn();
        let mut child = match child {
            Ok(child) => child,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return Ok(Err("valgrind is not installed".to_owned()));
            }
            Err(error) => return Ok(Err(format!("valgrind: {error}"))),
        };
        let done = wait(context, &mut child)?;
        if !done {
            return Ok(Err("the worker under valgrind failed".to_owned()));
        }
        let mut counts = Vec::new();
        for k in 0..jobs.len() {
            let total = |call: usize| total(&folder.join(format!("out.{}", 2 * k + call)));
            match (total(1), total(2)) {
                (Some(few), Some(many)) => counts.push((many - few) / (MANY - FEW) as f64),
                _ => return Ok(Err(format!("callgrind left no count of job {k}"))),
            }
        }
        Ok(Ok(counts))
    }
}

/// Waits until the worker ends, and returns whether it succeeded. If the study is asked to stop,
/// ends the worker and returns [`Interrupted`].
fn wait(context: &Context, child: &mut Child) -> Result<bool, Interrupted> {
    loop {
        if let Ok(Some(status)) = child.try_wait() {
            return Ok(status.success());
        }
        if let Err(stop) = context.go_on() {
            // The worker may already have ended, so errors are ignored.
            let _ = child.kill();
            let _ = child.wait();
            return Err(stop);
        }
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// Reads the total number of instructions from a file that callgrind has written. Returns `None` if
/// the file contains no total.
fn total(path: &Path) -> Option<f64> {
    let text = std::fs::read_to_string(path).ok()?;
    let line = text.lines().find(|line| line.starts_with("totals:"))?;
    line.split_whitespace().nth(1)?.parse().ok()
}
