//! Functions that draw the [`Model`] and do not change it. They return what the user asks for as
//! [`Act`]s. State of the window alone, such as the camera or the open tab, is kept in the
//! [`Desk`].

mod bar;
mod camera;
mod controllers;
mod film;
mod health;
mod joints;
mod law;
mod meters;
mod number;
#[cfg(test)]
mod painted;
mod parameter;
mod plots;
mod pointer;
mod recordings;
mod recover;
mod scene;
mod schema;
mod sphere;
mod state;
mod stiffness;
mod stop;
#[cfg(test)]
mod tests;
pub(crate) mod theme;

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::SystemTime;

use eframe::egui::{self, CentralPanel, Panel, RichText, ScrollArea, Ui};
use hbot_api::{Requester, StateEvent, time_of_day};

use crate::Folders;
use crate::files::Source;
use crate::model::{Film, Judged, Model, Weight};
use crate::net::{Intent, Lease};
use camera::Camera;
use theme::{Palette, coloured, weak, wrapped};

/// Height of the line for a new message, points.
const MESSAGE: f32 = 26.0;

/// Opacity of what is drawn and may be old.
const FADED: f32 = 0.5;

/// Height of the tape below the bar of a real rig, points. The parts below it begin lower.
const TAPE: f32 = 4.0;

/// Something that the user has asked for while the window was drawn.
#[derive(Clone, Debug)]
pub(crate) enum Act {
    /// Send a request to the server, for example to stop the rig.
    Ask(Intent),
    /// Load a ready-made scene, or a scene file from this computer.
    LoadScene(Source),
    SaveScene(PathBuf),
    /// Write these states of the rig to a CSV file.
    Export(Vec<Arc<StateEvent>>),
    /// Record the rig into a new file.
    Record(PathBuf),
    EndRecording,
    /// Open a recording or a flight log.
    Open(PathBuf),
    /// Say in a message that a number was refused, and why.
    Refuse(String),
}

/// The tab that is open at the right of the window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Tab {
    #[default]
    Scene,
    Joints,
    Health,
    Recordings,
    Messages,
}

impl Tab {
    const ALL: [(Self, &str); 5] = [
        (Self::Scene, "Scene"),
        (Self::Joints, "Joints"),
        (Self::Health, "Health"),
        (Self::Recordings, "Record"),
        (Self::Messages, "Messages"),
    ];
}

/// What the user has chosen and typed in the window, such as the open tab. It does not concern the
/// rig.
#[derive(Debug, Default)]
pub(crate) struct Desk {
    camera: Camera,
    /// The simulated hand while the user holds the sphere with it.
    hand: Option<sphere::Held>,
    tab: Tab,
    plots: plots::PlotDesk,
    shelf: scene::Shelf,
    reels: recordings::Reels,
    /// The recording that the middle of the window shows in the place of the rig.
    film: Option<Box<Film>>,
    /// The server's address as the user types it.
    address: String,
    /// Id of the spring whose stiffness the sliders change.
    spring: String,
    /// What the rig keeps stable of the scene.
    judged: Judged,
    /// For each effect that the user has switched off, the gain it had before, by the effect's id.
    gains: BTreeMap<String, f64>,
    /// The lease holder, while the panel asks whether to take the lease from this client.
    taking_over: Option<Requester>,
}

impl Desk {
    pub(crate) fn new(folders: Folders, address: &str, judged: Judged) -> Self {
        Self {
            shelf: scene::Shelf::new(folders.scenes),
            reels: recordings::Reels::new(folders.out),
            address: address.to_owned(),
            judged,
            ..Self::default()
        }
    }

    /// Shows a recording in the place of the rig.
    pub(crate) fn open(&mut self, film: Film) {
        self.plots.go_on();
        self.film = Some(Box::new(film));
    }

    /// Returns the recording that is shown in the place of the rig.
    pub(crate) fn film(&self) -> Option<&Film> {
        self.film.as_deref()
    }
}

