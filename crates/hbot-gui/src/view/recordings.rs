//! The tab for recordings: record the rig, and open a recording or a flight log.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

use eframe::egui::{self, RichText, TextEdit, Ui, vec2};
use hbot_api::time_of_day;

use super::Act;
use super::theme::{Palette, coloured, heading, named, press, weak};
use crate::files;
use crate::model::Model;

/// Time after which the folders are read again, to show new files.
const LIST_EVERY: Duration = Duration::from_secs(2);
/// Width of the buttons beside the fields, which end where all else in the tab does, points.
const BUTTON: f32 = 76.0;
/// Largest number of files of a folder in the list, the newest.
const MOST_FILES: usize = 12;

/// The recordings that the user can open, and the names that the user types.
#[derive(Debug, Default)]
pub(crate) struct Reels {
    /// Folder in which the panel records.
    folder: PathBuf,
    /// Folder of the flight logs of a server on this computer.
    flights: Option<PathBuf>,
    /// The newest recordings of both folders.
    files: [Vec<files::ReelFile>; 2],
    listed: Option<Instant>,
    /// Name of the next recording.
    name: String,
    /// File to open, as the user types it.
    path: String,
}

impl Reels {
    pub(crate) fn new(folder: PathBuf) -> Self {
        Self { folder, flights: files::flight_folder(), ..Self::default() }
    }

    fn refresh(&mut self) {
        if self.listed.is_none_or(|at| at.elapsed() > LIST_EVERY) {
            let newest = |folder: &Path| files::reels(folder, MOST_FILES);
            self.files = [newest(&self.folder), self.flights.as_deref().map(newest).unwrap_or_default()];
            self.listed = Some(Instant::now());
        }
    }
}

pub(crate) fn show(ui: &mut Ui, model: &Model, reels: &mut Reels, acts: &mut Vec<Act>) {
    reels.refresh();
    record(ui, model, reels, acts);
    ui.separator();
    open(ui, reels, acts);
}

fn record(ui: &mut Ui, model: &Model, reels: &mut Reels, acts: &mut Vec<Act>) {
    heading(ui, "Record");
    if let Some(progress) = &model.recording {
        let seconds = progress.since.elapsed().as_secs();
        let text = format!("REC {}:{:02}", seconds / 60, seconds % 60);
        ui.horizontal(|ui| {
            if named(ui.button("Stop recording"), "Stop recording").clicked() {
                acts.push(Act::EndRecording);
            }
            ui.label(RichText::new(text).strong().color(Palette::of(ui).warn));
        });
        weak(ui, format!("{}: {} states, {} lost", progress.path.display(), progress.states, progress.lost));
        return;
    }
    ui.horizontal(|ui| {
        let width = ui.available_width() - BUTTON - ui.spacing().item_spacing.x;
        let hint = "name, or empty for the time";
        let field = TextEdit::singleline(&mut reels.name).hint_text(hint).desired_width(width);
        named(ui.add(field), "Name of the recording");
        let button = press(ui, model.is_online(), egui::Button::new("Record").min_size(vec2(BUTTON, 0.0)));
        if named(button, "Start recording").clicked() {
            acts.push(Act::Record(files::new_reel(&reels.folder, reels.name.trim(), SystemTime::now())));
            reels.name.clear();
        }
    });
    weak(ui, format!("Every tick of the rig, as an MCAP file in {}", reels.folder.display()));
}

fn open(ui: &mut Ui, reels: &mut Reels, acts: &mut Vec<Act>) {
    heading(ui, "Open");
    ui.horizontal(|ui| {
        let width = ui.available_width() - BUTTON - ui.spacing().item_spacing.x;
        let field = TextEdit::singleline(&mut reels.path).hint_text("file, or drop one here");
        let response = named(ui.add(field.desired_width(width)), "Recording to open");
        let entered = response.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
        let path = reels.path.trim();
        let clicked =
            press(ui, !path.is_empty(), egui::Button::new("Open").min_size(vec2(BUTTON, 0.0))).clicked();
        if (clicked || entered) && !path.is_empty() {
            acts.push(Act::Open(path.into()));
        }
    });
    let dropped = ui.input(|input| input.raw.dropped_files.first().map(|file| file.path().to_path_buf()));
    acts.extend(dropped.map(Act::Open));
    for (title, files) in ["Recordings", "Flight logs of this computer"].into_iter().zip(&reels.files) {
        if files.is_empty() {
            continue;
        }
        weak(ui, title);
        for file in files {
            let name = file.title();
            let button = egui::Button::new(&name).wrap();
            if named(ui.add(button), &name).on_hover_text(about(file)).clicked() {
                acts.push(Act::Open(file.path.clone()));
            }
        }
    }
    if reels.files.iter().all(Vec::is_empty) {
        coloured(ui, Palette::of(ui).weak, format!("No recordings in {}.", reels.folder.display()));
    }
}

/// Says how large a file is, and when it was written.
fn about(file: &files::ReelFile) -> String {
    let size = file.bytes as f64;
    let size = if size < 1e6 { format!("{:.0} kB", size * 1e-3) } else { format!("{:.1} MB", size * 1e-6) };
    let path = file.path.display();
    format!("{path}, {size}, last written at {}", time_of_day(file.modified))
}
