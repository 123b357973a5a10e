//! A spring towards a reference orientation, with a damper on the rate relative to the reference.

use super::target::{beyond, beyond_gradient, places_of_spring};
use super::{Anchor, Law, Now};
use crate::real::{Mat3, Quat, Real, Vec3, sincos};
use crate::render::around::Spot;
use crate::render::impedance::{self, damper, geodesic_pull, quaternion_pull};
use crate::rotation::{angle_between, vector_part};

/// The law by which a spring computes its torque from the angle to its reference (physics notes,
/// section 6).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub enum SpringLaw {
    /// The torque is proportional to the angle, up to a half turn.
    Geodesic,
    /// The torque is computed from the vector part of a quaternion (paper eq. 25-29). If the
    /// stiffness is equal about all axes, the torque is proportional to the sine of the angle.
    Quaternion,
}

/// A spring that pulls the sphere to a reference orientation, with a damper.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Spring {
    law: SpringLaw,
    stiffness: Mat3,
    damping: Option<Mat3>,
    reference: Quat,
    anchor: Anchor,
    deadband: Real,
}

impl Spring {
    /// Creates a spring with `stiffness` (N m/rad) and `damping` (N m s/rad) that pulls the sphere
    /// to the unit quaternion `reference`. Both are matrices in the axes of the reference's frame.
    /// If the damping is zero, it takes no computing time.
    ///
    /// Returns `None` if `reference` is not of unit length, or if a matrix is not symmetric and
    /// positive semidefinite.
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
        legal.then_some(Self { law, stiffness, damping, reference, anchor, deadband: 0.0 })
    }

    /// Returns the spring with a dead band: no spring torque while the sphere is within the angle
    /// `deadband` of the reference (rad, from 0 to below pi). Beyond the dead band, the torque
    /// grows with the angle in excess of it. The torque is still the gradient of an energy.
    #[must_use]
    pub fn with_deadband(self, deadband: Real) -> Self {
        Self { deadband, ..self }
    }

    /// Returns sin(deadband / 2): the length of a quaternion's vector part for a turn by the dead
    /// band. The quaternion law measures its dead band in this length.
    fn dead_sine(&self) -> Real {
        sincos(0.5 * self.deadband).0
    }
}

/// The rotation vector of the last tick, rad. At exactly a half turn, the spring can turn the
/// sphere back in two directions, and this vector decides which one it keeps.
type Branch = Vec3;

impl Law for Spring {
    type Memory = Branch;
    const COMMON: bool = true;

    #[inline(always)]
    fn render(&self, now: &mut Now<'_>, branch: &mut Branch) -> Vec3 {
        let desired = now.reference.q;
        let mut x = now.relative();
        let elastic = match self.law {
            SpringLaw::Quaternion => {
                let e = vector_part(x);
                let ke = if self.deadband > 0.0 {
                    let dead = self.dead_sine();
                    beyond_gradient(e, dead, self.stiffness * beyond(e, dead))
                } else {
                    self.stiffness * e
                };
                quaternion_pull(x.w, e, ke)
            }
            SpringLaw::Geodesic => {
                let (factor, mut p) = now.log_of(x);
                if x.w == 0.0 && vector_part(x).dot(*branch) < 0.0 {
                    (x, p) = (-x, -p);
                }
                *branch = p;
                let kp = if self.deadband > 0.0 {
                    beyond_gradient(p, self.deadband, self.stiffness * beyond(p, self.deadband))
                } else {
                    self.stiffness * p
                };
                geodesic_pull(x.w, factor, p, kp)
            }
        };
        let mut torque = desired * elastic;
        if let Some(damping) = &self.damping {
            torque += damper(desired, damping, now.motion.omega, now.reference.omega);
        }
        torque
    }

    fn energy(&self, now: &mut Now<'_>, _: &Branch) -> Option<Real> {
        Some(match self.law {
            SpringLaw::Quaternion => {
                let e = beyond(vector_part(now.relative()), self.dead_sine());
                2.0 * e.dot(self.stiffness * e)
            }
            SpringLaw::Geodesic => {
                let p = beyond(now.log().1, self.deadband);
                0.5 * p.dot(self.stiffness * p)
            }
        })
    }

    fn reference(&self) -> Option<(Quat, Anchor)> {
        Some((self.reference, self.anchor))
    }

    fn excess(&self, desired: Quat, q: Quat, _: &[Real]) -> Option<Real> {
        Some((angle_between(desired, q) - self.deadband).max(0.0))
    }

    fn places(&self, _: &[Real], visit: &mut dyn FnMut(Spot, Quat, Vec3, Branch)) {
        places_of_spring(&[Vec3::X, Vec3::Y, Vec3::Z], self.deadband, visit);
    }
}
