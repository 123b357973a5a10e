//! Viscous resistance against turning: T = -D w, which only absorbs energy.

use super::target::beyond;
use super::{Law, Now};
use crate::real::{Mat3, Real, Vec3};
use crate::render::impedance;

/// An effect that resists turning of the sphere: a viscous torque proportional to its angular
/// velocity.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Damper {
    damping: Mat3,
    deadband: Real,
}

impl Damper {
    /// Creates a damper from the symmetric, positive semidefinite matrix `damping` (N m s/rad, in
    /// frame N). Returns `None` if the matrix is not of this kind.
    #[must_use]
    pub fn new(damping: Mat3) -> Option<Self> {
        impedance::is_impedance(&damping).then_some(Self { damping, deadband: 0.0 })
    }

    /// Returns the damper with a dead band: no torque while the sphere turns slower than `deadband`
    /// (rad/s, at least 0). Above the dead band, only the speed in excess of it is damped.
    #[must_use]
    pub fn with_deadband(self, deadband: Real) -> Self {
        Self { deadband, ..self }
    }
}

impl Law for Damper {
    type Memory = ();
    const COMMON: bool = true;

    #[inline(always)]
    fn render(&self, now: &mut Now<'_>, (): &mut ()) -> Vec3 {
        let omega = now.motion.omega;
        if self.deadband > 0.0 {
            // w.D w' >= 0 for w' along w, so it still only absorbs energy.
            return -(self.damping * beyond(omega, self.deadband));
        }
        -(self.damping * omega)
    }
}
