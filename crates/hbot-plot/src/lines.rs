//! Draws lines in a plane, with linear or logarithmic axes.

use std::ops::Range;

use plotters::coord::ranged1d::{AsRangedCoord, Ranged, ValueFormatter};
use plotters::prelude::*;

use crate::plane::{Axis, Legend, MARKS, PALE, TOP, Words, plane, rooms};
use crate::{COLOURS, Failed, SIZE, Surface, drawn, failed};

/// Largest number of points of a line that are drawn as dots. A line with more points has no dots,
/// because they would run together.
const MARKED: usize = 120;

/// One line of a plot, drawn by [`Lines`].
#[derive(Debug, Clone)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// Points (x, y) of the line.
    pub points: Vec<(f64, f64)>,
    /// Index into the palette of eight colours. Lines that belong together share a colour.
    pub colour: usize,
    /// Whether to draw open dots and a thin line instead of filled dots. This marks a prediction,
    /// or numbers of the other width (f32 or f64).
    pub open: bool,
}

/// A plot of lines in a plane.
#[derive(Debug, Clone)]
pub struct Lines {
    /// Title of the plot.
    pub title: String,
    /// Label of the x axis.
    pub x: String,
    /// Label of the y axis.
    pub y: String,
    /// Whether the x axis and the y axis are logarithmic. Points that are not positive on a
    /// logarithmic axis are left out.
    pub log: [bool; 2],
    /// The lines of the plot.
    pub series: Vec<Series>,
    /// Whether to circle the Pareto front: the points for which no other point is better, where
    /// small x and y are best.
    pub front: bool,
}

impl Lines {
    /// Creates a plot of `series` with linear axes and without circles at the Pareto front.
    #[must_use]
    pub fn new(
        title: impl Into<String>,
        x: impl Into<String>,
        y: impl Into<String>,
        series: Vec<Series>,
    ) -> Self {
        Self { title: title.into(), x: x.into(), y: y.into(), log: [false; 2], series, front: false }
    }

    /// Sets whether the x axis and the y axis are logarithmic. Returns the changed plot.
    #[must_use]
    pub fn log(self, log: [bool; 2]) -> Self {
        Self { log, ..self }
    }

    /// Switches on the circles at the Pareto front: the points for which no other point is better,
    /// if small x and y are best. Returns the changed plot.
    #[must_use]
    pub fn front(self) -> Self {
        Self { front: true, ..self }
    }
}

impl Series {
    /// A closed line.
    #[must_use]
    pub fn new(name: impl Into<String>, points: Vec<(f64, f64)>, colour: usize) -> Self {
        Self { name: name.into(), points, colour, open: false }
    }

    /// Sets whether the line is drawn thin and with open dots, as for a prediction. Returns the
    /// changed line.
    #[must_use]
    pub fn open(self, open: bool) -> Self {
        Self { open, ..self }
    }

    fn is_marked(&self) -> bool {
        self.points.len() <= MARKED
    }
}

impl Lines {
    /// Draws the plot and returns it as SVG.
    #[must_use]
    pub fn svg(&self) -> String {
        let [x, y] = [0, 1].map(|axis| self.range(axis));
        let even = Axis::even;
        let log = |range: Range<f64>| Axis { coordinate: range.log_scale(), rounding: 0.0 };
        drawn(SIZE, |area| match self.log {
            [true, true] => self.draw(area, log(x), log(y)),
            [true, false] => self.draw(area, log(x), even(y)),
            [false, true] => self.draw(area, even(x), log(y)),
            [false, false] => self.draw(area, even(x), even(y)),
        })
    }

    fn visible(&self, &(x, y): &(f64, f64)) -> bool {
        let shown = |value: f64, log: bool| value.is_finite() && (value > 0.0 || !log);
        shown(x, self.log[0]) && shown(y, self.log[1])
    }

