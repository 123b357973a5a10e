//! The picture of the sphere in three dimensions: its orientation, the reference, the wheels, the
//! torque, and what the hand meets.

mod drawing;
mod felt;
mod hand;
mod objects;

use eframe::egui::{self, Align2, FontId, Painter, Role, Sense, Ui, WidgetInfo, pos2, vec2};
use glam::{DQuat, DVec3};
use hbot_api::StateEvent;
use hbot_core::rotation;

use super::Desk;
use super::theme::Palette;
use crate::model::Model;
use crate::model::sample::quaternion;
use crate::net::Intent;
use crate::shape::{self, Shapes};
use drawing::Drawing;
pub(crate) use hand::Held;
use hand::Push;

/// Everything in the picture is drawn within this distance from the sphere's centre, in units of
/// the sphere's radius.
const REACH: f64 = 1.5;
/// Height of the text below the picture of the sphere, points.
const READOUTS: f32 = 50.0;
/// A picture of at most this width has the text on the hand below the sphere, points.
const NARROW: f32 = 500.0;
/// Length of the arrow that shows the torque, in units of the sphere's radius. The first number is
/// the least length, so that the direction is always visible. The second is added to it at the
/// rig's torque limit.
const TORQUE_LENGTH: [f64; 2] = [0.2, 0.32];
/// Length of the arrow that shows the force on the hand, in the same way.
const PUSH_LENGTH: [f64; 2] = [0.15, 0.6];

/// Draws the picture of the sphere into the room that is left in the window.
pub(crate) fn show(ui: &mut Ui, model: &Model, desk: &mut Desk, intents: &mut Vec<Intent>) {
    let (response, painter) = ui.allocate_painter(ui.available_size(), Sense::click_and_drag());
    let rect = response.rect;
    let narrow = rect.width() <= NARROW;
    let readouts_height = if narrow { READOUTS + 18.0 } else { READOUTS };
    let room = rect.with_max_y(rect.bottom() - readouts_height);
    let middle = room.center();
    let radius = (room.width().min(room.height()) / 2.0 / REACH as f32).max(10.0);
    let view = desk.camera.onto(middle, radius);
    hand::Control { ui, response: &response, model, desk, view, intents }.act();
    let state = model.state.as_ref();
    let q = state.map_or(DQuat::IDENTITY, |state| quaternion(state.q));
    let shapes = state.map_or_else(Shapes::default, |_| {
        shape::shapes(model.scene.laws(), &model.placing(), model.info.limits.torque)
    });
    response.widget_info(|| WidgetInfo::labeled(Role::Canvas, true, describe(state, &shapes)));

    let draw = Drawing::new(ui, &painter, desk.camera.onto(middle, radius));
    let palette = draw.palette;
    draw.sphere(q);
    if let Some(reference) = state.and_then(|state| state.reference) {
        draw.ghost(quaternion(reference));
    }
    draw.axes(q);
    draw.felt(&shapes.pieces);
    if let Some(state) = state {
        draw.wheels(&model.info.rig, &state.joints);
        draw.torque(state.torque.into(), model.info.limits.torque);
    }
    let sphere = model.info.rig.sphere.radius;
    let push = desk.hand.as_ref().zip(state).map(|(held, state)| {
        let push = held.push(q, state.torque.into(), sphere);
        draw.hand(held, &push, model.info.limits.torque, sphere);
        push
    });
    draw.write_names();
    let corner = desk.camera.unzoomed().onto(rect.right_top() + vec2(-50.0, 52.0), 26.0);
    Drawing::new(ui, &painter, corner).corner();
    let is_certain = model.is_certain();
    readouts(&draw.painter, rect, (state, is_certain), palette);
    legend(&draw.painter, rect, (state, is_certain, push), &shapes, palette);
    if !narrow {
        let at = rect.right_bottom() - vec2(8.0, 6.0);
        let hint = if model.has_hand() {
            "drag the sphere to turn it; with Shift or beside it, the view"
        } else {
            "drag to turn the view, double click to turn it back"
        };
        draw.painter.text(at, Align2::RIGHT_BOTTOM, hint, FontId::proportional(13.0), palette.weak);
    }
}

