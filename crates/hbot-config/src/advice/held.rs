//! Whether a sphere in one hold is stable: the turns of the determinant det(I + L(z)), counted
//! along the region outside the unit circle. What belongs to the rig and the hold alone is computed
//! once for all scenes.

use std::cell::{Cell, OnceCell};
use std::f64::consts::PI;

use hbot_core::{Mat3, Vec3};

use super::axis::Axis;
use super::complex::{Complex, determinant};
use super::inertia::principal;
use super::limit::Limit;
use super::sampled::{Hold, Sampled, Scene};

/// Growth of a swing that still counts as stable, 1/s: by a factor e in 20 s. Any friction takes
/// that.
const GROWTH: f64 = 0.05;
/// Slowest swing that counts, rad/s: half a turn of phase in a second. Slower motion is no shaking.
/// Nearer to the real axis, rounding would hide a determinant of directions that nothing holds.
const SLOWEST: f64 = PI;
/// Distance from the circle at which the determinant is 1, except for rounding.
const FAR: f64 = 1.0e3;
/// Largest number of points at which the determinant is computed. A usual scene needs a few
/// hundred.
const MOST_POINTS: u32 = 20_000;
/// Ratio between the distances or angles of two points, and the largest difference between two
/// angles (rad), before points are added where the determinant turns quickly.
const RATIO: f64 = 4.0;
const ANGLE: f64 = 0.8;
/// Largest change of the determinant between two points: the tangent of its angle, of 0.8 rad, and
/// the square of its size, of a factor exp(0.8).
const MOST_ANGLE: f64 = 1.03;
const MOST_SIZE: f64 = 4.95;
/// Number of points between two others whose responses are kept: those of five halvings.
const KEPT: usize = 32;

/// Number of a point beyond which no stretch is halved further: after 30 halvings. The determinant
/// is 0 there, or it cannot be followed.
const FINEST: usize = 1 << 30;

/// A sphere in one hold, as the loop of a rig sees it.
pub(super) struct Held<'a> {
    sampled: &'a Sampled,
    axes: [Axis; 3],
    free: bool,
    /// The points from far outside to the circle, and along the circle: whether they are on it,
    /// and their distance or angle.
    points: Vec<(bool, f64)>,
    /// For each of these points, its responses and those at halvings up to the next point.
    kept: Vec<OnceCell<Point>>,
}

/// The responses of the three axes at one z.
#[derive(Clone, Copy)]
struct Point {
    /// Pace of a swing, rad/s: the angle of z over the period.
    pace: f64,
    /// 1/z.
    back: Complex,
    /// What the determinant's rows are multiplied with.
    level: Complex,
    /// Angle and rate of each axis, times `level`.
    responses: [[Complex; 2]; 3],
}

/// The place of a point: the index of the point before it, and its number among the halvings. The
/// first half of the stretch `n` has the number 2 n, the second half 2 n + 1.
type Place = (usize, usize);

impl<'a> Held<'a> {
    pub(super) fn new(sampled: &'a Sampled, hold: &Hold) -> Self {
        // From far out along the ray of the slowest swing to the circle, and along the circle to
        // the negative real axis. Each pair of zeros outside turns the determinant back by a turn.
        let slowest = Self::slowest(sampled);
        let distances = std::iter::successors(Some(FAR), |beyond| Some(beyond / RATIO));
        let distances = distances.take_while(|beyond| *beyond > 0.1 * slowest).chain([0.0]);
        let angles = std::iter::successors(Some(slowest), |angle| {
            (*angle < PI).then(|| (angle * RATIO).min(angle + ANGLE).min(PI))
        });
        let points: Vec<_> = distances.map(|x| (false, x)).chain(angles.map(|x| (true, x))).collect();
        Self {
            sampled,
            axes: [0, 1, 2].map(|k| Axis::new(sampled, sampled.inertia[k], hold)),
            free: hold.stiffness == 0.0,
            kept: vec![OnceCell::new(); points.len() * KEPT],
            points,
        }
    }

    fn slowest(sampled: &Sampled) -> f64 {
        (SLOWEST * sampled.period).min(0.05)
    }

    /// Returns whether the loop keeps `scene` stable: if there is a `limit`, in all swings that are
    /// slower than its speed.
    ///
    /// With the limits' describing function, a swing of one speed and pace keeps itself up where
    /// the determinant is 0. So the determinant's turns change from one speed to another if there
    /// is such a swing between them.
    pub(super) fn is_stable(&self, scene: &Scene, limit: Option<Limit>) -> bool {
        let (turns, left) = self.turns(scene, limit);
        // A determinant that could not be followed speaks for no scene.
        left > 0 && turns > -0.5 * PI
    }

