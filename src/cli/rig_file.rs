//! The rig file that a command names.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use anyhow::anyhow;
use hbot_config::{LoadError, Override, RigConfig, did_you_mean, guess};

/// Reads a rig file, or the prototype if `path` is `None`, and replaces some of its values. If the
/// file does not exist, the error says which file is probably meant: one with the ending, or a
/// ready-made one.
pub(super) fn load(path: Option<&Path>, overrides: &[Override]) -> anyhow::Result<RigConfig> {
    RigConfig::load(path, overrides).map_err(|error| {
        let absent = matches!(&error, LoadError::Read { source, .. } if source.kind() == ErrorKind::NotFound);
        let meant = path.filter(|_| absent).and_then(rig_meant);
        let way = if absent {
            "; without a file, the prototype is built in; `hbot rig new FILE` makes one"
        } else {
            ""
        };
        anyhow!("{:#}{}{way}", anyhow::Error::from(error), guess(meant.as_deref()))
    })
}

/// Returns the rig file that is probably meant by the path of none.
fn rig_meant(path: &Path) -> Option<String> {
    let own = path.with_extension("toml");
    if own.is_file() {
        return Some(own.display().to_string());
    }
    let ready = std::fs::read_dir("rigs").into_iter().flatten().flatten().map(|entry| entry.path());
    let ready: Vec<PathBuf> =
        ready.filter(|file| file.extension().is_some_and(|end| end == "toml")).collect();
    let stems = ready.iter().filter_map(|file| file.file_stem()?.to_str());
    let stem = did_you_mean(path.file_stem()?.to_str()?, stems)?;
    Some(format!("rigs/{stem}.toml"))
}
