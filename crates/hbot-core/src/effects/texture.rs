//! Bumps on the sphere's surface, felt as it turns past a point that stands still.
//!
//! s = Rᵀ n is the point of the sphere that is under the unit vector n of N. V = (A/k) sum of cos(k s_i) over the sphere's three axes:
//! smooth everywhere, k waves a radian. T = A R (f x s), f_i = sin(k s_i): an exact gradient. Turning about n is not felt.

use super::{Law, Now};
use crate::real::{Real, Vec3, cos, sincos};

/// Bumps on the sphere's surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Texture {
    /// Where it is felt, a direction in N, unit.
    pub at: Vec3,
    /// k, rad of a wave for one rad of turn, > 0.
    pub wave_number: Real,
    /// A, N m.
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
        let s = self.under(now);
        let sine = |x: Real| sincos(self.wave_number * x).0;
        let f = Vec3::new(sine(s.x), sine(s.y), sine(s.z));
        now.motion.q * (f.cross(s) * self.depth)
    }

    fn energy(&self, now: &mut Now<'_>, (): &()) -> Option<Real> {
        let s = self.under(now);
        let k = self.wave_number;
        Some(self.depth / k * (cos(k * s.x) + cos(k * s.y) + cos(k * s.z)))
    }
}
