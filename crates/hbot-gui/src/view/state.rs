//! The mode of the rig, and the buttons that change it, with the stop button first.

use eframe::egui::{self, Button, RichText, Role, Ui, WidgetInfo, vec2};
use glam::DVec3;
use hbot_api::Mode;

use super::recover;
use super::theme::{Palette, STOP, coloured, column, named, weak};
use crate::model::{Model, words};
use crate::net::Intent;

/// Draws the stop button. The panel calls this in all its states, so that the button is always
/// present.
pub(crate) fn stop(ui: &mut Ui, intents: &mut Vec<Intent>) {
    let text = RichText::new("STOP").size(30.0).strong().color(egui::Color32::WHITE);
    let button = Button::new(text).fill(STOP).corner_radius(8);
    let response = named(ui.add_sized(vec2(ui.available_width(), 60.0), button), "Stop")
        .on_hover_text("zero torque at once: Esc and Space do the same");
    if response.clicked() {
        intents.push(Intent::Stop);
    }
    ui.vertical_centered(|ui| weak(ui, "Esc or Space, anywhere in this window"));
}

/// Draws the buttons that enable, disable and reset the rig, and the present mode of the rig.
pub(crate) fn show(ui: &mut Ui, model: &Model, intents: &mut Vec<Intent>) {
    orders(ui, model, intents);
    recover::show(ui, model, intents);
    let palette = Palette::of(ui);
    egui::Frame::group(ui.style()).show(ui, |ui| {
        ui.set_width(ui.available_width());
        let Some(state) = &model.state else {
            ui.label(RichText::new("NO STATE").strong().size(18.0).color(palette.weak));
            weak(ui, if model.is_online() { "Waiting for the first state." } else { "Not connected." });
            return;
        };
        let name = state.mode.as_str().to_uppercase();
        ui.label(RichText::new(name).strong().size(18.0).color(palette.mode(state.mode)));
        if let Some(silent) = model.silent_for() {
            let text = format!(
                "The server has said nothing for {:.0} s: what is shown is old.",
                silent.as_secs_f64()
            );
            coloured(ui, palette.bad, text);
        }
        match state.fault {
            Some(fault) => {
                let (what, cure) = words::fault(fault);
                coloured(ui, palette.bad, what);
                ui.add(egui::Label::new(cure).wrap());
                match &model.fault {
                    Some(told) => weak(ui, format!("{fault}: {}", without_log(&told.message))),
                    None => weak(ui, fault.as_str()),
                };
            }
            None => {
                weak(ui, words::mode(state.mode));
            }
        }
    });
    meters(ui, model, palette);
}

/// Removes the path of the flight log from a message, because the path is long. The list of
/// messages still shows it.
fn without_log(message: &str) -> &str {
    message.split("; flight log:").next().unwrap_or_default()
}

fn orders(ui: &mut Ui, model: &Model, intents: &mut Vec<Intent>) {
    let mode = model.mode();
    let may = model.may_command();
    let width = (ui.available_width() - 2.0 * ui.spacing().item_spacing.x) / 3.0;
    let orders = [
        (
            "Enable",
            Intent::Enable,
            may && matches!(mode, Some(Mode::Idle)),
            "begin to render, with a soft start of half a second",
        ),
        (
            "Disable",
            Intent::Disable,
            model.is_online() && matches!(mode, Some(Mode::Active | Mode::Enabling)),
            "stop rendering, with a ramp of 50 ms",
        ),
        (
            "Reset",
            Intent::Reset,
            may && matches!(mode, Some(Mode::Fault | Mode::Estop)),
            "leave a fault or a stop, once its cause is gone",
        ),
    ];
    ui.horizontal(|ui| {
        for (name, intent, enabled, hint) in orders {
            let button = Button::new(name).min_size(vec2(width, 30.0));
            let response = ui.add_enabled(enabled, button).on_hover_text(hint);
            if response.on_disabled_hover_text(hint).clicked() {
                intents.push(intent);
            }
        }
    });
}

/// Draws bars that show how near the rig is to each of its limits.
fn meters(ui: &mut Ui, model: &Model, palette: Palette) {
    let Some(state) = &model.state else { return };
    let limits = &model.info.limits;
    let torque = DVec3::from(state.torque).length();
    let speed = DVec3::from(state.omega).length();
    meter(
        ui,
        palette,
        "Torque",
        share(torque, limits.torque),
        format!("{torque:.2} / {:.2} N m", limits.torque),
    );
    meter(ui, palette, "Speed", share(speed, limits.speed), format!("{speed:.2} / {} rad/s", limits.speed));
    meter(ui, palette, "Traction", state.traction, format!("{:.0} % of friction", 100.0 * state.traction));
    let slip = format!("{:.1} / {:.0} mm/s", 1e3 * state.slip, 1e3 * limits.slip);
    meter(ui, palette, "Slip", share(state.slip, limits.slip), slip);
    let lost = 1.0 - state.scale;
    let text =
        if lost > 0.0005 { format!("{:.0} % cut off by limits", 100.0 * lost) } else { "none".to_owned() };
    meter(ui, palette, "Saturation", if lost > 0.0005 { 1.0 } else { 0.0 }, text);
}

fn share(value: f64, limit: f64) -> f64 {
    if limit > 0.0 { value / limit } else { 0.0 }
}

/// Draws a bar with its name and the text `figures` next to it. `share` is the length of the bar: 1
/// means that a limit is reached.
fn meter(ui: &mut Ui, palette: Palette, name: &str, share: f64, figures: String) {
    let color = match share {
        s if s > 0.9 => palette.bad,
        s if s > 0.7 => palette.warn,
        _ => palette.good,
    };
    ui.horizontal(|ui| {
        column(ui, 70.0, name);
        let width = (ui.available_width() - 122.0).max(24.0);
        let (rect, response) = ui.allocate_exact_size(vec2(width, 10.0), egui::Sense::hover());
        response
            .widget_info(|| WidgetInfo::labeled(Role::ProgressIndicator, true, format!("{name}: {figures}")));
        let painter = ui.painter();
        painter.rect_filled(rect, 3.0, ui.visuals().extreme_bg_color);
        let full = rect.with_max_x(rect.left() + rect.width() * share.clamp(0.0, 1.0) as f32);
        painter.rect_filled(full, 3.0, color);
        painter.rect_stroke(rect, 3.0, (1.0, palette.weak.gamma_multiply(0.5)), egui::StrokeKind::Inside);
        ui.label(RichText::new(figures).size(12.0));
    });
}
