//! A person's hand on the sphere: a spring, a damper and a mass, coupled to a moving target.
//!
//! The target is the orientation to which the hand pulls the sphere. It starts at the sphere's
//! orientation when the hand takes hold, at rest, so that taking hold causes no jerk. It then moves
//! about all three axes along sines with incommensurate frequencies, so the motion never repeats
//! exactly. The target depends on time alone: equal times give equal bits.
//!
//! A hand with an angle sweeps about one axis instead, to this angle and back.
//!
//! A [`Guide`] tells the hand where to turn the sphere instead.

use core::f64::consts::TAU;
use std::sync::{Arc, Mutex};

use hbot_core::{Quat, Vec3, rotation};

use crate::phenomena::Hand;
use crate::plant::Load;

/// Frequencies at which the hand's target moves about the three axes, relative to [`Hand::rate`].
/// 1, 1/sqrt 2 and the inverse of the golden ratio have no common period, so the motion never
/// repeats.
const RATIOS: [f64; 3] = [1.0, core::f64::consts::FRAC_1_SQRT_2, 0.618_033_988_749_894_9];

/// Time in which the amplitude of the target's motion rises from 0 to its full value after the hand
/// takes hold, s.
const FADE_S: f64 = 1.0;

/// An orientation to which a program tells the hand to turn the sphere, and how firm its grip is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Guide {
    /// Orientation as a unit quaternion that maps sphere axes to frame N.
    pub q: Quat,
    /// Time in which the hand's target turns there at a constant rate, by the shorter way, s. 0:
    /// at once.
    pub over_s: f64,
    /// Spring stiffness of the grip, N m/rad.
    pub stiffness: f64,
    /// Damping of the grip, N m s/rad.
    pub damping: f64,
    /// Moment of inertia that the hand adds to the sphere, kg m².
    pub inertia: f64,
}

/// A turn of the hand's target at a constant rate.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Turn {
    to: Quat,
    /// Angular velocity until the end, in frame N, rad/s.
    omega: Vec3,
    /// The time at which the target rests at `to`, s.
    until: f64,
}

impl Turn {
    fn target(&self, t: f64) -> HandTarget {
        let left = self.until - t;
        if !(left > 0.0) {
            return HandTarget { q: self.to, omega: Vec3::ZERO };
        }
        HandTarget { q: rotation::exp(self.omega * -left) * self.to, omega: self.omega }
    }
}

/// The torque of the simulated hand on the sphere, for other threads. Clones share one value.
#[derive(Debug, Clone, Default)]
pub struct HandTorque(Arc<Mutex<Option<Vec3>>>);

impl HandTorque {
    /// Returns the hand's torque on the sphere in frame N, N m, at the last command to the motors.
    /// `None` if no hand holds the sphere.
    #[must_use]
    pub fn get(&self) -> Option<Vec3> {
        self.0.lock().map_or(None, |torque| *torque)
    }

    /// Replaces the value. Never waits: while another thread reads it, the old value stays.
    pub(crate) fn set(&self, torque: Option<Vec3>) {
        if let Ok(mut place) = self.0.try_lock() {
            *place = torque;
        }
    }
}

/// A simulated hand that holds the sphere. As a [`Load`] it gives the torque of the hand's spring
/// and damper.
///
/// The hand's inertia is not part of the load. It is added to the plant by
/// [`Plant::set_sphere_inertia`](crate::plant::Plant::set_sphere_inertia).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grip {
    hand: Hand,
    since: f64,
    start: Quat,
    /// Where a program tells the hand to turn. `None`: the hand moves by itself.
    turn: Option<Turn>,
}

/// The orientation and angular velocity to which the hand's spring and damper pull the sphere, at
/// one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HandTarget {
    /// Orientation as a unit quaternion that maps sphere axes to frame N.
    pub q: Quat,
    /// Angular velocity in frame N, rad/s. It is exactly the rate of change of `q`.
    pub omega: Vec3,
}

impl Grip {
    /// Creates the grip of a simulated `hand` that takes hold of the sphere at time `since` (s),
    /// when the sphere's orientation is `q`.
    #[must_use]
    pub fn new(hand: Hand, since: f64, q: Quat) -> Self {
        Self { hand, since, start: q, turn: None }
    }

    /// Creates the grip of a hand that obeys `guide` from the time `since` (s) on. Its target is at
    /// `q` then.
    #[must_use]
    pub fn guided(guide: &Guide, since: f64, q: Quat) -> Self {
        let Guide { q: to, over_s, stiffness, damping, inertia } = *guide;
        let hand = Hand { stiffness, damping, inertia, amplitude: 0.0, rate: 0.0, ..Hand::default() };
        let omega = if over_s > 0.0 { rotation::difference(to, q) / over_s } else { Vec3::ZERO };
        let turn = Turn { to, omega, until: since + over_s.max(0.0) };
        Self { hand, since, start: q, turn: Some(turn) }
    }

