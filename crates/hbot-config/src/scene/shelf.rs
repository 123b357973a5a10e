//! The scenes of the folder `scenes/`, compiled into the program.

use super::SceneFile;
use crate::legal::did_you_mean;

/// A scene that is compiled into the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ShelfScene {
    /// Name of the scene's file in `scenes/`, without `.toml`.
    pub file: &'static str,
    /// Text of the scene file.
    pub text: &'static str,
}

/// Lists scenes by the names of their files, without `.toml`.
macro_rules! shelf {
    ($($file:literal),* $(,)?) => {
        &[$(ShelfScene {
            file: $file,
            text: include_str!(concat!("../../../../scenes/", $file, ".toml")),
        }),*]
    };
}

/// All scenes of the folder `scenes/`. The default scene is the first.
pub const SHELF: &[ShelfScene] = shelf![
    "spring",
    "ball-in-bowl",
    "clay",
    "compass",
    "cube-faces",
    "flight-yoke",
    "globe",
    "gravel",
    "gyroscope",
    "heavy-ball",
    "heavy-door",
    "hidden-notch",
    "hinge",
    "lock",
    "metronome",
    "notched-dial",
    "orientation-matching",
    "pendulum",
    "rocker-switch",
    "room-of-walls",
    "steering-wheel",
    "thick-air",
    "uneven-spring",
];

impl ShelfScene {
    /// Returns the scene with this file name, or `None` if there is none.
    #[must_use]
    pub fn named(file: &str) -> Option<Self> {
        SHELF.iter().copied().find(|scene| scene.file == file)
    }

    /// Returns the file name in the list that is most similar to `file`, for the hint "did you
    /// mean", or the only one that begins with it, or that begins alike and differs in few letters.
    /// Returns `None` if no name is similar enough.
    #[must_use]
    pub fn similar(file: &str) -> Option<&'static str> {
        let names = SHELF.iter().map(|scene| scene.file);
        did_you_mean(file, names.clone()).or_else(|| {
            let typed = file.to_lowercase();
            let start = typed.get(..3)?;
            let mut near = names.filter(|name| {
                name.starts_with(&typed)
                    || name.starts_with(start) && strsim::osa_distance(&typed, name) <= typed.len() / 2
            });
            near.next().filter(|_| near.next().is_none())
        })
    }

    /// Reads the scene.
    #[must_use]
    pub fn scene(self) -> SceneFile {
        SceneFile::from_toml(self.text, self.file)
            .unwrap_or_else(|mistakes| panic!("the scenes that are built in are legal, by test:\n{mistakes}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shelf_has_every_file_of_the_folder_and_each_says_what_it_is() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
        let paths = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let mut files: Vec<String> = paths
            .filter(|path| path.extension().is_some_and(|e| e == "toml"))
            .map(|path| path.file_stem().unwrap().to_str().unwrap().to_owned())
            .collect();
        files.sort();
        let mut shelf: Vec<&str> = SHELF.iter().map(|scene| scene.file).collect();
        assert_eq!(shelf[0], "spring", "the default scene is the first");
        shelf.sort_unstable();
        assert_eq!(shelf, files);
        for entry in SHELF {
            let scene = entry.scene();
            assert!(scene.description().ends_with('.'), "{}: one sentence", entry.file);
            // What is written back is the same scene.
            let again = SceneFile::from_toml(&scene.to_toml(), "written").unwrap();
            assert_eq!(again, scene, "{}", entry.file);
        }
    }
}
