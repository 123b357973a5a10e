//! The energy of a scene on the sphere of directions, seen from both sides.

use hbot_core::Vec3;
use plotters::backend::SVGBackend;
use plotters::prelude::*;

use super::sweep::Probe;

/// Height of the picture, pixels.
pub(super) const HEIGHT: u32 = 440;

/// Radius of a disc and side of a cell, pixels.
const RADIUS: i32 = 186;
const CELL: i32 = 6;
/// Shades from the deepest to the highest.
const SHADES: u32 = 10;

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;

/// Draws where the sphere's third axis may point, from above and from below, and the least energy there.
pub(super) fn sphere(area: &Area<'_>, probe: &mut Probe) -> Result<(), Box<dyn std::error::Error>> {
    let font = |size| ("sans-serif", size).into_font();
    let title = "where the sphere's third axis points, and the least energy there; dark is deep";
    area.draw(&Text::new(title, (14, 4), font(15)))?;
    let sides = [(1.0, 225, "seen from above (z)"), (-1.0, 615, "seen from below (-z)")];
    let cells: Vec<Vec<(i32, i32, f64)>> = sides.iter().map(|(side, ..)| disc(probe, *side)).collect();
    let all = || cells.iter().flatten().map(|(_, _, energy)| *energy);
    let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
    for ((_, centre, name), cells) in sides.iter().zip(&cells) {
        let shade = |energy: f64| {
            let part = (energy - low) / (high - low).max(f64::MIN_POSITIVE);
            (part * f64::from(SHADES)).min(f64::from(SHADES) - 1.0) as u32
        };
        let corner = |x: i32, y: i32| (centre + x, 30 + RADIUS - y);
        let mut rest = &cells[..];
        while let Some((x, y, energy)) = rest.first() {
            // Neighbours of one shade in a row are one box.
            let run = rest
                .iter()
                .enumerate()
                .take_while(|(i, c)| c.0 == x + *i as i32 * CELL && c.1 == *y && shade(c.2) == shade(*energy))
                .count();
            let grey = 40 + 200 * shade(*energy) / (SHADES - 1);
            let color = RGBColor((grey * 7 / 8) as u8, (grey * 15 / 16) as u8, grey.min(255) as u8);
            // A pixel over the edge, which the next box covers: no seams.
            let end = corner(x + run as i32 * CELL + 1, y - CELL - 1);
            area.draw(&Rectangle::new([corner(*x, *y), end], color.filled()))?;
            rest = &rest[run..];
        }
        area.draw(&Circle::new(corner(0, 0), RADIUS, BLACK.mix(0.4).stroke_width(1)))?;
        area.draw(&Text::new(*name, (centre - 60, 30 + 2 * RADIUS + 8), font(14)))?;
        area.draw(&Text::new("x", (centre + RADIUS + 4, 30 + RADIUS - 6), font(14)))?;
    }
    Ok(())
}

/// The cells of one side: upper left corners from its middle, pixels, y up, and their energies.
fn disc(probe: &mut Probe, side: f64) -> Vec<(i32, i32, f64)> {
    let steps = RADIUS / CELL;
    let mut cells = Vec::new();
    for row in (1 - steps..=steps).rev() {
        for column in -steps..steps {
            let middle = |k: i32| (f64::from(k) + 0.5) * f64::from(CELL) / f64::from(RADIUS);
            let (x, y) = (middle(column), middle(row - 1));
            let rest = 1.0 - x * x - y * y;
            if rest > 0.0 {
                // From below, x to the right still: y then points down.
                let direction = Vec3::new(x, y * side, side * rest.sqrt());
                cells.push((column * CELL, row * CELL, probe.least_energy(direction)));
            }
        }
    }
    cells
}