    fn range(&self, axis: usize) -> Range<f64> {
        let points = self.series.iter().flat_map(|s| &s.points).filter(|p| self.visible(p));
        let values = points.map(|p| if axis == 0 { p.0 } else { p.1 });
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        if !(low <= high) {
            return if self.log[axis] { 0.1..1.0 } else { 0.0..1.0 };
        }
        if self.log[axis] {
            low / 1.6..high * 1.6
        } else {
            let margin = if high > low { 0.05 * (high - low) } else { 1.0 };
            // An axis that would begin near zero begins at zero.
            let bottom = if low >= 0.0 && low < 0.3 * high { 0.0 } else { low - margin };
            bottom..high + margin
        }
    }

    fn draw<X, Y>(&self, whole: &Surface<'_>, x: Axis<X>, y: Axis<Y>) -> Result<(), Failed>
    where
        X: AsRangedCoord<Value = f64>,
        Y: AsRangedCoord<Value = f64>,
        X::CoordDescType: ValueFormatter<f64> + Ranged<ValueType = f64>,
        Y::CoordDescType: ValueFormatter<f64> + Ranged<ValueType = f64>,
    {
        let (area, legend) = rooms(whole, self.series.iter().map(|series| series.name.as_str()));
        self.legend(Legend::on(&legend, TOP))?;
        let words =
            Words { title: &self.title, x: &self.x, y: &self.y, x_marks: MARKS, pale: PALE, above: 0 };
        let mut chart = plane(&area, &words, x, y)?;
        for series in &self.series {
            let colour = COLOURS[series.colour % COLOURS.len()];
            let points: Vec<(f64, f64)> = series.points.iter().copied().filter(|p| self.visible(p)).collect();
            let width = if series.open { 1 } else { 2 };
            chart
                .draw_series(LineSeries::new(points.iter().copied(), colour.stroke_width(width)))
                .map_err(failed)?;
            if series.is_marked() {
                chart
                    .draw_series(points.iter().map(|p| {
                        let style = if series.open { colour.stroke_width(1) } else { colour.filled() };
                        Circle::new(*p, 4, style)
                    }))
                    .map_err(failed)?;
            }
        }
        if self.front {
            chart
                .draw_series(self.best().into_iter().map(|p| Circle::new(p, 8, BLACK.stroke_width(2))))
                .map_err(failed)?;
        }
        Ok(())
    }

    /// Draws the legend next to the plot.
    fn legend(&self, mut legend: Legend<'_, '_>) -> Result<(), Failed> {
        for series in &self.series {
            let colour = COLOURS[series.colour % COLOURS.len()];
            let (line, dot) = if series.open {
                (colour.stroke_width(1), colour.stroke_width(1))
            } else {
                (colour.stroke_width(2), colour.filled())
            };
            legend.line(line)?;
            if series.is_marked() {
                legend.dot(4, dot)?;
            }
            legend.name(&series.name)?;
        }
        if self.front {
            legend.skip(4);
            legend.dot(8, BLACK.stroke_width(2))?;
            legend.name("the front")?;
        }
        Ok(())
    }

    /// Returns the points of the Pareto front, which no other point beats. A point beats another if
    /// its x is smaller and its y at most 5 % larger, or if its y is smaller and its x is not
    /// larger.
    fn best(&self) -> Vec<(f64, f64)> {
        let all: Vec<(f64, f64)> =
            self.series.iter().flat_map(|s| &s.points).copied().filter(|p| self.visible(p)).collect();
        let beats =
            |o: &(f64, f64), p: &(f64, f64)| (o.0 < p.0 && o.1 <= 1.05 * p.1) || (o.0 <= p.0 && o.1 < p.1);
        let beaten = |p: &(f64, f64)| all.iter().any(|o| beats(o, p));
        all.iter().copied().filter(|p| !beaten(p)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_is_what_nothing_beats() {
        let series = Series {
            name: String::new(),
            points: vec![(1.0, 9.0), (2.0, 3.0), (3.0, 4.0), (4.0, 1.0), (5.0, 0.0)],
            colour: 0,
            open: false,
        };
        let lines = Lines {
            title: String::new(),
            x: String::new(),
            y: String::new(),
            log: [true; 2],
            series: vec![series],
            front: true,
        };
        // Zero has no place on a logarithmic axis.
        assert_eq!(lines.best(), [(1.0, 9.0), (2.0, 3.0), (4.0, 1.0)]);
        assert!(lines.svg().contains("<svg"));
    }
}
