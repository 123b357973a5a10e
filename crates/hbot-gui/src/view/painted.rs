//! What a frame has painted, for tests: each text with its place and colour.

use eframe::egui::epaint::{ClippedShape, Shape, TextShape};
use eframe::egui::{Color32, Rect};
use egui_kittest::Harness;

/// Two texts whose upper edges differ by less than this are in one line, points.
const SAME_LINE: f32 = 7.0;

/// A text in the window.
#[derive(Clone, Debug)]
pub(super) struct Text {
    pub(super) text: String,
    pub(super) color: Color32,
    place: Rect,
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

    /// Returns whether two horizontal texts cover each other.
    pub(super) fn overlaps(&self, other: &Self) -> bool {
        // Half a point for rounding.
        self.place.shrink(0.5).intersects(other.place)
    }
}

/// Returns the texts that the last frame has painted.
pub(super) fn texts<S>(harness: &Harness<'_, S>) -> Vec<Text> {
    let mut texts = Vec::new();
    for ClippedShape { clip_rect, shape, .. } in &harness.output().shapes {
        collect(shape, *clip_rect, &mut texts);
    }
    texts
}

fn collect(shape: &Shape, clip: Rect, texts: &mut Vec<Text>) {
    match shape {
        Shape::Vec(shapes) => shapes.iter().for_each(|shape| collect(shape, clip, texts)),
        Shape::Text(shape) if !shape.galley.text().is_empty() => texts.push(text(shape, clip)),
        _ => {}
    }
}

fn text(shape: &TextShape, clip: Rect) -> Text {
    let of_section = shape.galley.job.sections.first().map(|section| section.format.color);
    let of_section = of_section.filter(|color| *color != Color32::PLACEHOLDER);
    Text {
        text: shape.galley.text().to_owned(),
        color: shape.override_text_color.or(of_section).unwrap_or(shape.fallback_color),
        place: shape.galley.rect.translate(shape.pos.to_vec2()),
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
