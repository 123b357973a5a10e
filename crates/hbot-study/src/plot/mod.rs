//! Plots as SVG: lines on logarithmic or even axes, bars, maps over a plane, and sketches of the device.

mod map;
mod plane;
mod sketch;

pub(crate) mod scatter;

use std::ops::Range;

use plotters::coord::Shift;
use plotters::coord::ranged1d::{AsRangedCoord, Ranged, ValueFormatter};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use plane::{Axis, Legend, Words, plane, rooms};

pub(crate) use map::{Map, maps};
pub(crate) use sketch::{Pen, Sketch};

/// Colours that people of any colour vision tell apart (Okabe and Ito 2008).
const COLOURS: [RGBColor; 8] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(90, 90, 90),
    RGBColor(160, 110, 60),
];

/// A line of more points than this is drawn without them: they would run together.
const MARKED: usize = 120;

/// Width and height of a plot, pixels.
const SIZE: (u32, u32) = (960, 540);

/// One line of a plot.
#[derive(Debug, Clone)]
pub(crate) struct Series {
    /// What it is called in the legend.
    pub(crate) name: String,
    /// Its points.
    pub(crate) points: Vec<(f64, f64)>,
    /// Which colour; lines that belong together share one.
    pub(crate) colour: usize,
    /// Open points and a thin line, instead of filled ones: a prediction, or the other width of numbers.
    pub(crate) open: bool,
}

/// Lines over a plane.
#[derive(Debug, Clone)]
pub(crate) struct Lines {
    pub(crate) title: String,
    pub(crate) x: String,
    pub(crate) y: String,
    /// Whether each axis is logarithmic; what is not positive is left out then.
    pub(crate) log: [bool; 2],
    pub(crate) series: Vec<Series>,
    /// Marks what no other point beats in both x and y.
    pub(crate) front: bool,
}

/// One bar.
#[derive(Debug, Clone)]
pub(crate) struct Bar {
    pub(crate) name: String,
    pub(crate) value: f64,
    /// How far the value is sure: quartiles.
    pub(crate) spread: Option<[f64; 2]>,
    pub(crate) colour: usize,
}

impl Series {
    fn is_marked(&self) -> bool {
        self.points.len() <= MARKED
    }
}

type Surface<'a> = DrawingArea<SVGBackend<'a>, Shift>;

