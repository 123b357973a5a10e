//! Tests of the public interface for rig and scene files: what loads, and the messages for what
//! does not.

mod advice;
mod docs;
mod garbage;
mod kinds;
mod ranges;
mod rig;
mod running;
mod scene;

use std::path::PathBuf;

fn folder(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..").join(name)
}

/// Returns the paths of all TOML files in a folder of the workspace. There is at least one.
fn toml_files(name: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder(name)).unwrap();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|e| e == "toml"));
    assert!(!files.is_empty(), "no files in {name}/");
    files.sort();
    files
}
