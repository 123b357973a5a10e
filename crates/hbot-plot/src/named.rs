//! Draws points with their names beside them and with the spread of their x values.

use std::ops::Range;

use plotters::coord::ranged1d::{BoldPoints, Ranged as _};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::plane::{Axis, Legend, MARKS, PALE, TOP, Words, plane, rooms};
use crate::{COLOURS, Failed, SIZE, Surface, drawn, failed, short};

/// One point of a [`NamedPoints`] plot.
#[derive(Debug, Clone)]
pub struct NamedPoint {
    /// Name beside the point. Empty for none.
    pub name: String,
    /// Its x value.
    pub x: f64,
    /// Lower and upper quartile of the x value, drawn as a bar with ends.
    pub spread: [f64; 2],
    /// Its y value, above 0. A point with another y value is left out.
    pub y: f64,
}

/// Points of one kind in a [`NamedPoints`] plot.
#[derive(Debug, Clone)]
pub struct PointGroup {
    /// Name in the legend.
    pub name: String,
    /// Index into the palette of eight colours.
    pub colour: usize,
    /// The points.
    pub points: Vec<NamedPoint>,
}

/// A plot of points with their names beside them. The y axis is logarithmic.
#[derive(Debug, Clone)]
pub struct NamedPoints {
    /// Title of the plot.
    pub title: String,
    /// Label of the x axis.
    pub x: String,
    /// Label of the y axis.
    pub y: String,
    /// A second x axis above the plot: its label, and its value for an x of 1. `None` for none.
    pub above: Option<(String, f64)>,
    /// A dashed level with a name: the name, and its y value, above 0. `None` for none.
    pub level: Option<(String, f64)>,
    /// The groups of points.
    pub groups: Vec<PointGroup>,
}

/// Width of a letter and height of a line of a name, pixels.
const LETTER: [i32; 2] = [7, 15];
/// Half the height of the ends of a spread's bar, pixels.
const END: i32 = 5;
/// Height of the room for the second x axis, pixels.
const ABOVE: u32 = 34;

/// A rectangle of pixels: left, top, right, bottom.
type Room = [i32; 4];

impl NamedPoints {
    /// Draws the plot and returns it as SVG.
    #[must_use]
    pub fn svg(&self) -> String {
        drawn(SIZE, |area| self.draw(area))
    }

    fn points(&self) -> impl Iterator<Item = (RGBColor, &NamedPoint)> {
        let of = |group: &PointGroup| COLOURS[group.colour % COLOURS.len()];
        self.groups
            .iter()
            .flat_map(move |group| group.points.iter().map(move |point| (of(group), point)))
            .filter(|(_, point)| point.y > 0.0)
    }

