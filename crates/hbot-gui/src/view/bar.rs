//! The bar at the top of the window: whether the rig is simulated, the connection, and who holds
//! the lease.

use eframe::egui::{self, Button, RichText, TextEdit, TextStyle, Ui, vec2};

use super::Desk;
use super::stop::has_keys;
use super::theme::{LIVE, Palette, badge, bold_text, heading, lamp, leading, named, press, weak, wrapped};
use crate::model::{Link, Model, has_torque};
use crate::net::{Intent, Lease};

/// Width of the button for the lease, points. It is wide enough for every text of the button.
const LEASE: f32 = 112.0;
/// Width of the field for a server's address, points.
const ADDRESS: f32 = 220.0;
/// Width of the box that asks before the lease is taken over, points.
const QUESTION: f32 = 380.0;

/// Says to an observer which button makes the grey controls work.
pub(super) fn first(model: &Model) -> Option<&'static str> {
    let is_held = matches!(model.lease, Lease::Other(_));
    model.is_observer().then_some(if is_held { "Take over to change" } else { "Take command first" })
}

pub(crate) fn show(ui: &mut Ui, model: &Model, desk: &mut Desk, intents: &mut Vec<Intent>) {
    let palette = Palette::of(ui);
    ui.horizontal(|ui| {
        let (color, text) = match &model.link {
            Link::Online(hello) if model.silent_for().is_some() => {
                (palette.warn, format!("{}  silent", hello.rig))
            }
            Link::Online(hello) => (palette.good, format!("{}  {} Hz", hello.rig, hello.rate_hz)),
            Link::Connecting => (palette.warn, "connecting".to_owned()),
            Link::Offline { .. } | Link::Recording => (palette.warn, "not connected".to_owned()),
        };
        kind_of_rig(ui, model, desk, palette);
        lamp(ui, color);
        let text = bold_text(ui, text);
        ui.label(text);
        weak(ui, &model.server);
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            theme_switch(ui);
            lease(ui, model, palette, desk, intents);
        });
    });
}

/// Draws whether motors can push, in the words of the server's banner, or that a recording is
/// shown.
fn kind_of_rig(ui: &mut Ui, model: &Model, desk: &Desk, palette: Palette) {
    let (ground, word, hint) = match model.badge() {
        _ if desk.film.is_some() => {
            (palette.ghost, "RECORDING", "the middle of the window shows a recording, not the rig")
        }
        Some(word @ "LIVE") => (LIVE, word, "a real rig: its motors can push"),
        Some(word) => (palette.text, word, "a simulated rig: there are no motors"),
        None => {
            let hint = "not known: the server here can have a simulated rig or a real one";
            (palette.weak, model.last_badge().unwrap_or("UNKNOWN"), hint)
        }
    };
    badge(ui, ground, word).on_hover_text(hint);
}

fn theme_switch(ui: &mut Ui) {
    let dark = ui.visuals().dark_mode;
    let (text, theme) = if dark { ("Light", egui::Theme::Light) } else { ("Dark", egui::Theme::Dark) };
    let button = egui::Button::new(text).min_size(vec2(54.0, 0.0));
    if named(ui.add(button), "Light or dark").on_hover_text("light or dark ground").clicked() {
        ui.ctx().set_theme(theme);
    }
}

/// Draws who commands, and the buttons that change it. They are always there and always of one
/// size.
fn lease(ui: &mut Ui, model: &Model, palette: Palette, desk: &mut Desk, intents: &mut Vec<Intent>) {
    let (text, hint, intent) = match &model.lease {
        Lease::Other(holder) => (
            "Take over",
            format!("command in place of {}", model.other(holder)),
            Intent::Acquire { steal: true },
        ),
        _ => ("Take command", "command this rig".to_owned(), Intent::Acquire { steal: false }),
    };
    let live = model.is_online() && model.silent_for().is_none();
    let mine = model.lease == Lease::Mine;
    // The layout goes from right to left, so the buttons come first. A second click on the button
    // that takes command must not release it.
    let release = press(ui, live && mine, egui::Button::new("Release"));
    if release.on_hover_text("let another client command; a scene that runs goes on").clicked() {
        intents.push(Intent::Release);
    }
    let button = egui::Button::new(text).min_size(vec2(LEASE, 0.0));
    if press(ui, live && !mine, button).on_hover_text(hint).clicked() {
        match &model.lease {
            Lease::Other(holder) if model.mode().is_some_and(has_torque) => {
                desk.taking_over = Some(holder.clone());
            }
            _ => intents.push(intent),
        }
    }
    let (text, color) = match &model.lease {
        _ if !model.is_online() => return,
        Lease::Mine => ("you command".to_owned(), palette.good),
        Lease::Free => {
            let pushes = model.mode().is_some_and(has_torque);
            let color = if pushes { palette.warn } else { palette.text };
            let takes = if model.observes { "" } else { ": a change takes command" };
            (format!("nobody commands{takes}"), color)
        }
        Lease::Unknown => ("not known yet who commands".to_owned(), ui.visuals().text_color()),
        Lease::Other(holder) => {
            let who = format!("{} commands", model.other(holder));
            let long = format!("you observe, {who}");
            let font = TextStyle::Body.resolve(ui.style());
            let width = ui.painter().layout_no_wrap(long.clone(), font, palette.warn).size().x;
            // A long name comes before what the buttons say too.
            (if width <= ui.available_width() { long } else { who }, palette.warn)
        }
    };
    let who = |ui: &mut Ui, color| {
        ui.add(egui::Label::new(RichText::new(&text).color(color)).truncate()).on_hover_text(&text)
    };
    if model.is_certain() {
        who(ui, color);
    } else {
        // As grey as the bars.
        ui.add_enabled_ui(false, |ui| who(ui, palette.text));
    }
}

