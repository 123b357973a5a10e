//! Bumps on the sphere's surface, felt as it turns past a fixed point.
//!
//! s = Rᵀ n is the point of the sphere under the unit vector n of frame N. The energy is V = (A/k)
//! sum of cos(k s_i) over the sphere's three axes. k is the wave number, in rad of the wave per rad
//! of turn. The energy is smooth everywhere. The torque T = A R (f x s) with f_i = sin(k s_i) is an
//! exact gradient. A turn about n is not felt.

use super::{Law, Now};
use crate::real::{PI, Quat, Real, TURN, Vec3, cos, sincos, sqrt};
use crate::render::around::Spot;
use crate::render::outline::Outline;

/// An effect that simulates bumps on the sphere's surface, which the hand feels when the sphere
/// turns.
///
/// If the effect has a number in the scene's table, it is the viscous damping of the sphere across
/// `at`, N m s/rad.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Texture {
    /// Direction from the sphere's centre to the fixed point past which the bumps move, a unit
    /// vector in frame N.
    pub at: Vec3,
    /// Density of the bumps: wave number k, in rad of the wave per rad of turn; above 0.
    pub wave_number: Real,
    /// Amplitude of the torque, N m.
    pub depth: Real,
}

impl Texture {
    fn under(&self, now: &Now<'_>) -> Vec3 {
        now.motion.q.conjugate() * self.at
    }
}

impl Law for Texture {
    type Memory = ();

    #[inline]
    fn render(&self, now: &mut Now<'_>, (): &mut ()) -> Vec3 {
        now.lead_at_most(0.25 * TURN / self.wave_number);
        let s = self.under(now);
        let sine = |x: Real| sincos(self.wave_number * x).0;
        let f = Vec3::new(sine(s.x), sine(s.y), sine(s.z));
        let mut torque = now.motion.q * (f.cross(s) * self.depth);
        // The damping is the only number of the effect, so that a texture without it stays as it is
        // in recordings. A turn about `at` is not damped, because it is not felt.
        if let [damping, ..] = now.numbers {
            let omega = now.motion.omega;
            torque -= (omega - self.at * self.at.dot(omega)) * *damping;
        }
        torque
    }

    fn energy(&self, now: &mut Now<'_>, (): &()) -> Option<Real> {
        let s = self.under(now);
        let k = self.wave_number;
        Some(self.depth / k * (cos(k * s.x) + cos(k * s.y) + cos(k * s.z)))
    }

    fn places(&self, _: &[Real], visit: &mut dyn FnMut(Spot, Quat, Vec3, ())) {
        // The energy is lowest in the direction s where cos(k s) is -1. Two components can be
        // there; the third is what is left of the unit length. Longer waves have no such place, and
        // are steepest near the directions of the second list.
        let a = PI / self.wave_number;
        let left = 1.0 - 2.0 * a * a;
        let (h, t) = (sqrt(0.5), sqrt(1.0 / 3.0));
        let deep = [Vec3::new(a, a, sqrt(left.max(0.0)))];
        let wide = [Vec3::X, Vec3::new(h, h, 0.0), Vec3::new(t, t, t)];
        for s in if left > 0.0 { &deep[..] } else { &wide[..] } {
            visit(Spot::Bump, Quat::from_rotation_arc(*s, self.at), Vec3::ZERO, ());
        }
    }

    fn outline<'a>(&self, _: &'a [Real], visit: &mut dyn FnMut(Outline<'a>)) {
        visit(Outline::Finger(self.at));
    }
}