    fn ranges(&self) -> [Range<f64>; 2] {
        let over = |values: &mut dyn Iterator<Item = f64>| {
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)))
        };
        let (left, right) = over(&mut self.points().flat_map(|(_, p)| [p.spread[0], p.x, p.spread[1]]));
        let (low, high) = over(&mut self.points().map(|(_, p)| p.y));
        let margin = if right > left { 0.08 * (right - left) } else { 1.0 };
        let y = if low <= high { low / 3.0..high * 3.0 } else { 0.1..1.0 };
        // The names of the last points need room.
        let x = if left <= right { left - margin..right + 4.0 * margin } else { 0.0..1.0 };
        [x, y]
    }

    fn draw(&self, whole: &Surface<'_>) -> Result<(), Failed> {
        let (area, legend) = rooms(whole, self.groups.iter().map(|group| group.name.as_str()));
        self.legend(Legend::on(&legend, TOP))?;
        // The second axis is between the title and the plot.
        let (below, title, above) = match self.above {
            Some(_) => {
                let area = area.margin(12, 0, 0, 0);
                (area.titled(&self.title, ("sans-serif", 20)).map_err(failed)?, "", ABOVE)
            }
            None => (area.clone(), self.title.as_str(), 0),
        };
        let words = Words { title, x: &self.x, y: &self.y, x_marks: MARKS, pale: PALE, above };
        let [x, y] = self.ranges();
        let vertical = Axis { coordinate: y.clone().log_scale(), rounding: 0.0 };
        let chart = plane(&below, &words, Axis::even(x.clone()), vertical)?;
        let mut taken: Vec<Room> = Vec::new();
        if let Some((name, level)) = &self.level {
            let ends = [x.start, x.end].map(|x| chart.backend_coord(&(x, *level)));
            taken.push(dashed(&area, name, ends)?);
        }
        for (colour, point) in self.points() {
            let at = |x: f64| chart.backend_coord(&(x, point.y));
            let [(left, y), (x, _), (right, _)] = [point.spread[0], point.x, point.spread[1]].map(at);
            for line in [
                [(left, y), (right, y)],
                [(left, y - END), (left, y + END)],
                [(right, y - END), (right, y + END)],
            ] {
                area.draw(&PathElement::new(line.to_vec(), colour.stroke_width(2))).map_err(failed)?;
            }
            area.draw(&Circle::new((x, y), 4, colour.filled())).map_err(failed)?;
            taken.push([left.min(x - 5), y - 6, right.max(x + 5), y + 6]);
        }
        self.names(&area, &mut taken, |x, y| chart.backend_coord(&(x, y)))?;
        match &self.above {
            Some((label, factor)) => second(&area, label, x, *factor, |x| chart.backend_coord(&(x, y.end))),
            None => Ok(()),
        }
    }

    /// Writes the names beside their points, where they cover neither points nor other names.
    fn names(
        &self,
        area: &Surface<'_>,
        taken: &mut Vec<Room>,
        place: impl Fn(f64, f64) -> (i32, i32),
    ) -> Result<(), Failed> {
        for (colour, point) in self.points().filter(|(_, point)| !point.name.is_empty()) {
            let (right, y) = place(point.spread[1].max(point.x), point.y);
            let (x, _) = place(point.x, point.y);
            let room = free(taken, [x, y], right, point.name.chars().count() as i32);
            taken.push(room);
            let font = ("sans-serif", 13).into_font().color(&colour);
            area.draw(&Text::new(point.name.clone(), (room[0], room[1]), font)).map_err(failed)?;
        }
        Ok(())
    }

    fn legend(&self, mut legend: Legend<'_, '_>) -> Result<(), Failed> {
        for group in &self.groups {
            let colour = COLOURS[group.colour % COLOURS.len()];
            legend.line(colour.stroke_width(2))?;
            legend.dot(4, colour.filled())?;
            legend.name(&group.name)?;
        }
        Ok(())
    }
}

/// Draws a second x axis above the plot, with `factor` times the values of the first, which has the
/// range `x`. `place` returns the pixel of an x value at the upper edge of the plot.
fn second(
    area: &Surface<'_>,
    label: &str,
    x: Range<f64>,
    factor: f64,
    place: impl Fn(f64) -> (i32, i32),
) -> Result<(), Failed> {
    let [(left, top), (right, _)] = [x.start, x.end].map(&place);
    area.draw(&PathElement::new(vec![(left, top), (right, top)], BLACK.stroke_width(1))).map_err(failed)?;
    let above =
        |size: i32| ("sans-serif", size).into_font().color(&BLACK).pos(Pos::new(HPos::Center, VPos::Bottom));
    let axis = RangedCoordf64::from(x.start * factor..x.end * factor);
    for value in axis.key_points(BoldPoints(MARKS)) {
        let (at, _) = place(value / factor);
        area.draw(&PathElement::new(vec![(at, top), (at, top - 5)], BLACK.stroke_width(1)))
            .map_err(failed)?;
        area.draw(&Text::new(short(value), (at, top - 8), above(14))).map_err(failed)?;
    }
    let middle = (left.midpoint(right), top - 26);
    area.draw(&Text::new(label.to_owned(), middle, above(15))).map_err(failed)
}

