//! The plot of torque against deflection, with the stiffness and damping fitted to it.

use std::sync::Arc;

use eframe::egui::{Role, Ui, WidgetInfo};
use egui_plot::{CoordinatesFormatter, Corner, Line, PlotPoint, Points};
use glam::DVec3;
use hbot_api::{Mode, StateEvent};

use super::axes::{full_scale, held, plot};
use super::{PlotDesk, Which};
use crate::model::sample::{deflection, zero};
use crate::model::{Fit, History, Model, fit};
use crate::view::theme::{Palette, weak};

/// Largest number of points per axis in the plot of torque against deflection.
const CLOUD: usize = 400;

/// Draws the samples since the last change of the scene, because a fit over two scenes describes
/// neither.
pub(super) fn show(ui: &mut Ui, model: &Model, history: &History, plots: &PlotDesk) {
    let palette = Palette::of(ui);
    let newest = history.newest().map_or(0.0, |newest| newest.t);
    // While the plots are paused, a later change does not concern them.
    let changed = model.marks.changed().filter(|(mark, _)| mark.t <= newest);
    let seconds = changed.map_or(plots.window, |(_, until)| plots.window.min(newest - until));
    let samples = history.last(seconds);
    let fits = fit(samples.clone().map(Arc::as_ref), plots.zero);
    let clouds: [Vec<[f64; 2]>; 3] = std::array::from_fn(|k| {
        let point = |sample: &Arc<StateEvent>| {
            let zero = zero(sample, plots.zero);
            [deflection(sample, zero)[k], (zero.conjugate() * DVec3::from(sample.torque))[k]]
        };
        let step = samples.len().div_ceil(CLOUD).max(1);
        let active = samples.clone().step_by(step).filter(|sample| sample.mode == Mode::Active);
        active.map(point).collect()
    });
    ui.horizontal_wrapped(|ui| {
        told(ui, palette, &fits);
        if let Some((mark, _)) = changed.filter(|(mark, _)| newest - mark.t < plots.window) {
            weak(ui, format!("since {}, {:.1} s ago", mark.text, newest - mark.t));
        }
    });
    let ends = |part: usize| {
        let parts = clouds.iter().flatten().map(|point| point[part]);
        parts.fold([-0.002, 0.002], |[low, high]: [f64; 2], x| [low.min(x), high.max(x)])
    };
    let across = held(plots, Which::ALL.len(), ends(0), None);
    let up = held(plots, Which::Stiffness as usize, ends(1), Some(model.info.limits.torque));
    let at_pointer = |at: &PlotPoint, _: &_| format!("{:.4} rad, {:.3} N m", at.x, at.y);
    let shown = plot(ui, "deflection", plots, "torque, N m")
        .x_axis_label("deflection, rad")
        .include_x(across[0])
        .include_x(across[1])
        .include_y(up[0])
        .include_y(up[1])
        .show_crosshair(true)
        .coordinates_formatter(Corner::LeftBottom, CoordinatesFormatter::new(at_pointer))
        .show(ui, |plot| {
            for (k, cloud) in clouds.into_iter().enumerate() {
                let color = palette.axes[k];
                plot.points(Points::new(format!("n{}", k + 1), cloud).color(color).radius(1.6));
                if let Some(Fit { stiffness, offset, range, .. }) = fits[k].filter(Fit::is_one_spring) {
                    let ends: Vec<[f64; 2]> = range.iter().map(|x| [*x, offset - stiffness * x]).collect();
                    plot.line(Line::new(format!("n{}", k + 1), ends).color(color).width(2.5));
                }
            }
        });
    shown
        .response
        .widget_info(|| WidgetInfo::labeled(Role::Image, true, "Plot of torque against deflection"));
    full_scale(ui, *shown.transform.frame(), plots, up, "N m");
}

/// Writes the fitted stiffness and damping of each axis, or that the samples are not those of a
/// spring.
fn told(ui: &mut Ui, palette: Palette, fits: &[Option<Fit>; 3]) {
    if fits.iter().all(Option::is_none) {
        let text = "Turn the sphere by some hundredths of a radian, active and within its limits, to see its stiffness.";
        weak(ui, text);
        return;
    }
    weak(ui, "fitted, N m/rad (N m s/rad):");
    for (k, fit) in fits.iter().enumerate() {
        let Some(fit) = fit else { continue };
        let axis = k + 1;
        let text = if fit.is_one_spring() {
            format!("n{axis} {:.3} ({:.4})", fit.stiffness, fit.damping)
        } else {
            format!("n{axis} is not one spring (off by {:.3} N m)", fit.residual)
        };
        ui.colored_label(palette.axes[k], text);
    }
}