/// Asks whether the user really wants to take the lease from a client whose scene pushes now. The
/// question covers no part of the column with the stop button. It ends with the torque, and when
/// the user stops the rig by Esc.
pub(crate) fn question(ui: &Ui, model: &Model, desk: &mut Desk, intents: &mut Vec<Intent>) {
    let Some(asked) = &desk.taking_over else { return };
    let pushes = model.is_live() && model.mode().is_some_and(has_torque);
    let escaped = ui.input(|input| input.key_pressed(egui::Key::Escape));
    if !pushes || escaped || model.lease != Lease::Other(asked.clone()) {
        desk.taking_over = None;
        return;
    }
    let holder = model.other(asked);
    let area = egui::Area::new(egui::Id::unique("taking over")).order(egui::Order::Foreground);
    let is_new = !ui.memory(|memory| memory.areas().visible_last_frame(&area.layer()));
    area.anchor(egui::Align2::CENTER_TOP, vec2(0.0, 90.0)).show(ui.ctx(), |ui| {
        let frame = egui::Frame::popup(ui.style()).stroke((2.0, Palette::of(ui).warn)).inner_margin(12);
        frame.show(ui, |ui| {
            ui.set_width(QUESTION);
            heading(ui, &format!("Take over from {holder}?"));
            let keys = if has_keys(ui) { " Esc stops the rig and closes this question." } else { "" };
            let text = format!(
                "The sphere pushes, and {holder} commands it. The scene goes on when you take over. If the program of {holder} \
                 streams torques, they end.{keys}"
            );
            wrapped(ui, text);
            ui.add_space(6.0);
            ui.horizontal(|ui| {
                // As large and as far apart as fingers need.
                let size = vec2(110.0, 40.0);
                ui.spacing_mut().item_spacing.x = 16.0;
                let take = ui.add(Button::new("Take over").min_size(size));
                if named(take, "Take over now").clicked() {
                    intents.push(Intent::Acquire { steal: true });
                    desk.taking_over = None;
                }
                // The safe answer stands out, and Enter gives it.
                let cancel = ui.add(leading(ui, "Cancel").min_size(size));
                if is_new {
                    cancel.request_focus();
                }
                if cancel.clicked() {
                    desk.taking_over = None;
                }
            });
        });
    });
}

/// Draws the middle of the window while there is no connection. It shows why, and has a field for
/// another address.
pub(crate) fn no_server(ui: &mut Ui, model: &Model, desk: &mut Desk, intents: &mut Vec<Intent>) {
    ui.vertical_centered(|ui| {
        ui.add_space((ui.available_height() * 0.22 - 40.0).clamp(0.0, 160.0));
        let (title, why, absent) = match &model.link {
            Link::Offline { why, absent: true, .. } => (format!("No server at {}", model.server), why.as_str(), true),
            Link::Offline { why, .. } => (format!("No connection to {}", model.server), why.as_str(), false),
            _ => (format!("Looking for a server at {}", model.server), "", false),
        };
        heading(ui, &title);
        weak(ui, why);
        if absent {
            ui.add_space(12.0);
            ui.label("Start one:");
            ui.label(RichText::new("hbot server").monospace().size(16.0).strong());
            weak(ui, "In the project's folder, `cargo run server` builds and starts it.");
            let hint = "It drives a simulated rig unless it is told a serial port. This window connects as soon as it is there.";
            weak(ui, hint);
        }
        if let Link::Offline { again, .. } = &model.link {
            let left = again.saturating_duration_since(std::time::Instant::now()).as_secs_f64();
            weak(ui, format!("next attempt in {left:.0} s"));
        }
        ui.add_space(8.0);
        ui.label("Or connect to another:");
        // In one row, so that both are there in a low window, above the plots.
        let row = vec2((ADDRESS + 90.0).min(ui.available_width()), ui.spacing().interact_size.y);
        ui.allocate_ui_with_layout(row, egui::Layout::left_to_right(egui::Align::Center), |ui| {
            let field = TextEdit::singleline(&mut desk.address).hint_text("HOST or HOST:PORT");
            let response = named(ui.add(field.desired_width(ADDRESS)), "Server address");
            let entered = response.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
            let address = desk.address.trim();
            let clicked = press(ui, !address.is_empty(), egui::Button::new("Connect")).clicked();
            if (clicked || entered) && !address.is_empty() {
                intents.push(Intent::Connect(address.to_owned()));
            }
        });
    });
}