impl Lines {
    /// The plot as SVG.
    pub(crate) fn svg(&self) -> String {
        let mut out = String::new();
        let [x, y] = [0, 1].map(|axis| self.range(axis));
        let even = Axis::even;
        let log = |range: Range<f64>| Axis { coordinate: range.log_scale(), rounding: 0.0 };
        drawn(&mut out, SIZE, |area| match self.log {
            [true, true] => self.draw(area, log(x), log(y)),
            [true, false] => self.draw(area, log(x), even(y)),
            [false, true] => self.draw(area, even(x), log(y)),
            [false, false] => self.draw(area, even(x), even(y)),
        });
        out
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
            // An axis that begins near zero begins at zero.
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
        self.legend(Legend::on(&legend))?;
        let words = Words { title: &self.title, x: &self.x, y: &self.y };
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

    /// What each line is, beside the plane.
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

    /// The points that no other beats: none that is cheaper is as good to 5 %.
    fn best(&self) -> Vec<(f64, f64)> {
        let all: Vec<(f64, f64)> =
            self.series.iter().flat_map(|s| &s.points).copied().filter(|p| self.visible(p)).collect();
        let beats =
            |o: &(f64, f64), p: &(f64, f64)| (o.0 < p.0 && o.1 <= 1.05 * p.1) || (o.0 <= p.0 && o.1 < p.1);
        let beaten = |p: &(f64, f64)| all.iter().any(|o| beats(o, p));
        all.iter().copied().filter(|p| !beaten(p)).collect()
    }
}

/// Bars one below the other as SVG; `x` says what their lengths are.
pub(crate) fn bars(title: &str, x: &str, bars: &[Bar]) -> String {
    let mut out = String::new();
    let reach = |bar: &Bar| bar.spread.map_or(bar.value, |[_, high]| high.max(bar.value));
    let longest = bars.iter().map(reach).fold(0.0, f64::max).max(f64::MIN_POSITIVE);
    let least = bars.iter().map(|bar| bar.value).fold(0.0, f64::min);
    let names = bars.iter().map(|bar| bar.name.len()).max().unwrap_or(0) as u32;
    let height = 110 + 22 * bars.len() as u32;
    drawn(&mut out, (900, height), |area| {
        let mut chart = ChartBuilder::on(area)
            .caption(title, ("sans-serif", 20))
            .margin(12)
            .x_label_area_size(46)
            .y_label_area_size(24 + 8 * names)
            .build_cartesian_2d(1.05 * least..1.12 * longest, bars.len() as f64..0.0)
            .map_err(failed)?;
        let name = |row: &f64| {
            let inside = (row - 0.5).fract() == 0.0 && *row >= 0.0;
            if inside {
                bars.get(*row as usize).map_or(String::new(), |bar| bar.name.clone())
            } else {
                String::new()
            }
        };
        let number = |value: &f64| short(*value);
        chart
            .configure_mesh()
            .x_desc(x)
            .disable_y_mesh()
            .y_labels(0)
            .x_label_formatter(&number)
            .y_label_formatter(&name)
            .light_line_style(RGBColor(238, 238, 238))
            .label_style(("sans-serif", 14))
            .axis_desc_style(("sans-serif", 15))
            .draw()
            .map_err(failed)?;
        let label = ("sans-serif", 13).into_font().color(&BLACK);
        for (row, bar) in bars.iter().enumerate() {
            let y = row as f64;
            let colour = COLOURS[bar.colour % COLOURS.len()];
            let body = Rectangle::new([(0.0, y + 0.15), (bar.value, y + 0.85)], colour.filled());
            chart.draw_series([body]).map_err(failed)?;
            if let Some([low, high]) = bar.spread {
                let line = PathElement::new(vec![(low, y + 0.5), (high, y + 0.5)], BLACK.stroke_width(1));
                chart.draw_series([line]).map_err(failed)?;
            }
            let text = EmptyElement::at((reach(bar).max(0.0), y + 0.5))
                + Text::new(short(bar.value), (6, -6), label.clone());
            chart.draw_series([text]).map_err(failed)?;
            // Names stand left of the axis.
            let (x0, middle) = chart.backend_coord(&(1.05 * least, y + 0.5));
            let place = (x0 - 8, middle);
            let style = label.clone().pos(Pos::new(HPos::Right, VPos::Center));
            area.draw(&Text::new(bar.name.clone(), place, style)).map_err(failed)?;
        }
        Ok(())
    });
    out
}

/// A number with few digits, as axes and tables have it.
pub(crate) fn short(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 {
        "0".to_owned()
    } else if !(1.0e-3..1.0e5).contains(&size) {
        let text = format!("{value:.1e}");
        text.replace(".0e", "e")
    } else {
        let digits = (2 - size.log10().floor() as i32).clamp(0, 5) as usize;
        let text = format!("{value:.digits$}");
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
    }
}

/// Drawing into a string fails only where plotters has a bug.
#[derive(Debug)]
struct Failed(String);

fn failed(error: impl std::fmt::Display) -> Failed {
    Failed(error.to_string())
}

fn drawn(out: &mut String, size: (u32, u32), draw: impl FnOnce(&Surface<'_>) -> Result<(), Failed>) {
    let area = SVGBackend::with_string(out, size).into_drawing_area();
    let result = area.fill(&WHITE).map_err(failed).and_then(|()| draw(&area));
    let result = result.and_then(|()| area.present().map_err(failed));
    if let Err(Failed(why)) = result {
        unreachable!("drawing into a string: {why}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let all = [0.0, 1.0, 12.0, 0.25, 1234.0, 1.5e-7, 2e9, 99_999.0].map(short);
        assert_eq!(all, ["0", "1", "12", "0.25", "1234", "1.5e-7", "2e9", "99999"]);
    }

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

    #[test]
    fn bars_carry_their_names_and_values() {
        let bar = |name: &str, value| Bar { name: name.to_owned(), value, spread: None, colour: 0 };
        let svg = bars("Costs", "ns", &[bar("spring", 51.0), bar("damper", 7.5)]);
        for text in ["spring", "damper", "51", "7.5", "Costs"] {
            assert!(svg.contains(text), "{text}");
        }
    }
}
