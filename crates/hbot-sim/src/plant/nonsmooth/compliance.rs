//! Contacts and a cage that give way: springs and dampers between parts.
//!
//! A spring of stiffness k and damping d acts against the velocity v = W u of one row. With the
//! speeds u before and u' after a step of h seconds, its stretch z becomes
//!
//! z' = z + h s        s = W ((1 - t) u + t u')        impulse p = h (k (z + t h s) + d s)
//!
//! With t = 1/2 this is the implicit midpoint rule. The work of the impulse is p s, because masses
//! are constant and M (u' - u) = -Wᵀ p. The energy k z² / 2 changes by h k s (z + z') / 2. So
//! kinetic plus elastic energy falls by exactly h d s² in each step, at any stiffness, without
//! numerical damping. All angles advance at the mean of u and u' too.
//!
//! With gears t is 1, and the angles advance at u': implicit Euler, as for all other laws. Then no
//! step raises the energy. With t = 1/2 it could: flanks and losses of gears act against u', and a
//! spring that is too stiff for the step swings so that u' is nearly -u. In terms of u' the impulse
//! is
//!
//! p = base + gain W u'      gain = t h (t h k + d)      base = h k z + (1 - t) h (t h k + d) W u
//!
//! A contact that can slip limits the impulse to `limit`. Then s is the part of the velocity that
//! stretches the spring, and what is left of the velocity is lost by friction.

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

/// The springs of contacts and cage in one step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Springs {
    pub(super) parts: Compliance,
    /// The part t of the speeds at the end of the step in the velocity that stretches a spring: 1/2
    /// for the implicit midpoint rule, 1 for implicit Euler.
    pub(super) late: f64,
    /// Length of the step, s.
    pub(super) h: f64,
}

impl Springs {
    /// Returns the growth of a spring's impulse with the velocities before and after the step, kg.
    /// `stiffness` is in N/m and `damping` in N s/m.
    fn gains(&self, stiffness: f64, damping: f64) -> [f64; 2] {
        let all = self.h * (self.late * self.h * stiffness + damping);
        [(1.0 - self.late) * all, self.late * all]
    }

    /// Returns the velocity that stretches a spring, from those before and after the step.
    pub(super) fn mixed<T>(&self, before: T, after: T) -> T
    where
        T: std::ops::Mul<f64, Output = T> + std::ops::Add<Output = T>,
    {
        before * (1.0 - self.late) + after * self.late
    }
}

impl Bent {
    /// Returns the elastic energy of all contacts and of the cage, J.
    pub(super) fn energy(&self, parts: &Compliance) -> f64 {
        let contacts: f64 = self.contacts.iter().flatten().map(|z| z * z).sum();
        0.5 * (parts.contact_stiffness * contacts + parts.cage_stiffness * self.centre.length_squared())
    }

    /// Returns the law of contact `i`, which slides if the force on it exceeds `grip` (N). `rates`
    /// are the slip velocities of the contact before the step.
    pub(super) fn law(&self, springs: &Springs, i: usize, rates: [f64; 2], grip: f64) -> Law {
        let Springs { parts, h, .. } = springs;
        let [first, gain] = springs.gains(parts.contact_stiffness, parts.contact_damping);
        let base = [0, 1].map(|k| h * parts.contact_stiffness * self.contacts[i][k] + first * rates[k]);
        Law::Elastic { limit: h * grip, base, gain }
    }

    /// Adds contact `i`, which cannot slide, to `problem`. `rows` give its slip velocities, and
    /// `before` are the speeds before the step.
    pub(super) fn hold(
        &self,
        problem: &mut StepProblem,
        springs: &Springs,
        i: usize,
        rows: &[Row; 2],
        before: &Vector,
    ) {
        let law = self.law(springs, i, [0, 1].map(|k| rows[k].dot(before)), f64::INFINITY);
        let Law::Elastic { base, gain, .. } = law else { return };
        for (row, base) in rows.iter().zip(base) {
            problem.weigh(row, row, gain);
            problem.push(row, -base);
        }
    }

    /// Adds the cage to `problem`, in which the velocity of the centre of a sphere of `mass` (kg)
    /// has the index `at` and the two after it.
    pub(super) fn hold_centre(&self, problem: &mut StepProblem, springs: &Springs, mass: f64, at: usize) {
        let Springs { parts, h, .. } = springs;
        let [first, gain] = springs.gains(parts.cage_stiffness, parts.cage_damping);
        for k in 0..3 {
            let velocity = self.velocity[k];
            problem.mass[at + k][at + k] += mass + gain;
            problem.momentum[at + k] += (mass - first) * velocity - h * parts.cage_stiffness * self.centre[k];
        }
    }

    /// Advances the stretch of contact `i` over a step. `rates` are the velocities
    /// that stretch it if it does not slide. `slid` is the element of its law, or `None` if
    /// the contact cannot slide.
    pub(super) fn stretch(&mut self, springs: &Springs, i: usize, rates: [f64; 2], slid: Option<&Element>) {
        let Springs { parts, late, h } = springs;
        let k = parts.contact_stiffness;
        for c in 0..2 {
            let z = &mut self.contacts[i][c];
            *z += h * match slid {
                Some(element) => (element.impulse[c] / h - k * *z) / (late * h * k + parts.contact_damping),
                None => rates[c],
            };
        }
    }

    /// Moves the sphere's centre over a step, at whose end it has the velocity
    /// `velocity` (m/s).
    pub(super) fn move_centre(&mut self, springs: &Springs, velocity: Vec3) {
        self.centre += springs.mixed(self.velocity, velocity) * springs.h;
        self.velocity = velocity;
    }
}
