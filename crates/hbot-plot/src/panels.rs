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
    /// Largest absolute value that can be reached. It is drawn as two grey lines, and what lies
    /// beyond them is hatched. `None` draws nothing.
    pub limit: Option<f64>,
    /// The curves. Later ones are drawn over earlier ones.
    pub curves: Vec<Curve>,
}

/// Draws panels one below the other, and the discs of `below`, if given, under them. Returns the
/// picture as SVG.
#[must_use]
pub fn sheet(title: &str, panels: &[PlotPanel], below: Option<&Hemispheres>) -> String {
    let height = TITLE + PANEL * panels.len() as u32 + below.map_or(0, |_| hemispheres::HEIGHT);
    let names: Vec<&str> = panels.iter().flat_map(PlotPanel::names).collect();
    let mut curves = String::new();
    let mut out = drawn((WIDTH, height), |area| {
        let (head, mut rest) = area.split_vertically(TITLE);
        let font = ("sans-serif", 20).into_font();
        head.draw(&Text::new(title.to_owned(), (14, 12), font)).map_err(failed)?;
        for panel in panels {
            let (place, under) = rest.split_vertically(PANEL);
            panel.draw(&place, &names, &mut curves)?;
            rest = under;
        }
        below.map_or(Ok(()), |discs| discs.draw(&rest))
    });
    // plotters knows whole pixels only, which makes stairs of a smooth curve.
    let end = out.rfind("</svg>").unwrap_or(out.len());
    out.insert_str(end, &curves);
    out
}

impl PlotPanel {
    fn names(&self) -> impl Iterator<Item = &str> {
        self.curves.iter().filter_map(|curve| curve.name.as_deref())
    }

    /// Draws the panel, and adds its curves to `curves` as SVG. `names` are the curve names of all
    /// panels, so that all legends get equal widths.
    fn draw(&self, place: &Surface<'_>, names: &[&str], curves: &mut String) -> Result<(), Failed> {
        let mut area = place.clone();
        if !names.is_empty() {
            let (left, right) = rooms(place, names.iter().copied());
            self.legend(Legend::on(&right, 30))?;
            area = left;
        }
        let words = Words { title: "", x: &self.x, y: &self.y, x_marks: self.x_range.1, pale: 1, above: 0 };
        let [x, y] = [&self.x_range.0, &self.y_range].map(|range| Axis::even(range.clone()));
        let mut chart = plane(&area, &words, x, y)?;
        for strokes in self.limit.map(|limit| self.beyond(limit)).into_iter().flatten() {
            chart.draw_series(LineSeries::new(strokes, BLACK.mix(0.3).stroke_width(1))).map_err(failed)?;
        }
        let (columns, rows) = chart.plotting_area().get_pixel_range();
        for curve in &self.curves {
            curves.push_str(&curve.svg(self, columns.clone(), rows.clone()));
        }
        Ok(())
    }

    /// Returns the strokes that show what lies beyond `limit`: a line at the limit, and slanted
    /// strokes from it to the edge, above and below.
    fn beyond(&self, limit: f64) -> Vec<Vec<(f64, f64)>> {
        /// Number of slanted strokes on each side.
        const STROKES: u32 = 60;
        let (x, y) = (&self.x_range.0, &self.y_range);
        let width = (x.end - x.start) / f64::from(STROKES);
        let mut all = Vec::new();
        for (edge, limit) in [(y.end, limit), (y.start, -limit)] {
            // The limit can lie outside the picture.
            if (edge - limit) * edge <= 0.0 {
                continue;
            }
            all.push(vec![(x.start, limit), (x.end, limit)]);
            for k in 0..STROKES {
                let from = x.start + f64::from(k) * width;
                all.push(vec![(from, limit), (from + width, edge)]);
            }
        }
        all
    }

    fn legend(&self, mut legend: Legend<'_, '_>) -> Result<(), Failed> {
        for curve in &self.curves {
            if let Some(name) = &curve.name {
                if curve.dashed {
                    legend.dashes(curve.style())?;
                } else {
                    legend.line(curve.style().stroke_width(2))?;
                }
                legend.name(name)?;
            }
        }
        Ok(())
    }
}