/// Describes the picture of the sphere in words, for screen readers.
fn describe(state: Option<&StateEvent>, shapes: &Shapes) -> String {
    let Some(state) = state else { return "Sphere: no state yet".to_owned() };
    let [w, x, y, z] = state.q;
    let torque = DVec3::from(state.torque).length();
    let away = state.reference.map_or(String::new(), |reference| {
        format!(", {:.3} rad from its reference", quaternion(reference).angle_between(quaternion(state.q)))
    });
    let meets = match shapes.met.as_slice() {
        [] => String::new(),
        met => format!("; the hand meets {}", met.join(", ")),
    };
    format!("Sphere: orientation {w:.3} {x:.3} {y:.3} {z:.3}, torque {torque:.3} N m{away}{meets}")
}

/// Writes the orientation in numbers, in the lower left corner.
fn readouts(
    painter: &Painter,
    rect: egui::Rect,
    (state, is_certain): (Option<&StateEvent>, bool),
    palette: Palette,
) {
    let Some(state) = state else { return };
    let q = quaternion(state.q);
    let turn = rotation::shortest(q).to_scaled_axis();
    let lines = [
        format!("q from N     {:6.3} {:6.3} {:6.3} {:6.3}", q.w, q.x, q.y, q.z),
        format!("turn from N  {:7.4} {:7.4} {:7.4} rad", turn.x, turn.y, turn.z),
        format!("angle from N {:7.4} rad, {:.1}\u{b0}", turn.length(), turn.length().to_degrees()),
    ];
    let last = (!is_certain).then(|| "last heard".to_owned());
    let lines: Vec<String> = last.into_iter().chain(lines).collect();
    let font = FontId::monospace(12.0);
    for (k, line) in lines.iter().rev().enumerate() {
        let at = pos2(rect.left() + 8.0, rect.bottom() - 6.0 - 15.0 * k as f32);
        painter.text(at, Align2::LEFT_BOTTOM, line, font.clone(), palette.weak);
    }
}

/// Writes what the colours stand for, in the upper left corner.
fn legend(
    painter: &Painter,
    rect: egui::Rect,
    (state, is_certain, push): (Option<&StateEvent>, bool, Option<Push>),
    shapes: &Shapes,
    palette: Palette,
) {
    let Some(state) = state else { return };
    let torque = DVec3::from(state.torque).length();
    let last = if is_certain { "" } else { "last " };
    let mut lines = vec![(palette.torque, format!("{last}torque {torque:.3} N m"))];
    lines.push(match state.reference {
        Some(_) => (palette.ghost, "reference, dashed".to_owned()),
        None => (palette.weak, "no reference".to_owned()),
    });
    if let Some(push) = push {
        let text =
            format!("the scene pushes your hand: {:.2} N, {:.3} N m", push.force.length(), push.torque);
        if rect.width() <= NARROW {
            let at = rect.left_bottom() + vec2(8.0, -READOUTS - 2.0);
            painter.text(at, Align2::LEFT_BOTTOM, text, FontId::proportional(13.0), palette.hand);
        } else {
            lines.push((palette.hand, text));
        }
    }
    if !shapes.met.is_empty() {
        lines.push((palette.felt, format!("meets {}", shapes.met.join(", "))));
    }
    if shapes.unplaced > 0 {
        // The server tells the place of the first reference alone.
        let text = format!("not drawn: {} placed before this panel came", shapes.unplaced);
        lines.push((palette.weak, text));
    }
    let mut at = rect.left_top() + vec2(8.0, 6.0);
    for (color, text) in lines {
        painter.text(at, Align2::LEFT_TOP, text, FontId::proportional(13.0), color);
        at.y += 16.0;
    }
}