    /// Returns the angle by which the determinant turns around the half of the region outside the
    /// unit circle in which swings are, rad, and how many points were left to compute.
    fn turns(&self, scene: &Scene, limit: Option<Limit>) -> (f64, u32) {
        let closed = Closed::new(self.sampled, scene, limit);
        let left = Cell::new(MOST_POINTS);
        let count = |(index, number): Place, (circle, place): (bool, f64)| {
            left.set(left.get().saturating_sub(1));
            let compute = || self.compute(circle, place);
            if number < KEPT {
                closed.at(self.kept[index * KEPT + number].get_or_init(compute))
            } else {
                closed.at(&compute())
            }
        };
        let mut sum = 0.0;
        let mut last: Option<(bool, f64, Complex)> = None;
        for (index, (circle, place)) in self.points.iter().copied().enumerate() {
            let next = count((index, 0), (circle, place));
            if let Some((on, from, before)) = last
                && on == circle
            {
                let at = |number, place| count((index - 1, number), (circle, place));
                sum += turned(&at, 1, (from, before), (place, next), &left);
            }
            last = Some((circle, place, next));
        }
        (sum, left.get())
    }

    fn compute(&self, circle: bool, place: f64) -> Point {
        let radius = 1.0 + GROWTH * self.sampled.period;
        let z = if circle {
            Complex::polar(radius, place)
        } else {
            Complex::polar(radius + place, Self::slowest(self.sampled))
        };
        let back = z.inverse();
        let one = Complex::real(1.0);
        // Where nothing holds the sphere the determinant has two poles at 1 for each axis. Without
        // them it changes less near 1. What takes their place is inside the circle.
        let level = if self.free { (one - back) * (one - back) } else { one };
        let responses =
            [0, 1, 2].map(|k| self.axes[k].responses(self.sampled, z).map(|response| response * level));
        Point { pace: z.angle() / self.sampled.period, back, level, responses }
    }
}

/// Returns the angle by which the determinant turns from one place to another, rad. Adds places
/// between them where it changes quickly. `number` is that of the middle between them.
///
/// Between a place and the middle it may change by [`MOST_ANGLE`] and [`MOST_SIZE`]. The size
/// matters where several axes have equal zeros: their turns add up to whole ones, which the angle
/// alone does not show.
fn turned(
    at: &impl Fn(usize, f64) -> Complex,
    number: usize,
    from: (f64, Complex),
    to: (f64, Complex),
    left: &Cell<u32>,
) -> f64 {
    // The last stretch to the circle ends at the distance 0.
    let place = if to.0 > 0.0 { (from.0 * to.0).sqrt() } else { 0.5 * from.0 };
    let middle = (place, at(number, place));
    // The ratio of two values, times the square of the first one's size.
    let over = |to: Complex, from: Complex| to * Complex { im: -from.im, ..from };
    let little = |to: Complex, from: Complex| {
        let ratio = over(to, from);
        let square = |x: Complex| x.re * x.re + x.im * x.im;
        let (before, after) = (square(from), square(to));
        ratio.im.abs() < MOST_ANGLE * ratio.re && after < MOST_SIZE * before && before < MOST_SIZE * after
    };
    if little(middle.1, from.1) && little(to.1, middle.1) {
        return over(to.1, from.1).angle();
    }
    if left.get() == 0 || number >= FINEST {
        return over(middle.1, from.1).angle() + over(to.1, middle.1).angle();
    }
    turned(at, 2 * number, from, middle, left) + turned(at, 2 * number + 1, middle, to, left)
}

/// The closed loop: everything of a scene that det(I + L(z)) needs, in the rig's axes.
struct Closed {
    period: f64,
    limit: Option<(Limit, [Direction; 3])>,
    /// The frame of the rows of the matrices below: that of the limits' directions, if there are
    /// some. By columns.
    frame: [[f64; 3]; 3],
    stiffness: [[f64; 3]; 3],
    damping: [[f64; 3]; 3],
    masses: Vec<([[f64; 3]; 3], f64)>,
}

/// A direction of torque, with the sizes of a scene about it.
struct Direction {
    stiffness: f64,
    damping: f64,
    masses: Vec<f64>,
}

impl Direction {
    fn new(axis: Vec3, stiffness: &Mat3, damping: &Mat3, masses: &[(Mat3, f64)]) -> Self {
        let about = |m: &Mat3| axis.dot(*m * axis);
        let masses = masses.iter().map(|(mass, _)| about(mass)).collect();
        Self { stiffness: about(stiffness), damping: about(damping), masses }
    }
}

