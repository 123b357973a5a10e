//! The part of a state that the panel keeps.

use glam::{DQuat, DVec3};
use hbot_api::StateEvent;

/// A state of the rig in one tick, without its joints. Histories and plots consist of samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PlotSample {
    pub(crate) tick: u64,
    /// Time of the tick, in seconds since the control loop began.
    pub(crate) t: f64,
    /// Orientation of the sphere: the rotation from the sphere's axes to frame N.
    pub(crate) q: DQuat,
    /// Orientation towards which the scene pulls the sphere, if it has one.
    pub(crate) reference: Option<DQuat>,
    /// Angular velocity of the sphere in frame N (fixed in space), rad/s.
    pub(crate) omega: DVec3,
    /// Torque on the sphere in frame N (fixed in space), N m.
    pub(crate) torque: DVec3,
    /// Fraction of the requested torque that remained after the limits, 0 to 1.
    pub(crate) scale: f64,
    /// Largest slip between a wheel and the sphere, over all wheels, m/s.
    pub(crate) slip: f64,
    /// Energy delivered to the hand since the start, J.
    pub(crate) energy: f64,
    /// Time from the tick's deadline to its start, us.
    pub(crate) lateness_us: f64,
    /// Whether the rig rendered the scene with full torque (mode `active`).
    pub(crate) active: bool,
}

impl PlotSample {
    pub(crate) fn of(state: &StateEvent) -> Self {
        Self {
            tick: state.tick,
            t: state.t,
            q: quaternion(state.q),
            reference: state.reference.map(quaternion),
            omega: state.omega.into(),
            torque: state.torque.into(),
            scale: state.scale,
            slip: state.slip,
            energy: state.energy,
            lateness_us: state.timing.lateness_us,
            active: state.mode == hbot_api::Mode::Active,
        }
    }

    /// Returns the orientation from which the sphere's deflection is measured: `chosen` if it is
    /// given, otherwise the scene's reference, otherwise the axes of frame N.
    pub(crate) fn zero(&self, chosen: Option<DQuat>) -> DQuat {
        chosen.or(self.reference).unwrap_or(DQuat::IDENTITY)
    }

    /// Returns the deflection of the sphere, in rad: the smallest rotation from `zero` to its
    /// orientation, as a rotation vector in the axes of `zero`.
    pub(crate) fn deflection(&self, zero: DQuat) -> DVec3 {
        let x = zero.conjugate() * self.q;
        // q and -q are the same orientation. The one with w >= 0 is a rotation of at most half a
        // turn.
        let x = if x.w < 0.0 { -x } else { x };
        x.to_scaled_axis()
    }
}

/// Converts the elements `[w, x, y, z]` to a quaternion.
pub(crate) fn quaternion([w, x, y, z]: [f64; 4]) -> DQuat {
    DQuat::from_xyzw(x, y, z, w)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_deflection_is_the_least_rotation_in_the_axes_of_zero() {
        let zero = DQuat::from_rotation_z(1.0);
        let turned = zero * DQuat::from_rotation_x(0.3);
        for q in [turned, -turned] {
            let sample = PlotSample { q, ..PlotSample::of(&StateEvent::default()) };
            // The tolerance is the rounding of a few products of numbers below 1.
            assert!((sample.deflection(zero) - DVec3::new(0.3, 0.0, 0.0)).length() < 1e-15);
        }
    }
}
