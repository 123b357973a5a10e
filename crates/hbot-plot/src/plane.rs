//! What plots over a plane share: axes with a title, and beside them a legend.

use std::ops::Range;

use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::ranged1d::{AsRangedCoord, Ranged, ValueFormatter};
use plotters::prelude::*;

use crate::{Failed, Surface, failed, short};

/// What stands at a plot and its axes.
pub(crate) struct Words<'a> {
    /// Above the plot; nothing if empty.
    pub(crate) title: &'a str,
    pub(crate) x: &'a str,
    pub(crate) y: &'a str,
    /// About how many numbers stand at the lower axis.
    pub(crate) x_marks: usize,
    /// Into how many parts at most pale lines divide the room between two numbers.
    pub(crate) pale: usize,
}

/// [`Words::x_marks`] and [`Words::pale`] of a plot by itself.
pub(crate) const MARKS: usize = 8;
pub(crate) const PALE: usize = 10;

/// One axis.
pub(crate) struct Axis<C> {
    /// Even or logarithmic.
    pub(crate) coordinate: C,
    /// Below this a mark is zero: at zero it is off it by the rounding of the marks' distance.
    pub(crate) rounding: f64,
}

impl Axis<Range<f64>> {
    /// An even axis.
    pub(crate) fn even(range: Range<f64>) -> Self {
        let rounding = 1.0e-9 * (range.end - range.start);
        Self { coordinate: range, rounding }
    }
}

/// The room of the plane and that of its legend, which has the longest of these names.
pub(crate) fn rooms<'a, 'b>(
    whole: &Surface<'a>,
    names: impl Iterator<Item = &'b str>,
) -> (Surface<'a>, Surface<'a>) {
    let longest = names.map(str::len).max().unwrap_or(0).max(16);
    whole.split_horizontally(whole.dim_in_pixel().0 as i32 - 44 - 7 * longest as i32)
}

/// A plane with its axes drawn.
type Plane<'a, 'b, X, Y> = ChartContext<
    'b,
    SVGBackend<'a>,
    Cartesian2d<<X as AsRangedCoord>::CoordDescType, <Y as AsRangedCoord>::CoordDescType>,
>;

/// Draws the axes.
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

/// [`Legend::on`] below the title of a plot by itself.
pub(crate) const TOP: i32 = 56;

/// What each colour and mark is, one below the other: the marks first, then the name of each.
pub(crate) struct Legend<'a, 'b> {
    area: &'b Surface<'a>,
    y: i32,
}

impl<'a, 'b> Legend<'a, 'b> {
    /// A legend whose first line stands `top` pixels below the upper edge of `area`.
    pub(crate) fn on(area: &'b Surface<'a>, top: i32) -> Self {
        Self { area, y: top }
    }

    /// Leaves some pixels out.
    pub(crate) fn skip(&mut self, pixels: i32) {
        self.y += pixels;
    }

    pub(crate) fn line(&self, style: impl Into<ShapeStyle>) -> Result<(), Failed> {
        self.area.draw(&PathElement::new(vec![(4, self.y), (28, self.y)], style)).map_err(failed)
    }

    pub(crate) fn dot(&self, radius: i32, style: impl Into<ShapeStyle>) -> Result<(), Failed> {
        self.area.draw(&Circle::new((16, self.y), radius, style)).map_err(failed)
    }

    /// A filled shape, by its corners from its middle.
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
