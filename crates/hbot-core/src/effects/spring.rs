//! A spring towards a reference orientation, with a damper on the rate relative to the reference.

use super::target::{beyond, beyond_gradient};
use super::{Anchor, Law, Now};
use crate::impedance::{self, damper, geodesic_pull, quaternion_pull};
use crate::real::{Mat3, Quat, Real, Vec3, sincos};
use crate::rotation::{angle_between, vector_part};

/// The law of a spring (physics notes, section 6).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SpringLaw {
    /// The torque is linear in the angle up to a half turn.
    Geodesic,
    /// The law of the paper. For an isotropic stiffness the torque is proportional to the sine of
    /// the angle.
    Quaternion,
}

/// A spring towards a reference, with a damper.
///
/// ```
/// use hbot_core::effects::{Anchor, Effect, Kind, Motion, Spring, SpringLaw};
/// use hbot_core::render::Renderer;
/// use hbot_core::rig::RigParts;
/// use hbot_core::{CompiledScene, Device, Mat3, Quat, Rig, Vec3, WheelSpec, rotation};
///
/// // 1 N m/rad about n1 and n2, 3 N m/rad about n3, and a little damping. The reference is the
/// // identity.
/// let stiffness = Mat3::from_diagonal(Vec3::new(1.0, 1.0, 3.0));
/// let damping = Mat3::from_diagonal(Vec3::splat(0.01));
/// let (law, anchor) = (SpringLaw::Geodesic, Anchor::Absolute);
/// let spring = Spring::new(law, stiffness, damping, Quat::IDENTITY, anchor);
/// let spring = Kind::Spring(spring.ok_or("not valid")?);
/// let scene = CompiledScene::new(1, &[Effect::new(0, 1, spring)])?;
///
/// let wheel = |side| WheelSpec { axis: Vec3::new(side, 0.0, -1.0), ..WheelSpec::default() };
/// let device = Device::new(0.1, 0.5, &[wheel(1.0), wheel(-1.0)])?;
/// let mut renderer = Renderer::new(&Rig::new(RigParts::new(device))?);
///
/// // At rest, 0.2 rad about n3: the spring pulls back with 0.6 N m and stores 0.06 J.
/// let q = rotation::exp(Vec3::new(0.0, 0.0, 0.2));
/// renderer.adopt(&scene, q);
/// let torque = renderer.render(&scene, &Motion { q, omega: Vec3::ZERO }, 1, 1e-3, 1e-3);
/// assert!((torque - Vec3::new(0.0, 0.0, -0.6)).length() < 1e-12);
/// assert!((renderer.energy(&scene, q).ok_or("a spring has an energy")? - 0.06).abs() < 1e-12);
///
/// // A negative stiffness is refused.
/// let soft = Mat3::from_diagonal(Vec3::splat(-1.0));
/// assert!(Spring::new(law, soft, damping, Quat::IDENTITY, anchor).is_none());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spring {
    law: SpringLaw,
    stiffness: Mat3,
    damping: Option<Mat3>,
    reference: Quat,
    anchor: Anchor,
    deadband: Real,
}

impl Spring {
    /// Creates a spring with `stiffness` (N m/rad) and `damping` (N m s/rad) towards the unit
    /// quaternion `reference`. A damping of zero costs no time.
    ///
    /// Returns `None` if `reference` is not of unit length, or if `stiffness` or `damping` is not
    /// symmetric and positive semidefinite. Both matrices are in the axes of the desired frame.
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

    /// Returns the spring with a dead band: no spring torque within `deadband` of the reference
    /// (rad, from 0 to below pi). The angle counts from there. The energy is that of the shortened
    /// rotation vector, so the torque is still a gradient.
    #[must_use]
    pub fn with_deadband(self, deadband: Real) -> Self {
        Self { deadband, ..self }
    }

    /// Returns the dead band of the quaternion law as a length of the vector part: that of a turn
    /// by the dead band.
    fn dead_sine(&self) -> Real {
        sincos(0.5 * self.deadband).0
    }
}

/// The rotation vector of the last tick. At exactly a half turn it decides between the two possible
/// directions.
type Branch = Vec3;

impl Law for Spring {
    type Memory = Branch;

    #[inline]
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
                let (factor, mut p) = now.log();
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
        Some(angle_between(desired, q))
    }
}
