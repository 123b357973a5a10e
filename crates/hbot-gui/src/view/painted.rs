//! What a frame has painted, for tests: each text with its place and colour, rectangles,
//! their rims, and vertical lines.

use eframe::egui::epaint::{ClippedShape, Shape, TextShape};
use eframe::egui::{Color32, Rect, Stroke, Ui};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;

/// Two texts whose upper edges differ by less than this are in one line, points.
const SAME_LINE: f32 = 7.0;

/// A text in the window.
#[derive(Clone, Debug)]
pub(super) struct Text {
    pub(super) text: String,
    pub(super) color: Color32,
    pub(super) place: Rect,
    /// The size of its smallest letters, points.
    pub(super) size: f32,
    /// The part of the window in which the text is visible.
    clip: Rect,
    /// Whether the text is too long for its place and ends in dots.
    shortened: bool,
}

impl Text {
    /// Returns whether people can read the whole text, after they have scrolled to it.
    pub(super) fn is_whole(&self) -> bool {
        // Half a point for rounding.
        let (left, right) = (self.clip.left() - 0.5, self.clip.right() + 0.5);
        !self.shortened && self.place.left() >= left && self.place.right() <= right
    }

    /// Returns whether the visible parts of two horizontal texts cover each other.
    pub(super) fn overlaps(&self, other: &Self) -> bool {
        // Half a point for rounding.
        let both = self.place.intersect(self.clip).shrink(0.5).intersect(other.place.intersect(other.clip));
        both.is_positive()
    }
}

/// Returns the texts that the last frame has painted.
pub(super) fn texts<S>(harness: &Harness<'_, S>) -> Vec<Text> {
    each(harness, |shape, clip| match shape {
        Shape::Text(shape) if !shape.galley.text().is_empty() => Some(text(shape, clip)),
        _ => None,
    })
}

/// Returns the rectangles that the last frame has filled, with their colours.
pub(super) fn filled<S>(harness: &Harness<'_, S>) -> Vec<(Rect, Color32)> {
    each(harness, |shape, _| match shape {
        Shape::Rect(it) if it.fill != Color32::TRANSPARENT => Some((it.rect, it.fill)),
        _ => None,
    })
}

/// Returns the rectangles that the last frame has given a rim, with the rim.
pub(super) fn rims<S>(harness: &Harness<'_, S>) -> Vec<(Rect, Stroke)> {
    each(harness, |shape, _| match shape {
        Shape::Rect(it) if !it.stroke.is_empty() => Some((it.rect, it.stroke)),
        _ => None,
    })
}

/// Returns the polygons that the last frame has filled with this colour.
pub(super) fn polygons<S>(harness: &Harness<'_, S>, color: Color32) -> Vec<Rect> {
    each(harness, |shape, _| match shape {
        Shape::Path(it) if it.fill == color => Some(it.visual_bounding_rect()),
        _ => None,
    })
}

/// Returns the horizontal places of the vertical lines that the last frame has painted.
pub(super) fn vertical_lines<S>(harness: &Harness<'_, S>) -> Vec<f32> {
    each(harness, |shape, _| match shape {
        Shape::LineSegment { points: [a, b], .. } if a.x == b.x => Some(a.x),
        _ => None,
    })
}

/// Draws something in a window of this size.
pub(super) fn drawn(size: [f32; 2], draw: impl FnMut(&mut Ui) + 'static) -> Harness<'static> {
    let mut harness = Harness::builder().with_size(size).build_ui(draw);
    harness.run_steps(4);
    harness
}

/// Returns the texts that appear while the pointer is over the last label with the text `text`.
pub(super) fn hint<S>(harness: &mut Harness<'_, S>, text: &str) -> String {
    let before: Vec<String> = texts(harness).into_iter().map(|it| it.text).collect();
    let label = harness.query_all_by_label(text).last().expect("a label").rect().center();
    harness.hover_at(label);
    // Hints appear after half a second.
    harness.run_steps(8);
    let after: Vec<String> =
        texts(harness).into_iter().map(|it| it.text).filter(|text| !before.contains(text)).collect();
    after.join("; ")
}

/// Returns what `of` makes of each shape that the last frame has painted, and of the part of the
/// window in which the shape is visible.
fn each<S, T>(harness: &Harness<'_, S>, of: impl Fn(&Shape, Rect) -> Option<T>) -> Vec<T> {
    fn visit<T>(shape: &Shape, clip: Rect, of: &impl Fn(&Shape, Rect) -> Option<T>, into: &mut Vec<T>) {
        match shape {
            Shape::Vec(shapes) => shapes.iter().for_each(|shape| visit(shape, clip, of, into)),
            shape => into.extend(of(shape, clip)),
        }
    }
    let mut all = Vec::new();
    for ClippedShape { clip_rect, shape, .. } in &harness.output().shapes {
        visit(shape, *clip_rect, &of, &mut all);
    }
    all
}

fn text(shape: &TextShape, clip: Rect) -> Text {
    // A part of the window that is grey has changed the colour of the glyphs only.
    let rows = shape.galley.rows.iter().map(|row| &row.row.visuals);
    let mut glyphs = rows.filter_map(|row| row.mesh.vertices.get(row.glyph_vertex_range.start));
    let of_glyph = glyphs.next().map(|vertex| vertex.color).filter(|color| *color != Color32::PLACEHOLDER);
    Text {
        text: shape.galley.text().to_owned(),
        color: shape.override_text_color.or(of_glyph).unwrap_or(shape.fallback_color),
        place: shape.galley.rect.translate(shape.pos.to_vec2()),
        size: shape.galley.job.sections.iter().map(|part| part.format.font_id.size).fold(f32::MAX, f32::min),
        clip,
        shortened: shape.galley.elided,
    }
}

/// Returns the texts of the last frame line by line, as people read them. A bar stands between the
/// columns of a line.
pub(super) fn lines<S>(harness: &Harness<'_, S>) -> Vec<String> {
    let mut texts = texts(harness);
    texts.sort_by(|a, b| a.place.top().total_cmp(&b.place.top()));
    let mut lines: Vec<Vec<Text>> = Vec::new();
    for text in texts {
        match lines.last_mut() {
            Some(line) if text.place.top() - line[0].place.top() < SAME_LINE => line.push(text),
            _ => lines.push(vec![text]),
        }
    }
    let read = |mut line: Vec<Text>| {
        line.sort_by(|a, b| a.place.left().total_cmp(&b.place.left()));
        line.iter().map(|text| text.text.trim()).collect::<Vec<_>>().join(" | ")
    };
    lines.into_iter().map(read).collect()
}
