//! Files on this machine: scenes, and exported samples.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::Context as _;
use hbot_api::{StateEvent, StateTiming};
use hbot_config::SceneFile;
use hbot_config::scene::{SHELF, ShelfScene};
use hbot_record::flight::Name;
use serde::Serialize;
use serde_json::Value;

/// Where a scene comes from.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Source {
    /// It is compiled into the program.
    ReadyMade(ShelfScene),
    File(PathBuf),
}

impl Source {
    /// Returns the name for the list of scenes. The name of a file that a ready-made scene has too
    /// is followed by its folder.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::ReadyMade(scene) => scene.file.to_owned(),
            Self::File(path) => {
                let stem = stem(path);
                match path.parent() {
                    Some(folder) if ShelfScene::named(&stem).is_some() => {
                        format!("{stem} ({})", folder.display())
                    }
                    _ => stem,
                }
            }
        }
    }
}

fn stem(path: &Path) -> String {
    path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default()
}

/// A scene from which the user can choose.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ShelfFile {
    pub(crate) source: Source,
    /// When the file was last changed. `None` if there is no file or the file system does not tell.
    modified: Option<SystemTime>,
    /// The sentence that says what the scene feels like, or what is wrong with the file.
    description: Result<String, String>,
    /// Whether the file is that of a ready-made scene, which is in the list already.
    pub(crate) is_copy: bool,
}

impl ShelfFile {
    fn ready_made(scene: ShelfScene) -> Self {
        let description = Ok(scene.scene().description().to_owned());
        Self { source: Source::ReadyMade(scene), modified: None, description, is_copy: false }
    }

    /// Reads the description of the scene in a file. Takes it from `known` if the file has not
    /// changed since.
    fn at(path: PathBuf, known: &[Self]) -> Self {
        let modified = std::fs::metadata(&path).and_then(|file| file.modified()).ok();
        let source = Source::File(path.clone());
        let same = |file: &&Self| file.source == source && file.modified == modified && modified.is_some();
        if let Some(file) = known.iter().find(same) {
            return file.clone();
        }
        let scene = SceneFile::from_path(&path);
        let ready_made = ShelfScene::named(&stem(&path)).map(ShelfScene::scene);
        let is_copy = ready_made.is_some() && ready_made == scene.as_ref().ok().cloned();
        let description = match scene {
            Ok(scene) => Ok(scene.description().to_owned()),
            // Mistakes are told in full when the user loads the file.
            Err(_) => Err("This file has mistakes: load it to read them.".to_owned()),
        };
        Self { source, modified, description, is_copy }
    }

    /// Returns the description of the scene, or what to say in its place.
    pub(crate) fn said(&self) -> &str {
        match &self.description {
            Ok(text) if text.is_empty() => "This scene has no description.",
            Ok(text) | Err(text) => text,
        }
    }
}

/// Returns the ready-made scenes, and after them the scene files (`*.toml`) in a folder, sorted by
/// name. Copies of ready-made scenes are marked. `known` is the list that this function returned
/// before.
pub(crate) fn scenes(folder: &Path, known: &[ShelfFile]) -> Vec<ShelfFile> {
    let count = SHELF.len();
    let mut all = match known.get(..count) {
        Some(ready_made) => ready_made.to_vec(),
        None => SHELF.iter().copied().map(ShelfFile::ready_made).collect(),
    };
    let mut paths: Vec<_> = files_of(folder, "toml").collect();
    paths.sort();
    all.extend(paths.into_iter().map(|path| ShelfFile::at(path, known)));
    all
}

/// Returns the files in a folder whose names have this ending. Returns none if the folder cannot
/// be read.
fn files_of(folder: &Path, ending: &str) -> impl Iterator<Item = PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries.map(|entry| entry.path()).filter(move |path| path.extension().is_some_and(|e| e == ending))
}

/// Reads a scene, and returns it in the form that the op `load_scene` accepts.
pub(crate) fn load(source: &Source) -> anyhow::Result<Value> {
    match source {
        Source::ReadyMade(scene) => Ok(scene.scene().to_json()),
        Source::File(path) => Ok(SceneFile::from_path(path)?.to_json()),
    }
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
pub(crate) fn export(folder: &Path, samples: &[Arc<StateEvent>]) -> anyhow::Result<PathBuf> {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_millis();
    let path = folder.join(format!("hbot-{now}.csv"));
    let write = || -> anyhow::Result<()> {
        let mut csv = csv::Writer::from_path(&path)?;
        let joints = samples.iter().map(|sample| sample.joints.len()).max().unwrap_or_default();
        csv.write_record(columns(joints))?;
        for sample in samples {
            csv.serialize(row(sample, joints))?;
        }
        Ok(csv.flush()?)
    };
    write().with_context(|| format!("cannot write {}", path.display()))?;
    Ok(path)
}

/// A recording or a flight log that the user can open.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ReelFile {
    pub(crate) path: PathBuf,
    pub(crate) modified: SystemTime,
    pub(crate) bytes: u64,
}

