//! Draws a value over all directions as two discs: the unit sphere seen from above and from below.

use hbot_core::Vec3;
use plotters::prelude::*;

use crate::{Failed, Surface, failed};

/// Height of both discs with their title and names, pixels.
pub(crate) const HEIGHT: u32 = 440;
/// Radius of a disc, pixels.
const RADIUS: i32 = 186;
/// Side of a square cell of a disc, pixels.
const CELL: i32 = 6;
/// Number of shades between the smallest and the largest value.
const SHADES: u32 = 10;
/// For each disc: the side of the sphere (1 upper, -1 lower), the x coordinate of its centre in
/// pixels, and its name.
const SIDES: [(f64, i32, &str); 2] = [(1.0, 225, "seen from above (z)"), (-1.0, 615, "seen from below (-z)")];

/// A cell of a disc: x and y of its upper left corner relative to the disc's centre (pixels, y up),
/// and its value.
type Cell = (i32, i32, f64);

/// A picture of a value over all directions: the unit sphere as two shaded discs. Small values are
/// dark.
#[derive(Debug, Clone)]
pub struct Hemispheres {
    title: String,
    cells: [Vec<Cell>; 2],
}

impl Hemispheres {
    /// Creates the discs from `value`, which is called with the direction (a unit vector) of the
    /// centre of every cell.
    pub fn new(title: &str, mut value: impl FnMut(Vec3) -> f64) -> Self {
        Self { title: title.to_owned(), cells: SIDES.map(|(side, ..)| cells(&mut value, side)) }
    }

    pub(crate) fn draw(&self, area: &Surface<'_>) -> Result<(), Failed> {
        let font = |size| ("sans-serif", size).into_font();
        area.draw(&Text::new(self.title.clone(), (14, 4), font(15))).map_err(failed)?;
        let all = || self.cells.iter().flatten().map(|(_, _, value)| *value);
        let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
        let shade = |value: f64| {
            let part = (value - low) / (high - low).max(f64::MIN_POSITIVE);
            (part * f64::from(SHADES)).min(f64::from(SHADES) - 1.0) as u32
        };
        for ((_, centre, name), cells) in SIDES.iter().zip(&self.cells) {
            let corner = |x: i32, y: i32| (centre + x, 30 + RADIUS - y);
            disc(area, cells, &shade, &corner)?;
            let edge = Circle::new(corner(0, 0), RADIUS, BLACK.mix(0.4).stroke_width(1));
            area.draw(&edge).map_err(failed)?;
            let below = (centre - 60, 30 + 2 * RADIUS + 8);
            area.draw(&Text::new(*name, below, font(14))).map_err(failed)?;
            let beside = (centre + RADIUS + 4, 30 + RADIUS - 6);
            area.draw(&Text::new("x", beside, font(14))).map_err(failed)?;
        }
        Ok(())
    }
}

/// Draws the cells of one disc. Neighbouring cells in a row with equal shade are drawn as one box,
/// which keeps files small.
fn disc(
    area: &Surface<'_>,
    cells: &[Cell],
    shade: &impl Fn(f64) -> u32,
    corner: &impl Fn(i32, i32) -> (i32, i32),
) -> Result<(), Failed> {
    let mut rest = cells;
    while let Some((x, y, value)) = rest.first() {
        let run = rest
            .iter()
            .enumerate()
            .take_while(|(i, c)| c.0 == x + *i as i32 * CELL && c.1 == *y && shade(c.2) == shade(*value))
            .count();
        let grey = 40 + 200 * shade(*value) / (SHADES - 1);
        let colour = RGBColor((grey * 7 / 8) as u8, (grey * 15 / 16) as u8, grey.min(255) as u8);
        // The box overlaps the next one by a pixel, so that no seam shows.
        let end = corner(x + run as i32 * CELL + 1, y - CELL - 1);
        area.draw(&Rectangle::new([corner(*x, *y), end], colour.filled())).map_err(failed)?;
        rest = &rest[run..];
    }
    Ok(())
}

/// Returns the cells of the disc for one side of the sphere, row by row from the top. `side` is 1
/// for the upper and -1 for the lower half.
fn cells(value: &mut impl FnMut(Vec3) -> f64, side: f64) -> Vec<Cell> {
    let steps = RADIUS / CELL;
    let mut cells = Vec::new();
    for row in (1 - steps..=steps).rev() {
        for column in -steps..steps {
            let middle = |k: i32| (f64::from(k) + 0.5) * f64::from(CELL) / f64::from(RADIUS);
            let (x, y) = (middle(column), middle(row - 1));
            let rest = 1.0 - x * x - y * y;
            if rest > 0.0 {
                // Seen from below, x still points right, so y points down.
                let direction = Vec3::new(x, y * side, side * rest.sqrt());
                cells.push((column * CELL, row * CELL, value(direction)));
            }
        }
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks that the two discs show different halves of the sphere, and that each direction is a
    /// unit vector.
    #[test]
    fn every_cell_has_the_value_of_its_direction() {
        let mut seen = Vec::new();
        let both = Hemispheres::new("z", |direction| {
            seen.push(direction);
            direction.z
        });
        assert!(
            both.cells[0].iter().all(|cell| cell.2 > 0.0) && both.cells[1].iter().all(|cell| cell.2 < 0.0)
        );
        assert_eq!(both.cells[0].len(), both.cells[1].len());
        // A disc with a radius of 31 cells.
        assert!((both.cells[0].len() as f64 / (core::f64::consts::PI * 31.0 * 31.0) - 1.0).abs() < 0.01);
        assert!(seen.iter().all(|direction| (direction.length() - 1.0).abs() < 1e-12));
    }
}
