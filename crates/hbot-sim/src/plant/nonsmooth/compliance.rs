//! Contacts and a cage that give way: springs and dampers between parts, without numerical damping.
//!
//! A spring of stiffness k and damping d acts against the velocity v = W u of one row. With the
//! speeds u before and u' after a step of h seconds, its stretch z becomes
//!
//! z' = z + h s        s = W (u + u') / 2        impulse p = h (k (z + z') / 2 + d s)
//!
//! The work of the impulse is p s, because masses are constant and M (u' - u) = -Wᵀ p. The energy
//! k z² / 2 changes by h k s (z + z') / 2. So kinetic plus elastic energy falls by exactly h d s²
//! in each step, at any stiffness: this is the implicit midpoint rule. All angles advance at the
//! mean of u and u' too. With gears they advance at u' instead, and h W u' / 2 lies between their
//! stretch and z, which never grows: h (u' - (u + u') / 2) sums up to the difference of two speeds.
//! In terms of u' the impulse is
//!
//! p = base + gain W u'        gain = h (h k / 2 + d) / 2        base = h k z + gain W u
//!
//! A contact that can slip limits the impulse to `limit`. Then s is the part of the velocity that
//! stretches the spring, and p W (u + u') / 2 - p s >= 0 is lost by friction.

use hbot_core::Vec3;
use hbot_core::design::device::MAX_WHEELS;

use super::Vector;
use super::law::{Element, Law, Row};
use super::solver::StepProblem;
use crate::phenomena::Compliance;

/// Stretches and speeds of the parts that give way.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Bent {
    /// Stretch of each contact along c1 and c2, wheel relative to sphere, m.
    contacts: [[f64; 2]; MAX_WHEELS],
    /// Displacement of the sphere's centre in frame N, m.
    centre: Vec3,
    /// Velocity of the sphere's centre in frame N, m/s.
    pub(super) velocity: Vec3,
}

/// Returns the growth of a spring's impulse with the velocity at the end of a step of `h` seconds,
/// kg. `stiffness` is in N/m and `damping` in N s/m.
fn gain(stiffness: f64, damping: f64, h: f64) -> f64 {
    0.5 * h * (0.5 * h * stiffness + damping)
}

impl Bent {
    /// Returns the elastic energy of all contacts and of the cage, J.
    pub(super) fn energy(&self, parts: &Compliance) -> f64 {
        let contacts: f64 = self.contacts.iter().flatten().map(|z| z * z).sum();
        0.5 * (parts.contact_stiffness * contacts + parts.cage_stiffness * self.centre.length_squared())
    }

    /// Returns the law of contact `i`, which slides if the force on it exceeds `grip` (N). `rates`
    /// are the slip velocities of the contact before the step.
    pub(super) fn law(&self, parts: &Compliance, i: usize, rates: [f64; 2], grip: f64, h: f64) -> Law {
        let gain = gain(parts.contact_stiffness, parts.contact_damping, h);
        let base = [0, 1].map(|k| h * parts.contact_stiffness * self.contacts[i][k] + gain * rates[k]);
        Law::Elastic { limit: h * grip, base, gain }
    }

    /// Adds contact `i`, which cannot slide, to `problem`. `rows` give its slip velocities, and
    /// `before` are the speeds before the step.
    pub(super) fn hold(
        &self,
        problem: &mut StepProblem,
        parts: &Compliance,
        i: usize,
        rows: &[Row; 2],
        before: &Vector,
        h: f64,
    ) {
        let law = self.law(parts, i, [0, 1].map(|k| rows[k].dot(before)), f64::INFINITY, h);
        let Law::Elastic { base, gain, .. } = law else { return };
        for (row, base) in rows.iter().zip(base) {
            problem.weigh(row, row, gain);
            problem.push(row, -base);
        }
    }

    /// Adds the cage to `problem`, in which the velocity of the centre of a sphere of `mass` (kg)
    /// has the index `at` and the two after it.
    pub(super) fn hold_centre(
        &self,
        problem: &mut StepProblem,
        parts: &Compliance,
        mass: f64,
        at: usize,
        h: f64,
    ) {
        let gain = gain(parts.cage_stiffness, parts.cage_damping, h);
        for k in 0..3 {
            let velocity = self.velocity[k];
            problem.mass[at + k][at + k] += mass + gain;
            problem.momentum[at + k] += (mass - gain) * velocity - h * parts.cage_stiffness * self.centre[k];
        }
    }

    /// Advances the stretch of contact `i` over a step of `h` seconds. `rates` are the means of its
    /// slip velocities before and after the step. `slid` is the element of its law, or `None` if
    /// the contact cannot slide.
    pub(super) fn stretch(
        &mut self,
        parts: &Compliance,
        i: usize,
        rates: [f64; 2],
        slid: Option<&Element>,
        h: f64,
    ) {
        let k = parts.contact_stiffness;
        for c in 0..2 {
            let z = &mut self.contacts[i][c];
            *z += h * match slid {
                Some(element) => (element.impulse[c] / h - k * *z) / (0.5 * h * k + parts.contact_damping),
                None => rates[c],
            };
        }
    }

    /// Moves the sphere's centre over a step of `h` seconds, at whose end it has the velocity
    /// `velocity` (m/s).
    pub(super) fn move_centre(&mut self, velocity: Vec3, h: f64) {
        self.centre += (self.velocity + velocity) * (0.5 * h);
        self.velocity = velocity;
    }
}
