//! Instructions, counted by callgrind: this program runs itself under valgrind as a worker, which does one setup after another,
//! each in one call of [`counted`] for few ticks and one for many.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use serde_json::Value;

use super::desk::{Desk, SceneSetup};
use crate::context::{Context, Interrupted};

/// Ticks of the two calls: what lies between is one period of the torques that the rig is told.
const FEW: usize = 20;
pub(super) const MANY: usize = FEW + 128;
/// What callgrind knows [`counted`] by.
const FUNCTION: &str = concat!(module_path!(), "::counted");

/// How this program is run as a worker: what stands before the worker's own argument.
#[derive(Debug, Clone)]
pub struct Counter {
    /// The program.
    pub program: PathBuf,
    /// Its arguments, of which the setups are the last.
    pub arguments: Vec<String>,
}

/// The worker: runs the setups that `setups` (JSON) lists. Only under callgrind does it have a result.
///
/// # Errors
/// What `setups` is not.
pub fn count_worker(setups: &str) -> Result<(), String> {
    let value: Value = serde_json::from_str(setups).map_err(|error| error.to_string())?;
    let setups: Option<Vec<SceneSetup>> =
        value.as_array().and_then(|all| all.iter().map(SceneSetup::from_json).collect());
    let active = Desk::active();
    for setup in setups.ok_or("a list of {names, gone}")? {
        let desk = active.with(&setup);
        for ticks in [FEW, MANY] {
            std::hint::black_box(counted(&mut desk.clone(), ticks));
        }
    }
    Ok(())
}

/// What is counted, by its name.
#[inline(never)]
fn counted(desk: &mut Desk, ticks: usize) -> f64 {
    desk.run(ticks)
}

impl Counter {
    /// Instructions a tick of each setup; the reason where they cannot be counted.
    pub(super) fn count(
        &self,
        context: &Context,
        setups: &[SceneSetup],
    ) -> Result<Result<Vec<f64>, String>, Interrupted> {
        let folder = std::env::temp_dir().join(format!("hbot-callgrind-{}", std::process::id()));
        if let Err(error) = std::fs::create_dir_all(&folder) {
            return Ok(Err(format!("{}: {error}", folder.display())));
        }
        let result = self.count_in(context, &folder, setups);
        // What is left of it is in nobody's way.
        let _ = std::fs::remove_dir_all(&folder);
        result
    }

    fn count_in(
        &self,
        context: &Context,
        folder: &Path,
        setups: &[SceneSetup],
    ) -> Result<Result<Vec<f64>, String>, Interrupted> {
        let list: Value = setups.iter().map(SceneSetup::to_json).collect();
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
        for k in 0..setups.len() {
            let total = |call: usize| total(&folder.join(format!("out.{}", 2 * k + call)));
            match (total(1), total(2)) {
                (Some(few), Some(many)) => counts.push((many - few) / (MANY - FEW) as f64),
                _ => return Ok(Err(format!("callgrind left no count of setup {k}"))),
            }
        }
        Ok(Ok(counts))
    }
}

/// Waits for the worker, and ends it where the study is to stop: whether it went well.
fn wait(context: &Context, child: &mut Child) -> Result<bool, Interrupted> {
    loop {
        if let Ok(Some(status)) = child.try_wait() {
            return Ok(status.success());
        }
        if let Err(stop) = context.go_on() {
            // It may have ended by itself.
            let _ = child.kill();
            let _ = child.wait();
            return Err(stop);
        }
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// The instructions of one dump.
fn total(path: &Path) -> Option<f64> {
    let text = std::fs::read_to_string(path).ok()?;
    let line = text.lines().find(|line| line.starts_with("totals:"))?;
    line.split_whitespace().nth(1)?.parse().ok()
}
