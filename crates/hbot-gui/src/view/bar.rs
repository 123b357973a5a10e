//! The bar at the top of the window: the connection, and who holds the lease.

use eframe::egui::{self, RichText, TextEdit, Ui};

use super::Desk;
use super::theme::{Palette, heading, lamp, named, weak};
use crate::model::{Link, Model};
use crate::net::{Intent, Lease};

pub(crate) fn show(ui: &mut Ui, model: &Model, intents: &mut Vec<Intent>) {
    let palette = Palette::of(ui);
    ui.horizontal(|ui| {
        let (color, text) = match &model.link {
            Link::Online(hello) => (palette.good, format!("{}  {} Hz", hello.rig, hello.rate_hz)),
            Link::Connecting => (palette.warn, "connecting".to_owned()),
            Link::Offline { .. } => (palette.bad, "not connected".to_owned()),
        };
        lamp(ui, color);
        ui.label(RichText::new(text).strong());
        weak(ui, &model.server);
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            theme_switch(ui);
            if model.is_online() {
                lease(ui, model, palette, intents);
            }
        });
    });
}

fn theme_switch(ui: &mut Ui) {
    let dark = ui.visuals().dark_mode;
    let (text, theme) = if dark { ("Light", egui::Theme::Light) } else { ("Dark", egui::Theme::Dark) };
    if named(ui.button(text), "Light or dark").on_hover_text("light or dark ground").clicked() {
        ui.ctx().set_theme(theme);
    }
}

fn lease(ui: &mut Ui, model: &Model, palette: Palette, intents: &mut Vec<Intent>) {
    // The layout goes from right to left, so the button comes first.
    match &model.lease {
        Lease::Mine => {
            let hint = "let another client command; a scene that runs goes on";
            if ui.button("Release").on_hover_text(hint).clicked() {
                intents.push(Intent::Release);
            }
            ui.colored_label(palette.good, "you command");
        }
        Lease::Free | Lease::Unknown => {
            if ui.button("Take command").clicked() {
                intents.push(Intent::Acquire { steal: false });
            }
            ui.label(if model.lease == Lease::Free { "nobody commands" } else { "watching" });
        }
        Lease::Other(holder) => {
            let hint = format!("command in place of {holder}");
            if ui.button("Take over").on_hover_text(hint).clicked() {
                intents.push(Intent::Acquire { steal: true });
            }
            let text = RichText::new(format!("observer: {holder} commands")).color(palette.warn);
            ui.add(egui::Label::new(text).truncate());
        }
    }
}

/// Draws the middle of the window while there is no connection. It shows why, and has a field for
/// another address.
pub(crate) fn no_server(ui: &mut Ui, model: &Model, desk: &mut Desk, intents: &mut Vec<Intent>) {
    ui.vertical_centered(|ui| {
        ui.add_space((ui.available_height() * 0.22).min(160.0));
        let (title, why, absent) = match &model.link {
            Link::Offline { why, absent: true, .. } => (format!("No server at {}", model.server), why.as_str(), true),
            Link::Offline { why, .. } => (format!("No connection to {}", model.server), why.as_str(), false),
            _ => (format!("Looking for a server at {}", model.server), "", false),
        };
        heading(ui, &title);
        weak(ui, why);
        if absent {
            ui.add_space(12.0);
            ui.label("Start one in the project's folder:");
            ui.label(RichText::new("cargo run server").monospace().size(16.0).strong());
            let hint = "It drives a simulated rig unless it is told a serial port. This window connects as soon as it is there.";
            weak(ui, hint);
        }
        if let Link::Offline { again, .. } = &model.link {
            let left = again.saturating_duration_since(std::time::Instant::now()).as_secs_f64();
            weak(ui, format!("next attempt in {left:.0} s"));
        }
        ui.add_space(16.0);
        ui.label("Or connect to another:");
        let field = TextEdit::singleline(&mut desk.address).hint_text("HOST or HOST:PORT").desired_width(220.0);
        let response = named(ui.add(field), "Server address");
        let entered = response.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
        let address = desk.address.trim();
        let clicked = ui.add_enabled(!address.is_empty(), egui::Button::new("Connect")).clicked();
        if (clicked || entered) && !address.is_empty() {
            intents.push(Intent::Connect(address.to_owned()));
        }
    });
}