    /// Returns whether the hand obeys a program.
    #[must_use]
    pub fn is_guided(&self) -> bool {
        self.turn.is_some()
    }

    /// Returns the parameters of the simulated hand, such as its stiffness.
    #[must_use]
    pub fn hand(&self) -> &Hand {
        &self.hand
    }

    /// Returns the energy stored in the hand's spring, J, if the sphere has the orientation `q` at
    /// time `t` (s).
    #[must_use]
    pub fn energy(&self, t: f64, q: Quat) -> f64 {
        2.0 * self.hand.stiffness * rotation::vector_part(q * self.target(t).q.conjugate()).length_squared()
    }

    /// Returns the orientation and angular velocity to which the hand pulls the sphere at time `t`,
    /// s. Before the hand takes hold, this is the orientation at which it will take hold, at rest.
    #[must_use]
    pub fn target(&self, t: f64) -> HandTarget {
        if let Some(turn) = &self.turn {
            return turn.target(t);
        }
        let age = t - self.since;
        if !(age > 0.0) {
            return HandTarget { q: self.start, omega: Vec3::ZERO };
        }
        if self.hand.angle != 0.0 {
            let axis = Vec3::from_array(self.hand.axis).normalize_or_zero();
            // The sweep begins at rest, so it needs no rising amplitude.
            let pace = TAU * self.hand.rate;
            let (s, c) = libm::sincos(pace * age);
            let angle = self.hand.angle * 0.5 * (1.0 - c);
            let rate = self.hand.angle * 0.5 * pace * s;
            return HandTarget { q: rotation::exp(axis * angle) * self.start, omega: axis * rate };
        }
        // The amplitude's factor rises from 0 to 1 without a jump in rate or acceleration at either
        // end.
        let (fade, fade_rate) = if age < FADE_S {
            let x = age / FADE_S;
            (x * x * x * (10.0 - x * (15.0 - 6.0 * x)), 30.0 * x * x * (1.0 - x) * (1.0 - x) / FADE_S)
        } else {
            (1.0, 0.0)
        };
        let (mut p, mut p_rate) = ([0.0; 3], [0.0; 3]);
        for (k, ratio) in RATIOS.into_iter().enumerate() {
            let pace = TAU * self.hand.rate * ratio;
            let (s, c) = libm::sincos(pace * age);
            p[k] = self.hand.amplitude * fade * s;
            p_rate[k] = self.hand.amplitude * (fade * pace * c + fade_rate * s);
        }
        // The turn is a vector of length 2 tan(angle/2), from which rotation and rate need no
        // further sine.
        let (g, g_rate) = (Vec3::from_array(p) * 0.5, Vec3::from_array(p_rate) * 0.5);
        let size = 1.0 + g.length_squared();
        let turn = rotation::from_parts(1.0, g) * (1.0 / libm::sqrt(size));
        HandTarget { q: turn * self.start, omega: (g_rate + g.cross(g_rate)) * (2.0 / size) }
    }
}

impl Load for Grip {
    type Instant = HandTarget;

    #[inline]
    fn at(&self, t: f64) -> HandTarget {
        self.target(t)
    }

