//! A spring towards a reference orientation, with a damper on the rate relative to it.

use super::{EffectState, Motion};
use crate::impedance::{self, damper, geodesic_law, quaternion_law};
use crate::real::{Mat3, Quat, Vec3};

/// Which law a spring follows (physics notes, section 6).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SpringLaw {
    /// Linear in the angle up to a half turn.
    Geodesic,
    /// The paper's: proportional to the sine of the angle for an isotropic stiffness.
    Quaternion,
}

/// What a reference is measured from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// The frame N.
    Absolute,
    /// The orientation at enable, or at load where the rig is active already: the reference turns from there.
    Here,
}

/// A spring towards a reference, with a damper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spring {
    law: SpringLaw,
    stiffness: Mat3,
    damping: Option<Mat3>,
    reference: Quat,
    anchor: Anchor,
}

impl Spring {
    /// A spring of `stiffness` (N m/rad) and `damping` (N m s/rad; zero costs nothing), both symmetric positive
    /// semidefinite in desired-frame axes, towards the unit quaternion `reference`. `None` where one of them is not legal.
    #[must_use]
    pub fn new(
        law: SpringLaw,
        stiffness: Mat3,
        damping: Mat3,
        reference: Quat,
        anchor: Anchor,
    ) -> Option<Self> {
        let legal = impedance::is_impedance(&stiffness)
            && impedance::is_impedance(&damping)
            && (reference.length_squared() - 1.0).abs() < 1.0e-6;
        let damping = (damping != Mat3::ZERO).then_some(damping);
        legal.then_some(Self { law, stiffness, damping, reference, anchor })
    }

    /// The reference as the scene states it.
    #[inline]
    #[must_use]
    pub fn reference(&self) -> Quat {
        self.reference
    }

    /// What the reference is measured from.
    #[inline]
    #[must_use]
    pub fn anchor(&self) -> Anchor {
        self.anchor
    }

    #[inline]
    pub(super) fn torque(&self, motion: &Motion, state: &mut EffectState) -> Vec3 {
        let desired = state.reference.q;
        let mut torque = match self.law {
            SpringLaw::Quaternion => quaternion_law(desired, motion.q, &self.stiffness).torque,
            SpringLaw::Geodesic => {
                let (elastic, branch) = geodesic_law(desired, motion.q, &self.stiffness, state.branch);
                state.branch = branch;
                elastic.torque
            }
        };
        if let Some(damping) = &self.damping {
            torque += damper(desired, damping, motion.omega, state.reference.omega);
        }
        torque
    }
}
