//! Plots of torque and angle against time, and of torque against deflection with the fitted
//! stiffness.

use eframe::egui::{self, ComboBox, Role, Ui, WidgetInfo};
use egui_plot::{Corner, GridInput, GridMark, HLine, Legend, Line, LineStyle, Plot, Points};
use glam::DQuat;

use super::round_up;
use super::theme::{Palette, named, weak};
use super::{Act, Desk};
use crate::model::{Fit, History, Model, PlotSample, SPAN_S, fit, thinned};
use crate::net::Intent;

/// Largest number of points per axis in the plot of torque against deflection.
const CLOUD: usize = 400;

/// The vertical axis of a plot extends at least this far above and below zero, N m or rad. Smaller
/// noise therefore does not fill the plot.
const LEAST_SPAN: f64 = 0.02;

/// The quantity that a plot shows, such as the torque.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Which {
    #[default]
    Torque,
    Angle,
    Stiffness,
}

impl Which {
    const ALL: [(Self, &str); 3] =
        [(Self::Torque, "Torque"), (Self::Angle, "Angle"), (Self::Stiffness, "Torque / deflection")];
}

/// The settings of the plots that the user can change.
#[derive(Debug)]
pub(crate) struct PlotDesk {
    which: Which,
    /// Length of the time that the plots show, s.
    window: f64,
    /// The samples that are shown while the user has paused the plots.
    paused: Option<Box<History>>,
    /// Orientation from which the sphere's deflection is measured, if the user has chosen one.
    zero: Option<DQuat>,
}

impl Default for PlotDesk {
    fn default() -> Self {
        Self { which: Which::Torque, window: 10.0, paused: None, zero: None }
    }
}

pub(crate) fn show(ui: &mut Ui, model: &Model, desk: &mut Desk, acts: &mut Vec<Act>) {
    controls(ui, model, &mut desk.plots, acts);
    super::faded_unless_live(ui, model);
    let plots = &desk.plots;
    let history = plots.paused.as_deref().unwrap_or(&model.history);
    let palette = Palette::of(ui);
    match plots.which {
        Which::Torque => {
            let limit = (model.info.limits.torque > 0.0).then_some(model.info.limits.torque);
            against_time(ui, palette, history, plots, "torque, N m", limit, |sample| {
                sample.torque.to_array()
            });
        }
        Which::Angle => {
            let chosen = plots.zero;
            let values = move |sample: &PlotSample| sample.deflection(sample.zero(chosen)).to_array();
            against_time(ui, palette, history, plots, "rotation vector, rad", None, values);
        }
        Which::Stiffness => against_deflection(ui, palette, history, plots),
    }
}

fn controls(ui: &mut Ui, model: &Model, plots: &mut PlotDesk, acts: &mut Vec<Act>) {
    ui.horizontal_wrapped(|ui| {
        for (which, name) in Which::ALL {
            ui.selectable_value(&mut plots.which, which, name);
        }
        ui.separator();
        let window =
            ComboBox::from_id_salt("window").selected_text(format!("{} s", plots.window)).width(52.0);
        let response = window.show_ui(ui, |ui| {
            for seconds in [2.0, 5.0, 10.0, SPAN_S] {
                ui.selectable_value(&mut plots.window, seconds, format!("{seconds} s"));
            }
        });
        named(response.response, "Time shown");
        let paused = plots.paused.is_some();
        if ui.button(if paused { "Go on" } else { "Pause" }).clicked() {
            plots.paused = if paused { None } else { Some(Box::new(model.history.clone())) };
        }
        let export = ui
            .button("Export CSV")
            .on_hover_text("writes the last 30 s to a file in the folder the panel runs in");
        if export.clicked() {
            let history = plots.paused.as_deref().unwrap_or(&model.history);
            acts.push(Act::Export(history.last(SPAN_S).copied().collect()));
        }
        let rates =
            ComboBox::from_id_salt("rate").selected_text(format!("{}/s", model.samples_per_s)).width(64.0);
        let response = rates.show_ui(ui, |ui| {
            for n in [60, 120, 250, 1000, 10_000] {
                if ui.selectable_label(model.samples_per_s == n, format!("{n}/s")).clicked() {
                    acts.push(Act::Ask(Intent::Samples(n)));
                }
            }
        });
        named(response.response, "Samples a second")
            .on_hover_text("states that the server sends; at most one a tick");
        if plots.which != Which::Torque {
            zero_control(ui, model, plots);
        }
    });
}

fn zero_control(ui: &mut Ui, model: &Model, plots: &mut PlotDesk) {
    let hint = "measures deflection from the orientation of this moment, wherever the scene's reference is";
    if plots.zero.is_none() {
        let newest = model.history.newest().map(|sample| sample.q);
        if ui.add_enabled(newest.is_some(), egui::Button::new("Zero here")).on_hover_text(hint).clicked() {
            plots.zero = newest;
        }
    } else if ui
        .button("Zero at reference")
        .on_hover_text("measures from the scene's reference again")
        .clicked()
    {
        plots.zero = None;
    }
}

/// Creates a plot that follows the newest data. While the plots are paused, the user can drag and
/// zoom it instead.
fn plot<'a>(ui: &Ui, id: &str, plots: &PlotDesk, y: &str) -> Plot<'a> {
    let still = plots.paused.is_some();
    Plot::new(id)
        // Leaves room for the right half of the last number on the horizontal axis.
        .width(ui.available_width() - 12.0)
        .legend(Legend::default().position(Corner::LeftTop))
        .y_axis_label(y)
        .y_axis_min_width(44.0)
        .x_grid_spacer(|input| round_steps(input, 9.0))
        .y_grid_spacer(|input| round_steps(input, 4.0))
        .x_axis_formatter(|mark, _| figure(mark))
        .y_axis_formatter(|mark, _| figure(mark))
        .allow_drag(still)
        .allow_zoom(still)
        .allow_scroll(still)
        .allow_boxed_zoom(still)
        .allow_axis_zoom_drag(still)
}

