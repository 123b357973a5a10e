//! What a plot says at the pointer: the place on its horizontal axis, and the value of each curve
//! there.

use eframe::egui::{Color32, FontId, Rect, Response, StrokeKind, Ui, pos2, vec2};
use egui_plot::PlotTransform;

use super::theme::Palette;

/// Distance of the text from the pointer and of a value from its name, and of both from the edge,
/// points.
const APART: f32 = 12.0;
const MARGIN: f32 = 5.0;

/// The values of the curves of a plot at one place.
#[derive(Debug)]
pub(super) struct Reading {
    /// Where this is on the horizontal axis, as a number and in words.
    pub(super) x: f64,
    pub(super) place: String,
    /// Colour, name and value of each curve.
    pub(super) values: Vec<(Color32, String, f64)>,
}

/// Draws what `read` returns for the pointer's place on the horizontal axis, while the pointer is
/// over a plot.
pub(super) fn show(
    ui: &Ui,
    response: &Response,
    transform: &PlotTransform,
    read: impl FnOnce(f64) -> Option<Reading>,
) {
    let frame = *transform.frame();
    let Some(at) = response.hover_pos().filter(|at| frame.contains(*at)) else { return };
    let Some(reading) = read(transform.value_from_position(at).x) else { return };
    let palette = Palette::of(ui);
    let painter = ui.painter().with_clip_rect(frame);
    let x = transform.position_from_point_x(reading.x);
    painter.vline(x, frame.y_range(), (1.0, palette.weak));
    let font = FontId::proportional(12.0);
    let decimals = decimals(transform.bounds().height());
    let layout = |text: String, color| painter.layout_no_wrap(text, font.clone(), color);
    let mut rows = vec![(layout(reading.place, palette.text), None)];
    for (color, name, value) in reading.values {
        painter.circle_filled(pos2(x, transform.position_from_point_y(value)), 3.0, color);
        rows.push((layout(name, color), Some(layout(format!("{value:.decimals$}"), color))));
    }
    let height = rows[0].0.size().y;
    let width = rows.iter().fold(0.0_f32, |width, (name, value)| {
        width.max(name.size().x + value.as_ref().map_or(0.0, |value| APART + value.size().x))
    });
    let size = vec2(width, height * rows.len() as f32) + vec2(2.0 * MARGIN, 2.0 * MARGIN);
    // On the side that has room.
    let left = if x + APART + size.x < frame.right() { x + APART } else { x - APART - size.x };
    let top = at.y.min(frame.bottom() - size.y).max(frame.top());
    let place = Rect::from_min_size(pos2(left, top), size);
    painter.rect(place, 4.0, ui.visuals().panel_fill, (1.0, palette.weak), StrokeKind::Inside);
    let inner = place.shrink(MARGIN);
    for (k, (name, value)) in rows.into_iter().enumerate() {
        let y = inner.top() + height * k as f32;
        painter.galley(pos2(inner.left(), y), name, palette.text);
        if let Some(value) = value {
            painter.galley(pos2(inner.right() - value.size().x, y), value, palette.text);
        }
    }
}

/// Returns how many decimals tell about three digits on an axis of this height.
fn decimals(height: f64) -> usize {
    (2.0 - height.log10().floor()).clamp(0.0, 6.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_has_the_digits_that_its_axis_can_show() {
        assert_eq!([0.02, 0.6, 1.0, 60.0, 2000.0].map(decimals), [4, 3, 2, 1, 0]);
    }
}
