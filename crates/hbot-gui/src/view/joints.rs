//! The tab for the joints: angle, rate and torque of the steer and the drive of each wheel, with
//! the torque as a share of what the motor can give, and what the motor controllers report about
//! themselves.

use eframe::egui::{Grid, RichText, Role, Sense, StrokeKind, Ui, WidgetInfo, vec2};
use hbot_api::{JointInfo, JointState, WheelInfo};

use super::controllers;
use super::theme::{Palette, heading, weak};
use crate::model::Model;

pub(crate) fn show(ui: &mut Ui, model: &Model) {
    let Some(state) = &model.state else {
        weak(ui, "No state yet.");
        return;
    };
    if state.joints.is_empty() {
        weak(ui, "The server sends no joints.");
        return;
    }
    for (k, pair) in state.joints.chunks(2).enumerate() {
        let wheel = model.info.rig.wheels.get(k);
        heading(ui, wheel.and_then(|wheel| wheel.name.as_deref()).unwrap_or("Wheel"));
        Grid::new(("joints", k)).num_columns(4).spacing([10.0, 3.0]).show(ui, |ui| {
            for text in ["", "angle", "rate", "torque"] {
                ui.label(RichText::new(text).weak());
            }
            ui.end_row();
            for (joint, name) in pair.iter().zip(["steer", "drive"]) {
                row(ui, joint, name);
            }
        });
        for (joint, (name, limits)) in pair.iter().zip(motors(wheel)) {
            effort(ui, joint.torque, name, limits);
        }
        if let Some(pair) = model.controllers.chunks(2).nth(k) {
            ui.scope(|ui| controllers::show(ui, pair));
        }
        ui.add_space(6.0);
    }
    weak(
        ui,
        "The torque is what the motor was commanded to give. In a bar, the line is what it can hold without time limit.",
    );
}

/// Returns the names and the limits of a wheel's two joints.
fn motors(wheel: Option<&WheelInfo>) -> [(&'static str, JointInfo); 2] {
    wheel.map_or([("steer", JointInfo::default()), ("drive", JointInfo::default())], |wheel| {
        [("steer", wheel.steer), ("drive", wheel.drive)]
    })
}

fn row(ui: &mut Ui, joint: &JointState, name: &str) {
    ui.label(name);
    let number = |text: String| RichText::new(text).monospace().size(12.0);
    let degrees = joint.angle.to_degrees();
    ui.label(number(format!("{degrees:5.1}\u{b0}"))).on_hover_text(format!("{:.4} rad", joint.angle));
    ui.label(number(format!("{:+7.3} rad/s", joint.rate)));
    ui.label(number(format!("{:+7.4} N m", joint.torque)));
    ui.end_row();
}

/// Draws a bar from the middle to the share of the motor's peak torque that it gives.
fn effort(ui: &mut Ui, torque: f64, name: &str, limits: JointInfo) {
    if !(limits.peak > 0.0) {
        return;
    }
    let palette = Palette::of(ui);
    let share = (torque / limits.peak).clamp(-1.0, 1.0);
    let text = format!("{name}: {:.0} % of {} N m", 100.0 * share.abs(), limits.peak);
    ui.horizontal(|ui| {
        let (rect, response) =
            ui.allocate_exact_size(vec2((ui.available_width() - 150.0).max(40.0), 9.0), Sense::hover());
        response.widget_info(|| WidgetInfo::labeled(Role::ProgressIndicator, true, &text));
        let painter = ui.painter();
        painter.rect_filled(rect, 3.0, ui.visuals().extreme_bg_color);
        let middle = rect.center().x;
        let end = middle + 0.5 * rect.width() * share as f32;
        let bar = rect.with_min_x(middle.min(end)).with_max_x(middle.max(end));
        let lasting = limits.continuous / limits.peak;
        let color = match share.abs() {
            share if share > 0.97 => palette.bad,
            share if lasting > 0.0 && share > lasting => palette.warn,
            _ => palette.good,
        };
        painter.rect_filled(bar, 0.0, color);
        if lasting > 0.0 {
            for side in [-1.0, 1.0] {
                let x = middle + side * 0.5 * rect.width() * lasting as f32;
                painter.vline(x, rect.y_range(), (1.0, palette.weak));
            }
        }
        painter.rect_stroke(rect, 3.0, (1.0, palette.weak.gamma_multiply(0.5)), StrokeKind::Inside);
        ui.label(RichText::new(text).size(12.0));
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use hbot_api::{RigInfo, StateEvent};

    #[test]
    fn each_joint_has_its_angle_rate_torque_and_share_of_its_motor() {
        let mut model = Model::new("", "panel me@here", 1);
        let motor = |peak| JointInfo { peak, continuous: 0.5 * peak };
        let wheel = |name: &str| WheelInfo {
            name: Some(name.to_owned()),
            steer: motor(0.2),
            drive: motor(0.4),
            ..WheelInfo::default()
        };
        model.info.rig = RigInfo { wheels: vec![wheel("left"), wheel("right")], ..RigInfo::default() };
        let joint = |angle, rate, torque| JointState { angle, rate, torque };
        let joints =
            vec![joint(0.5, 1.25, 0.05), joint(1.0, -2.5, -0.1), joint(1.5, 0.0, 0.2), joint(2.0, 3.0, 0.4)];
        model.state = Some(StateEvent { joints, ..StateEvent::default() });
        let mut harness = egui_kittest::Harness::new_ui(move |ui| show(ui, &model));
        harness.run();
        let said = format!("{:?}", harness.root());
        for text in ["left", "right", "28.6\u{b0}", "-2.500 rad/s", "+0.0500 N m"] {
            assert!(said.contains(text), "{text}: {said}");
        }
        for text in ["steer: 25 % of 0.2 N m", "drive: 25 % of 0.4 N m", "drive: 100 % of 0.4 N m"] {
            assert!(said.contains(text), "{text}: {said}");
        }
    }
}
