//! Lines, arrows and texts in three dimensions.

use eframe::egui::{Align2, Color32, FontId, Painter, Pos2, Shape, Stroke};
use glam::DVec3;

use crate::view::camera::Projection;
use crate::view::theme::Palette;

/// Number of straight pieces with which a circle is drawn.
pub(super) const CIRCLE: usize = 48;

/// Draws objects in three dimensions. Lines that the sphere hides are dimmed.
pub(super) struct Drawing {
    pub(super) painter: Painter,
    pub(super) view: Projection,
    pub(super) palette: Palette,
}

impl Drawing {
    /// Draws either the hidden or the visible parts of a line.
    pub(super) fn runs(&self, line: &[DVec3], hidden: bool, stroke: Stroke) {
        for run in line.chunk_by(|a, b| self.view.is_hidden(*a) == self.view.is_hidden(*b)) {
            if self.view.is_hidden(run[0]) == hidden {
                self.painter.add(Shape::line(run.iter().map(|p| self.view.point(*p)).collect(), stroke));
            }
        }
    }

    pub(super) fn dashes(&self, line: &[DVec3], stroke: Stroke) {
        for run in line.chunk_by(|a, b| self.view.is_hidden(*a) == self.view.is_hidden(*b)) {
            let points: Vec<Pos2> = run.iter().map(|p| self.view.point(*p)).collect();
            let dim = if self.view.is_hidden(run[0]) { 0.3 } else { 1.0 };
            let stroke = Stroke::new(stroke.width, stroke.color.gamma_multiply(dim));
            self.painter.extend(Shape::dashed_line(&points, stroke, 5.0, 4.0));
        }
    }

    pub(super) fn arrow(&self, from: DVec3, to: DVec3, stroke: Stroke) {
        let line = segment(from, to);
        self.runs(&line, true, Stroke::new(stroke.width, stroke.color.gamma_multiply(0.3)));
        self.runs(&line, false, stroke);
        let dim = if self.view.is_hidden(to) { 0.35 } else { 1.0 };
        let size = 5.0 + 2.0 * stroke.width;
        self.head(self.view.point(from), self.view.point(to), size, stroke.color.gamma_multiply(dim));
    }

    pub(super) fn head(&self, from: Pos2, to: Pos2, size: f32, color: Color32) {
        let along = (to - from).normalized();
        // An arrow seen along its direction is drawn as a dot.
        if !along.is_finite() || (to - from).length() < 1.0 {
            self.painter.circle_filled(to, size / 2.0, color);
            return;
        }
        let base = to - along * size;
        let points =
            vec![to + along * 2.0, base + along.rot90() * size * 0.45, base - along.rot90() * size * 0.45];
        self.painter.add(Shape::convex_polygon(points, color, Stroke::NONE));
    }

    pub(super) fn text(&self, at: DVec3, text: &str, color: Color32) {
        let dim = if self.view.is_hidden(at) { 0.5 } else { 1.0 };
        let font = FontId::proportional(13.0);
        self.painter.text(self.view.point(at), Align2::CENTER_CENTER, text, font, color.gamma_multiply(dim));
    }
}

/// Returns the points of a closed circle on the unit sphere. Its plane passes through the centre
/// and is perpendicular to `normal`.
pub(super) fn circle(normal: DVec3) -> impl Iterator<Item = DVec3> {
    let across = normal.any_orthonormal_vector();
    let along = normal.cross(across);
    (0..=CIRCLE).map(move |k| {
        let (s, c) = (k as f64 / CIRCLE as f64 * std::f64::consts::TAU).sin_cos();
        across * c + along * s
    })
}

/// Returns the points that divide a straight line into short pieces, so that each piece can be
/// hidden or visible.
pub(super) fn segment(from: DVec3, to: DVec3) -> Vec<DVec3> {
    (0..=16).map(|k| from.lerp(to, f64::from(k) / 16.0)).collect()
}
