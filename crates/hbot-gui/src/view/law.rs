//! The torque of the running scene against angle, and where the sphere is on it now.

use std::f64::consts::PI;

use eframe::egui::{Role, Ui, WidgetInfo};
use egui_plot::{GridMark, Line, LineStyle, PlotBounds, Points as Dots};
use hbot_config::sweep::Points;
use hbot_core::rotation;

use super::plots::plain;
use super::pointer::{self, Reading};
use super::theme::{Palette, weak};
use super::{Desk, faded_unless_live};
use crate::model::Model;
use crate::model::sample::quaternion;

/// Height of the plot, points.
const HEIGHT: f32 = 130.0;
/// The vertical axis ends at this multiple of the rig's torque limit at most. Walls that are many
/// times as strong would flatten everything that the hand can feel.
const BEYOND: f64 = 1.25;
/// Least width of the vertical axis, points. It holds a number such as -0.02.
const Y_AXIS_WIDTH: f32 = 42.0;
/// The vertical axis extends at least this far, N m.
const LEAST: f64 = 0.002;

/// Draws the torque about n1, n2 and n3 against the angle about each, with a dot for each axis. All
/// is grey unless it is what the rig does now.
pub(crate) fn show(ui: &mut Ui, model: &Model, desk: &mut Desk) {
    desk.judged.take(&model.info);
    let Some(curves) = desk.judged.curves(&model.scene.shown()) else { return };
    ui.scope(|ui| {
        faded_unless_live(ui, model);
        draw(ui, model, curves);
    });
}

fn draw(ui: &mut Ui, model: &Model, curves: &[Points; 3]) {
    let palette = Palette::of(ui);
    let largest = curves.iter().flatten().fold(LEAST, |most, (_, torque)| most.max(torque.abs()));
    let limit = model.info.limits.torque;
    let end = 1.08 * if limit > 0.0 { largest.min(BEYOND * limit) } else { largest };
    // Curves that lie on each other are one line, which has none of the colours of the axes.
    let alike = are_alike(curves, 0.01 * end);
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 6.0;
        weak(ui, if alike { "N m, alike about" } else { "N m about" });
        for (k, color) in palette.axes.into_iter().enumerate() {
            ui.colored_label(color, format!("n{}", k + 1));
        }
        weak(ui, if model.is_fresh() { "(dots: now)" } else { "(dots: last heard)" });
    });
    let dots = dots(model);
    let degrees = |mark: GridMark, _: &_| format!("{:.0}\u{b0}", mark.value.to_degrees());
    let quarter = |_| {
        // The size of the step is that of a whole turn, so that the numbers are not dimmed.
        let mark = |k: i32| GridMark { value: f64::from(k) * PI / 2.0, step_size: 2.0 * PI };
        (-2..=2).map(mark).collect()
    };
    let plot = plain(ui, "law", false)
        .height(HEIGHT)
        // Leaves room for the right half of the last number on the horizontal axis.
        .width(ui.available_width() - 16.0)
        .auto_bounds(false)
        .x_grid_spacer(quarter)
        .x_axis_formatter(degrees)
        .y_axis_min_width(Y_AXIS_WIDTH);
    let shown = plot.show(ui, |plot| {
        plot.set_plot_bounds(PlotBounds::from_min_max([-PI, -end], [PI, end]));
        for (k, curve) in curves.iter().enumerate().take(if alike { 1 } else { 3 }) {
            let points: Vec<_> = curve.iter().map(|(x, y)| [*x, *y]).collect();
            let color = if alike { palette.text } else { palette.axes[k] };
            plot.line(Line::new(format!("n{}", k + 1), points).color(color).width(1.6));
        }
        if limit > 0.0 && end > limit {
            for limit in [-limit, limit] {
                let ends = vec![[-PI, limit], [PI, limit]];
                let line = Line::new("limit", ends).color(palette.warn).style(LineStyle::dashed_loose());
                plot.line(line.width(1.0));
            }
        }
        for (k, [x, y]) in dots.iter().flatten().enumerate() {
            let dot = Dots::new(format!("now n{}", k + 1), vec![[*x, y.clamp(-end, end)]]);
            plot.points(dot.color(palette.axes[k]).radius(4.0));
        }
    });
    pointer::show(ui, &shown.response, &shown.transform, |x| {
        let near =
            |curve: &Points| curve.iter().min_by(|a, b| (a.0 - x).abs().total_cmp(&(b.0 - x).abs())).copied();
        let of = |k: usize| Some((palette.axes[k], format!("n{}", k + 1), near(&curves[k])?.1));
        let values = (0..3).filter_map(of).collect();
        Some(Reading { x, place: format!("{:.0}\u{b0}", x.to_degrees()), values })
    });
    let text = "Torque of the scene against the angle about each axis";
    shown.response.widget_info(|| WidgetInfo::labeled(Role::Image, true, text));
}

/// Returns whether the curves of all axes differ by at most `by`, N m.
fn are_alike([first, others @ ..]: &[Points; 3], by: f64) -> bool {
    others.iter().all(|other| {
        first.len() == other.len() && first.iter().zip(other).all(|(a, b)| (a.1 - b.1).abs() <= by)
    })
}

/// Returns the angle about each axis from the scene's anchor, rad, and the torque about it, N m.
fn dots(model: &Model) -> Option<[[f64; 2]; 3]> {
    let state = model.state.as_ref()?;
    let anchor = model.placing().anchor(model.scene.laws());
    let turn = rotation::difference(quaternion(state.q), anchor);
    Some([0, 1, 2].map(|k| [turn[k], state.torque[k]]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::tests::{commanding, see_state};
    use glam::{DQuat, DVec3};
    use hbot_api::{Mode, StateEvent};
    use hbot_config::SceneFile;
    use hbot_config::sweep::Probe;
    use serde_json::json;

    /// A spring that is anchored where the sphere was: its torque is on the curve that the panel
    /// computes.
    #[test]
    fn the_dot_of_a_turned_sphere_is_on_the_curve_of_its_axis() {
        let mut model = commanding(true);
        model.scene.take(&json!({"name": "S", "effect": [
            {"id": "s", "kind": "spring", "stiffness": 2.0, "damping": 0.0, "anchor": "here"}]}));
        let array = |q: DQuat| [q.w, q.x, q.y, q.z];
        let anchor = DQuat::from_scaled_axis(DVec3::new(0.4, -1.0, 0.3));
        for (k, axis) in DVec3::AXES.into_iter().enumerate() {
            let q = DQuat::from_scaled_axis(axis * 0.3) * anchor;
            let state = StateEvent {
                tick: 200 + k as u64,
                t: 0.2 + k as f64,
                mode: Mode::Active,
                q: array(q),
                reference: Some(array(anchor)),
                torque: (axis * -0.6).to_array(),
                ..StateEvent::default()
            };
            see_state(&mut model, state);
            let dots = dots(&model).expect("a state");
            let curve =
                &Probe::new(&SceneFile::from_json(model.scene.to_json()).expect("legal")).about_axes(400)[k];
            let near = curve.iter().min_by(|a, b| (a.0 - 0.3).abs().total_cmp(&(b.0 - 0.3).abs()));
            let (_, torque) = near.expect("a point");
            // The nearest point of the curve is within 0.02 rad, at 2 N m/rad.
            assert!(
                (dots[k][0] - 0.3).abs() < 1e-12 && (dots[k][1] - torque).abs() < 0.05,
                "{dots:?} {near:?}"
            );
        }
    }
}
