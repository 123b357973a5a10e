//! The stop button, and below it the keys that do the same.

use eframe::egui::{Align2, Button, Color32, Event, PointerButton, Role, Sense, Ui, WidgetInfo, vec2};
use glam::DVec3;
use hbot_api::Mode;

use super::state::TURNS;
use super::theme::{Palette, STOP, bold, named, stripes};
use crate::model::Model;
use crate::net::Intent;

/// Size of the text below the stop button, and of the second line in it, points.
const KEYS: f32 = 13.0;
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
    let (line, is_doubtful) = match stopped {
        Some(state) if DVec3::from(state.omega).length() > TURNS => {
            ("torque off, still turns".to_owned(), false)
        }
        Some(state) => (format!("stopped, {:.2} N m", DVec3::from(state.torque).length()), false),
        None if !model.is_online() => ("cannot reach the rig".to_owned(), true),
        None if model.quiet_for().is_some() => ("may not arrive".to_owned(), true),
        None if model.is_simulated() => (String::new(), false),
        None => ("Not an emergency switch".to_owned(), false),
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
    if is_doubtful {
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
    ui.painter().text(below, Align2::CENTER_BOTTOM, &line, bold(ui, REACH), ink);
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
    let (text, ground, ink) = if model.is_online() && model.awaits_stop() {
        ("STOP sent, not confirmed yet", Color32::TRANSPARENT, palette.warn)
    } else if has_keys(ui) {
        ("Esc or Space, anywhere in this window", Color32::TRANSPARENT, palette.weak)
    } else {
        ("Esc and Space are off: click here", palette.warn, ui.visuals().panel_fill)
    };
    // In one line also in a narrow window, and as high in all states, so that nothing moves.
    let (rect, label) = ui.allocate_exact_size(vec2(ui.available_width(), 18.0), Sense::hover());
    ui.painter().rect_filled(rect, 3.0, ground);
    ui.painter().text(rect.center(), Align2::CENTER_CENTER, text, bold(ui, KEYS), ink);
    label.widget_info(|| WidgetInfo::labeled(Role::Label, true, text));
}

/// Returns whether this window gets what is typed.
pub(super) fn has_keys(ui: &Ui) -> bool {
    ui.input(|input| input.focused)
}
