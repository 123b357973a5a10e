//! Shapes on SO(3) that several effects use: the dial about an axis and the swing away from it
//! (physics notes, section 6).
//!
//! All quantities are in the frame of a reference: x = q_d⁻¹ q = (eta, e), and the sphere's axis
//! `a` is at R(x) a. A gradient is for a turn in that frame: the rate of change of a function is
//! its gradient times the rate. With dx/dt = 1/2 (0, w) x: d eta = -1/2 e.w and d e = 1/2 (eta w +
//! w x e).

use crate::real::{PI, Quat, Real, TURN, Vec3, atan2, round, sqrt};
use crate::rotation::vector_part;

/// The twist of the sphere about an axis, psi = 2 atan2(e.a, eta), and its fade when the axis
/// swings away by nearly a half turn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Dial {
    /// Angle of the twist, rad, -pi to pi.
    pub(crate) psi: Real,
    /// Gradient of the angle; 0 if it has none.
    pub(crate) gradient: Vec3,
    /// cos²(swing/2). It is 1 if the axis is in its place, and 0 at a swing of a half turn, at
    /// which there is no twist.
    upright: Real,
    upright_gradient: Vec3,
}

/// Value of cos²(swing/2) below which dials fade: a swing of 120 degrees. They are gone at 180
/// degrees.
const FADE_BELOW: Real = 0.25;

impl Dial {
    pub(crate) const NONE: Self =
        Self { psi: 0.0, gradient: Vec3::ZERO, upright: 0.0, upright_gradient: Vec3::ZERO };

    /// Returns the twist of the rotation `x` (with eta >= 0) about the unit vector `axis`.
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

    /// Returns the factor on a dial's energy and the factor's derivative with respect to `upright`.
    #[inline]
    pub(crate) fn fade(&self) -> (Real, Real) {
        if self.upright >= FADE_BELOW {
            return (1.0, 0.0);
        }
        let t = self.upright * (1.0 / FADE_BELOW);
        (t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t) * (1.0 / FADE_BELOW))
    }

    /// Returns the faded torque of an energy `v` (J) over psi with the slope `slope` (N m). It is
    /// exactly the gradient of the faded energy.
    #[inline]
    pub(crate) fn torque(&self, v: Real, slope: Real) -> Vec3 {
        let (fade, fade_slope) = self.fade();
        -(self.gradient * (slope * fade) + self.upright_gradient * (v * fade_slope))
    }

    /// Returns the torque of a damper on psi with `damping` N m s/rad, at the rate `w` of the
    /// sphere (rad/s).
    #[inline]
    pub(crate) fn resist(&self, w: Vec3, damping: Real) -> Vec3 {
        let (fade, _) = self.fade();
        self.gradient * (-damping * fade * self.gradient.dot(w))
    }
}

/// The angle of a dial over many turns.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Turns {
    last: Option<Real>,
}

impl Turns {
    /// Returns `psi` plus or minus whole turns, so that it is nearest to the last angle.
    #[inline]
    pub(crate) fn unwrap(&self, psi: Real) -> Real {
        match self.last {
            Some(last) => psi + TURN * round((last - psi) * (1.0 / TURN)),
            None => psi,
        }
    }

    /// Returns `psi` plus or minus whole turns, so that it is nearest to the last angle. Remembers
    /// the result as the last angle.
    #[inline]
    pub(crate) fn follow(&mut self, psi: Real) -> Real {
        let unwrapped = self.unwrap(psi);
        self.last = Some(unwrapped);
        unwrapped
    }
}

/// The angle by which an axis has swung from its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Swing {
    /// Angle of the swing, rad, 0 to pi.
    pub(crate) angle: Real,
    /// Gradient of the angle. It is 0 at angles of 0 and pi, where there is no gradient.
    pub(crate) gradient: Vec3,
}

/// Angle before the opposite direction over which the walls of a cone fade, rad (20 degrees). At
/// the opposite direction the way out is undefined.
pub(crate) const SWING_FADE: Real = 0.35;

impl Swing {
    /// Returns the swing of the unit vector `axis` under the rotation `x`.
    #[inline]
    pub(crate) fn new(x: Quat, axis: Vec3) -> Self {
        let at = x * axis;
        let out = axis.cross(at);
        let sine = sqrt(out.length_squared());
        let gradient = if sine > Real::MIN_POSITIVE { out * (1.0 / sine) } else { Vec3::ZERO };
        Self { angle: atan2(sine, axis.dot(at)), gradient }
    }

    /// Returns the factor on the torque of a wall at this swing, 0 to 1.
    #[inline]
    pub(crate) fn fade(&self) -> Real {
        ((PI - self.angle) * (1.0 / SWING_FADE)).min(1.0)
    }
}
