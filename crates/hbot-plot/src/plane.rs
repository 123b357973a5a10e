//! Axes with a title, and the legend beside them, for all plots in a plane.

use std::ops::Range;

use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::ranged1d::{AsRangedCoord, Ranged, ValueFormatter};
use plotters::prelude::*;

use crate::{Failed, Surface, failed, short};

/// The texts of a plot and the density of its axis marks.
pub(crate) struct Words<'a> {
    /// Title above the plot. Empty for no title.
    pub(crate) title: &'a str,
    pub(crate) x: &'a str,
    pub(crate) y: &'a str,
    /// Approximate number of labels on the x axis.
    pub(crate) x_marks: usize,
    /// Largest number of parts into which pale lines divide the distance between two labels.
    pub(crate) pale: usize,
    /// Height of the room that is left free above the plot, for a second x axis, pixels.
    pub(crate) above: u32,
}

/// Approximate number of labels on the x axis of a plot that fills its picture, for
/// [`Words::x_marks`].
pub(crate) const MARKS: usize = 8;
/// Largest number of parts between two axis labels in a plot that fills its picture, for
/// [`Words::pale`].
pub(crate) const PALE: usize = 10;

/// One axis of a plot, linear or logarithmic.
pub(crate) struct Axis<C> {
    /// The axis as the plotters library needs it, linear or logarithmic.
    pub(crate) coordinate: C,
    /// Values closer to zero than this are labelled 0, because the computed mark at zero can be off
    /// by a rounding error.
    pub(crate) rounding: f64,
}

impl Axis<Range<f64>> {
    /// Returns a linear axis over `range`.
    pub(crate) fn even(range: Range<f64>) -> Self {
        let rounding = 1.0e-9 * (range.end - range.start);
        Self { coordinate: range, rounding }
    }
}

/// Splits a drawing area into a part for the plot and a part for its legend, wide enough for the
/// longest of `names`.
pub(crate) fn rooms<'a, 'b>(
    whole: &Surface<'a>,
    names: impl Iterator<Item = &'b str>,
) -> (Surface<'a>, Surface<'a>) {
    let longest = names.map(str::len).max().unwrap_or(0).max(16);
    whole.split_horizontally(whole.dim_in_pixel().0 as i32 - 44 - 7 * longest as i32)
}

/// A plotters chart whose axes have been drawn.
type Plane<'a, 'b, X, Y> = ChartContext<
    'b,
    SVGBackend<'a>,
    Cartesian2d<<X as AsRangedCoord>::CoordDescType, <Y as AsRangedCoord>::CoordDescType>,
>;

/// Draws the axes of a plot. Returns the chart, into which the curves are drawn.
pub(crate) fn plane<'a, 'b, X, Y>(
    area: &'b Surface<'a>,
    words: &Words<'_>,
    x: Axis<X>,
    y: Axis<Y>,
) -> Result<Plane<'a, 'b, X, Y>, Failed>
where
    X: AsRangedCoord<Value = f64>,
    Y: AsRangedCoord<Value = f64>,
    X::CoordDescType: ValueFormatter<f64> + Ranged<ValueType = f64>,
    Y::CoordDescType: ValueFormatter<f64> + Ranged<ValueType = f64>,
{
    let number = |rounding: f64| move |value: &f64| short(if value.abs() < rounding { 0.0 } else { *value });
    let (x_number, y_number) = (number(x.rounding), number(y.rounding));
    let mut builder = ChartBuilder::on(area);
    if !words.title.is_empty() {
        builder.caption(words.title, ("sans-serif", 20));
    }
    let mut chart = builder
        .margin(12)
        .margin_top(12 + words.above)
        .x_label_area_size(46)
        .y_label_area_size(74)
        .build_cartesian_2d(x.coordinate, y.coordinate)
        .map_err(failed)?;
    chart
        .configure_mesh()
        .x_desc(words.x)
        .y_desc(words.y)
        .x_labels(words.x_marks)
        .max_light_lines(words.pale)
        .x_label_formatter(&x_number)
        .y_label_formatter(&y_number)
        .light_line_style(RGBColor(238, 238, 238))
        .bold_line_style(RGBColor(215, 215, 215))
        .label_style(("sans-serif", 14))
        .axis_desc_style(("sans-serif", 15))
        .draw()
        .map_err(failed)?;
    Ok(chart)
}

/// Distance from the upper edge to the first legend entry in a plot with a title, pixels, for
/// [`Legend::on`].
pub(crate) const TOP: i32 = 56;

/// A legend with one entry per line: the mark first, then its name.
pub(crate) struct Legend<'a, 'b> {
    area: &'b Surface<'a>,
    y: i32,
}

impl<'a, 'b> Legend<'a, 'b> {
    /// Creates a legend whose first entry is `top` pixels below the upper edge of `area`.
    pub(crate) fn on(area: &'b Surface<'a>, top: i32) -> Self {
        Self { area, y: top }
    }

    /// Leaves a gap of `pixels` before the next entry.
    pub(crate) fn skip(&mut self, pixels: i32) {
        self.y += pixels;
    }

    pub(crate) fn line(&self, style: impl Into<ShapeStyle>) -> Result<(), Failed> {
        self.area.draw(&PathElement::new(vec![(4, self.y), (28, self.y)], style)).map_err(failed)
    }

    /// Draws a dashed line as the mark of an entry.
    pub(crate) fn dashes(&self, style: ShapeStyle) -> Result<(), Failed> {
        for x in [4, 12, 20] {
            self.area.draw(&PathElement::new(vec![(x, self.y), (x + 4, self.y)], style)).map_err(failed)?;
        }
        Ok(())
    }

    pub(crate) fn dot(&self, radius: i32, style: impl Into<ShapeStyle>) -> Result<(), Failed> {
        self.area.draw(&Circle::new((16, self.y), radius, style)).map_err(failed)
    }

    /// Draws a filled polygon as the mark of an entry. `corners` are relative to the mark's centre,
    /// pixels.
    pub(crate) fn shape(&self, corners: &[(i32, i32)], colour: RGBColor) -> Result<(), Failed> {
        let corners: Vec<_> = corners.iter().map(|(dx, dy)| (16 + dx, self.y + dy)).collect();
        self.area.draw(&Polygon::new(corners, colour.filled())).map_err(failed)
    }

    pub(crate) fn name(&mut self, name: &str) -> Result<(), Failed> {
        let font = ("sans-serif", 13).into_font().color(&BLACK);
        self.area.draw(&Text::new(name.to_owned(), (34, self.y - 7), font)).map_err(failed)?;
        self.y += 19;
        Ok(())
    }
}