/// Draws a dashed grey line between two points at one height, with its name above its right end.
/// Returns the room of the name.
fn dashed(area: &Surface<'_>, name: &str, [(left, y), (right, _)]: [(i32, i32); 2]) -> Result<Room, Failed> {
    let grey = COLOURS[6];
    for x in (left..right).step_by(10) {
        area.draw(&PathElement::new(vec![(x, y), (right.min(x + 6), y)], grey.stroke_width(1)))
            .map_err(failed)?;
    }
    let font = ("sans-serif", 13).into_font().color(&grey);
    let end = font.pos(Pos::new(HPos::Right, VPos::Bottom));
    area.draw(&Text::new(name.to_owned(), (right - 4, y - 3), end)).map_err(failed)?;
    Ok([right - 4 - name.chars().count() as i32 * LETTER[0], y - 3 - LETTER[1], right, y])
}

/// Returns a room for a name of `letters` letters near the point at `at` that overlaps none of
/// `taken`: right of the bar that ends at `right`, or else above or below the point, as near as
/// possible.
fn free(taken: &[Room], [x, y]: [i32; 2], right: i32, letters: i32) -> Room {
    let (wide, high) = (letters * LETTER[0], LETTER[1]);
    let near = |left: i32, top: i32| [left, top, left + wide, top + high];
    let beside = near(right + 8, y - high / 2);
    let around =
        (1..12).flat_map(|step| [-1, 1].map(|side| near(x - 10, y - high / 2 + side * (4 + step * high))));
    let overlaps = |a: &Room, b: &Room| a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3];
    let is_free = |room: &Room| !taken.iter().any(|other| overlaps(room, other));
    [beside].into_iter().chain(around).find(is_free).unwrap_or(beside)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(name: &str, x: f64, y: f64) -> NamedPoint {
        NamedPoint { name: name.to_owned(), x, spread: [x - 1.0, x + 2.0], y }
    }

    #[test]
    fn every_point_has_its_bar_and_its_name() {
        let group = |name: &str, colour, points| PointGroup { name: name.to_owned(), colour, points };
        let plot = NamedPoints {
            title: "Costs".to_owned(),
            x: "ns".to_owned(),
            y: "rad".to_owned(),
            above: Some(("per cent".to_owned(), 100.0)),
            level: Some(("a floor".to_owned(), 1e-5)),
            groups: vec![
                group("named", 0, vec![point("euler", 10.0, 1e-3), point("midpoint", 20.0, 1e-6)]),
                group("unnamed", 1, vec![point("", 20.0, 1e-4), point("no place", 20.0, 0.0)]),
            ],
        };
        let svg = plot.svg();
        // 15 ns are 1500 per cent of a nanosecond.
        for text in
            ["Costs", "ns", "rad", "named", "unnamed", "euler", "midpoint", "per cent", "1500", "a floor"]
        {
            assert!(svg.contains(text), "{text}");
        }
        assert!(!svg.contains("no place"), "it has no place on a logarithmic axis");
        // Three points and two entries of the legend.
        assert_eq!(svg.matches("<circle").count(), 5);
        let [x, y] = plot.ranges();
        assert!(x.contains(&9.0) && x.contains(&22.0) && y.contains(&1e-6) && y.contains(&1e-3));
    }

    #[test]
    fn a_name_covers_nothing() {
        let at = [100, 100];
        let first = free(&[[90, 94, 110, 106]], at, 110, 10);
        assert_eq!(first, [118, 93, 188, 108], "beside its point");
        let second = free(&[[90, 94, 110, 106], first], at, 110, 10);
        assert!(second[3] <= 93 && second[0] == 90, "above it: {second:?}");
        let third = free(&[[90, 94, 110, 106], first, second], at, 110, 10);
        assert!(third[1] >= 106, "below it: {third:?}");
    }
}
