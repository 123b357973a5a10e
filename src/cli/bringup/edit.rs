//! Changes values of a rig file and keeps its comments and the order of its keys.

use std::fs::{File, Metadata};
use std::io::{ErrorKind, Write as _};
use std::os::unix::fs::{MetadataExt as _, fchown};
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

/// Writes a changed rig file. Fails if it is not legal, or cannot be written. The old file stays
/// then, unless it had to be written in place.
pub(super) fn save(document: &DocumentMut, file: &Path) -> anyhow::Result<()> {
    let text = document.to_string();
    RigConfig::from_toml(&text, &file.display().to_string())
        .context("nothing is written, because the values found make no legal rig file")?;
    replace(file, &text)
        .with_context(|| format!("{}: cannot be written, and stays as it was", file.display()))
}

/// Writes `text` to a file beside `file` and renames it, so that `file` is never half written. Mode
/// and owner stay, and so does a link to the file. Where nothing can be renamed, as in a folder of
/// another user or on a mount point, `file` is written in place.
fn replace(file: &Path, text: &str) -> std::io::Result<()> {
    // The file must be writable: a rename would replace a write-protected one.
    let old = match File::options().write(true).open(file) {
        Ok(old) => Some(old.metadata()?),
        Err(error) if error.kind() == ErrorKind::NotFound => None,
        Err(error) => return Err(error),
    };
    if old.as_ref().is_some_and(|old| !old.is_file()) {
        return std::fs::write(file, text);
    }
    let file = if old.is_some() { file.canonicalize()? } else { file.to_owned() };
    let mut name = file.file_name().unwrap_or_default().to_owned();
    name.push(format!(".{}", std::process::id()));
    let beside = file.with_file_name(name);
    let in_place = old.is_some();
    let new = match File::create_new(&beside) {
        Err(error) if in_place && cannot_rename(&error) => return std::fs::write(&file, text),
        new => new?,
    };
    let written = fill(new, text, old).and_then(|()| match std::fs::rename(&beside, &file) {
        Err(error) if in_place && cannot_rename(&error) => std::fs::write(&file, text),
        renamed => renamed,
    });
    // It is there still unless it was renamed.
    let _ = std::fs::remove_file(&beside);
    written
}

/// Returns whether `error` is of the folder of a file, and not of the file.
fn cannot_rename(error: &std::io::Error) -> bool {
    use ErrorKind::{CrossesDevices, PermissionDenied, ReadOnlyFilesystem, ResourceBusy};
    matches!(error.kind(), PermissionDenied | ResourceBusy | CrossesDevices | ReadOnlyFilesystem)
}

/// Writes `text` to a new file that takes the place of one with the metadata `old`.
fn fill(mut new: File, text: &str, old: Option<Metadata>) -> std::io::Result<()> {
    if let Some(old) = old {
        new.set_permissions(old.permissions())?;
        // Only root can give a file away, and has to for the file of a service.
        let _ = fchown(&new, Some(old.uid()), Some(old.gid()));
    }
    new.write_all(text.as_bytes())?;
    new.sync_all()
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
