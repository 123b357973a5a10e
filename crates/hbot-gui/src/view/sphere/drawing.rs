//! Lines, arrows and texts in three dimensions.

use std::cell::RefCell;
use std::sync::Arc;

use eframe::egui::{Color32, FontId, Galley, Painter, Pos2, Rect, Shape, Stroke, Ui, Vec2, vec2};
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
    /// Colour of the background.
    pub(super) ground: Color32,
    /// The names that are to be written, and the point of the picture about which each belongs.
    pub(super) names: RefCell<Vec<(Pos2, Arc<Galley>)>>,
    /// The places of names that have been written, and of marks that no name may cover.
    pub(super) taken: RefCell<Vec<Rect>>,
}

impl Drawing {
    pub(super) fn new(ui: &Ui, painter: &Painter, view: Projection) -> Self {
        let (palette, ground) = (Palette::of(ui), ui.visuals().panel_fill);
        Self {
            painter: painter.clone(),
            view,
            palette,
            ground,
            names: RefCell::default(),
            taken: RefCell::default(),
        }
    }

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

    /// Notes a name to be written at a place, `beyond` points farther from the sphere's centre.
    pub(super) fn text(&self, at: DVec3, text: &str, color: Color32, beyond: f32) {
        // A name can be read also where the sphere hides its place.
        let dim = if self.view.is_hidden(at) { 0.85 } else { 1.0 };
        let point = self.view.point(at);
        let out = point - self.view.point(DVec3::ZERO);
        // An axis along the line of sight has no direction in the picture.
        let out = if out.length() > 1.0 { out.normalized() } else { vec2(0.7, -0.7) };
        let color = color.gamma_multiply(dim);
        let galley = self.painter.layout_no_wrap(text.to_owned(), FontId::proportional(13.0), color);
        self.names.borrow_mut().push((point + beyond * out, galley));
    }

    /// Keeps names away from a point of the picture that has a mark of this size, points.
    pub(super) fn keep_free(&self, at: DVec3, size: f32) {
        self.taken.borrow_mut().push(Rect::from_center_size(self.view.point(at), Vec2::splat(size)));
    }

    /// Writes all names, each at its place or beside it if another name or a mark is there. They
    /// are the last to be drawn, so that no line crosses them.
    pub(super) fn write_names(&self) {
        let mut taken = self.taken.borrow_mut();
        for (at, galley) in self.names.borrow_mut().drain(..) {
            let place = free_place(&taken, self.painter.clip_rect().shrink(2.0), at, galley.size());
            self.painter.rect_filled(place.expand2(vec2(2.0, -1.0)), 4.0, self.ground.gamma_multiply(0.6));
            self.painter.galley(place.min, galley, Color32::PLACEHOLDER);
            taken.push(place);
        }
    }
}

/// Returns the place of a name about the point `at`, in the picture `room`, that covers none of the
/// places `taken`: there, or else below, above, beside or farther away. If all of them are taken,
/// it is the first.
fn free_place(taken: &[Rect], room: Rect, at: Pos2, size: Vec2) -> Rect {
    /// Steps in the size of the name.
    const ACROSS: [f32; 21] = [
        0.0, 0.0, 0.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.5, -1.5, 1.5, -1.5, 2.0, -2.0,
        2.0, -2.0,
    ];
    const DOWN: [f32; 21] = [
        0.0, 1.0, -1.0, 0.0, 0.0, 1.0, 1.0, -1.0, -1.0, 2.0, -2.0, 3.0, -3.0, 2.0, 2.0, -2.0, -2.0, 0.0, 0.0,
        1.0, -1.0,
    ];
    let inner = room.shrink2(0.5 * size);
    let at = at.max(inner.min).min(inner.max);
    let place = |(x, y): (f32, f32)| Rect::from_center_size(at + vec2(x, y) * size, size);
    let covers = |place: &Rect| taken.iter().any(|other| other.shrink(1.0).intersects(*place));
    let is_free = |place: &Rect| room.expand(0.5).contains_rect(*place) && !covers(place);
    ACROSS.into_iter().zip(DOWN).map(place).find(is_free).unwrap_or_else(|| place((0.0, 0.0)))
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

#[cfg(test)]
mod tests {
    use super::*;
    use eframe::egui::pos2;

    #[test]
    fn names_at_one_point_do_not_cover_each_other() {
        let mut taken = Vec::new();
        for width in [20.0, 40.0, 8.0, 60.0, 20.0, 30.0, 16.0, 16.0, 16.0] {
            let place = free_place(&taken, Rect::EVERYTHING, pos2(100.0, 100.0), vec2(width, 14.0));
            let clear = taken.iter().all(|other: &Rect| !other.shrink(1.0).intersects(place));
            assert!(clear, "{place:?} among {taken:?}");
            taken.push(place);
        }
        assert_eq!(taken[0].center(), pos2(100.0, 100.0), "the first stays where it is");
    }
}
