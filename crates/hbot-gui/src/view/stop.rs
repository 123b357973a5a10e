//! The stop button, and below it the keys that do the same.

use eframe::egui::{Align2, Button, Color32, Event, FontId, PointerButton, RichText, Ui, vec2};
use glam::DVec3;
use hbot_api::Mode;

use super::state::TURNS;
use super::theme::{Palette, STOP, bold, named, stripes};
use crate::model::Model;
use crate::net::Intent;

/// Size of the text below the stop button, and of the second line in it, points.
const KEYS: f32 = 12.0;
const REACH: f32 = 14.0;
/// Width of the striped edge of a button that may reach nobody, points.
const EDGE: f32 = 5.0;

/// Draws the stop button. The panel calls this in all its states, so that the button is always
/// present.
pub(crate) fn show(ui: &mut Ui, model: &Model, intents: &mut Vec<Intent>) {
    let palette = Palette::of(ui);
    // A stop that a state has confirmed leaves only the edge of the button.
    let stopped = model.state.as_ref().filter(|state| state.mode == Mode::Estop && model.is_certain());
    let (fill, ink) = match stopped {
        Some(_) => (Color32::TRANSPARENT, palette.text),
        None => (STOP, Color32::WHITE),
    };
    let line = match stopped {
        Some(state) if DVec3::from(state.omega).length() > TURNS => "torque off, still turns".to_owned(),
        Some(state) => format!("stopped, {:.2} N m", DVec3::from(state.torque).length()),
        None if !model.is_online() => "cannot reach the rig".to_owned(),
        None if model.quiet_for().is_some() => "may not arrive".to_owned(),
        None => String::new(),
    };
    let button = Button::new("").fill(fill).corner_radius(8);
    let size = vec2(ui.available_width(), 60.0);
    let add = |ui: &mut Ui| {
        let widgets = &mut ui.visuals_mut().widgets;
        for widget in [&mut widgets.inactive, &mut widgets.hovered] {
            widget.bg_stroke = (3.0, STOP).into();
        }
        ui.add_sized(size, button)
    };
    let response = named(ui.scope(add).inner, "Stop");
    if stopped.is_none() && !line.is_empty() {
        let rect = response.rect;
        for edge in [
            rect.with_max_y(rect.top() + EDGE),
            rect.with_min_y(rect.bottom() - EDGE),
            rect.with_max_x(rect.left() + EDGE),
            rect.with_min_x(rect.right() - EDGE),
        ] {
            ui.painter().with_clip_rect(edge).extend(stripes(edge, Color32::BLACK, 6.0, Color32::WHITE));
        }
    }
    let (up, size) = if line.is_empty() { (0.0, 30.0) } else { (9.0, 26.0) };
    let word = response.rect.center() - vec2(0.0, up);
    ui.painter().text(word, Align2::CENTER_CENTER, "STOP", bold(ui, size), ink);
    let below = response.rect.center_bottom() - vec2(0.0, 6.0);
    ui.painter().text(below, Align2::CENTER_BOTTOM, &line, FontId::proportional(REACH), ink);
    ui.ctx().accesskit_node_builder(response.id, |node| node.set_description(line));
    // As the pointer goes down: a press that slides off the button stops the rig too, and one that
    // ends before the next frame. A click without a pointer is that of a key.
    let is_press = |event: &Event| {
        matches!(event, Event::PointerButton { pos, button: PointerButton::Primary, pressed: true, .. }
            if response.rect.contains(*pos))
    };
    let [pressed, released] =
        ui.input(|input| [input.events.iter().any(is_press), input.pointer.any_released()]);
    if pressed || response.clicked() && !released {
        intents.push(Intent::Stop);
    }
    let (text, color, is_loud) = if model.is_online() && model.awaits_stop() {
        ("STOP sent, not confirmed yet", palette.warn, true)
    } else if !has_keys(ui) {
        ("Esc and Space are off: click in this window", palette.text, true)
    } else if model.is_simulated() {
        ("Esc or Space, anywhere in this window", palette.weak, false)
    } else {
        ("Esc or Space stops. Not an emergency switch.", palette.weak, false)
    };
    let font = if is_loud { bold(ui, KEYS) } else { FontId::proportional(KEYS) };
    // In one line also in a narrow window, so that nothing moves.
    ui.vertical_centered(|ui| ui.label(RichText::new(text).font(font).color(color)));
}

/// Returns whether this window gets what is typed.
pub(super) fn has_keys(ui: &Ui) -> bool {
    ui.input(|input| input.focused)
}
