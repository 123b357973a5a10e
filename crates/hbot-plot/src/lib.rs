//! Draws plots as SVG text, for the studies and for `hbot scene plot`.
//!
//! | module | what it draws |
//! |---|---|
//! | `lines` | lines in a plane, with linear or logarithmic axes: [`Lines`] |
//! | `scatter` | groups of points and one marked point: [`Scatter`] |
//! | `named` | points with their names and with bars for their spread: [`NamedPoints`] |
//! | `bars` | horizontal bars, one below the other: [`bars()`] |
//! | `map` | a value over a square of angles, as colours: [`maps`] |
//! | `sketch` | a sphere with lines, arrows and points around it: [`Sketch`] |
//! | `panels` | curves over linear axes, one panel below the other: [`sheet`] |
//! | `hemispheres` | a value over all directions, as two discs: [`Hemispheres`] |
//! | `plane` | axes and legends for the other modules |
//!
//! Equal inputs give equal text on every machine.

mod bars;
mod hemispheres;
mod lines;
mod map;
mod named;
mod panels;
mod plane;
mod scatter;
mod sketch;

use plotters::coord::Shift;
use plotters::prelude::*;

pub use bars::{Bar, bars};
pub use hemispheres::Hemispheres;
pub use lines::{Lines, Series};
pub use map::{Map, maps};
pub use named::{NamedPoint, NamedPoints, PointGroup};
pub use panels::{Curve, PlotPanel, sheet};
pub use scatter::{Cloud, Scatter};
pub use sketch::{Pen, Sketch};

/// The palette of eight colours, which people with any colour vision can distinguish (Okabe and Ito
/// 2008).
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

/// Width and height of a plot, pixels.
const SIZE: (u32, u32) = (960, 540);

type Surface<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Formats a number with few digits, for axes and tables: `0.25`, `1234`, `1.5e-7`.
#[must_use]
pub fn short(value: f64) -> String {
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

/// An error in drawing. Drawing into a string fails only if plotters has a bug.
#[derive(Debug)]
struct Failed(String);

fn failed(error: impl std::fmt::Display) -> Failed {
    Failed(error.to_string())
}

/// Returns what `draw` draws on a white picture of `size` (width and height, pixels), as SVG.
fn drawn(size: (u32, u32), draw: impl FnOnce(&Surface<'_>) -> Result<(), Failed>) -> String {
    let mut out = String::new();
    let area = SVGBackend::with_string(&mut out, size).into_drawing_area();
    let result = area.fill(&WHITE).map_err(failed).and_then(|()| draw(&area));
    let result = result.and_then(|()| area.present().map_err(failed));
    if let Err(Failed(why)) = result {
        unreachable!("drawing into a string: {why}");
    }
    drop(area);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let all = [0.0, 1.0, 12.0, 0.25, 1234.0, 1.5e-7, 2e9, 99_999.0].map(short);
        assert_eq!(all, ["0", "1", "12", "0.25", "1234", "1.5e-7", "2e9", "99999"]);
    }
}