impl Closed {
    fn new(sampled: &Sampled, scene: &Scene, limit: Option<Limit>) -> Self {
        let turned = |m: &Mat3| sampled.axes.transpose() * *m * sampled.axes;
        let stiffness = turned(&scene.stiffness);
        let part = |smoothing: f64| sampled.period / (smoothing + sampled.period);
        let damping = turned(&scene.damping) + stiffness * sampled.lead;
        let masses: Vec<_> =
            scene.masses.iter().map(|(m, smoothing)| (turned(m), part(*smoothing))).collect();
        let mut frame = Mat3::IDENTITY;
        let limit = limit.map(|limit| {
            let all = masses.iter().fold(stiffness * sampled.lateness() + damping, |sum, (m, part)| {
                sum + *m * (*part / sampled.period)
            });
            let axes = principal(&((all + all.transpose()) * 0.5)).1;
            frame = axes.transpose();
            (limit, [0, 1, 2].map(|k| Direction::new(axes.col(k), &stiffness, &damping, &masses)))
        });
        let columns = |m: &Mat3| (frame * *m).to_cols_array_2d();
        Self {
            period: sampled.period,
            limit,
            frame: frame.to_cols_array_2d(),
            stiffness: columns(&stiffness),
            damping: columns(&damping),
            masses: masses.iter().map(|(m, part)| (columns(m), *part)).collect(),
        }
    }

    /// Returns det(I + L(z)).
    fn at(&self, point: &Point) -> Complex {
        let Point { pace, back, level, responses } = point;
        let one = Complex::real(1.0);
        // A virtual mass resists the change of the rate since the last tick, smoothed: how much,
        // for each entry of the matrix and about each direction of the limits.
        let mut resists = [[Complex::real(0.0); 3]; 3];
        let mut about = [Complex::real(0.0); 3];
        for (n, (mass, part)) in self.masses.iter().enumerate() {
            let change = (one - *back) * (*part / self.period);
            let smoothed = change * (one - *back * (1.0 - part)).inverse();
            for j in 0..3 {
                for i in 0..3 {
                    resists[j][i] = resists[j][i] + smoothed * mass[j][i];
                }
                if let Some((_, directions)) = &self.limit {
                    about[j] = about[j] + smoothed * directions[j].masses[n];
                }
            }
        }
        // By columns.
        let mut m = [[Complex::real(0.0); 3]; 3];
        for j in 0..3 {
            let [angle, rate] = responses[j];
            for i in 0..3 {
                let damping = resists[j][i] + self.damping[j][i];
                m[j][i] = angle * self.stiffness[j][i] + rate * damping;
            }
        }
        if let Some((limit, directions)) = &self.limit {
            // The part of the torque about each direction that is made.
            for (i, of) in directions.iter().enumerate() {
                let asked = about[i] + Complex { re: of.damping, im: -of.stiffness / *pace };
                let part = limit.part(limit.speed * asked.size(), *pace);
                if part != one {
                    m.iter_mut().for_each(|column| column[i] = column[i] * part);
                }
            }
        }
        for j in 0..3 {
            for i in 0..3 {
                m[j][i] = m[j][i] + *level * self.frame[j][i];
            }
        }
        determinant(&m)
    }
}

#[cfg(test)]
mod tests {
    use super::super::sampled::HOLDS;
    use super::*;

    /// Directions that nothing holds, in any frame, beside a stiff one: their determinant is lost
    /// in rounding near the real axis. A search there would not end.
    #[test]
    fn directions_that_nothing_holds_cost_no_time() {
        let turn = Mat3::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 0.7);
        for period in [2.0e-3, 2.5e-4, 5.0e-5] {
            let sampled = Sampled {
                period,
                delay: 1,
                lag: 5.0e-4,
                lead: 0.0,
                rate_lag: 0.0,
                taps: Vec::new(),
                inertia: Vec3::splat(3.4e-3),
                axes: Mat3::IDENTITY,
            };
            let free = Held::new(&sampled, &HOLDS[0]);
            for stiffness in [1.0e-3, 1.0, 1.0e3, 1.0e6] {
                let held = turn * Mat3::from_diagonal(Vec3::X * stiffness) * turn.transpose();
                let scene = Scene { stiffness: held, damping: held * 0.01, masses: Vec::new() };
                let points = MOST_POINTS - free.turns(&scene, None).1;
                assert!(points < 1000, "{period} {stiffness}: {points} points");
                // 0.01 s of damping per stiffness is more than the delay takes away.
                if stiffness < 2.0 {
                    assert!(free.is_stable(&scene, None), "{period} {stiffness}");
                }
            }
        }
    }
}
