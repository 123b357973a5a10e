//! The part of a state that the panel keeps.

use glam::{DQuat, DVec3};
use hbot_api::{ClientStream, Fault, JointState, Mode, StateEvent, StateTiming};

/// Largest number of joints of a rig: a steer and a drive of each of at most eight wheels.
const MAX_JOINTS: usize = 16;

/// A state of the rig in one tick, in a form that needs no further memory. Histories and plots
/// consist of samples.
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
    /// Fraction of the friction limit that the most loaded contact uses, 0 to 1.
    pub(crate) traction: f64,
    /// Cause of the fault. `None` except in mode fault.
    pub(crate) fault: Option<Fault>,
    /// The last stream message that the control loop has accepted.
    pub(crate) client: Option<ClientStream>,
    /// Lateness, computing time and other times of the tick, us.
    pub(crate) timing: StateTiming,
    pub(crate) mode: Mode,
    joints: [JointState; MAX_JOINTS],
    /// Number of joints of the rig.
    joint_count: usize,
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
            traction: state.traction,
            fault: state.fault,
            client: state.client,
            timing: state.timing,
            mode: state.mode,
            joints: std::array::from_fn(|k| state.joints.get(k).copied().unwrap_or_default()),
            joint_count: state.joints.len().min(MAX_JOINTS),
            active: state.mode == Mode::Active,
        }
    }

    /// Returns the joints of the rig: steer and drive of the first wheel, then of the next.
    pub(crate) fn joints(&self) -> &[JointState] {
        &self.joints[..self.joint_count]
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
