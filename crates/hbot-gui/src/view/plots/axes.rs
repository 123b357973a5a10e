//! The axes that all plots share, with their grid lines.

use eframe::egui::{Button, Rect, RichText, TextStyle, Ui, UiBuilder};
use egui_plot::{AxisHints, GridInput, GridMark, Plot};

use super::{PlotDesk, Which};
use crate::view::round_up;
use crate::view::theme::Palette;

/// Least width of the vertical axis, points. It holds the name of the axis and a number such as
/// -0.002.
const Y_AXIS_WIDTH: f32 = 62.0;
/// Height of the horizontal axis with its name and its numbers, in rows of text. The library leaves
/// a quarter of a row below the name.
const X_AXIS_ROWS: f32 = 2.25;

/// How far an axis reaches that the user lets begin anew.
const FITTED: f64 = f64::MIN_POSITIVE;

/// Returns how far an axis reaches below and above 0, so that `low` and `high` are on it. It only
/// grows, in steps of 1, 2 and 5, up to the limit: who looks at a curve keeps its scale in mind. A
/// torque begins with its limit, so that one sees how near it is.
pub(super) fn held(plots: &PlotDesk, axis: usize, ends: [f64; 2], limit: Option<f64>) -> [f64; 2] {
    let mut scale = plots.scale.get();
    if let Some(limit) = limit.filter(|_| axis == Which::Torque as usize && scale[axis] == [0.0; 2]) {
        scale[axis] = [limit; 2];
    }
    for (held, end) in scale[axis].iter_mut().zip([-ends[0], ends[1]]) {
        if end > *held * (1.0 + 1e-9) {
            *held = limit.filter(|limit| end <= *limit).unwrap_or(f64::INFINITY).min(round_up(end));
        }
    }
    plots.scale.set(scale);
    [-scale[axis][0], scale[axis][1]]
}

/// Draws the full scale onto the upper left corner of a plot. A click lets it begin anew.
pub(super) fn full_scale(ui: &mut Ui, frame: Rect, plots: &PlotDesk, [low, high]: [f64; 2], unit: &str) {
    let figures = |x: f64| format!("{x:.4}").trim_end_matches('0').trim_end_matches('.').to_owned();
    let text = format!("full scale {} to {} {unit}", figures(low), figures(high));
    let text = RichText::new(text).size(11.0);
    let mut over = ui.new_child(UiBuilder::new().max_rect(frame.shrink(3.0)));
    if over.add(Button::new(text).small()).on_hover_text("fit the axis to what is shown now").clicked() {
        plots.scale.set(plots.scale.get().map(|_| [FITTED; 2]));
    }
}

/// Creates a plot that follows the newest data. While the plots are paused, the user can drag and
/// zoom it instead.
pub(super) fn plot<'a>(ui: &Ui, id: &str, plots: &PlotDesk, y: &str) -> Plot<'a> {
    // The plot reserves the room that its axes needed when they were drawn last. It forgets this
    // when egui discards a drawing, so the axes always have their room.
    let x_axis_height = (X_AXIS_ROWS * ui.text_style_height(&TextStyle::Body)).ceil();
    plain(ui, id, plots.paused.is_some())
        // Leaves room for the right half of the last number on the horizontal axis.
        .width(ui.available_width() - 12.0)
        .y_axis_label(y)
        .custom_x_axes(vec![AxisHints::new_x().min_thickness(x_axis_height)])
        .y_axis_min_width(Y_AXIS_WIDTH)
        .x_grid_spacer(|input| round_steps(input, 9.0))
        .x_axis_formatter(|mark, _| figure(mark))
}

/// Creates a plot with the grid lines of all plots, which the user can drag and zoom if it is
/// `still`.
pub(crate) fn plain<'a>(ui: &Ui, id: &str, still: bool) -> Plot<'a> {
    // A pale grid does not compete with the curves.
    Plot::new(id)
        .grid_color(Palette::of(ui).grid.gamma_multiply(0.35))
        .y_grid_spacer(vertical)
        .y_axis_formatter(|mark, _| figure(mark))
        .allow_drag(still)
        .allow_zoom(still)
        .allow_scroll(still)
        .allow_boxed_zoom(still)
        .allow_axis_zoom_drag(still)
        .show_crosshair(false)
        .show_x(false)
        .show_y(false)
}

/// Returns the grid lines of the vertical axis. They are closer in a low plot, which would else
/// have none but that at 0.
fn vertical(input: GridInput) -> Vec<GridMark> {
    let close = GridInput { ..input };
    let apart = round_steps(input, 4.0);
    if apart.len() < 2 { round_steps(close, 2.0) } else { apart }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_low_plot_has_more_numbers_than_0() {
        let figures = |base_step_size| {
            let marks = vertical(GridInput { bounds: (-0.8, 0.8), base_step_size });
            marks.into_iter().map(figure).collect::<Vec<_>>()
        };
        assert_eq!(figures(0.2), ["-0.5", "0.0", "0.5"]);
        assert_eq!(figures(0.05), ["-0.8", "-0.6", "-0.4", "-0.2", "0.0", "0.2", "0.4", "0.6", "0.8"]);
    }

    #[test]
    fn grid_lines_have_round_numbers_with_their_decimals() {
        let marks = round_steps(GridInput { bounds: (-1.02, 1.02), base_step_size: 0.07 }, 4.0);
        let figures: Vec<_> = marks.into_iter().map(figure).collect();
        assert_eq!(figures, ["-1.0", "-0.5", "0.0", "0.5", "1.0"]);
        let marks = round_steps(GridInput { bounds: (-30.0, 0.0), base_step_size: 1.0 }, 9.0);
        assert_eq!(marks.into_iter().map(figure).collect::<Vec<_>>(), ["-30", "-20", "-10", "0"]);
    }
}
