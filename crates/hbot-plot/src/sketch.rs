//! Draws sketches of a sphere with lines, arrows and points around it, in parallel projection.

use hbot_core::Vec3;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::{COLOURS, Failed, Surface, drawn, failed};

/// Number of drawing points per pixel. The library plotters accepts only whole numbers of drawing
/// points, and a circle of whole pixels would look uneven.
const FINE: u32 = 16;
/// Converts pixels to drawing points.
const fn pixels(count: u32) -> u32 {
    FINE * count
}

/// Width and height of each panel, pixels.
const SIZE: (u32, u32) = (500, 480);
/// Radius with which the sphere is drawn, pixels.
const SCALE: u32 = 140;
/// Position of the sphere's centre in its panel, pixels.
const CENTRE: (u32, u32) = (250, 240);

/// The style of a line.
#[derive(Debug, Clone, Copy)]
pub enum Pen {
    /// A thin grey line.
    Thin,
    /// A thick line in the colour with this index in the palette.
    Strong(usize),
}

/// One panel of a picture: a sphere with lines, arrows and points around it.
///
/// Coordinates are in frame N relative to the sphere's centre, with the sphere's radius as the unit
/// of length. Parts behind the plane through the centre are drawn paler.
#[derive(Debug, Clone)]
pub struct Sketch {
    title: String,
    /// Unit vectors that point right, up, and towards the eye.
    eye: [Vec3; 3],
    lines: Vec<(Vec<Vec3>, Pen)>,
    dots: Vec<(Vec3, usize)>,
    labels: Vec<Label>,
}

/// A text next to a point.
#[derive(Debug, Clone)]
struct Label {
    at: Vec3,
    text: String,
    /// Index into the palette of eight colours. `None` is black.
    colour: Option<usize>,
    /// Offset of the text from the point to the right and down, drawing points.
    off: [i32; 2],
}

impl Sketch {
    /// Creates a sketch that shows the sphere's outline, seen from the direction with the angles
    /// `azimuth` (about axis n3, from n1) and `elevation`, degrees.
    #[must_use]
    pub fn new(title: impl Into<String>, azimuth: f64, elevation: f64) -> Self {
        let (sa, ca) = libm::sincos(azimuth.to_radians());
        let (se, ce) = libm::sincos(elevation.to_radians());
        let towards = Vec3::new(ce * ca, ce * sa, se);
        let right = Vec3::new(-sa, ca, 0.0);
        let eye = [right, towards.cross(right), towards];
        Self { title: title.into(), eye, lines: Vec::new(), dots: Vec::new(), labels: Vec::new() }
    }

    /// Adds a line through `points`.
    pub fn line(&mut self, points: Vec<Vec3>, pen: Pen) -> &mut Self {
        self.lines.push((points, pen));
        self
    }

    /// Adds a line from `from` to `to` with an arrow head.
    fn arrow(&mut self, from: Vec3, to: Vec3, pen: Pen) -> &mut Self {
        let along = to - from;
        let side = along.cross(self.eye[2]);
        let length = along.length();
        let width = side.length().max(1.0e-9);
        // The head has a fixed size, but at most half the length of the arrow.
        let head = f64::min(0.07, 0.5 * length);
        let (back, out) = (along * (head / length), side * (0.45 * head / width));
        self.line(vec![from, to], pen);
        self.line(vec![to - back + out, to, to - back - out], pen)
    }

    /// Adds an arrow from `from` to `to` with a name beyond its head.
    pub fn named(&mut self, from: Vec3, to: Vec3, name: &str, pen: Pen) -> &mut Self {
        let colour = match pen {
            Pen::Thin => None,
            Pen::Strong(colour) => Some(colour),
        };
        let [a, b] = [from, to].map(|at| self.place(at));
        let (x, y) = (f64::from(b.0 - a.0), f64::from(b.1 - a.1));
        let length = libm::hypot(x, y);
        // An arrow that points at the eye has its name above it.
        let (x, y) = if length > f64::from(pixels(6)) { (x / length, y / length) } else { (0.0, -1.0) };
        let off = [(14, x), (13, y)].map(|(far, along)| (f64::from(pixels(far)) * along).round() as i32);
        self.labels.push(Label { at: to, text: name.to_owned(), colour, off });
        self.arrow(from, to, pen)
    }

    /// Adds a text `down` pixels below the point `at`, in the colour with the index `colour`.
    pub fn label(&mut self, at: Vec3, down: u32, text: &str, colour: usize) -> &mut Self {
        let off = [0, pixels(down) as i32];
        self.labels.push(Label { at, text: text.to_owned(), colour: Some(colour), off });
        self
    }

    /// Adds a point at `at` in the colour with the index `colour`.
    pub fn dot(&mut self, at: Vec3, colour: usize) -> &mut Self {
        self.dots.push((at, colour));
        self
    }

    /// Adds the circle of all unit vectors at `angle` (rad) from `axis`.
    pub fn circle(&mut self, axis: Vec3, angle: f64, pen: Pen) -> &mut Self {
        let across = if axis.z.abs() < 0.9 { Vec3::Z } else { Vec3::X };
        let u = axis.cross(across);
        let u = u / u.length();
        let v = axis.cross(u);
        let (sin, cos) = libm::sincos(angle);
        let at = |k: u32| {
            let (s, c) = libm::sincos(f64::from(k) * core::f64::consts::TAU / 72.0);
            axis * cos + (u * c + v * s) * sin
        };
        self.line((0..=72).map(at).collect(), pen)
    }