impl ReelFile {
    /// Returns what the list calls this file: a flight log by its time and its cause, such as
    /// `2026-01-31 23:59:59 UTC: thermal` for `flight-20260131T235959.123Z-4711-001-thermal.mcap`.
    pub(crate) fn title(&self) -> String {
        // The log that the recording belongs to.
        let log = self.path.with_extension("csv");
        let Some(Name { time, what, .. }) = log.file_name().and_then(|name| Name::parse(name.to_str()?))
        else {
            return self.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        };
        let [year, month, day] = [0..4, 4..6, 6..8].map(|part| &time[part]);
        let [hour, minute, second] = [9..11, 11..13, 13..15].map(|part| &time[part]);
        format!("{year}-{month}-{day} {hour}:{minute}:{second} UTC: {what}")
    }
}

/// Returns the recordings (`*.mcap`) in a folder, at most `most`, the newest first.
pub(crate) fn reels(folder: &Path, most: usize) -> Vec<ReelFile> {
    let about = |path: PathBuf| {
        let about = std::fs::metadata(&path).ok()?;
        Some(ReelFile { path, modified: about.modified().ok()?, bytes: about.len() })
    };
    let mut files: Vec<_> = files_of(folder, "mcap").filter_map(about).collect();
    files.sort_by(|a, b| b.modified.cmp(&a.modified).then_with(|| a.path.cmp(&b.path)));
    files.truncate(most);
    files
}

/// Returns the path of a new recording in `folder`: with the given name, or else with the
/// seconds from 1970 to `now`.
pub(crate) fn new_reel(folder: &Path, name: &str, now: SystemTime) -> PathBuf {
    let name = name.trim_end_matches(".mcap");
    if !name.is_empty() {
        return folder.join(format!("{name}.mcap"));
    }
    let seconds = now.duration_since(UNIX_EPOCH).unwrap_or_default().as_secs();
    folder.join(format!("hbot-{seconds}.mcap"))
}

/// Returns the folder in which a server on this computer keeps its flight logs, in the user's state
/// directory (XDG base directories).
pub(crate) fn flight_folder() -> Option<PathBuf> {
    let absolute = |name| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let state = absolute("XDG_STATE_HOME").or_else(|| absolute("HOME").map(|home| home.join(".local/state")));
    state.map(|state| state.join("hbot/flight"))
}

/// The columns before those of the joints, in SI units except for times in us. Each has the meaning
/// of the field of state messages in docs/api.md. A field that is null there is an empty cell.
const COLUMNS: &str = "tick t mode fault q_w q_x q_y q_z omega_1 omega_2 omega_3 reference_w reference_x \
    reference_y reference_z torque_1 torque_2 torque_3 slip scale traction energy client_seq \
    client_age_ticks lateness_us compute_us link_us age_us lead_us";

/// Returns the names of the columns for a rig with so many joints.
fn columns(joints: usize) -> Vec<String> {
    let fixed = COLUMNS.split(' ').map(str::to_owned);
    let of_joint = |k: usize| ["angle", "rate", "torque"].map(|what| format!("joint{}_{what}", k + 1));
    fixed.chain((0..joints).flat_map(of_joint)).collect()
}