/// Draws all contents of the window. Adds what the user asks for to `acts`.
pub(crate) fn show(ui: &mut Ui, model: &Model, desk: &mut Desk, acts: &mut Vec<Act>) {
    let mut intents = Vec::new();
    let narrow = ui.available_width() < 1100.0;
    let (left, right) = if narrow { (262.0, 286.0) } else { (300.0, 330.0) };
    let bar = Panel::top("bar").show(ui, |ui| bar::show(ui, model, desk, &mut intents)).response.rect;
    Panel::left("state").exact_size(left).resizable(false).show(ui, |ui| {
        ui.add_space(6.0);
        stop::show(ui, model, &mut intents);
        ScrollArea::vertical().id_salt("left").auto_shrink([false, true]).show(ui, |ui| {
            let online = model.is_online();
            let warnings = if online { desk.judged.warnings(&model.scene.shown()) } else { &[] };
            let told = usize::from(state::show(ui, model, warnings, &mut intents));
            // A scene stays while the server is away, so that its sliders stay in their places.
            if model.is_online() || !model.scene.effects().is_empty() {
                ui.separator();
                ui.add_enabled_ui(model.may_command(), |ui| {
                    stiffness::show(ui, model, (desk, told), &mut intents)
                });
            }
            ui.add_space(8.0);
        });
    });
    // Beside the column with STOP, and always there, so that nothing moves.
    Panel::bottom("new message")
        .exact_size(MESSAGE)
        .resizable(false)
        .show(ui, |ui| new_message(ui, model, desk));
    Panel::right("details").exact_size(right).resizable(false).show(ui, |ui| {
        ui.add_space(4.0);
        ui.horizontal(|ui| {
            // The names of all tabs fit into one row, also in a narrow window.
            (ui.spacing_mut().button_padding.x, ui.spacing_mut().item_spacing.x) =
                if narrow { (3.0, 2.0) } else { (6.0, 4.0) };
            for (tab, name) in Tab::ALL {
                ui.selectable_value(&mut desk.tab, tab, name);
            }
        });
        ui.separator();
        ScrollArea::vertical().id_salt("right").auto_shrink([false, false]).show(ui, |ui| match desk.tab {
            Tab::Scene if !model.is_online() && model.scene.effects().is_empty() => {
                drop(weak(ui, "Not connected."));
            }
            Tab::Scene => scene::show(ui, model, desk, acts),
            Tab::Joints => drop(ui.add_enabled_ui(model.is_fresh(), |ui| joints::show(ui, model))),
            Tab::Health => drop(ui.add_enabled_ui(model.is_fresh(), |ui| health::show(ui, model))),
            Tab::Recordings => recordings::show(ui, model, &mut desk.reels, acts),
            Tab::Messages => messages(ui, model),
        });
    });
    if desk.hand.is_some() && (desk.film.is_some() || !model.has_hand()) {
        desk.hand = None;
        // Who loses the lease or the connection has lost the hand: the scene moves it again.
        if model.is_online() && model.lease == Lease::Mine {
            intents.push(Intent::Hand(None));
        }
    }
    CentralPanel::default().show(ui, |ui| {
        if let Some(mut film) = desk.film.take() {
            let closed = film::show(ui, &mut film);
            middle(ui, &film.model, desk, &mut intents, acts);
            desk.film = (!closed).then_some(film);
            return;
        }
        if model.is_online() {
            middle(ui, model, desk, &mut intents, acts);
            return;
        }
        // The plots stay while the server is away, so that their samples can be looked at and
        // saved.
        if model.history.newest().is_some() {
            curves(ui, model, desk, acts);
        }
        bar::no_server(ui, model, desk, &mut intents);
    });
    // A real rig can be told from a simulated one at a glance. The tape takes no room, so that
    // nothing moves.
    if model.badge() == Some("LIVE") {
        let line = bar.bottom() - 1.0..=bar.bottom() + TAPE;
        let tape = egui::Rect::from_x_y_ranges(ui.ctx().content_rect().x_range(), line);
        let stripes = theme::stripes(tape, theme::LIVE, 8.0, egui::Color32::BLACK);
        ui.painter().with_clip_rect(tape).extend(stripes);
    }
    bar::question(ui, model, desk, &mut intents);
    acts.extend(intents.into_iter().map(Act::Ask));
    acts.extend(number::refused(ui).map(Act::Refuse));
}

