//! The computer that a study ran on, and how the program was compiled.

use serde_json::{Value, json};

/// Description of the computer and of the build, without which measured times cannot be judged.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Computer {
    cpu: String,
    cores: usize,
    os: String,
    rustc: &'static str,
    profile: String,
    /// Whether the program was compiled for speed. If not, its measured times have no meaning.
    optimised: bool,
}

impl Computer {
    /// Describes the computer that this program runs on, and its build.
    pub(crate) fn here() -> Self {
        let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
        let value = |text: &str, key: &str, by: char| {
            let line = text.lines().find(|line| line.starts_with(key))?;
            line.split_once(by).map(|(_, value)| value.trim().trim_matches('"').to_owned())
        };
        let unknown = || "unknown".to_owned();
        let name = value(&read("/etc/os-release"), "PRETTY_NAME", '=').unwrap_or_else(unknown);
        let kernel = read("/proc/sys/kernel/osrelease").trim().to_owned();
        let optimised = env!("HBOT_STUDY_PROFILE") == "release" && !cfg!(debug_assertions);
        Self {
            cpu: value(&read("/proc/cpuinfo"), "model name", ':').unwrap_or_else(unknown),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            os: format!("{name}, Linux {kernel}, {}", std::env::consts::ARCH),
            rustc: env!("HBOT_STUDY_RUSTC"),
            profile: format!(
                "{}, opt-level {}, debug assertions {}",
                env!("HBOT_STUDY_PROFILE"),
                env!("HBOT_STUDY_OPT_LEVEL"),
                if cfg!(debug_assertions) { "on" } else { "off" }
            ),
            optimised,
        }
    }

    /// Returns this description as JSON, for `summary.json`.
    pub(crate) fn to_json(&self) -> Value {
        json!({
            "cpu": self.cpu, "cores": self.cores, "os": self.os, "rustc": self.rustc, "profile": self.profile,
            "times_count": self.optimised,
        })
    }

    /// Returns this description as one sentence, for the report.
    pub(crate) fn sentence(&self) -> String {
        format!("{}, {} cores, {}; {}, {}.", self.cpu, self.cores, self.os, self.rustc, self.profile)
    }

    /// Returns a warning for the report if measured times have no meaning, because the program was
    /// not compiled for speed.
    pub(crate) fn warning(&self) -> Option<&'static str> {
        (!self.optimised).then_some(
            "The times of this run count for nothing: the program was not compiled with `--release`. \
             They are marked `\"marked\": \"not release\"` in summary.json.",
        )
    }
}
