//! A spring to a reference that moves by itself: swings of a sine or a chirp, way-points, a recorded path.
//!
//! q_d = turn(t) q_r, with q_r the effect's reference and the turn in N; T = -K log(q q_d⁻¹) - D (w - w_d), with w_d the turn's own rate.
//! Between way-points the angle goes as 10 u³ - 15 u⁴ + 6 u⁵ (minimum jerk: Flash and Hogan 1985) and rests at each; between
//! the points of a record at a constant rate. It gives energy: what moving the reference puts into the spring.

use super::target::Target;
use super::{Anchor, Law, Now};
use crate::real::{Quat, Real, TURN, Vec3, floor, sincos};
use crate::rotation::{self, from_parts, vector_part};

/// How a track's reference moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TrackPath {
    /// Amplitude times a sine about an axis, its frequency going from one to the other in a time.
    Swing {
        /// In N, unit.
        axis: Vec3,
        /// rad.
        amplitude: Real,
        /// Frequency at the start, Hz.
        from: Real,
        /// Frequency at the end, Hz.
        to: Real,
        /// How long the sweep takes, s; 0 stays at `from`.
        sweep: Real,
        /// Whether the sweep goes back and forth for ever; else it stays at `to`.
        repeat: bool,
    },
    /// From point to point of the effect's figures, each [t, w, x, y, z]: time in s, ascending, and a unit quaternion.
    Points {
        /// Smoothly, with a rest at each; else at constant rates.
        rest: bool,
        /// Whether it starts over at the last point.
        repeat: bool,
    },
}

/// A spring to a reference that moves by itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Track {
    /// What the path starts from.
    pub target: Target,
    /// How it goes on.
    pub path: TrackPath,
    /// N m/rad.
    pub stiffness: Real,
    /// N m s/rad.
    pub damping: Real,
    /// No spring torque within this angle of the reference, rad.
    pub deadband: Real,
}

/// Where a track stands.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct TrackPlace {
    /// Since the start, or since the path began again, s.
    time: Real,
    /// Of the sine, 0 to 1.
    phase: Real,
    /// The last rotation vector, which decides the side of a half turn.
    branch: Vec3,
}

/// Figures of one point.
const POINT: usize = 5;

fn orientation(point: &[Real]) -> Quat {
    from_parts(point[1], Vec3::new(point[2], point[3], point[4]))
}

impl TrackPath {
    /// The turn at a place, and its rate, both in N.
    #[inline]
    fn at(&self, place: &TrackPlace, figures: &[Real]) -> (Quat, Vec3) {
        match *self {
            Self::Swing { axis, amplitude, .. } => {
                let (sine, cosine) = sincos(TURN * place.phase);
                let rate = amplitude * TURN * self.frequency(place.time) * cosine;
                (rotation::exp(axis * (amplitude * sine)), axis * rate)
            }
            Self::Points { rest, .. } => along(figures, place.time, rest),
        }
    }

    /// Frequency of a swing at a time, Hz.
    fn frequency(&self, time: Real) -> Real {
        match *self {
            Self::Swing { from, to, sweep, .. } if sweep > 0.0 => {
                // A sweep that repeats comes back as it went.
                let part = time / sweep;
                from + (to - from) * (if part > 1.0 { 2.0 - part } else { part }).max(0.0)
            }
            Self::Swing { from, .. } => from,
            Self::Points { .. } => 0.0,
        }
    }

    #[inline]
    fn advance(&self, place: &mut TrackPlace, figures: &[Real], dt: Real) {
        match *self {
            Self::Swing { sweep, repeat, .. } => {
                let before = self.frequency(place.time);
                place.time += dt;
                if repeat && place.time > 2.0 * sweep {
                    place.time -= 2.0 * sweep;
                } else if !repeat {
                    place.time = place.time.min(sweep);
                }
                place.phase += 0.5 * (before + self.frequency(place.time)) * dt;
                place.phase -= floor(place.phase);
            }
            Self::Points { repeat, .. } => {
                let end = figures.len().checked_sub(POINT).map_or(0.0, |last| figures[last]);
                place.time += dt;
                if place.time > end {
                    place.time = if repeat && end > 0.0 { place.time - end } else { end };
                }
            }
        }
    }
}

/// The turn and its rate at a time on the way along points.
fn along(figures: &[Real], time: Real, rest: bool) -> (Quat, Vec3) {
    let count = figures.len() / POINT;
    let point = |i: usize| &figures[i * POINT..(i + 1) * POINT];
    // The first point that is still to come.
    let (mut low, mut high) = (0, count);
    while low < high {
        let middle = (low + high) / 2;
        if point(middle)[0] > time {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    if count == 0 {
        return (Quat::IDENTITY, Vec3::ZERO);
    }
    if low == 0 || low == count {
        return (orientation(point(low.saturating_sub(1))), Vec3::ZERO);
    }
    let (from, to) = (point(low - 1), point(low));
    let whole = to[0] - from[0];
    let u = (time - from[0]) / whole;
    let (part, rate) = if rest {
        (u * u * u * (10.0 - u * (15.0 - 6.0 * u)), 30.0 * u * u * (1.0 - u) * (1.0 - u) / whole)
    } else {
        (u, 1.0 / whole)
    };
    let start = orientation(from);
    let way = rotation::difference(orientation(to), start);
    (rotation::renormalized(rotation::exp(way * part) * start), way * rate)
}

impl Law for Track {
    type Memory = TrackPlace;

    #[inline]
    fn render(&self, now: &mut Now<'_>, place: &mut TrackPlace) -> Vec3 {
        let (turn, rate) = self.path.at(place, now.figures);
        let desired = turn * now.reference.q;
        let mut x = rotation::shortest(now.motion.q * desired.conjugate());
        if x.w == 0.0 && vector_part(x).dot(place.branch) < 0.0 {
            x = -x;
        }
        let p = vector_part(x) * rotation::angle_over_sine(x.w, vector_part(x));
        place.branch = p;
        let mut torque = super::target::beyond(p, self.deadband) * -self.stiffness;
        if self.damping > 0.0 {
            torque -= (now.motion.omega - now.reference.omega - rate) * self.damping;
        }
        self.path.advance(place, now.figures, now.dt);
        torque
    }

    fn reference(&self) -> Option<(Quat, Anchor)> {
        Some(self.target.reference())
    }

    fn excess(&self, desired: Quat, q: Quat, figures: &[Real]) -> Option<Real> {
        let (start, _) = self.path.at(&TrackPlace::default(), figures);
        Some(rotation::angle_between(start * desired, q))
    }
}
