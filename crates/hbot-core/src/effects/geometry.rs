//! Shapes on SO(3) that several effects are made of: the dial about an axis and the swing away from it (physics notes,
//! section 6).
//!
//! All in the frame of a reference: x = q_d⁻¹ q = (eta, e), the sphere's axis `a` stands at R(x) a. A gradient is for a turn in
//! that frame: a function's rate of change is its gradient times the rate. With dx/dt = 1/2 (0, w) x: d eta = -1/2 e.w,
//! d e = 1/2 (eta w + w x e).

use crate::real::{PI, Quat, Real, TURN, Vec3, atan2, round, sqrt};
use crate::rotation::vector_part;

/// The twist about an axis, psi = 2 atan2(e.a, eta), and what becomes of it where the swing nears a half turn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Dial {
    /// The angle, -pi to pi.
    pub(crate) psi: Real,
    /// Its gradient; 0 where it has none.
    pub(crate) gradient: Vec3,
    /// cos²(swing/2): 1 where the axis is in its place, 0 at a swing of a half turn, where there is no twist.
    upright: Real,
    upright_gradient: Vec3,
}

/// Dials fade where the swing is beyond 120 degrees, cos² of whose half this is, and are gone at 180.
const FADE_BELOW: Real = 0.25;

impl Dial {
    pub(crate) const NONE: Self =
        Self { psi: 0.0, gradient: Vec3::ZERO, upright: 0.0, upright_gradient: Vec3::ZERO };

    /// The dial of `x` (with eta >= 0) about the unit vector `axis`.
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

    /// The factor on a dial's energy, and its slope over `upright`.
    #[inline]
    pub(crate) fn fade(&self) -> (Real, Real) {
        if self.upright >= FADE_BELOW {
            return (1.0, 0.0);
        }
        let t = self.upright * (1.0 / FADE_BELOW);
        (t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t) * (1.0 / FADE_BELOW))
    }

    /// The torque of the energy `v` (J) over psi with the slope `slope` (N m), faded: exactly the gradient of the faded energy.
    #[inline]
    pub(crate) fn torque(&self, v: Real, slope: Real) -> Vec3 {
        let (fade, fade_slope) = self.fade();
        -(self.gradient * (slope * fade) + self.upright_gradient * (v * fade_slope))
    }

    /// The torque against turning the dial at the rate `w`, by `damping` N m s/rad: what a damper on psi gives.
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
    /// `psi` less or plus whole turns: the one nearest to the last.
    #[inline]
    pub(crate) fn unwrap(&self, psi: Real) -> Real {
        match self.last {
            Some(last) => psi + TURN * round((last - psi) * (1.0 / TURN)),
            None => psi,
        }
    }

    /// The same angle, which is remembered as the last one.
    #[inline]
    pub(crate) fn follow(&mut self, psi: Real) -> Real {
        let unwrapped = self.unwrap(psi);
        self.last = Some(unwrapped);
        unwrapped
    }
}

/// How far an axis has swung from its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Swing {
    /// The angle, 0 to pi.
    pub(crate) angle: Real,
    /// Its gradient; 0 where it has none, at 0 and pi.
    pub(crate) gradient: Vec3,
}

/// Walls about a cone fade over the last 20 degrees before the opposite direction, where which way is out is undefined.
pub(crate) const SWING_FADE: Real = 0.35;

impl Swing {
    /// The swing of the unit vector `axis` under `x`.
    #[inline]
    pub(crate) fn new(x: Quat, axis: Vec3) -> Self {
        let at = x * axis;
        let out = axis.cross(at);
        let sine = sqrt(out.length_squared());
        let gradient = if sine > Real::MIN_POSITIVE { out * (1.0 / sine) } else { Vec3::ZERO };
        Self { angle: atan2(sine, axis.dot(at)), gradient }
    }

    /// The factor on a wall at this swing.
    #[inline]
    pub(crate) fn fade(&self) -> Real {
        ((PI - self.angle) * (1.0 / SWING_FADE)).min(1.0)
    }
}
