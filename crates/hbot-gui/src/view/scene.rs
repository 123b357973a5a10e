//! The tab for the scene: choose one, switch its effects, change their parameters, save it.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use eframe::egui::text::LayoutJob;
use eframe::egui::{self, CollapsingHeader, ComboBox, FontId, TextEdit, TextStyle, Ui, vec2};
use serde_json::{Value, json};

use super::bar;
use super::schema::{explain, words};
use super::theme::{Palette, bold_text, coloured, column, heading_text, named, press, sized, weak};
use super::{Act, Desk, faded_unless_live};
use super::{law, parameter};
use crate::files;
use crate::model::{Effect, Model};
use crate::net::Intent;

/// Time after which the panel reads the list of scene files again, to show new files.
const LIST_EVERY: Duration = Duration::from_secs(2);
/// Height of the list of scenes, points.
const LIST: f32 = 420.0;
/// Widths of the buttons that load and save a scene, which end where all else in the tab does,
/// points.
const LOAD: f32 = 68.0;
const SAVE: f32 = 88.0;
/// Room for the words of [`bar::first`] and the gap before them, points.
const OBSERVER_ROOM: f32 = 126.0;

/// The ready-made scenes and the scene files in the folder, with their descriptions; the one that
/// the user has picked; and the name that the user has typed.
#[derive(Debug, Default)]
pub(crate) struct Shelf {
    folder: PathBuf,
    files: Vec<files::ShelfFile>,
    listed: Option<Instant>,
    picked: Option<files::Source>,
    save_as: String,
}

impl Shelf {
    pub(crate) fn new(folder: PathBuf) -> Self {
        Self { folder, ..Self::default() }
    }

    fn picked(&self) -> Option<&files::ShelfFile> {
        self.files.iter().find(|file| Some(&file.source) == self.picked.as_ref())
    }

    fn refresh(&mut self) {
        if self.listed.is_none_or(|at| at.elapsed() > LIST_EVERY) {
            self.files = files::scenes(&self.folder, &self.files);
            self.listed = Some(Instant::now());
        }
    }
}

pub(crate) fn show(ui: &mut Ui, model: &Model, desk: &mut Desk, acts: &mut Vec<Act>) {
    choose(ui, model, &mut desk.shelf, acts);
    // The shelf already shows the description of the scene that was picked.
    let above = desk.shelf.picked().map_or("", files::ShelfFile::said);
    ui.scope(|ui| {
        faded_unless_live(ui, model);
        title(ui, model);
        if !model.scene.description().is_empty() && model.scene.description() != above {
            weak(ui, model.scene.description());
        }
        if model.scene.is_known() && model.scene.effects().is_empty() {
            weak(ui, "This scene has no effects: nothing is rendered.");
        }
    });
    law::show(ui, model, desk);
    let may = model.may_command();
    for effect in model.scene.effects() {
        // What is being typed into a control is kept when something appears above the effect.
        let alone = egui::UiBuilder::new().scope_id(egui::Id::unique(("effect", &effect.id)));
        ui.scope_builder(alone, |ui| {
            egui::Frame::group(ui.style()).show(ui, |ui| {
                ui.set_width(ui.available_width());
                ui.add_enabled_ui(may, |ui| one(ui, model, effect, desk, acts));
            });
        });
    }
    save(ui, model, &mut desk.shelf, acts);
}

/// Draws the name of the scene, and beside it which button lets an observer change the scene. A
/// name that is too long for its line is shortened, so that nothing below it moves when the words
/// come.
fn title(ui: &mut Ui, model: &Model) {
    ui.add_space(2.0);
    ui.horizontal(|ui| {
        let first = bar::first(model);
        let width = ui.available_width() - first.map_or(0.0, |_| OBSERVER_ROOM);
        let name = heading_text(ui, model.scene.name());
        column(ui, width, name);
        if let Some(first) = first {
            coloured(ui, Palette::of(ui).warn, first);
        }
    });
}

