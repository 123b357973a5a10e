//! Shapes on SO(3) that several effects use: the dial about an axis and the swing away from it
//! (physics notes, section 6).
//!
//! All quantities are in the frame of a reference: x = q_d⁻¹ q = (eta, e), and the sphere's axis
//! `a` is at R(x) a. A gradient is for a turn in that frame: the rate of change of a function is
//! its gradient times the rate. With dx/dt = 1/2 (0, w) x: d eta = -1/2 e.w and d e = 1/2 (eta w +
//! w x e).

use crate::real::{PI, Quat, Real, TURN, Vec3, atan2, round, sqrt};
use crate::rotation::vector_part;

/// The angle by which the sphere is twisted about an axis, psi = 2 atan2(e.a, eta). If the axis
/// itself swings far away, the angle becomes ill-defined, and a factor fades the dial's torque out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Dial {
    /// Angle of the twist, rad, -pi to pi.
    pub(crate) psi: Real,
    /// Gradient of the twist angle with respect to a turn of the sphere. 0 if the twist angle is
    /// not defined.
    pub(crate) gradient: Vec3,
    /// The factor cos²(swing/2). It is 1 if the axis has not swung away, and 0 at a swing of a half
    /// turn, at which the twist is not defined.
    upright: Real,
    upright_gradient: Vec3,
}

/// Value of cos²(swing/2) below which the torque of a dial fades. It is reached when the dial's
/// axis has swung away by 120 degrees. At 180 degrees the torque is zero.
const FADE_BELOW: Real = 0.25;

impl Dial {
    pub(crate) const NONE: Self =
        Self { psi: 0.0, gradient: Vec3::ZERO, upright: 0.0, upright_gradient: Vec3::ZERO };

    /// Returns the twist angle of the rotation `x` about the unit vector `axis`, and its gradient.
    /// The scalar part eta of `x` must not be negative.
    #[inline]
    pub(crate) fn new(x: Quat, axis: Vec3) -> Self {
        let (eta, e) = (x.w, vector_part(x));
        let s = e.dot(axis);
        let upright = eta * eta + s * s;
        if !(upright > Real::MIN_POSITIVE) {
            return Self::NONE;
        }
        let ds = axis * eta + e.cross(axis);
        Self {
            psi: 2.0 * atan2(s, eta),
            gradient: (ds * eta + e * s) * (1.0 / upright),
            upright,
            upright_gradient: ds * s - e * eta,
        }
    }

    /// Returns the factor that fades the dial's energy, 0 to 1, and the derivative of this factor
    /// with respect to `upright`.
    #[inline]
    pub(crate) fn fade(&self) -> (Real, Real) {
        if self.upright >= FADE_BELOW {
            return (1.0, 0.0);
        }
        let t = self.upright * (1.0 / FADE_BELOW);
        (t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t) * (1.0 / FADE_BELOW))
    }

    /// Returns the torque of a dial with the energy `v` (J) and the energy's slope `slope` over the
    /// twist angle (N m). If the axis swings far away, the torque fades. It is exactly the negative
    /// gradient of the faded energy.
    #[inline]
    pub(crate) fn torque(&self, v: Real, slope: Real) -> Vec3 {
        let (fade, fade_slope) = self.fade();
        -(self.gradient * (slope * fade) + self.upright_gradient * (v * fade_slope))
    }

    /// Returns the torque of a viscous damper on the twist, with `damping` in N m s/rad. `w` is the
    /// angular velocity of the sphere, rad/s.
    #[inline]
    pub(crate) fn resist(&self, w: Vec3, damping: Real) -> Vec3 {
        let (fade, _) = self.fade();
        self.gradient * (-damping * fade * self.gradient.dot(w))
    }
}

/// Follows the angle of a dial over many turns.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Turns {
    last: Option<Real>,
}

impl Turns {
    /// Creates a memory that has followed the dial to the angle `psi`, rad.
    pub(crate) fn at(psi: Real) -> Self {
        Self { last: Some(psi) }
    }

    /// Returns the angle `psi` (rad), shifted by whole turns so that it is nearest to the last
    /// angle.
    #[inline]
    pub(crate) fn unwrap(&self, psi: Real) -> Real {
        match self.last {
            Some(last) => psi + TURN * round((last - psi) * (1.0 / TURN)),
            None => psi,
        }
    }

    /// Returns the angle `psi` (rad), shifted by whole turns so that it is nearest to the last
    /// angle. Stores the result as the last angle.
    #[inline]
    pub(crate) fn follow(&mut self, psi: Real) -> Real {
        let unwrapped = self.unwrap(psi);
        self.last = Some(unwrapped);
        unwrapped
    }
}

/// The angle by which an axis of the sphere has swung away from its original direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Swing {
    /// Angle of the swing, rad, 0 to pi.
    pub(crate) angle: Real,
    /// Gradient of the swing angle with respect to a turn of the sphere. 0 at angles of 0 and pi,
    /// where no gradient exists.
    pub(crate) gradient: Vec3,
}

/// Angle over which the wall of a cone fades near the direction opposite to the cone, rad (20
/// degrees). In the opposite direction all ways out of the wall are equally long, so the torque
/// must be zero.
pub(crate) const SWING_FADE: Real = 0.35;

impl Swing {
    /// Returns the angle between the unit vector `axis` before and after the rotation `x`, and the
    /// gradient of this angle.
    #[inline]
    pub(crate) fn new(x: Quat, axis: Vec3) -> Self {
        let at = x * axis;
        let out = axis.cross(at);
        let sine = sqrt(out.length_squared());
        let gradient = if sine > Real::MIN_POSITIVE { out * (1.0 / sine) } else { Vec3::ZERO };
        Self { angle: atan2(sine, axis.dot(at)), gradient }
    }

    /// Returns the factor, 0 to 1, by which the torque of a cone's wall is reduced at this swing.
    #[inline]
    pub(crate) fn fade(&self) -> Real {
        ((PI - self.angle) * (1.0 / SWING_FADE)).min(1.0)
    }
}