/// Returns the grid lines of a plot. Their distance is a round number (1, 2 or 5 times a power of
/// ten) and at least `apart` times the smallest distance that the plot proposes, so that each line
/// has room for its number.
fn round_steps(input: GridInput, apart: f64) -> Vec<GridMark> {
    let (low, high) = input.bounds;
    let step_size = round_up(apart * input.base_step_size);
    if !(step_size.is_normal() && step_size > 0.0) {
        return Vec::new();
    }
    let (first, last) = ((low / step_size).ceil() as i64, (high / step_size).floor() as i64);
    (first..=last.min(first + 50)).map(|k| GridMark { value: k as f64 * step_size, step_size }).collect()
}

/// Formats the number next to a grid line, with as many decimals as the distance between lines
/// needs.
fn figure(mark: GridMark) -> String {
    let decimals = (-mark.step_size.log10() - 1e-9).ceil().clamp(0.0, 9.0) as usize;
    format!("{:.decimals$}", mark.value)
}

fn against_time(
    ui: &mut Ui,
    palette: Palette,
    history: &History,
    plots: &PlotDesk,
    y: &str,
    limit: Option<f64>,
    values: impl Fn(&PlotSample) -> [f64; 3],
) {
    let Some(newest) = history.newest() else {
        weak(ui, "No samples yet.");
        return;
    };
    let now = newest.t;
    let columns = ui.available_width() as usize;
    let lines: [Vec<[f64; 2]>; 3] = std::array::from_fn(|k| {
        thinned(history.last(plots.window).map(|sample| [sample.t - now, values(sample)[k]]), columns)
    });
    let most = lines.iter().flatten().fold(0.0_f64, |most, point| most.max(point[1].abs()));
    let shown = plot(ui, y, plots, y)
        .include_x(-plots.window)
        .include_x(0.0)
        .include_y(-LEAST_SPAN)
        .include_y(LEAST_SPAN)
        .x_axis_label("time before now, s")
        .show(ui, |plot| {
            for (k, points) in lines.into_iter().enumerate() {
                plot.line(Line::new(format!("n{}", k + 1), points).color(palette.axes[k]).width(1.6));
            }
            // Show the limit only if a curve is near it. Otherwise it would flatten the curves.
            for limit in
                limit.filter(|limit| most > 0.6 * limit).into_iter().flat_map(|limit| [limit, -limit])
            {
                plot.hline(HLine::new("limit", limit).color(palette.warn).style(LineStyle::dashed_loose()));
            }
        });
    let points = history.last(plots.window).len();
    shown
        .response
        .widget_info(|| WidgetInfo::labeled(Role::Image, true, format!("Plot of {y} over {points} samples")));
}

fn against_deflection(ui: &mut Ui, palette: Palette, history: &History, plots: &PlotDesk) {
    let samples = history.last(plots.window);
    let fits = fit(samples.clone(), plots.zero);
    let clouds: [Vec<[f64; 2]>; 3] = std::array::from_fn(|k| {
        let point = |sample: &PlotSample| {
            let zero = sample.zero(plots.zero);
            [sample.deflection(zero)[k], (zero.conjugate() * sample.torque)[k]]
        };
        let step = samples.len().div_ceil(CLOUD).max(1);
        let active = samples.clone().step_by(step).filter(|sample| sample.active);
        active.map(point).collect()
    });
    ui.horizontal_wrapped(|ui| {
        if fits.iter().all(Option::is_none) {
            weak(ui, "Turn the sphere by some hundredths of a radian, active and within its limits, to see its stiffness.");
        }
        if fits.iter().any(Option::is_some) {
            weak(ui, "fitted, N m/rad (N m s/rad):");
        }
        for (k, fit) in fits.iter().enumerate() {
            let Some(Fit { stiffness, damping, .. }) = fit else { continue };
            let text = format!("n{} {stiffness:.3} ({damping:.4})", k + 1);
            ui.colored_label(palette.axes[k], text);
        }
    });
    let shown =
        plot(ui, "deflection", plots, "torque, N m").x_axis_label("deflection, rad").show(ui, |plot| {
            for (k, cloud) in clouds.into_iter().enumerate() {
                let color = palette.axes[k];
                plot.points(Points::new(format!("n{}", k + 1), cloud).color(color).radius(1.6));
                if let Some(Fit { stiffness, offset, range, .. }) = fits[k] {
                    let ends: Vec<[f64; 2]> = range.iter().map(|x| [*x, offset - stiffness * x]).collect();
                    plot.line(Line::new(format!("n{}", k + 1), ends).color(color).width(2.5));
                }
            }
        });
    shown
        .response
        .widget_info(|| WidgetInfo::labeled(Role::Image, true, "Plot of torque against deflection"));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grid_lines_have_round_numbers_with_their_decimals() {
        let marks = round_steps(GridInput { bounds: (-1.02, 1.02), base_step_size: 0.07 }, 4.0);
        let figures: Vec<_> = marks.into_iter().map(figure).collect();
        assert_eq!(figures, ["-1.0", "-0.5", "0.0", "0.5", "1.0"]);
        let marks = round_steps(GridInput { bounds: (-30.0, 0.0), base_step_size: 1.0 }, 9.0);
        assert_eq!(marks.into_iter().map(figure).collect::<Vec<_>>(), ["-30", "-20", "-10", "0"]);
    }
}
