//! Draws maps: a value over a plane as colours, with a colour bar.

use std::ops::Range;

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::{Failed, Surface, drawn, failed, short};

/// Width and height of one map with its colour bar, pixels.
const SIZE: (u32, u32) = (560, 470);
/// Number of colours in a map. Neighbouring cells of equal colour are drawn as one rectangle, which
/// keeps files small.
const BANDS: usize = 20;

/// Stops of the viridis colour map (Smith, van der Walt and Firing 2015), dark for small values.
/// People with any colour vision can read it.
const VIRIDIS: [[f64; 3]; 9] = [
    [68.0, 1.0, 84.0],
    [71.0, 44.0, 122.0],
    [59.0, 81.0, 139.0],
    [44.0, 113.0, 142.0],
    [33.0, 144.0, 141.0],
    [39.0, 173.0, 129.0],
    [92.0, 200.0, 99.0],
    [170.0, 220.0, 50.0],
    [253.0, 231.0, 37.0],
];

/// A map of a value over a square of angles in degrees, drawn by [`maps`].
#[derive(Debug, Clone)]
pub struct Map {
    /// Title of the map.
    pub title: String,
    /// Label of the x axis.
    pub x: String,
    /// Label of the y axis.
    pub y: String,
    /// Range of both axes, degrees.
    pub span: Range<f64>,
    /// Values at the centres of the cells of a square grid, row by row from the lowest y.
    pub values: Vec<f64>,
    /// Range of the colour bar. Values outside it have the colour of the nearer end.
    pub range: Range<f64>,
    /// Lines drawn over the map, for example along the zeros of the value. Each has two ends (x,
    /// y).
    pub lines: Vec<[(f64, f64); 2]>,
}

/// Draws maps side by side, two in a row, and returns the picture as SVG.
#[must_use]
pub fn maps(all: &[Map]) -> String {
    let columns = all.len().min(2);
    let rows = all.len().div_ceil(columns.max(1));
    drawn((SIZE.0 * columns as u32, SIZE.1 * rows as u32), |area| {
        let parts = area.split_evenly((rows, columns));
        all.iter().zip(&parts).try_for_each(|(map, part)| map.draw(part))
    })
}

impl Map {
    /// Returns the number of cells in a row of the grid.
    fn cells(&self) -> usize {
        self.values.len().isqrt()
    }

    fn band(&self, value: f64) -> usize {
        let part = (value - self.range.start) / (self.range.end - self.range.start);
        ((part * BANDS as f64) as usize).min(BANDS - 1)
    }

