//! Dry friction that truly sticks: a bristle anchored on SO(3) that slides along when its torque exceeds the limit
//! (V. Hayward and B. Armstrong, A new computational model of friction applied to haptic rendering, 2000).
//!
//! z = log(q q_b⁻¹), the turn from the anchor q_b, T = -k z. Where |k z| > torque the anchor follows along the geodesic until it
//! is not. Below the limit the anchor does not move at all, so no load below it makes the sphere drift. The bristle
//! stores 1/2 k |z|² and gives back no more; sliding takes energy out.

use super::{Law, Now};
use crate::real::{Quat, Real, Vec3, sqrt};
use crate::rotation;

/// Coulomb friction with true sticking, and a viscous part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Friction {
    /// The torque at which it slides, N m.
    pub torque: Real,
    /// Stiffness of the bristle, N m/rad.
    pub stiffness: Real,
    /// Damping, sticking and sliding alike, N m s/rad.
    pub damping: Real,
}

impl Law for Friction {
    /// The anchor, once there is one.
    type Memory = Option<Quat>;

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
