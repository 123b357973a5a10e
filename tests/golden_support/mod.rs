//! Reads a folder of golden vectors and checks every figure in it, in both widths.

mod ledger;
mod plant;
mod sensitivity;
mod vectors;

pub use ledger::Ledger;

use serde::de::DeserializeOwned;
use std::path::Path;

/// The checks in f64.
#[path = "."]
pub mod double {
    pub use hbot_core as core;

    #[path = "checks/mod.rs"]
    #[allow(clippy::duplicate_mod, reason = "the same checks in both widths")]
    pub mod checks;
}

/// The checks in f32.
#[path = "."]
pub mod single {
    pub use hbot_core_f32 as core;

    #[path = "checks/mod.rs"]
    #[allow(clippy::duplicate_mod, reason = "the same checks in both widths")]
    pub mod checks;
}

/// A function that checks one case in one width.
type Check<Case> = fn(&Case, &mut Ledger);

/// Reads and checks every file of `folder`.
///
/// # Errors
/// Fails if the folder cannot be read, has no vectors, or has an unknown file.
pub fn check_folder(folder: &Path) -> Result<Vec<Ledger>, String> {
    let listing =
        std::fs::read_dir(folder).map_err(|e| format!("no golden vectors in {}: {e}", folder.display()))?;
    let mut names = Vec::new();
    for entry in listing {
        let entry = entry.map_err(|e| format!("{}: {e}", folder.display()))?;
        names.push(entry.file_name().to_string_lossy().into_owned());
    }
    names.sort();
    // The folder also holds Markdown pages, which are not checked.
    names.retain(|name| !name.ends_with(".md"));
    if names.is_empty() {
        return Err(format!("no golden vectors in {}: the folder is empty", folder.display()));
    }
    let mut ledgers = Vec::new();
    for name in names {
        let path = folder.join(&name);
        let text = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        check_file(&name, &text, &mut ledgers)?;
    }
    Ok(ledgers)
}

/// Checks the file `name` with the content `text`.
fn check_file(name: &str, text: &str, ledgers: &mut Vec<Ledger>) -> Result<(), String> {
    let mut run = Run { name, text, ledgers };
    use {double::checks as wide, single::checks as narrow};
    match name {
        "kinematics.json" => run.with([("f64", wide::kinematics), ("f32", narrow::kinematics)]),
        "odometry.json" => run.with([("f64", wide::odometry), ("f32", narrow::odometry)]),
        "hopf.json" => run.with([("f64", wide::hopf), ("f32", narrow::hopf)]),
        "impedance.json" => run.with([("f64", wide::impedance), ("f32", narrow::impedance)]),
        "allocation.json" => run.with([("f64", wide::allocation), ("f32", narrow::allocation)]),
        "dynamics.json" => run.with([("f64", plant::dynamics)]),
        "trajectories.json" => run.with([("f64", plant::trajectory)]),
        _ => Err(format!(
            "{name}: no check for a file of this name; known are kinematics, odometry, hopf, impedance, allocation, \
             dynamics and trajectories, each .json"
        )),
    }
}

struct Run<'a> {
    name: &'a str,
    text: &'a str,
    ledgers: &'a mut Vec<Ledger>,
}

impl Run<'_> {
    fn with<Case: DeserializeOwned, const N: usize>(
        &mut self,
        widths: [(&'static str, Check<Case>); N],
    ) -> Result<(), String> {
        let file: vectors::File<Case> =
            serde_json::from_str(self.text).map_err(|e| format!("{}: {e}", self.name))?;
        if file.cases.is_empty() {
            return Err(format!("{}: no cases", self.name));
        }
        for (width, check) in widths {
            let mut ledger = Ledger::new(self.name, width);
            for (index, case) in file.cases.iter().enumerate() {
                ledger.case(index);
                check(case, &mut ledger);
            }
            self.ledgers.push(ledger);
        }
        Ok(())
    }
}
