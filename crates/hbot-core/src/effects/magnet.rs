//! Attraction near an orientation, nothing far from it.
//!
//! V = -A w exp(1/2 - s²/(2 w²)) over the chord s = 2 sin(angle/2) = 2 |e|: the torque is largest, A but for cos(angle/2), at s = w.
//! T = -(2 A/w) exp(1/2 - s²/(2 w²)) eta e. Smooth everywhere.

use super::target::Target;
use super::{Anchor, Law, Now};
use crate::real::{Quat, Real, Vec3, exp};
use crate::rotation::vector_part;

/// Attraction near an orientation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Magnet {
    /// Where it pulls to.
    pub target: Target,
    /// The largest torque, N m.
    pub strength: Real,
    /// Where it is largest, rad, > 0.
    pub width: Real,
}

impl Magnet {
    /// exp(1/2 - s²/(2 w²)) with |e|² = s²/4.
    #[inline]
    fn nearness(&self, e: Vec3) -> Real {
        exp(0.5 - 2.0 * e.length_squared() / (self.width * self.width))
    }
}

impl Law for Magnet {
    type Memory = ();

    #[inline]
    fn render(&self, now: &mut Now<'_>, (): &mut ()) -> Vec3 {
        let x = now.relative();
        let e = vector_part(x);
        now.in_n(e * (-2.0 * self.strength / self.width * self.nearness(e) * x.w))
    }

    fn energy(&self, now: &mut Now<'_>, (): &()) -> Option<Real> {
        let e = vector_part(now.relative());
        Some(-self.strength * self.width * self.nearness(e))
    }

    fn reference(&self) -> Option<(Quat, Anchor)> {
        Some(self.target.reference())
    }
}
