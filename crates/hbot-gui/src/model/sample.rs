//! What is kept of a state.

use glam::{DQuat, DVec3};
use hbot_api::StateEvent;

/// A state without its joints: what histories and plots are made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PlotSample {
    pub(crate) tick: u64,
    /// Loop's time, s.
    pub(crate) t: f64,
    /// Sphere axes into N.
    pub(crate) q: DQuat,
    /// Where the scene is to bring the sphere.
    pub(crate) reference: Option<DQuat>,
    /// In N, rad/s.
    pub(crate) omega: DVec3,
    /// On the sphere in N, N m.
    pub(crate) torque: DVec3,
    /// Share of the torque wanted that the limits left.
    pub(crate) scale: f64,
    /// Largest slip, m/s.
    pub(crate) slip: f64,
    /// Given out to the hand, J.
    pub(crate) energy: f64,
    /// From deadline to start of the tick, us.
    pub(crate) lateness_us: f64,
    /// The scene is rendered with full torque.
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

    /// Where deflections are measured from: what was `chosen`, else where the scene is to bring the sphere, else N's axes.
    pub(crate) fn zero(&self, chosen: Option<DQuat>) -> DQuat {
        chosen.or(self.reference).unwrap_or(DQuat::IDENTITY)
    }

    /// The least rotation from `zero` to the orientation, as a vector in the axes of `zero`, rad.
    pub(crate) fn deflection(&self, zero: DQuat) -> DVec3 {
        let x = zero.conjugate() * self.q;
        // q and -q are one orientation; the half with w >= 0 turns by at most half a turn.
        let x = if x.w < 0.0 { -x } else { x };
        x.to_scaled_axis()
    }
}

/// From `[w, x, y, z]`.
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
            // Rounding of a handful of products of numbers below 1.
            assert!((sample.deflection(zero) - DVec3::new(0.3, 0.0, 0.0)).length() < 1e-15);
        }
    }
}
