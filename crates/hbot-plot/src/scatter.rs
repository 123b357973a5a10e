//! Draws groups of points and one marked point in a plane, for example many designs at once.

use std::ops::Range;

use plotters::prelude::*;

use crate::plane::{Axis, Legend, MARKS, PALE, TOP, Words, plane, rooms};
use crate::{COLOURS, Failed, SIZE, Surface, drawn, failed};

/// A group of points of one kind, drawn by a [`Scatter`].
#[derive(Debug, Clone)]
pub struct Cloud {
    /// Name in the legend.
    pub name: String,
    /// Points (x, y) of the group.
    pub points: Vec<(f64, f64)>,
    /// Index into the palette of eight colours. Larger numbers start again from the first.
    pub colour: usize,
    /// Whether the points are large and joined by a line in their order. Otherwise they are small
    /// and open.
    pub joined: bool,
}

/// A plot of groups of points over linear axes, with one marked point.
#[derive(Debug, Clone)]
pub struct Scatter {
    /// Title of the plot.
    pub title: String,
    /// Label of the x axis.
    pub x: String,
    /// Label of the y axis.
    pub y: String,
    /// The groups of points.
    pub clouds: Vec<Cloud>,
    /// Name and position of a single point, drawn as a black diamond.
    pub mark: (String, (f64, f64)),
}

impl Scatter {
    /// Draws the plot and returns it as SVG.
    #[must_use]
    pub fn svg(&self) -> String {
        drawn(SIZE, |area| self.draw(area))
    }

    fn range(&self, of: impl Fn(&(f64, f64)) -> f64) -> Range<f64> {
        let all = self.clouds.iter().flat_map(|cloud| &cloud.points).chain([&self.mark.1]);
        let (low, high) =
            all.map(of).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        let margin = if high > low { 0.05 * (high - low) } else { 1.0 };
        low - margin..high + margin
    }

    fn draw(&self, whole: &Surface<'_>) -> Result<(), Failed> {
        let names = self.clouds.iter().map(|cloud| cloud.name.as_str());
        let (area, legend) = rooms(whole, names.chain([self.mark.0.as_str()]));
        let words =
            Words { title: &self.title, x: &self.x, y: &self.y, x_marks: MARKS, pale: PALE, above: 0 };
        let [x, y] = [self.range(|p| p.0), self.range(|p| p.1)].map(Axis::even);
        let mut chart = plane(&area, &words, x, y)?;
        for cloud in &self.clouds {
            let colour = COLOURS[cloud.colour % COLOURS.len()];
            if cloud.joined {
                let line = LineSeries::new(cloud.points.iter().copied(), colour.stroke_width(2));
                chart.draw_series(line).map_err(failed)?;
            }
            chart
                .draw_series(cloud.points.iter().map(|p| {
                    if cloud.joined {
                        Circle::new(*p, 3, colour.filled())
                    } else {
                        Circle::new(*p, 2, colour.mix(0.45).stroke_width(1))
                    }
                }))
                .map_err(failed)?;
        }
        let diamond = EmptyElement::at(self.mark.1) + Polygon::new(DIAMOND.to_vec(), BLACK.filled());
        chart.draw_series([diamond]).map_err(failed)?;
        self.legend(Legend::on(&legend, TOP))
    }

    fn legend(&self, mut legend: Legend<'_, '_>) -> Result<(), Failed> {
        for cloud in &self.clouds {
            let colour = COLOURS[cloud.colour % COLOURS.len()];
            if cloud.joined {
                legend.line(colour.stroke_width(2))?;
                legend.dot(3, colour.filled())?;
            } else {
                legend.dot(2, colour.stroke_width(1))?;
            }
            legend.name(&cloud.name)?;
        }
        legend.shape(&DIAMOND, BLACK)?;
        legend.name(&self.mark.0)
    }
}

const DIAMOND: [(i32, i32); 4] = [(0, -7), (6, 0), (0, 7), (-6, 0)];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_and_name_is_drawn() {
        let cloud = |name: &str, joined| Cloud {
            name: name.to_owned(),
            points: vec![(1.0, 2.0), (2.0, 1.0), (3.0, 0.5)],
            colour: 1,
            joined,
        };
        let scatter = Scatter {
            title: "Designs".to_owned(),
            x: "speed".to_owned(),
            y: "torque".to_owned(),
            clouds: vec![cloud("all", false), cloud("front", true)],
            mark: ("this one".to_owned(), (5.0, 5.0)),
        };
        let svg = scatter.svg();
        for text in ["Designs", "speed", "torque", "all", "front", "this one"] {
            assert!(svg.contains(text), "{text}");
        }
        // Three points of each cloud, and one of each in the legend.
        assert_eq!(svg.matches("<circle").count(), 8);
        assert_eq!(svg.matches("<polygon").count(), 2);
        // The axes include the mark.
        assert!(scatter.range(|p| p.0).contains(&5.0));
    }
}