    fn draw(&self, whole: &Surface<'_>) -> Result<(), Failed> {
        let (left, bar) = whole.split_horizontally(SIZE.0 as i32 - 90);
        let mut chart = ChartBuilder::on(&left)
            .caption(&self.title, ("sans-serif", 17))
            .margin(8)
            .x_label_area_size(42)
            .y_label_area_size(58)
            .build_cartesian_2d(self.span.clone(), self.span.clone())
            .map_err(failed)?;
        // Converts positions on the whole drawing to positions relative to this map's corner.
        let (left_edge, top_edge) = whole.get_base_pixel();
        let shifted = |(x, y): (i32, i32)| (x - left_edge, y - top_edge);
        let cells = self.cells();
        let step = (self.span.end - self.span.start) / cells as f64;
        let at = |k: usize| self.span.start + step * k as f64;
        for (row, values) in self.values.chunks_exact(cells).enumerate() {
            let mut from = 0;
            for run in values.chunk_by(|a, b| self.band(*a) == self.band(*b)) {
                let corners = [(at(from), at(row)), (at(from + run.len()), at(row + 1))];
                let style = colour(self.band(run[0])).filled();
                chart.draw_series([Rectangle::new(corners, style)]).map_err(failed)?;
                from += run.len();
            }
        }
        for line in &self.lines {
            let line = PathElement::new(line.to_vec(), RGBColor(230, 60, 0).stroke_width(2));
            chart.draw_series([line]).map_err(failed)?;
        }
        chart
            .configure_mesh()
            .disable_mesh()
            .x_desc(&self.x)
            .y_desc(&self.y)
            .x_labels(0)
            .y_labels(0)
            .axis_desc_style(("sans-serif", 14))
            .draw()
            .map_err(failed)?;
        // Angles are labelled every quarter of the range, which plotters does not do by itself.
        let font = ("sans-serif", 13).into_font().color(&BLACK);
        let below = font.clone().pos(Pos::new(HPos::Center, VPos::Top));
        let beside = font.pos(Pos::new(HPos::Right, VPos::Center));
        for k in 0..=4 {
            let angle = self.span.start + f64::from(k) / 4.0 * (self.span.end - self.span.start);
            let (x, bottom) = chart.backend_coord(&(angle, self.span.start));
            let (corner, y) = chart.backend_coord(&(self.span.start, angle));
            for (text, place, mark) in [
                (&below, (x, bottom + 7), [(x, bottom), (x, bottom + 5)]),
                (&beside, (corner - 7, y), [(corner - 5, y), (corner, y)]),
            ] {
                whole.draw(&Text::new(short(angle), shifted(place), text.clone())).map_err(failed)?;
                let mark = mark.map(shifted).to_vec();
                whole.draw(&PathElement::new(mark, BLACK.stroke_width(1))).map_err(failed)?;
            }
        }
        self.bar(&bar)
    }

    /// Draws the colour bar with its numbers.
    fn bar(&self, area: &Surface<'_>) -> Result<(), Failed> {
        let (top, bottom) = (38, SIZE.1 as i32 - 52);
        let place = |part: f64| bottom - (part * f64::from(bottom - top)).round() as i32;
        for band in 0..BANDS {
            let ends = [band, band + 1].map(|k| place(k as f64 / BANDS as f64));
            let corners = [(6, ends[1]), (24, ends[0])];
            area.draw(&Rectangle::new(corners, colour(band).filled())).map_err(failed)?;
        }
        let style = ("sans-serif", 13).into_font().color(&BLACK).pos(Pos::new(HPos::Left, VPos::Center));
        for k in 0..=4 {
            let part = f64::from(k) / 4.0;
            let value = self.range.start + part * (self.range.end - self.range.start);
            area.draw(&Text::new(short(value), (29, place(part)), style.clone())).map_err(failed)?;
        }
        Ok(())
    }
}

/// Returns the colour of a band of values. Band 0 holds the smallest values.
fn colour(band: usize) -> RGBColor {
    let stops = (VIRIDIS.len() - 1) as f64;
    let along = stops * band as f64 / (BANDS - 1) as f64;
    let k = (along as usize).min(VIRIDIS.len() - 2);
    let mixed = |c: usize| {
        let (a, b) = (VIRIDIS[k][c], VIRIDIS[k + 1][c]);
        (a + (along - k as f64) * (b - a)).round() as u8
    };
    RGBColor(mixed(0), mixed(1), mixed(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_of_one_colour_are_one_rectangle() {
        let map = Map {
            title: "Margin".to_owned(),
            x: "theta 1".to_owned(),
            y: "theta 2".to_owned(),
            span: 0.0..360.0,
            // Two rows: one of a single colour and one of two.
            values: vec![0.1, 0.1, 0.1, 9.0],
            range: 0.0..1.0,
            lines: vec![[(0.0, 0.0), (360.0, 360.0)]],
        };
        assert_eq!([map.band(-1.0), map.band(0.5), map.band(9.0)], [0, BANDS / 2, BANDS - 1]);
        let svg = maps(std::slice::from_ref(&map));
        // The white background, three rectangles, and the bar.
        assert_eq!(svg.matches("<rect").count(), 1 + 3 + BANDS);
        assert!(svg.contains("Margin") && svg.contains("theta 2"));
    }
}
