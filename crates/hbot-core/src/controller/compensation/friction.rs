//! The friction that is fed forward: a smooth sign of the rate, which is flat at rest.

use crate::design::rig::Friction;
use crate::real::{Real, Vec3, sqrt};

impl Friction {
    /// Returns the torque of the friction, with the sign of the `rate` (rad/s), N m.
    ///
    /// The dry part is coulomb x³ / (1 + x²)^(3/2), with x = rate / smoothing. At rest it and its
    /// derivative are zero, so noise of the rate is not amplified there, and a joint that sticks
    /// is not pushed.
    #[inline]
    pub(super) fn against(&self, rate: Real, smoothing: Real) -> Real {
        rate * self.damping(rate * rate, smoothing)
    }

    /// Returns the torque of the friction along the angular velocity `omega` (rad/s), N m.
    #[inline]
    pub(super) fn along(&self, omega: Vec3, smoothing: Real) -> Vec3 {
        omega * self.damping(omega.length_squared(), smoothing)
    }

    /// Returns the part of the dry friction that is fed forward in steady motion at `rate` (rad/s),
    /// with its sign.
    #[inline]
    pub(super) fn part(rate: Real, smoothing: Real) -> Real {
        rate * Self { coulomb: 1.0, viscous: 0.0 }.damping(rate * rate, smoothing)
    }

    /// Returns the torque divided by the rate whose square is `square`, N m s/rad.
    #[inline]
    fn damping(&self, square: Real, smoothing: Real) -> Real {
        let sum = square + smoothing * smoothing;
        self.coulomb * square / (sum * sqrt(sum)) + self.viscous
    }

    /// Returns the power that the friction takes at the rate whose square is `square`, W.
    #[inline]
    pub(super) fn loss(&self, square: Real) -> Real {
        self.coulomb * sqrt(square) + self.viscous * square
    }
}
