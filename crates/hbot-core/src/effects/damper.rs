//! Resistance against turning: T = -D w, which only takes energy out.

use super::Motion;
use crate::impedance;
use crate::real::{Mat3, Vec3};

/// Viscous resistance against the sphere's rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Damper {
    damping: Mat3,
}

impl Damper {
    /// A damper of `damping` (N m s/rad), symmetric positive semidefinite in N. `None` where it is not.
    #[must_use]
    pub fn new(damping: Mat3) -> Option<Self> {
        impedance::is_impedance(&damping).then_some(Self { damping })
    }

    #[inline]
    pub(super) fn torque(&self, motion: &Motion) -> Vec3 {
        -(self.damping * motion.omega)
    }
}
