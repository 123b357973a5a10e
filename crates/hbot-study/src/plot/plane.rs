//! What plots over a plane share: axes with a title, and beside them a legend.

use std::ops::Range;

use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::ranged1d::{AsRangedCoord, Ranged, ValueFormatter};
use plotters::prelude::*;

use super::{Failed, SIZE, Surface, failed, short};

/// What stands at a plot and its axes.
pub(super) struct Words<'a> {
    pub(super) title: &'a str,
    pub(super) x: &'a str,
    pub(super) y: &'a str,
}

/// One axis.
pub(super) struct Axis<C> {
    /// Even or logarithmic.
    pub(super) coordinate: C,
    /// Below this a mark is zero: at zero it is off it by the rounding of the marks' distance.
    pub(super) rounding: f64,
}

impl Axis<Range<f64>> {
    /// An even axis.
    pub(super) fn even(range: Range<f64>) -> Self {
        let rounding = 1.0e-9 * (range.end - range.start);
        Self { coordinate: range, rounding }
    }
}

/// The room of the plane and that of its legend, which has the longest of these names.
pub(super) fn rooms<'a, 'b>(
    whole: &Surface<'a>,
    names: impl Iterator<Item = &'b str>,
) -> (Surface<'a>, Surface<'a>) {
    let longest = names.map(str::len).max().unwrap_or(0).max(16);
    whole.split_horizontally(SIZE.0 as i32 - 44 - 7 * longest as i32)
}

/// A plane with its axes drawn.
type Plane<'a, 'b, X, Y> = ChartContext<
    'b,
    SVGBackend<'a>,
    Cartesian2d<<X as AsRangedCoord>::CoordDescType, <Y as AsRangedCoord>::CoordDescType>,
>;

/// Draws the axes.
pub(super) fn plane<'a, 'b, X, Y>(
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
    let mut chart = ChartBuilder::on(area)
        .caption(words.title, ("sans-serif", 20))
        .margin(12)
        .x_label_area_size(46)
        .y_label_area_size(74)
        .build_cartesian_2d(x.coordinate, y.coordinate)
        .map_err(failed)?;
    chart
        .configure_mesh()
        .x_desc(words.x)
        .y_desc(words.y)
        .x_labels(8)
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

/// What each colour and mark is, one below the other: the marks first, then the name of each.
pub(super) struct Legend<'a, 'b> {
    area: &'b Surface<'a>,
    y: i32,
}

impl<'a, 'b> Legend<'a, 'b> {
    pub(super) fn on(area: &'b Surface<'a>) -> Self {
        Self { area, y: 56 }
    }

    /// Leaves some pixels out.
    pub(super) fn skip(&mut self, pixels: i32) {
        self.y += pixels;
    }

    pub(super) fn line(&self, style: impl Into<ShapeStyle>) -> Result<(), Failed> {
        self.area.draw(&PathElement::new(vec![(4, self.y), (28, self.y)], style)).map_err(failed)
    }

    pub(super) fn dot(&self, radius: i32, style: impl Into<ShapeStyle>) -> Result<(), Failed> {
        self.area.draw(&Circle::new((16, self.y), radius, style)).map_err(failed)
    }

    /// A filled shape, by its corners from its middle.
    pub(super) fn shape(&self, corners: &[(i32, i32)], colour: RGBColor) -> Result<(), Failed> {
        let corners: Vec<_> = corners.iter().map(|(dx, dy)| (16 + dx, self.y + dy)).collect();
        self.area.draw(&Polygon::new(corners, colour.filled())).map_err(failed)
    }

    pub(super) fn name(&mut self, name: &str) -> Result<(), Failed> {
        let font = ("sans-serif", 13).into_font().color(&BLACK);
        self.area.draw(&Text::new(name.to_owned(), (34, self.y - 7), font)).map_err(failed)?;
        self.y += 19;
        Ok(())
    }
}
