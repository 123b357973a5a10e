//! Sketches of a sphere and what stands around it, seen from far away.

use hbot_core::Vec3;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::{COLOURS, Failed, Surface, drawn, failed};

/// Pixels of each panel.
const SIZE: (u32, u32) = (500, 480);
/// Pixels of a length of 1, the sphere's radius.
const SCALE: f64 = 140.0;
/// Where the centre stands in its panel, pixels.
const CENTRE: (f64, f64) = (250.0, 240.0);

/// How a line is drawn.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Pen {
    /// A thin grey one.
    Thin,
    /// A strong one of a colour.
    Strong(usize),
}

/// One panel: what is drawn in units of the sphere's radius, in N, around its centre.
///
/// What lies behind the sphere's middle plane is drawn paler.
#[derive(Debug, Clone)]
pub(crate) struct Sketch {
    title: String,
    /// Right, up, and towards the eye.
    eye: [Vec3; 3],
    lines: Vec<(Vec<Vec3>, Pen)>,
    dots: Vec<(Vec3, usize)>,
    labels: Vec<Label>,
}

/// A name beside a place.
#[derive(Debug, Clone)]
struct Label {
    at: Vec3,
    text: String,
    /// Black without one.
    colour: Option<usize>,
    /// How far right and down of the place, pixels.
    off: (i32, i32),
}

impl Sketch {
    /// Nothing but the sphere's outline, seen from `azimuth` (about n3 from n1) and `elevation`, deg.
    pub(crate) fn new(title: impl Into<String>, azimuth: f64, elevation: f64) -> Self {
        let (sa, ca) = libm::sincos(azimuth.to_radians());
        let (se, ce) = libm::sincos(elevation.to_radians());
        let towards = Vec3::new(ce * ca, ce * sa, se);
        let right = Vec3::new(-sa, ca, 0.0);
        let eye = [right, towards.cross(right), towards];
        Self { title: title.into(), eye, lines: Vec::new(), dots: Vec::new(), labels: Vec::new() }
    }

    /// A line through `points`.
    pub(crate) fn line(&mut self, points: Vec<Vec3>, pen: Pen) -> &mut Self {
        self.lines.push((points, pen));
        self
    }

    /// A line from `from` to `to` with a head.
    fn arrow(&mut self, from: Vec3, to: Vec3, pen: Pen) -> &mut Self {
        let along = to - from;
        let side = along.cross(self.eye[2]);
        let length = along.length();
        let width = side.length().max(1.0e-9);
        // A head of a fixed size, but never longer than half of the arrow.
        let head = f64::min(0.07, 0.5 * length);
        let (back, out) = (along * (head / length), side * (0.45 * head / width));
        self.line(vec![from, to], pen);
        self.line(vec![to - back + out, to, to - back - out], pen)
    }

    /// An arrow with a name beyond its head.
    pub(crate) fn named(&mut self, from: Vec3, to: Vec3, name: &str, pen: Pen) -> &mut Self {
        let colour = match pen {
            Pen::Thin => None,
            Pen::Strong(colour) => Some(colour),
        };
        let [a, b] = [from, to].map(|at| self.place(at));
        let (x, y) = (f64::from(b.0 - a.0), f64::from(b.1 - a.1));
        let length = libm::hypot(x, y);
        // An arrow that points at the eye has its name above.
        let (x, y) = if length > 6.0 { (x / length, y / length) } else { (0.0, -1.0) };
        let off = ((14.0 * x).round() as i32, (13.0 * y).round() as i32);
        self.labels.push(Label { at: to, text: name.to_owned(), colour, off });
        self.arrow(from, to, pen)
    }

    /// A point.
    pub(crate) fn dot(&mut self, at: Vec3, colour: usize) -> &mut Self {
        self.dots.push((at, colour));
        self
    }

    /// The circle of the unit vectors at `angle` (rad) from `axis`.
    pub(crate) fn circle(&mut self, axis: Vec3, angle: f64, pen: Pen) -> &mut Self {
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

    /// Panels, two in a row.
    pub(crate) fn panels(all: &[Self]) -> String {
        let columns = all.len().min(2);
        let rows = all.len().div_ceil(columns.max(1));
        let mut out = String::new();
        drawn(&mut out, (SIZE.0 * columns as u32, SIZE.1 * rows as u32), |area| {
            let parts = area.split_evenly((rows, columns));
            all.iter().zip(&parts).try_for_each(|(sketch, part)| sketch.draw(part))
        });
        out
    }

    fn place(&self, at: Vec3) -> (i32, i32) {
        let [x, y] = [self.eye[0], self.eye[1]].map(|axis| SCALE * axis.dot(at));
        ((CENTRE.0 + x).round() as i32, (CENTRE.1 - y).round() as i32)
    }

    fn draw(&self, area: &Surface<'_>) -> Result<(), Failed> {
        let title = ("sans-serif", 16).into_font().color(&BLACK).pos(Pos::new(HPos::Center, VPos::Top));
        area.draw(&Text::new(self.title.clone(), (SIZE.0 as i32 / 2, 8), title)).map_err(failed)?;
        let centre = self.place(Vec3::ZERO);
        area.draw(&Circle::new(centre, SCALE as i32, RGBColor(246, 247, 250).filled())).map_err(failed)?;
        area.draw(&Circle::new(centre, SCALE as i32, RGBColor(150, 150, 150).stroke_width(1)))
            .map_err(failed)?;
        // Far ones first.
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
            area.draw(&Circle::new(self.place(*at), 4, fill.filled())).map_err(failed)?;
        }
        for Label { at, text, colour, off } in &self.labels {
            let ink = colour.map_or(BLACK, |colour| COLOURS[colour % COLOURS.len()]);
            let font = ("sans-serif", 14).into_font().color(&ink).pos(Pos::new(HPos::Center, VPos::Center));
            let (x, y) = self.place(*at);
            area.draw(&Text::new(text.clone(), (x + off.0, y + off.1), font)).map_err(failed)?;
        }
        Ok(())
    }
}

fn style(pen: Pen, front: bool) -> ShapeStyle {
    match pen {
        Pen::Thin => shade(RGBColor(130, 130, 130), front).stroke_width(1),
        Pen::Strong(colour) => shade(COLOURS[colour % COLOURS.len()], front).stroke_width(2),
    }
}

/// The colour itself, or a paler one for what is behind.
fn shade(colour: RGBColor, front: bool) -> RGBColor {
    let pale = |c: u8| if front { c } else { ((u16::from(c) + 2 * 235) / 3) as u8 };
    RGBColor(pale(colour.0), pale(colour.1), pale(colour.2))
}
