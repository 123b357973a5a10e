//! The tab for the joints: angle, rate and torque of the steer and the drive of each wheel, with
//! the torque as a share of what the motor can give, and what the motor controllers report about
//! themselves.

use eframe::egui::{
    Align, Grid, Label, Layout, Response, RichText, Role, Sense, StrokeKind, Ui, WidgetInfo, vec2,
};
use hbot_api::{JointInfo, JointState, WheelInfo};

use super::controllers;
use super::theme::{Palette, cell, heading, weak};
use crate::model::Model;

/// Names of the columns with values and their hover texts, which also explain the units.
const COLUMNS: [(&str, &str); 3] = [
    ("angle", "in degrees; the hint of a value has it in radians"),
    ("rate, rad/s", "radians per second: how fast the joint turns, 1 rad is 57.3\u{b0}"),
    ("torque, N m", "newton metres: the torque of the motor, 1 N m is that of 1 N on a lever of 1 m"),
];

/// Widths of these columns, points.
const WIDTHS: [f32; 3] = [52.0, 68.0, 74.0];

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
            ui.label("");
            for ((text, hint), width) in COLUMNS.into_iter().zip(WIDTHS) {
                right(ui, width, RichText::new(text).weak()).on_hover_text(hint);
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
    if model.lacks_controllers {
        weak(ui, controllers::OLDER_SERVER);
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
    let [angle, rate, torque] = WIDTHS;
    right(ui, angle, number(format!("{degrees:.1}\u{b0}"))).on_hover_text(format!("{:.4} rad", joint.angle));
    right(ui, rate, number(format!("{:+.3}", joint.rate)));
    right(ui, torque, number(format!("{:+.4}", joint.torque)));
    ui.end_row();
}

/// Draws text at the right of a column of this width.
fn right(ui: &mut Ui, width: f32, text: RichText) -> Response {
    cell(ui, width, Layout::right_to_left(Align::Center), Label::new(text))
}

/// Draws a bar from the middle to the share of the motor's peak torque that it gives.
fn effort(ui: &mut Ui, torque: f64, name: &str, limits: JointInfo) {
    if !(limits.peak > 0.0) {
        return;
    }
    let palette = Palette::of(ui);
    let share = (torque / limits.peak).clamp(-1.0, 1.0);
    let lasting = limits.continuous / limits.peak;
    let is_long = lasting > 0.0 && share.abs() > lasting;
    let percent = 100.0 * share.abs();
    let text = if is_long {
        format!("{name}: {percent:.0} %, lasts at {:.0} %", 100.0 * lasting)
    } else {
        format!("{name}: {percent:.0} % of {} N m", limits.peak)
    };
    ui.horizontal(|ui| {
        let (rect, response) =
            ui.allocate_exact_size(vec2((ui.available_width() - 150.0).max(40.0), 9.0), Sense::hover());
        response.widget_info(|| WidgetInfo::labeled(Role::ProgressIndicator, true, &text));
        let painter = ui.painter();
        painter.rect_filled(rect, 3.0, ui.visuals().extreme_bg_color);
        let middle = rect.center().x;
        let end = middle + 0.5 * rect.width() * share as f32;
        let bar = rect.with_min_x(middle.min(end)).with_max_x(middle.max(end));
        let color = if is_long || share.abs() > 0.97 { palette.warn } else { palette.good };
        painter.rect_filled(bar, 0.0, color);
        if lasting > 0.0 {
            for side in [-1.0, 1.0] {
                let x = middle + side * 0.5 * rect.width() * lasting as f32;
                painter.vline(x, rect.y_range(), (2.0, palette.weak));
            }
        }
        painter.rect_stroke(rect, 3.0, (1.0, palette.weak.gamma_multiply(0.5)), StrokeKind::Inside);
        ui.label(RichText::new(text).size(12.0));
    });
}

#[cfg(test)]
mod tests {
    use eframe::egui::Color32;
    use egui_kittest::Harness;
    use hbot_api::{ControllerInfo, RigInfo, StateEvent};

    use super::*;
    use crate::view::painted::{self, filled, hint, lines, texts, vertical_lines};

    const NOTE: &str = "The torque is what the motor was commanded to give. In a bar, the line is what it can hold without time limit.";

    /// Returns what the tab for the joints shows of a rig with two wheels, line by line. `change`
    /// changes the model before it is drawn.
    fn shown(change: impl FnOnce(&mut Model)) -> Vec<String> {
        lines(&drawn(change))
    }

    /// Draws the tab for a rig with two wheels. `change` changes the model before.
    fn drawn(change: impl FnOnce(&mut Model)) -> Harness<'static> {
        let mut model = Model::new("", "panel me@here", 1);
        let motor = |peak| JointInfo { peak, continuous: 0.5 * peak };
        let wheel = |name: Option<&str>, steer, drive| WheelInfo {
            name: name.map(str::to_owned),
            steer: motor(steer),
            drive: motor(drive),
            ..WheelInfo::default()
        };
        let wheels = vec![wheel(Some("left"), 0.2, 0.4), wheel(None, 0.8, 1.6)];
        model.info.rig = RigInfo { wheels, ..RigInfo::default() };
        let joint = |angle, rate, torque| JointState { angle, rate, torque };
        let joints =
            vec![joint(0.5, 1.25, 0.05), joint(1.0, -2.5, -0.2), joint(-1.5, 0.0, 0.6), joint(2.0, 3.0, 1.6)];
        model.state = Some(StateEvent { joints, ..StateEvent::default() });
        change(&mut model);
        painted::drawn([330.0, 800.0], move |ui| show(ui, &model))
    }

    #[test]
    fn each_joint_has_its_angle_rate_torque_and_share_of_its_motor() {
        let expected = [
            "left",
            "angle | rate, rad/s | torque, N m",
            "steer | 28.6\u{b0} | +1.250 | +0.0500",
            "drive | 57.3\u{b0} | -2.500 | -0.2000",
            "steer: 25 % of 0.2 N m",
            "drive: 50 % of 0.4 N m",
            "Wheel",
            "angle | rate, rad/s | torque, N m",
            "steer | -85.9\u{b0} | +0.000 | +0.6000",
            "drive | 114.6\u{b0} | +3.000 | +1.6000",
            "steer: 75 %, lasts at 50 %",
            "drive: 100 %, lasts at 50 %",
            NOTE,
        ];
        assert_eq!(shown(|_| ()), expected);
        // A server that does not know the controllers.
        let of_older = shown(|model| model.lacks_controllers = true);
        let (last, rest) = expected.split_last().expect("lines");
        assert_eq!(of_older, [rest, &[controllers::OLDER_SERVER, *last]].concat());
    }

    #[test]
    fn what_is_missing_is_said_or_left_out() {
        assert_eq!(shown(|model| model.state = None), ["No state yet."]);
        let without_joints = |model: &mut Model| model.state.as_mut().expect("a state").joints.clear();
        assert_eq!(shown(without_joints), ["The server sends no joints."]);
        // A wheel has its name, the names of the columns and two joints. Without the limits of its
        // motors it has no bars.
        let shown = shown(|model| model.info.rig.wheels.clear());
        assert_eq!(shown.len(), 2 * 4 + 1, "{shown:?}");
        assert!(!shown.iter().any(|line| line.contains('%')), "{shown:?}");
    }

    #[test]
    fn the_hint_of_an_angle_is_the_angle_in_radians() {
        for (degrees, radians) in [("-85.9\u{b0}", "-1.5000 rad"), ("114.6\u{b0}", "2.0000 rad")] {
            assert_eq!(hint(&mut drawn(|_| ()), degrees), radians);
        }
    }

    #[test]
    fn each_column_says_what_its_unit_is() {
        for (column, unit) in
            [("angle", "degrees"), ("rate, rad/s", "radians per second"), ("torque, N m", "newton metres")]
        {
            let said = hint(&mut drawn(|_| ()), column);
            assert!(said.contains(unit), "{column}: {said}");
        }
    }

    #[test]
    fn a_bar_goes_from_the_middle_to_the_share_of_the_peak_torque() {
        let palette = Palette::of_theme(true, Color32::GRAY);
        for (torque, continuous, share, color) in [
            (0.2, 0.4, 0.25, palette.good),
            (-0.2, 0.4, -0.25, palette.good),
            (0.6, 0.4, 0.75, palette.warn),
            (-0.6, 0.4, -0.75, palette.warn),
            (0.79, 0.4, 0.9875, palette.warn),
            (-3.0, 0.4, -1.0, palette.warn),
            // The rig does not say what the motor can hold without time limit.
            (0.6, 0.0, 0.75, palette.good),
        ] {
            let limits = JointInfo { peak: 0.8, continuous };
            let mut harness = Harness::new_ui(move |ui| effort(ui, torque, "steer", limits));
            harness.run_steps(2);
            let rects = filled(&harness);
            let bar = rects.iter().position(|(_, it)| *it == color).expect("a bar of this colour");
            let (ground, bar) = (rects[bar - 1].0, rects[bar].0);
            let at = |share: f32| ground.center().x + 0.5 * ground.width() * share;
            let (left, right) = (at(0.0_f32.min(share)), at(0.0_f32.max(share)));
            // A hundredth of a point is the rounding of places in a window of 800 points.
            let near = |a: f32, b: f32| (a - b).abs() < 0.01;
            assert!(near(bar.left(), left) && near(bar.right(), right), "{torque} N m: {bar:?}");
            let is_long = continuous > 0.0 && share.abs() > 0.5;
            let said = texts(&harness).into_iter().any(|it| it.text.ends_with(" %, lasts at 50 %"));
            assert_eq!(said, is_long, "{torque} N m: why the bar has this colour");
            let lines = vertical_lines(&harness);
            if continuous > 0.0 {
                assert_eq!(lines.len(), 2);
                assert!(near(lines[0], at(-0.5)) && near(lines[1], at(0.5)), "{lines:?} in {ground:?}");
            } else {
                assert!(lines.is_empty(), "{lines:?}");
            }
        }
    }

    #[test]
    fn each_wheel_has_the_values_of_its_own_two_controllers() {
        let controller = |joint: u32| ControllerInfo {
            joint,
            firmware: Some(format!("firmware {joint}")),
            current_a: Some(0.125 * f64::from(joint)),
            temperature_c: Some(25.0 + f64::from(joint)),
            flags: if joint == 2 { vec!["silent".to_owned()] } else { Vec::new() },
            ..ControllerInfo::default()
        };
        let all = shown(|model| model.controllers = (0..4).map(controller).collect());
        let [head, left, right] = ["current | temp. | firmware", "left", "Wheel"];
        let of_controllers = [left, head, right].map(str::to_owned);
        let told = |line: &&String| {
            of_controllers.contains(line) || line.contains("firmware ") || line.contains(": silent")
        };
        let expected = [
            left,
            head,
            "steer | +0.000 A | 25.0 \u{b0}C | firmware 0",
            "drive | +0.125 A | 26.0 \u{b0}C | firmware 1",
            right,
            head,
            "steer | +0.250 A | 27.0 \u{b0}C | firmware 2",
            "drive | +0.375 A | 28.0 \u{b0}C | firmware 3",
            "steer: silent",
        ];
        assert_eq!(all.iter().filter(told).collect::<Vec<_>>(), expected);
        assert_eq!(all.len(), 20);
    }
}
