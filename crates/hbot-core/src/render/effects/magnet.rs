//! Attraction near an orientation, and almost no torque far from it.
//!
//! V = -A w exp(1/2 - s²/(2 w²)) with the chord s = 2 sin(angle/2) = 2 |e|. The torque T = -(2 A/w)
//! exp(1/2 - s²/(2 w²)) eta e is smooth everywhere. Apart from the factor eta = cos(angle/2), it is
//! largest at s = w, where it is A.

use super::target::Target;
use super::{Anchor, Law, Now};
use crate::real::{Quat, Real, Vec3, exp};
use crate::render::outline::Outline;
use crate::rotation::vector_part;

/// exp(-1/2), the inverse of [`Magnet::nearness`] at the target.
#[allow(clippy::excessive_precision, reason = "f64 has the digits that f32 has not")]
const AT_TARGET: Real = 0.606_530_659_712_633_4;

/// An effect that attracts the sphere to an orientation, but only if the sphere is near it.
///
/// If the effect has a number in the scene's table, it is the viscous damping of the sphere at the
/// target, N m s/rad. With the distance it falls to zero, as exp(-s²/(2 w²)).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Magnet {
    /// Orientation to which the sphere is attracted.
    pub target: Target,
    /// Largest torque of the attraction (A in the law of the effect), N m.
    pub strength: Real,
    /// Angle from the target at which the torque is largest (w in the law of the effect), rad;
    /// above 0.
    pub width: Real,
}

impl Magnet {
    /// Returns exp(1/2 - s²/(2 w²)): how strongly the magnet acts at the chord s from its target.
    /// `e` is the vector part of the quaternion from the target, with |e|² = s²/4.
    #[inline]
    fn nearness(&self, e: Vec3) -> Real {
        exp(0.5 - 2.0 * e.length_squared() / (self.width * self.width))
    }
}

impl Law for Magnet {
    type Memory = ();

    #[inline]
    fn render(&self, now: &mut Now<'_>, (): &mut ()) -> Vec3 {
        now.lead_at_most(self.width);
        let x = now.relative();
        let e = vector_part(x);
        let near = self.nearness(e);
        let mut torque = e * (-2.0 * self.strength / self.width * near * x.w);
        // The damping is the only number of the effect, so that a magnet without it stays as it is
        // in recordings. Its factor is 1 at the target.
        if let [damping, ..] = now.numbers {
            torque -= now.rate() * (damping * near * AT_TARGET);
        }
        now.in_n(torque)
    }

    fn energy(&self, now: &mut Now<'_>, (): &()) -> Option<Real> {
        let e = vector_part(now.relative());
        Some(-self.strength * self.width * self.nearness(e))
    }

    fn reference(&self) -> Option<(Quat, Anchor)> {
        Some(self.target.reference())
    }

    fn outline<'a>(&self, _: &'a [Real], visit: &mut dyn FnMut(Outline<'a>)) {
        visit(Outline::Well { width: self.width });
    }
}