    /// Returns the torque on the sphere by the hand's quaternion spring (isotropic stiffness) and
    /// damper, in frame N, in N m.
    ///
    /// The equations are in the physics notes, section 6. The spring torque is K sin(angle): beyond
    /// a quarter turn it falls, as a person's grip does.
    #[inline]
    fn torque(&self, target: &HandTarget, q: Quat, omega: Vec3) -> Vec3 {
        let error = target.q * q.conjugate();
        rotation::vector_part(error) * (2.0 * self.hand.stiffness * error.w)
            - (omega - target.omega) * self.hand.damping
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn taking_hold_gives_no_torque() {
        let q = rotation::exp(Vec3::new(0.3, -2.0, 1.0));
        let grip = Grip::new(Hand::default(), 5.0, q);
        // q q⁻¹ is the identity to rounding.
        assert!(grip.torque(&grip.at(5.0), q, Vec3::ZERO).length() < 1e-15);
        // The amplitude's factor begins as 10 t³. After 1 ms the target is at A 10 t³ w t = 4e-12
        // rad and moves at 2e-8 rad/s.
        let soon = grip.torque(&grip.at(5.001), q, Vec3::ZERO);
        assert!(soon.length() > 0.0 && soon.length() < 1e-8, "{soon}");
    }

    #[test]
    fn the_target_s_rate_is_the_rate_of_its_orientation() {
        let grip = Grip::new(Hand::default(), 1.0, rotation::exp(Vec3::new(1.0, 0.5, -0.2)));
        for t in [1.2, 1.7, 1.999, 2.3, 7.0, 100.0] {
            let h = 1e-4;
            let turn = rotation::difference(grip.target(t + h).q, grip.target(t - h).q) / (2.0 * h);
            let target = grip.target(t);
            // The error of central differences is h² times a third derivative of order 10 (100
            // while the amplitude rises).
            assert!((turn - target.omega).length() < 1e-6, "t = {t}: {turn} against {}", target.omega);
            assert!((target.q.length() - 1.0).abs() < 4.0 * f64::EPSILON);
        }
    }

    #[test]
    fn the_target_stays_within_its_amplitude_and_uses_all_axes() {
        let grip = Grip::new(Hand::default(), 0.0, Quat::IDENTITY);
        let amplitude = Hand::default().amplitude;
        let mut widest = Vec3::ZERO;
        for i in 0..60_000 {
            let turn = rotation::log(grip.target(f64::from(i) * 1e-3).q);
            widest = widest.max(turn.abs());
            assert!(turn.length() <= amplitude * 3.0f64.sqrt());
        }
        assert!(widest.min_element() > 0.75 * amplitude, "{widest}");
    }

    #[test]
    fn a_hand_with_an_angle_sweeps_about_its_axis_there_and_back() {
        let start = rotation::exp(Vec3::new(0.3, -0.2, 1.0));
        // The axis need not be a unit vector.
        let hand = Hand { axis: [0.0, 0.0, -2.0], angle: 0.7, rate: 0.25, ..Hand::default() };
        let grip = Grip::new(hand, 4.0, start);
        // The tolerances are rounding.
        for (t, part) in [(3.0, 0.0), (4.0, 0.0), (5.0, 0.5), (6.0, 1.0), (7.0, 0.5), (8.0, 0.0)] {
            let turned = rotation::difference(grip.target(t).q, start);
            assert!((turned - Vec3::Z * (-0.7 * part)).length() < 1e-14, "t = {t}: {turned}");
        }
        assert!(grip.target(6.0).omega.length() < 1e-14 && grip.target(8.0).omega.length() < 1e-14);
        for t in [4.3, 5.0, 6.7, 21.1] {
            let h = 1e-4;
            let turn = rotation::difference(grip.target(t + h).q, grip.target(t - h).q) / (2.0 * h);
            // The error of central differences is h² times a third derivative of order 1.
            assert!((turn - grip.target(t).omega).length() < 1e-7, "t = {t}");
        }
    }

    #[test]
    fn a_guided_hand_turns_at_a_constant_rate_and_rests_at_the_end() {
        let (from, axis) = (rotation::exp(Vec3::new(0.3, -0.2, 1.0)), Vec3::new(0.0, 0.6, 0.8));
        let to = rotation::exp(axis * 0.7) * from;
        let guide = Guide { q: to, over_s: 2.0, stiffness: 5.0, damping: 0.1, inertia: 1e-3 };
        let grip = Grip::guided(&guide, 4.0, from);
        assert!(grip.is_guided() && grip.hand().stiffness == 5.0);
        // The tolerances are rounding.
        for (t, part) in [(4.0, 0.0), (4.5, 0.25), (5.0, 0.5), (6.0, 1.0), (60.0, 1.0)] {
            let target = grip.target(t);
            let turned = rotation::difference(target.q, from);
            assert!((turned - axis * (0.7 * part)).length() < 1e-14, "t = {t}: {turned}");
            let rate = if t < 6.0 { axis * 0.35 } else { Vec3::ZERO };
            assert!((target.omega - rate).length() < 1e-14, "t = {t}: {}", target.omega);
        }
        let at_once = Grip::guided(&Guide { over_s: 0.0, ..guide }, 4.0, from);
        assert_eq!(at_once.target(4.0), HandTarget { q: to, omega: Vec3::ZERO });
    }

    #[test]
    fn a_pull_away_from_the_target_is_pulled_back() {
        let grip = Grip::new(Hand { amplitude: 0.0, ..Hand::default() }, 0.0, Quat::IDENTITY);
        let now = grip.at(3.0);
        for sign in [1.0, -1.0] {
            let torque = grip.torque(&now, rotation::exp(Vec3::X * 0.1) * sign, Vec3::ZERO);
            assert!((torque - Vec3::X * (-3.0 * 0.1f64.sin())).length() < 1e-15, "{torque}");
        }
        assert_eq!(grip.torque(&now, Quat::IDENTITY, Vec3::Y), Vec3::Y * -0.05);
        // A sphere that moves exactly with the target feels no torque.
        let moving = Grip::new(Hand::default(), 0.0, Quat::IDENTITY);
        let target = moving.target(3.0);
        assert!(target.omega.length() > 0.1);
        assert!(moving.torque(&target, target.q, target.omega).length() < 1e-15);
    }
}
