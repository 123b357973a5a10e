//! A spring to a reference that moves by itself: in swings of a sine or a chirp, through
//! way-points, or along a recorded path.
//!
//! ```text
//! q_d = turn(t) q_r
//! T = -K log(q q_d⁻¹) - D (w - w_d)
//! ```
//!
//! q_r is the effect's reference, the turn is in frame N, and w_d is the rate of the turn. Between
//! way-points the angle follows 10 u³ - 15 u⁴ + 6 u⁵ (minimum jerk: Flash and Hogan 1985) and rests
//! at each point. Between the points of a record the rate is constant. The effect gives out energy:
//! the work that moves the reference against the spring.

use super::target::{Target, places_of_spring};
use super::{Anchor, Law, Now};
use crate::real::{Quat, Real, TURN, Vec3, floor, sincos};
use crate::render::around::Spot;
use crate::rotation::{self, from_parts, vector_part};

/// The motion of the reference to which a track effect pulls the sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub enum TrackPath {
    /// A swing about an axis: a sine whose frequency changes linearly over time.
    Swing {
        /// Axis of the swing, a unit vector in frame N.
        axis: Vec3,
        /// Amplitude of the swing, rad.
        amplitude: Real,
        /// Frequency at the start of the sweep, Hz.
        from: Real,
        /// Frequency at the end of the sweep, Hz.
        to: Real,
        /// Duration of the change of frequency from `from` to `to`, s. If 0, the frequency stays at
        /// `from`.
        sweep: Real,
        /// True if the frequency goes back and forth forever. If false, it stays at `to` after the
        /// sweep.
        repeat: bool,
    },
    /// A path through points in the effect's table of numbers. Each point is `[t, w, x, y, z]`: a
    /// time in s, ascending, and an orientation as a unit quaternion.
    Points {
        /// True if the reference moves smoothly and rests at each point. If false, it moves at a
        /// constant rate from each point to the next.
        rest: bool,
        /// True if the path starts over after the last point.
        repeat: bool,
    },
}

/// An effect that pulls the sphere to a moving reference, like a spring.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Track {
    /// Orientation relative to which the path is given.
    pub target: Target,
    /// Motion of the reference over time.
    pub path: TrackPath,
    /// Stiffness of the spring to the reference, N m/rad.
    pub stiffness: Real,
    /// Viscous damping of motion relative to the reference, N m s/rad.
    pub damping: Real,
    /// Dead band, rad: there is no spring torque while the sphere is within this angle of the
    /// reference.
    pub deadband: Real,
}

/// The memory of a track effect from one tick to the next: how far its path has run.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct TrackPlace {
    /// Time since the path started or started over, s.
    time: Real,
    /// Phase of the swing's sine, 0 to 1.
    phase: Real,
    /// The rotation vector from the reference to the sphere in the last tick, rad. At exactly a
    /// half turn, it decides between the two possible directions of the torque.
    branch: Vec3,
}

/// Count of numbers that describe one point of a path: `[t, w, x, y, z]`.
const POINT: usize = 5;

fn orientation(point: &[Real]) -> Quat {
    from_parts(point[1], Vec3::new(point[2], point[3], point[4]))
}

impl TrackPath {
    /// Returns how far the path has turned the reference at `place`, and the angular velocity of
    /// this turn (rad/s). Both are in frame N.
    #[inline]
    fn at(&self, place: &TrackPlace, numbers: &[Real]) -> (Quat, Vec3) {
        match *self {
            Self::Swing { axis, amplitude, .. } => {
                let (sine, cosine) = sincos(TURN * place.phase);
                let rate = amplitude * TURN * self.frequency(place.time) * cosine;
                (rotation::exp(axis * (amplitude * sine)), axis * rate)
            }
            Self::Points { rest, .. } => along(numbers, place.time, rest),
        }
    }

    /// Returns the frequency of a swing `time` seconds after its start, Hz.
    fn frequency(&self, time: Real) -> Real {
        match *self {
            Self::Swing { from, to, sweep, .. } if sweep > 0.0 => {
                // A sweep that repeats comes back in the same way.
                let part = time / sweep;
                from + (to - from) * (if part > 1.0 { 2.0 - part } else { part }).max(0.0)
            }
            Self::Swing { from, .. } => from,
            Self::Points { .. } => 0.0,
        }
    }

    #[inline]
    fn advance(&self, place: &mut TrackPlace, numbers: &[Real], dt: Real) {
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
                let end = numbers.len().checked_sub(POINT).map_or(0.0, |last| numbers[last]);
                place.time += dt;
                if place.time > end {
                    place.time = if repeat && end > 0.0 { place.time - end } else { end };
                }
            }
        }
    }
}

/// Returns how far a path through points has turned the reference at `time`, and the angular
/// velocity of this turn (rad/s). `rest` is true if the reference rests at each point.
fn along(numbers: &[Real], time: Real, rest: bool) -> (Quat, Vec3) {
    let count = numbers.len() / POINT;
    let point = |i: usize| &numbers[i * POINT..(i + 1) * POINT];
    // Finds the first point after `time`.
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

    const GIVES: bool = true;

    #[inline]
    fn render(&self, now: &mut Now<'_>, place: &mut TrackPlace) -> Vec3 {
        let (turn, rate) = self.path.at(place, now.numbers);
        let turn = if now.ahead > 0.0 { rotation::exp(rate * now.ahead) * turn } else { turn };
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
        self.path.advance(place, now.numbers, now.dt);
        torque
    }

    fn reference(&self) -> Option<(Quat, Anchor)> {
        Some(self.target.reference())
    }

    fn excess(&self, desired: Quat, q: Quat, numbers: &[Real]) -> Option<Real> {
        let (start, _) = self.path.at(&TrackPlace::default(), numbers);
        Some((rotation::angle_between(start * desired, q) - self.deadband).max(0.0))
    }

    fn places(&self, numbers: &[Real], visit: &mut dyn FnMut(Spot, Quat, Vec3, TrackPlace)) {
        // The path turns the reference in frame N.
        let (reference, _) = self.target.reference();
        let start = reference.conjugate() * self.path.at(&TrackPlace::default(), numbers).0 * reference;
        places_of_spring(&[Vec3::X, Vec3::Y, Vec3::Z], self.deadband, &mut |spot, x, deeper, memory| {
            visit(spot, start * x, deeper, memory);
        });
    }
}