/// Returns the cells of one sample, in the order of [`columns`].
fn row(s: &StateEvent, joints: usize) -> impl Serialize + use<> {
    let of_joints: Vec<_> = (0..joints)
        .map(|k| s.joints.get(k).map(|joint| [joint.angle, joint.rate, joint.torque]))
        .flat_map(|joint| (0..3).map(move |part| joint.map(|joint| joint[part])))
        .collect();
    let StateTiming { lateness_us, compute_us, link_us, age_us, lead_us } = s.timing;
    let times = [lateness_us, compute_us, link_us, age_us, lead_us];
    (
        (s.tick, s.t, s.mode, s.fault),
        s.q,
        s.omega,
        [0, 1, 2, 3].map(|part| s.reference.map(|q| q[part])),
        s.torque,
        [s.slip, s.scale, s.traction, s.energy],
        (s.client.and_then(|client| client.seq), s.client.map(|client| client.age_ticks)),
        times,
        of_joints,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use hbot_api::{ClientStream, Fault, JointState};
    use std::collections::BTreeSet;

    #[test]
    fn a_scene_that_is_saved_is_the_scene_that_is_loaded() {
        let folder = tempfile::tempdir().expect("a folder");
        let scenes_of_the_project = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
        let files = scenes(&scenes_of_the_project, &[]);
        assert!(files.iter().all(|file| file.said().ends_with('.')), "{files:?}");
        assert_eq!(scenes(&scenes_of_the_project, &files), files);
        let offered = files.iter().filter(|file| !file.is_copy).count();
        assert_eq!(offered, SHELF.len(), "the files of the project are the ready-made scenes");
        let path = folder.path().join("spring.toml");
        for ShelfFile { source, .. } in files {
            let scene = load(&source).expect("legal");
            save(&path, &scene).expect("written");
            assert_eq!(load(&Source::File(path.clone())).expect("legal"), scene, "{}", source.name());
        }
        // The user's own file is added to the ready-made scenes, also if it has the name of one.
        let mine = scenes(folder.path(), &[]).pop().expect("it is the last");
        assert!(!mine.is_copy);
        assert_eq!(mine.source.name(), format!("spring ({})", folder.path().display()));
    }

    #[test]
    fn a_flight_log_is_listed_by_its_time_and_cause() {
        for (name, title) in [
            ("flight-20260131T235958.123Z-4711-001-link_lost.mcap", "2026-01-31 23:59:58 UTC: link_lost"),
            ("flight-plan.mcap", "flight-plan.mcap"),
            ("run.mcap", "run.mcap"),
        ] {
            let path = Path::new("folder").join(name);
            assert_eq!(ReelFile { path, modified: UNIX_EPOCH, bytes: 0 }.title(), title);
        }
    }

    fn names(key: &str, value: &Value) -> Vec<String> {
        let with = |ends: &[&str]| ends.iter().map(|end| format!("{key}_{end}")).collect();
        match (key, value) {
            ("joints", Value::Array(joints)) => {
                let parts =
                    |k: usize| ["angle", "rate", "torque"].map(|part| format!("joint{}_{part}", k + 1));
                (0..joints.len()).flat_map(parts).collect()
            }
            ("timing", Value::Object(times)) => times.keys().cloned().collect(),
            (_, Value::Object(parts)) => parts.keys().map(|part| format!("{key}_{part}")).collect(),
            (_, Value::Array(parts)) if parts.len() == 4 => with(&["w", "x", "y", "z"]),
            (_, Value::Array(_)) => with(&["1", "2", "3"]),
            _ => vec![key.to_owned()],
        }
    }

    #[test]
    fn a_csv_file_has_every_field_of_a_state() {
        let folder = tempfile::tempdir().expect("a folder");
        let joint = JointState { angle: 1.5, rate: -2.5, torque: 0.25 };
        let full = StateEvent {
            tick: 7,
            reference: Some([0.5; 4]),
            fault: Some(Fault::LinkLost),
            joints: vec![joint; 4],
            client: Some(ClientStream { seq: Some(9), age_ticks: 2 }),
            traction: 0.75,
            ..StateEvent::default()
        };
        let samples = [full.clone(), StateEvent { tick: 8, ..StateEvent::default() }].map(Arc::new);
        let path = export(folder.path(), &samples).expect("written");
        let mut csv = csv::Reader::from_path(path).expect("a file");
        let heads: Vec<String> = csv.headers().expect("a line").iter().map(str::to_owned).collect();
        let Ok(Value::Object(fields)) = serde_json::to_value(&full) else { panic!("a map") };
        let wanted: BTreeSet<String> = fields.iter().flat_map(|(key, value)| names(key, value)).collect();
        assert_eq!(heads.iter().cloned().collect::<BTreeSet<_>>(), wanted);
        let rows: Vec<Vec<String>> = csv
            .records()
            .map(|row| row.expect("as many cells as columns").iter().map(str::to_owned).collect())
            .collect();
        let cell = |row: usize, head: &str| {
            rows[row][heads.iter().position(|name| name == head).expect("a column")].clone()
        };
        for (head, with, without) in [
            ("fault", "link_lost", ""),
            ("mode", "unreferenced", "unreferenced"),
            ("reference_w", "0.5", ""),
            ("client_seq", "9", ""),
            ("traction", "0.75", "0.0"),
            ("joint4_rate", "-2.5", ""),
        ] {
            assert_eq!((cell(0, head).as_str(), cell(1, head).as_str()), (with, without), "{head}");
        }
    }
}