    /// Draws sketches as panels, two in a row, and returns the picture as SVG.
    #[must_use]
    pub fn panels(all: &[Self]) -> String {
        let columns = all.len().min(2);
        let rows = all.len().div_ceil(columns.max(1));
        let (width, height) = (SIZE.0 * columns as u32, SIZE.1 * rows as u32);
        let out = drawn((pixels(width), pixels(height)), |area| {
            let parts = area.split_evenly((rows, columns));
            all.iter().zip(&parts).try_for_each(|(sketch, part)| sketch.draw(part))
        });
        shrunk(&out, (width, height))
    }

    fn place(&self, at: Vec3) -> (i32, i32) {
        let [x, y] = [self.eye[0], self.eye[1]].map(|axis| f64::from(SCALE) * axis.dot(at));
        let point = |pixel: f64| (f64::from(FINE) * pixel).round() as i32;
        (point(f64::from(CENTRE.0) + x), point(f64::from(CENTRE.1) - y))
    }

    fn draw(&self, area: &Surface<'_>) -> Result<(), Failed> {
        let title =
            ("sans-serif", pixels(16)).into_font().color(&BLACK).pos(Pos::new(HPos::Center, VPos::Top));
        let top = (pixels(SIZE.0 / 2) as i32, pixels(8) as i32);
        area.draw(&Text::new(self.title.clone(), top, title)).map_err(failed)?;
        let (centre, radius) = (self.place(Vec3::ZERO), pixels(SCALE));
        area.draw(&Circle::new(centre, radius, RGBColor(246, 247, 250).filled())).map_err(failed)?;
        area.draw(&Circle::new(centre, radius, RGBColor(150, 150, 150).stroke_width(pixels(1))))
            .map_err(failed)?;
        // Parts behind the plane are drawn first.
        for front in [false, true] {
            for (points, pen) in &self.lines {
                let near = |p: &[Vec3]| self.eye[2].dot(p[0] + p[1]) > -1.0e-9;
                let steps: Vec<&[Vec3]> = points.windows(2).collect();
                for run in steps.chunk_by(|a, b| near(a) == near(b)).filter(|run| near(run[0]) == front) {
                    let mut path = vec![self.place(run[0][0])];
                    path.extend(run.iter().map(|step| self.place(step[1])));
                    area.draw(&PathElement::new(path, style(*pen, front))).map_err(failed)?;
                }
            }
        }
        for (at, colour) in &self.dots {
            let fill = shade(COLOURS[*colour % COLOURS.len()], self.eye[2].dot(*at) > -1.0e-9);
            area.draw(&Circle::new(self.place(*at), pixels(4), fill.filled())).map_err(failed)?;
        }
        for Label { at, text, colour, off } in &self.labels {
            let ink = colour.map_or(BLACK, |colour| COLOURS[colour % COLOURS.len()]);
            let font =
                ("sans-serif", pixels(14)).into_font().color(&ink).pos(Pos::new(HPos::Center, VPos::Center));
            let (x, y) = self.place(*at);
            area.draw(&Text::new(text.clone(), (x + off[0], y + off[1]), font)).map_err(failed)?;
        }
        Ok(())
    }
}

fn style(pen: Pen, front: bool) -> ShapeStyle {
    match pen {
        Pen::Thin => shade(RGBColor(130, 130, 130), front).stroke_width(pixels(1)),
        Pen::Strong(colour) => shade(COLOURS[colour % COLOURS.len()], front).stroke_width(pixels(2)),
    }
}

/// Returns the colour, made paler if it is for a part behind the plane through the sphere's centre.
fn shade(colour: RGBColor, front: bool) -> RGBColor {
    let pale = |c: u8| if front { c } else { ((u16::from(c) + 2 * 235) / 3) as u8 };
    RGBColor(pale(colour.0), pale(colour.1), pale(colour.2))
}

/// Sets the size of a picture to `width` and `height` pixels without changing the drawing.
fn shrunk(svg: &str, (width, height): (u32, u32)) -> String {
    let of = |width: u32, height: u32| format!(r#"<svg width="{width}" height="{height}""#);
    // The header holds the size in drawing points. The viewBox holds it too and stays.
    svg.replacen(&of(pixels(width), pixels(height)), &of(width, height), 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks that the corners of a circle are drawn within a small fraction of a pixel of their
    /// true places.
    #[test]
    fn circles_do_not_wobble() {
        let mut sketch = Sketch::new("A pole", 0.0, 90.0);
        sketch.circle(Vec3::Z, core::f64::consts::FRAC_PI_6, Pen::Thin);
        let svg = Sketch::panels(&[sketch]);
        let head = r#"<svg width="500" height="480" viewBox="0 0 8000 7680""#;
        assert!(svg.starts_with(head), "{}", &svg[..100]);
        let points = svg.split("points=\"").nth(1).and_then(|rest| rest.split('"').next()).expect("a line");
        let mut corners = 0;
        for point in points.split_whitespace() {
            let (x, y) = point.split_once(',').expect("x and y");
            let pixel = |points: &str| points.parse::<f64>().expect("a number") / f64::from(FINE);
            let far = libm::hypot(pixel(x) - f64::from(CENTRE.0), pixel(y) - f64::from(CENTRE.1));
            // Rounding by half a point in each direction.
            assert!((far - 0.5 * f64::from(SCALE)).abs() < 0.75 / f64::from(FINE), "{far}");
            corners += 1;
        }
        assert!(corners > 60, "{corners}");
    }
}
