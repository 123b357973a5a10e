//! Attraction near an orientation, and almost no torque far from it.
//!
//! V = -A w exp(1/2 - s²/(2 w²)) with the chord s = 2 sin(angle/2) = 2 |e|. The torque T = -(2 A/w)
//! exp(1/2 - s²/(2 w²)) eta e is smooth everywhere. Apart from the factor eta = cos(angle/2), it is
//! largest at s = w, where it is A.

use super::target::Target;
use super::{Anchor, Law, Now};
use crate::real::{Quat, Real, Vec3, exp};
use crate::rotation::vector_part;

/// An effect that attracts the sphere when it is near an orientation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Magnet {
    /// Orientation that attracts the sphere.
    pub target: Target,
    /// Largest torque A, N m.
    pub strength: Real,
    /// Distance w from the target at which the torque is largest, rad, > 0.
    pub width: Real,
}

impl Magnet {
    /// Returns exp(1/2 - s²/(2 w²)) with |e|² = s²/4.
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
