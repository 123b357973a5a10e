//! Changes values of a rig file and keeps its comments and the order of its keys.

use std::path::Path;

use anyhow::Context as _;
use hbot_config::RigConfig;
use toml_edit::{DocumentMut, Item, Value};

use super::super::out::refuse_folder_or_pipe;

/// Text of the rig file that is used if no other is named.
const PROTOTYPE: &str = include_str!("../../../rigs/prototype.toml");

/// Reads the rig file `rig`, or the built-in one, to change it.
pub(super) fn open(rig: Option<&Path>) -> anyhow::Result<DocumentMut> {
    let text = match rig {
        Some(path) => hbot_config::read_text(path).with_context(|| path.display().to_string())?,
        None => PROTOTYPE.to_owned(),
    };
    Ok(text.parse()?)
}

/// Fails if `file` cannot become a rig file, or is a file of another kind.
pub(super) fn refuse_another(file: &Path) -> anyhow::Result<()> {
    refuse_folder_or_pipe(file, "the rig file to write")?;
    if file.metadata().is_ok_and(|found| found.is_file() && found.len() > 0) {
        RigConfig::from_path(file).context("the file to write exists already and is no rig file")?;
    }
    Ok(())
}

/// Writes a changed rig file.
pub(super) fn save(document: &DocumentMut, file: &Path) -> anyhow::Result<()> {
    std::fs::write(file, document.to_string())
        .with_context(|| format!("{}: cannot be written", file.display()))
}

/// Sets `key` in `table`. The comment behind the old value stays.
pub(super) fn put(table: &mut Item, key: &str, new: Value) {
    match table.get_mut(key).and_then(Item::as_value_mut) {
        Some(old) => {
            let decor = old.decor().clone();
            *old = new;
            *old.decor_mut() = decor;
        }
        None => table[key] = Item::Value(new),
    }
}
