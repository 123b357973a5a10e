//! Notches of a dial.
//!
//! Let psi be the dial's angle (physics notes, section 6), d its distance from the nearest notch, w
//! the half width of a notch and A its strength. The energy is V = (A w/pi) (1 - cos(pi d/w)) for
//! |d| < w and constant beyond. The torque -A sin(pi d/w) is 0 at the notch and at its rim, and A
//! half way. Notches nearer to each other than 2 w meet half way. Beyond the outermost of given
//! positions the energy is constant. With closed ends there is a wall instead: V = 1/2 K d². The
//! energy is continuous and has a continuous slope everywhere.

use super::geometry::{Dial, Turns};
use super::knock::{Meets, Touched};
use super::target::Target;
use super::{Anchor, Law, Now};
use crate::real::{PI, Quat, Real, TURN, Vec3, fabs, round, sincos};
use crate::render::around::Spot;
use crate::render::outline::{Angles, Outline};
use crate::rotation::{exp, shortest};

/// An effect that gives the sphere the notches of a dial: it snaps into notches as it turns about
/// an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Detents {
    /// Orientation from which the dial's angle is measured.
    pub target: Target,
    /// Axis of the dial, a unit vector in the frame of `target`.
    pub axis: Vec3,
    /// Largest torque with which a notch holds the sphere, N m.
    pub strength: Real,
    /// Half of the width of a notch, rad; above 0.
    pub width: Real,
    /// Number of notches, evenly spaced around a turn, with the first at angle 0. If it is 0, the
    /// effect's table of numbers gives the angles of the notches, in rad and in ascending order.
    /// These angles can cover many turns.
    pub count: u16,
    /// Stiffness of the walls beyond the first and last of the given notches, N m/rad. If 0, there
    /// are no walls.
    pub end_stiffness: Real,
    /// Viscous damping of the dial, N m s/rad.
    pub damping: Real,
}

impl Detents {
    /// Returns the dial's energy (J) and its slope (N m) at the angle `psi`. `figures` are the
    /// angles of the notches if they are given one by one, rad.
    #[inline]
    fn profile(&self, psi: Real, numbers: &[Real]) -> (Real, Real) {
        if self.count > 0 {
            let step = TURN / Real::from(self.count);
            return self.notch(psi - step * round(psi / step), 0.5 * step);
        }
        let right = numbers.partition_point(|position| *position <= psi);
        match (right.checked_sub(1).map(|left| numbers[left]), numbers.get(right)) {
            (None, None) => (0.0, 0.0),
            (None, Some(&first)) => self.beyond(psi - first),
            (Some(last), None) => self.beyond(psi - last),
            (Some(left), Some(&right)) => {
                let (from_left, to_right) = (psi - left, right - psi);
                let room = 0.5 * (right - left);
                self.notch(if from_left < to_right { from_left } else { -to_right }, room)
            }
        }
    }

    /// Returns half of the width of a notch, rad. Notches that are given one by one can be narrower
    /// if they are near to each other ([`room`](Self::room)).
    #[inline]
    fn narrowest(&self) -> Real {
        if self.count > 0 { self.width.min(0.5 * TURN / Real::from(self.count)) } else { self.width }
    }

    /// Returns half of the distance between the two given notches on both sides of the angle `psi`,
    /// rad. Infinite beyond the first and the last.
    fn room(&self, psi: Real, positions: &[Real]) -> Real {
        let right = positions.partition_point(|position| *position <= psi);
        match (right.checked_sub(1), positions.get(right)) {
            (Some(left), Some(right)) => 0.5 * (right - positions[left]),
            _ => Real::INFINITY,
        }
    }

    /// Returns the number of the notch that is nearest to the angle `psi` (above 0), the distance
    /// from it and half of its width, rad. Returns `None` if there is no notch.
    fn nearest(&self, psi: Real, numbers: &[Real]) -> Option<(u16, Real, Real)> {
        if self.count > 0 {
            let step = TURN / Real::from(self.count);
            let turns = round(psi / step);
            // The number of a notch around a turn. Angles of many turns stay far below the range.
            let number = (turns as i64).rem_euclid(i64::from(self.count)) as u16;
            return Some((number + 1, psi - step * turns, self.width.min(0.5 * step)));
        }
        let right = numbers.partition_point(|position| *position <= psi);
        let left = right.checked_sub(1);
        let distance = |k: usize| numbers.get(k).map(|position| psi - position);
        let k = match (left.and_then(distance), distance(right)) {
            (Some(from_left), Some(to_right)) if from_left >= -to_right => right,
            (None, Some(_)) => right,
            (Some(_), _) => left?,
            (None, None) => return None,
        };
        let gap = |k: usize| Some(0.5 * (numbers.get(k + 1)? - numbers.get(k)?));
        let rooms = [k.checked_sub(1).and_then(gap), gap(k)];
        let width = rooms.into_iter().flatten().fold(self.width, Real::min);
        Some((k as u16 + 1, distance(k)?, width))
    }

