//! Draws curves over linear axes, in panels one below the other with a common title.

use std::ops::Range;

use plotters::prelude::*;

use crate::hemispheres::{self, Hemispheres};
use crate::plane::{Axis, Legend, Words, plane, rooms};
use crate::{COLOURS, Failed, Surface, drawn, failed};

/// Width of the picture, pixels.
const WIDTH: u32 = 840;
/// Height of each panel, pixels.
const PANEL: u32 = 250;
/// Height of the title above the panels, pixels.
const TITLE: u32 = 40;

/// One curve in a [`PlotPanel`], with its points, name and style.
#[derive(Debug, Clone)]
pub struct Curve {
    /// Name in the legend. A curve without a name has no legend entry.
    pub name: Option<String>,
    /// Points (x, y) of the curve.
    pub points: Vec<(f64, f64)>,
    /// Index into the palette of eight colours, for a thin line. `None` gives a thick black line.
    pub colour: Option<usize>,
    /// Whether the line is dashed and thin.
    pub dashed: bool,
}

/// One panel: several curves over common axes.
#[derive(Debug, Clone)]
pub struct PlotPanel {
    /// Label of the x axis.
    pub x: String,
    /// Label of the y axis.
    pub y: String,
    /// Range of the x axis, and the approximate number of its tick labels.
    pub x_range: (Range<f64>, usize),
    /// Range of the y axis.
    pub y_range: Range<f64>,
    /// The curves. Later ones are drawn over earlier ones.
    pub curves: Vec<Curve>,
}

/// Draws panels one below the other, and the discs of `below`, if given, under them. Returns the
/// picture as SVG.
#[must_use]
pub fn sheet(title: &str, panels: &[PlotPanel], below: Option<&Hemispheres>) -> String {
    let height = TITLE + PANEL * panels.len() as u32 + below.map_or(0, |_| hemispheres::HEIGHT);
    let names: Vec<&str> = panels.iter().flat_map(PlotPanel::names).collect();
    let mut out = String::new();
    drawn(&mut out, (WIDTH, height), |area| {
        let (head, mut rest) = area.split_vertically(TITLE);
        let font = ("sans-serif", 20).into_font();
        head.draw(&Text::new(title.to_owned(), (14, 12), font)).map_err(failed)?;
        for panel in panels {
            let (place, under) = rest.split_vertically(PANEL);
            panel.draw(&place, &names)?;
            rest = under;
        }
        below.map_or(Ok(()), |discs| discs.draw(&rest))
    });
    out
}

impl PlotPanel {
    fn names(&self) -> impl Iterator<Item = &str> {
        self.curves.iter().filter_map(|curve| curve.name.as_deref())
    }

    /// Draws the panel. `names` are the curve names of all panels, so that all legends get equal
    /// widths.
    fn draw(&self, place: &Surface<'_>, names: &[&str]) -> Result<(), Failed> {
        let mut area = place.clone();
        if !names.is_empty() {
            let (left, right) = rooms(place, names.iter().copied());
            self.legend(Legend::on(&right, 30))?;
            area = left;
        }
        let words = Words { title: "", x: &self.x, y: &self.y, x_marks: self.x_range.1, pale: 1 };
        let [x, y] = [&self.x_range.0, &self.y_range].map(|range| Axis::even(range.clone()));
        let mut chart = plane(&area, &words, x, y)?;
        for curve in &self.curves {
            let (points, style) = (curve.points.iter().copied(), curve.style());
            if curve.dashed {
                chart.draw_series(DashedLineSeries::new(points, 4, 4, style)).map_err(failed)?;
            } else {
                chart.draw_series(LineSeries::new(points, style)).map_err(failed)?;
            }
        }
        Ok(())
    }

    fn legend(&self, mut legend: Legend<'_, '_>) -> Result<(), Failed> {
        for curve in &self.curves {
            if let Some(name) = &curve.name {
                legend.line(curve.style().stroke_width(2))?;
                legend.name(name)?;
            }
        }
        Ok(())
    }
}

impl Curve {
    fn style(&self) -> ShapeStyle {
        match self.colour {
            Some(colour) => COLOURS[colour % COLOURS.len()].stroke_width(1),
            None => BLACK.stroke_width(if self.dashed { 1 } else { 2 }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_panel_has_its_words_and_curves_and_only_named_curves_a_legend() {
        let curve = |name: Option<&str>, dashed| Curve {
            name: name.map(str::to_owned),
            points: vec![(0.0, 0.0), (1.0, 1.0), (2.0, -1.0)],
            colour: name.map(|_| 0),
            dashed,
        };
        let panel = |x: &str, curves| PlotPanel {
            x: x.to_owned(),
            y: "torque, N m".to_owned(),
            x_range: (0.0..2.0, 8),
            y_range: -2.0..2.0,
            curves,
        };
        let alone = panel("angle", vec![curve(None, false)]);
        let named = panel("time", vec![curve(Some("about x"), false), curve(None, true)]);
        let svg = sheet("A scene", &[alone.clone(), named], None);
        for text in ["A scene", "angle", "time", "torque, N m", "about x"] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(svg.starts_with(r#"<svg width="840" height="540""#), "{}", &svg[..60]);
        // Without names there is no legend, and the plane takes its place.
        assert!(sheet("A scene", std::slice::from_ref(&alone), None).contains("angle"));
        let discs = Hemispheres::new("energy", |direction| direction.z);
        assert!(
            sheet("A scene", std::slice::from_ref(&alone), Some(&discs))
                .starts_with(r#"<svg width="840" height="730""#)
        );
    }
}
