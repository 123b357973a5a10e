//! Files on this machine: scenes, and exported samples.

use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::Context as _;
use hbot_config::SceneFile;
use serde_json::Value;

use crate::model::PlotSample;

/// A scene file from which the user can choose.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ShelfFile {
    pub(crate) path: PathBuf,
    /// When the file was last changed. `None` if the file system does not tell.
    modified: Option<SystemTime>,
    /// The sentence that says what the scene feels like, or what is wrong with the file.
    description: Result<String, String>,
}

impl ShelfFile {
    /// Reads the description of the scene in a file. Takes it from `known` if the file has not
    /// changed since.
    fn at(path: PathBuf, known: &[Self]) -> Self {
        let modified = std::fs::metadata(&path).and_then(|file| file.modified()).ok();
        let same = |file: &&Self| file.path == path && file.modified == modified && modified.is_some();
        if let Some(file) = known.iter().find(same) {
            return file.clone();
        }
        let description = match SceneFile::from_path(&path) {
            Ok(scene) => Ok(scene.description().to_owned()),
            // Mistakes are told in full when the user loads the file.
            Err(_) => Err("This file has mistakes: load it to read them.".to_owned()),
        };
        Self { path, modified, description }
    }

    /// Returns the description of the scene, or what to say in its place.
    pub(crate) fn said(&self) -> &str {
        match &self.description {
            Ok(text) if text.is_empty() => "This scene has no description.",
            Ok(text) | Err(text) => text,
        }
    }
}

/// Returns the scene files (`*.toml`) in a folder, sorted by name. Returns an empty list if the
/// folder cannot be read. `known` is the list that this function returned before.
pub(crate) fn scenes(folder: &Path, known: &[ShelfFile]) -> Vec<ShelfFile> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<_> = entries
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|e| e == "toml"))
        .map(|path| ShelfFile::at(path, known))
        .collect();
    files.sort_by(|a, b| a.path.cmp(&b.path));
    files
}

/// Reads a scene file, and returns the scene in the form that the op `load_scene` accepts.
pub(crate) fn load(path: &Path) -> anyhow::Result<Value> {
    Ok(SceneFile::from_path(path)?.to_json())
}

/// Writes a scene to a TOML file. If writing fails, an existing file at this path stays unchanged.
pub(crate) fn save(path: &Path, scene: &Value) -> anyhow::Result<()> {
    let text = toml::to_string(scene).context("the scene cannot be written as TOML")?;
    let beside = path.with_extension("toml.new");
    std::fs::write(&beside, text)
        .and_then(|()| std::fs::rename(&beside, path))
        .with_context(|| format!("cannot write {}", path.display()))
}

/// Writes samples to a new CSV file in `folder`, and returns the path of the file.
pub(crate) fn export(folder: &Path, samples: &[PlotSample]) -> anyhow::Result<PathBuf> {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_millis();
    let path = folder.join(format!("hbot-{now}.csv"));
    let write = || -> anyhow::Result<()> {
        let mut csv = csv::Writer::from_path(&path)?;
        csv.write_record(COLUMNS)?;
        for s in samples {
            csv.serialize((
                (s.tick, s.t),
                (s.q.w, s.q.x, s.q.y, s.q.z),
                s.omega.to_array(),
                s.torque.to_array(),
                (s.scale, s.slip, s.energy, s.lateness_us),
            ))?;
        }
        Ok(csv.flush()?)
    };
    write().with_context(|| format!("cannot write {}", path.display()))?;
    Ok(path)
}

/// The columns of the CSV file, in SI units except for the last. Each has the meaning of the field
/// of state messages in docs/api.md.
const COLUMNS: [&str; 16] = [
    "tick",
    "t",
    "q_w",
    "q_x",
    "q_y",
    "q_z",
    "omega_1",
    "omega_2",
    "omega_3",
    "torque_1",
    "torque_2",
    "torque_3",
    "scale",
    "slip",
    "energy",
    "lateness_us",
];

#[cfg(test)]
mod tests {
    use super::*;
    use hbot_api::StateEvent;

    #[test]
    fn a_scene_that_is_saved_is_the_scene_that_is_loaded() {
        let folder = tempfile::tempdir().expect("a folder");
        let scenes_of_the_project = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
        let files = scenes(&scenes_of_the_project, &[]);
        assert!(files.len() >= 3, "{files:?}");
        assert!(files.iter().all(|file| file.said().ends_with('.')), "{files:?}");
        assert_eq!(scenes(&scenes_of_the_project, &files), files);
        for ShelfFile { path: file, .. } in files {
            let scene = load(&file).expect("legal");
            let path = folder.path().join("saved.toml");
            save(&path, &scene).expect("written");
            assert_eq!(load(&path).expect("legal"), scene, "{}", file.display());
        }
    }

    #[test]
    fn every_sample_is_a_line_of_as_many_figures_as_there_are_columns() {
        let folder = tempfile::tempdir().expect("a folder");
        let samples = [PlotSample::of(&StateEvent::default()); 3];
        let path = export(folder.path(), &samples).expect("written");
        let text = std::fs::read_to_string(path).expect("a file");
        assert_eq!(text.lines().count(), 4);
        assert!(text.lines().all(|line| line.split(',').count() == COLUMNS.len()), "{text}");
    }
}
