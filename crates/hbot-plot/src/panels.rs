//! Curves over even axes, one panel below the other, with one title.

use std::ops::Range;

use plotters::prelude::*;

use crate::hemispheres::{self, Hemispheres};
use crate::plane::{Axis, Legend, Words, plane, rooms};
use crate::{COLOURS, Failed, Surface, drawn, failed};

/// Width of the picture and height of each panel, pixels.
const WIDTH: u32 = 840;
const PANEL: u32 = 250;
/// Height of the title, pixels.
const TITLE: u32 = 40;

/// One curve of a panel.
#[derive(Debug, Clone)]
pub struct Curve {
    /// Its name in the legend, if it has one.
    pub name: Option<String>,
    /// Its points.
    pub points: Vec<(f64, f64)>,
    /// Which colour, for a thin line. `None`: a strong black one.
    pub colour: Option<usize>,
    /// Dashed and thin.
    pub dashed: bool,
}

/// One panel: curves over the same axes.
#[derive(Debug, Clone)]
pub struct PlotPanel {
    /// What stands at the lower axis.
    pub x: String,
    /// What stands at the left axis.
    pub y: String,
    /// What the lower axis spans, and about how many numbers stand at it.
    pub x_range: (Range<f64>, usize),
    /// What the left axis spans.
    pub y_range: Range<f64>,
    /// The curves; later ones are drawn over earlier ones.
    pub curves: Vec<Curve>,
}

/// Draws panels one below the other, and `below` them the two discs if there are any; the picture as SVG.
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

    /// Draws the panel. `names`: those of all panels, which leave the same room for their legends.
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
        // Without a name there is no legend, and its room is the plane's.
        assert!(sheet("A scene", std::slice::from_ref(&alone), None).contains("angle"));
        let discs = Hemispheres::new("energy", |direction| direction.z);
        assert!(
            sheet("A scene", std::slice::from_ref(&alone), Some(&discs))
                .starts_with(r#"<svg width="840" height="730""#)
        );
    }
}