impl Curve {
    /// Returns the curve as SVG, in tenths of a pixel. The axes of `panel` take the pixels
    /// `columns` and `rows` of the picture.
    fn svg(&self, panel: &PlotPanel, columns: Range<i32>, rows: Range<i32>) -> String {
        let (x, y) = (&panel.x_range.0, &panel.y_range);
        let share = |value: f64, range: &Range<f64>| (value - range.start) / (range.end - range.start);
        let along = |share: f64, pixels: &Range<i32>| {
            let pixel = f64::from(pixels.start) + share * f64::from(pixels.end - 1 - pixels.start);
            (10.0 * pixel).round() / 10.0
        };
        let points = self.points.iter().map(|point| {
            let (x, y) = (along(share(point.0, x), &columns), along(1.0 - share(point.1, y), &rows));
            format!("{x},{y}")
        });
        let points = points.collect::<Vec<_>>().join(" ");
        let style = self.style();
        let RGBAColor(r, g, b, _) = style.color;
        let dashes = if self.dashed { r#" stroke-dasharray="4 4""# } else { "" };
        format!(
            "<polyline fill=\"none\" stroke=\"#{r:02X}{g:02X}{b:02X}\" stroke-width=\"{}\"{dashes} points=\"{points}\"/>\n",
            style.stroke_width
        )
    }

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
            limit: None,
            curves,
        };
        let alone = panel("angle", vec![curve(None, false)]);
        let named = panel("time", vec![curve(Some("about x"), false), curve(None, true)]);
        let svg = sheet("A scene", &[alone.clone(), named], None);
        for text in ["A scene", "angle", "time", "torque, N m", "about x"] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(svg.starts_with(r#"<svg width="840" height="540""#), "{}", &svg[..60]);
        // A dashed line has a dashed mark: three short lines instead of one.
        let marks = |dashed| {
            let svg = sheet("", &[panel("time", vec![curve(Some("a"), dashed)])], None);
            let (before, _) = svg.split_once("\na\n").expect("the name of the curve");
            before.matches("<polyline").count()
        };
        assert_eq!((marks(false), marks(true)), (1, 3));
        // Without names there is no legend, and the plane takes its place.
        assert!(sheet("A scene", std::slice::from_ref(&alone), None).contains("angle"));
        let discs = Hemispheres::new("energy", |direction| direction.z);
        assert!(
            sheet("A scene", std::slice::from_ref(&alone), Some(&discs))
                .starts_with(r#"<svg width="840" height="730""#)
        );
    }

    #[test]
    fn curves_have_tenths_of_a_pixel_and_lie_on_their_axes() {
        let points = vec![(0.0, -2.0), (0.01, 0.0), (2.0, 2.0)];
        let curve = Curve { name: None, points, colour: None, dashed: true };
        let panel = PlotPanel {
            x: String::new(),
            y: String::new(),
            x_range: (0.0..2.0, 8),
            y_range: -2.0..2.0,
            limit: None,
            curves: vec![curve.clone()],
        };
        // The first and the last column, and the first and the last row, of 201 x 101 pixels.
        let svg = curve.svg(&panel, 10..211, 20..121);
        assert!(svg.contains(r#"points="10,120 11,70 210,20""#), "{svg}");
        assert!(svg.contains(r##"stroke="#000000" stroke-width="1" stroke-dasharray="4 4""##), "{svg}");
        let svg = curve.svg(&panel, 0..102, 0..102);
        assert!(svg.contains(r#"points="0,101 0.5,50.5 101,0""#), "{svg}");
        assert!(sheet("", &[panel], None).contains("stroke-dasharray"));
    }

    #[test]
    fn what_lies_beyond_the_limit_is_hatched_on_both_sides_if_it_is_in_the_picture() {
        let panel = |limit| PlotPanel {
            x: String::new(),
            y: String::new(),
            x_range: (0.0..6.0, 3),
            y_range: -2.0..2.0,
            limit,
            curves: Vec::new(),
        };
        let strokes = panel(None).beyond(0.5);
        assert_eq!(strokes.len(), 2 * (1 + 60));
        assert!(strokes.iter().flatten().all(|(_, y)| y.abs() >= 0.5 && y.abs() <= 2.0));
        assert_eq!(panel(None).beyond(2.5), Vec::<Vec<(f64, f64)>>::new());
        let lines = |limit| sheet("", &[panel(limit)], None).matches("<polyline").count();
        assert_eq!(lines(Some(0.5)), lines(None) + strokes.len());
    }
}
