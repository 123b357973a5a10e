//! Dry friction that truly sticks: a bristle anchored on SO(3) that slides along if its torque
//! exceeds the limit (V. Hayward and B. Armstrong, A new computational model of friction applied to
//! haptic rendering, 2000).
//!
//! z = log(q q_b⁻¹) is the turn from the anchor q_b, and T = -k z. If |k z| exceeds the limit, the
//! anchor follows along the geodesic until it does not. Below the limit the anchor does not move at
//! all, so a smaller load never makes the sphere drift. The bristle stores 1/2 k |z|² and never
//! returns more. Sliding absorbs energy.

use super::{Law, Now};
use crate::real::{Quat, Real, Vec3, sqrt};
use crate::rotation;

/// An effect of dry (Coulomb) friction, with additional viscous damping. A sphere at rest truly
/// sticks: it does not creep under a small load.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Friction {
    /// Torque above which the sphere begins to slide, N m.
    pub torque: Real,
    /// Stiffness of the spring that holds the sphere while it sticks, N m/rad.
    pub stiffness: Real,
    /// Viscous damping, N m s/rad. It acts while the sphere sticks and while it slides.
    pub damping: Real,
}

impl Law for Friction {
    /// Orientation in which the friction holds the sphere. `None` before the first tick.
    type Memory = Option<Quat>;
    const REMEMBERS: bool = true;

    #[inline]
    fn render(&self, now: &mut Now<'_>, anchor: &mut Option<Quat>) -> Vec3 {
        let q = now.motion.q;
        let held = *anchor.get_or_insert(q);
        let mut z = rotation::difference(q, held);
        let limit = self.torque / self.stiffness;
        let length2 = z.length_squared();
        if length2 > limit * limit {
            let shorter = z * (limit / sqrt(length2));
            *anchor = Some(rotation::renormalized(rotation::exp(-shorter) * q));
            z = shorter;
        }
        z * -self.stiffness - now.motion.omega * self.damping
    }
}