fn choose(ui: &mut Ui, model: &Model, shelf: &mut Shelf, acts: &mut Vec<Act>) {
    shelf.refresh();
    ui.horizontal(|ui| {
        let ask = if model.scene.is_known() { "choose another scene" } else { "choose a scene" };
        let text = shelf.picked.as_ref().map_or_else(|| ask.to_owned(), files::Source::name);
        let width = ui.available_width() - LOAD - ui.spacing().item_spacing.x;
        let combo = ComboBox::from_id_salt("scenes").selected_text(text).width(width).height(LIST).truncate();
        let response = combo.show_ui(ui, |ui| {
            ui.set_width(width);
            for file in shelf.files.iter().filter(|file| !file.is_copy) {
                let name = file.source.name();
                let is_picked = shelf.picked.as_ref() == Some(&file.source);
                let button = egui::Button::selectable(is_picked, entry(ui, &name, file.said())).wrap();
                if named(ui.add(button), &name).clicked() {
                    shelf.picked = Some(file.source.clone());
                }
            }
        });
        named(response.response, "Scene file");
        let enabled = model.may_command() && shelf.picked.is_some();
        if press(ui, enabled, egui::Button::new("Load").min_size(vec2(LOAD, 0.0))).clicked()
            && let Some(source) = &shelf.picked
        {
            acts.push(Act::LoadScene(source.clone()));
        }
    });
    let Some(file) = shelf.picked() else {
        weak(ui, "The list says what each scene feels like.");
        return;
    };
    // Each scene has this much room, so that nothing below it moves when the choice changes.
    let room = vec2(ui.available_width(), 3.0 * ui.text_style_height(&TextStyle::Body));
    ui.allocate_ui(room, |ui| {
        ui.set_min_size(room);
        weak(ui, file.said());
    });
}

/// Returns an entry of the list: the name of a scene, and below it what it feels like.
fn entry(ui: &Ui, name: &str, said: &str) -> LayoutJob {
    let (size, visuals) = (TextStyle::Body.resolve(ui.style()).size, ui.visuals());
    let below = format!("\n{said}");
    let font = FontId::proportional;
    sized(&[
        (name, font(size), visuals.strong_text_color()),
        (&below, font(0.9 * size), visuals.weak_text_color()),
    ])
}

/// Draws the controls of one effect: a switch, and one control for each parameter in the schema of
/// its kind.
fn one(ui: &mut Ui, model: &Model, effect: &Effect, desk: &mut Desk, acts: &mut Vec<Act>) {
    let kind = model.info.kind(&effect.kind);
    let set = |key: &str, value: Value| {
        Act::Ask(Intent::Set { effect: effect.id.clone(), key: key.to_owned(), value })
    };
    let gain = model.scene.value(effect, "gain").and_then(Value::as_f64);
    ui.horizontal(|ui| {
        if let Some(gain) = gain {
            let mut on = gain != 0.0;
            if named(ui.checkbox(&mut on, ""), &format!("{} on", effect.id)).changed() {
                let before = desk.gains.insert(effect.id.clone(), gain).filter(|gain| *gain != 0.0);
                acts.push(set("gain", json!(if on { before.unwrap_or(1.0) } else { 0.0 })));
            }
        }
        let id = bold_text(ui, &effect.id);
        ui.label(id);
        let cost = model.scene.cost_ns(effect).map(|ns| format!(", {ns} ns a tick")).unwrap_or_default();
        let response = weak(ui, format!("{}{cost}", effect.kind));
        response.on_hover_text(kind.map_or("", |kind| kind.description.as_str()));
    });
    let Some(kind) = kind else {
        weak(ui, "The server has told no parameters of this kind.");
        return;
    };
    let open = model.scene.effects().len() <= 2;
    let header =
        CollapsingHeader::new("parameters").id_salt("parameters").default_open(open).show(ui, |ui| {
            for (key, schema) in kind.schema["properties"].as_object().into_iter().flatten() {
                let value =
                    model.scene.value(effect, key).or_else(|| schema.get("default")).unwrap_or(&Value::Null);
                let name = format!("{} {key}", effect.id);
                ui.horizontal_top(|ui| {
                    let label = |ui: &mut Ui| {
                        ui.set_width(74.0);
                        ui.add_space(2.0);
                        weak(ui, words(key, schema))
                    };
                    ui.vertical(label).inner.on_hover_text(format!("{key}: {}", explain(schema)));
                    let room = ui.available_width();
                    ui.vertical(|ui| {
                        ui.set_max_width(room);
                        if let Some(value) = parameter::edit(ui, &name, schema, value) {
                            acts.push(set(key, value));
                        }
                    });
                });
            }
        });
    named(header.header_response, &format!("{} parameters", effect.id));
}

fn save(ui: &mut Ui, model: &Model, shelf: &mut Shelf, acts: &mut Vec<Act>) {
    ui.separator();
    ui.horizontal(|ui| {
        let width = ui.available_width() - SAVE - ui.spacing().item_spacing.x;
        let field = TextEdit::singleline(&mut shelf.save_as).hint_text("file name").desired_width(width);
        named(ui.add(field), "Save scene as");
        let name = shelf.save_as.trim();
        let path = shelf.folder.join(format!("{}.toml", name.trim_end_matches(".toml")));
        let taken = !name.is_empty() && path.exists();
        let legal = !name.is_empty() && model.is_online();
        let text = if taken { "Overwrite" } else { "Save" };
        if press(ui, legal, egui::Button::new(text).min_size(vec2(SAVE, 0.0))).clicked() {
            acts.push(Act::SaveScene(path));
            shelf.listed = None;
        }
    });
}