    /// Returns the dial's energy (J) and its slope (N m) at the distance `d` (rad) from a notch.
    /// `room` is half of the distance to the next notch, rad.
    #[inline]
    fn notch(&self, d: Real, room: Real) -> (Real, Real) {
        let width = self.width.min(room);
        let scale = self.strength * width * (1.0 / PI);
        if fabs(d) >= width {
            return (2.0 * scale, 0.0);
        }
        let (sine, cosine) = sincos(PI * d / width);
        (scale * (1.0 - cosine), self.strength * sine)
    }

    /// Returns the dial's energy (J) and its slope (N m) at the angle `d` (rad) beyond the first or
    /// last notch.
    #[inline]
    fn beyond(&self, d: Real) -> (Real, Real) {
        if self.end_stiffness > 0.0 {
            (0.5 * self.end_stiffness * d * d, self.end_stiffness * d)
        } else {
            self.notch(d, self.width)
        }
    }
}

/// Distance from an end wall at which a dial that touched it has left it, rad.
const LEFT: Real = 2.0e-3;

impl Meets for Detents {
    /// A notch is touched from the steepest place of its flank on, half of its half width from its
    /// middle, and left at its rim.
    fn touched(&self, now: &mut Now<'_>, turns: &Turns, held: [u16; 2]) -> [Option<Touched>; 2] {
        let dial = now.dial(self.axis);
        let psi = turns.unwrap(dial.psi);
        let notch = self.nearest(psi, now.numbers).and_then(|(place, d, width)| {
            let reach = if place == held[0] { width } else { 0.5 * width };
            // A notch is met on the way to its middle.
            (fabs(d) < reach)
                .then_some(Touched { place, way: if d > 0.0 { -dial.gradient } else { dial.gradient } })
        });
        let ends = now.numbers.first().zip(now.numbers.last()).filter(|_| self.count == 0);
        let wall = ends.filter(|_| self.end_stiffness > 0.0).and_then(|(first, last)| {
            let edge = |place: u16| if held[1] == place { -LEFT } else { 0.0 };
            if psi - last > edge(2) {
                Some(Touched { place: 2, way: dial.gradient })
            } else if first - psi > edge(1) {
                Some(Touched { place: 1, way: -dial.gradient })
            } else {
                None
            }
        });
        [notch, wall]
    }
}

impl Law for Detents {
    type Memory = Turns;

    #[inline]
    fn render(&self, now: &mut Now<'_>, turns: &mut Turns) -> Vec3 {
        now.lead_at_most(0.5 * self.narrowest());
        let mut dial = now.dial(self.axis);
        if now.lead > 0.0 && self.count == 0 {
            let room = self.room(turns.unwrap(dial.psi), now.numbers);
            if now.lead_at_most(0.5 * room) {
                dial = now.dial(self.axis);
            }
        }
        let (energy, slope) = self.profile(turns.follow(dial.psi), now.numbers);
        let mut torque = dial.torque(energy, slope);
        if self.damping > 0.0 {
            torque += dial.resist(now.rate(), self.damping);
        }
        now.in_n(torque)
    }

    fn energy(&self, now: &mut Now<'_>, turns: &Turns) -> Option<Real> {
        let dial = now.dial(self.axis);
        let (energy, _) = self.profile(turns.unwrap(dial.psi), now.numbers);
        Some(energy * dial.fade().0)
    }

    fn reference(&self) -> Option<(Quat, Anchor)> {
        Some(self.target.reference())
    }

    fn excess(&self, desired: Quat, q: Quat, numbers: &[Real]) -> Option<Real> {
        let (first, last) = (numbers.first()?, numbers.last()?);
        let psi = Dial::new(shortest(desired.conjugate() * q), self.axis).psi;
        (self.end_stiffness > 0.0).then(|| (first - psi).max(psi - last).max(0.0))
    }

    fn places(&self, numbers: &[Real], visit: &mut dyn FnMut(Spot, Quat, Vec3, Turns)) {
        let mut at = |spot, angle, deeper| {
            visit(spot, exp(self.axis * angle), deeper, Turns::at(angle));
        };
        let gap = |k: usize| numbers[k + 1] - numbers[k];
        match numbers {
            [] => at(Spot::Notch, 0.0, Vec3::ZERO),
            [.., last] => {
                // The notch with the nearest neighbour is the steepest.
                let near = |k: usize| {
                    let left = k.checked_sub(1).map_or(Real::INFINITY, gap);
                    if k + 1 < numbers.len() { left.min(gap(k)) } else { left }
                };
                let narrowest = (0..numbers.len()).min_by(|a, b| near(*a).total_cmp(&near(*b))).unwrap_or(0);
                at(Spot::Notch, numbers[narrowest], Vec3::ZERO);
                if self.end_stiffness > 0.0 {
                    at(Spot::Wall, numbers[0], -self.axis);
                    at(Spot::Wall, *last, self.axis);
                }
            }
        }
    }

    fn outline<'a>(&self, numbers: &'a [Real], visit: &mut dyn FnMut(Outline<'a>)) {
        let angles = if self.count > 0 { Angles::Even(self.count) } else { Angles::At(numbers) };
        let walls = self.count == 0 && self.end_stiffness > 0.0;
        visit(Outline::Notches { axis: self.axis, angles, width: self.width, walls });
    }
}