/// Draws the sphere, and below it the plots.
fn middle(ui: &mut Ui, model: &Model, desk: &mut Desk, intents: &mut Vec<Intent>, acts: &mut Vec<Act>) {
    curves(ui, model, desk, acts);
    ui.scope(|ui| {
        faded_unless_live(ui, model);
        sphere::show(ui, model, desk, intents);
    });
}

fn curves(ui: &mut Ui, model: &Model, desk: &mut Desk, acts: &mut Vec<Act>) {
    let height = (ui.available_height() * 0.42).max(190.0);
    Panel::bottom("plots").exact_size(height).resizable(false).show(ui, |ui| {
        ui.add_space(4.0);
        plots::show(ui, model, desk, acts);
    });
}

/// Greys out what is drawn in `ui` from now on, unless it shows what the rig does now.
fn faded_unless_live(ui: &mut Ui, model: &Model) {
    if !model.is_fresh() {
        ui.multiply_opacity(FADED);
    }
}

fn messages(ui: &mut Ui, model: &Model) {
    let palette = Palette::of(ui);
    if model.messages.newest_first().len() == 0 {
        weak(ui, "none yet");
    }
    for message in model.messages.newest_first() {
        let elapsed = message.at.elapsed();
        let time = time_of_day(SystemTime::now() - elapsed);
        let ago = elapsed.as_secs();
        let ago = if ago < 120 { format!("{ago} s ago") } else { format!("{} min ago", ago / 60) };
        let times = if message.times > 1 { format!(", {} times", message.times) } else { String::new() };
        weak(ui, format!("{time}, {ago}{times}"));
        match message.weight {
            Weight::Good => wrapped(ui, &message.text),
            Weight::Warn | Weight::Bad => coloured(ui, palette.warn, &message.text),
        };
        ui.add_space(4.0);
    }
}

/// Draws the new message that concerns the user most for some seconds, in one line, after its time,
/// and how many others are new beside it. What happened last stays, in grey; of what is told
/// elsewhere in the window, its name. A click opens the list.
fn new_message(ui: &mut Ui, model: &Model, desk: &mut Desk) {
    // The newest of those that weigh most.
    let fresh = model.messages.fresh().min_by_key(|message| Reverse(message.weight));
    let color = match fresh.map(|message| message.weight) {
        None => Palette::of(ui).weak,
        Some(Weight::Good) => Palette::of(ui).text,
        Some(Weight::Warn | Weight::Bad) => Palette::of(ui).warn,
    };
    let Some(message) = fresh.or_else(|| model.messages.newest_first().next()) else { return };
    let name = message.text.split([':', ';']).next().filter(|_| message.told);
    let text = RichText::new(name.unwrap_or(&message.text)).color(color);
    let label = egui::Label::new(text).truncate().sense(egui::Sense::click());
    let told = |ui: &mut Ui| {
        ui.weak(time_of_day(SystemTime::now() - message.at.elapsed()));
        ui.add(label).clicked()
    };
    let beside = |ui: &mut Ui| {
        let more = model.messages.fresh().count().saturating_sub(1);
        if more > 0 {
            ui.weak(format!("and {more} more"));
        }
    };
    if egui::Sides::new().shrink_left().show(ui, told, beside).0 {
        desk.tab = Tab::Messages;
    }
}

/// Rounds a positive number up to 1, 2 or 5 times a power of ten.
fn round_up(x: f64) -> f64 {
    let decade = 10_f64.powf(x.log10().floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|k| k * decade).find(|y| *y >= x * (1.0 - 1e-9)).unwrap_or(x)
}

/// Formats a positive number with about three digits, such as 9.86, 15.7 and 157.
fn three_digits(x: f64) -> String {
    match x {
        x if x < 10.0 => format!("{x:.2}"),
        x if x < 100.0 => format!("{x:.1}"),
        x => format!("{x:.0}"),
    }
}
