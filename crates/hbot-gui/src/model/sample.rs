//! Orientations and deflections of the sphere in a state.

use glam::{DQuat, DVec3};
use hbot_api::StateEvent;
use hbot_core::rotation::shortest;

/// Returns the orientation from which the sphere's deflection is measured: `chosen` if it is given,
/// otherwise the scene's reference, otherwise the axes of frame N.
pub(crate) fn zero(state: &StateEvent, chosen: Option<DQuat>) -> DQuat {
    chosen.or(state.reference.map(quaternion)).unwrap_or(DQuat::IDENTITY)
}

/// Returns the deflection of the sphere, in rad: the smallest rotation from `zero` to its
/// orientation, as a rotation vector in the axes of `zero`.
pub(crate) fn deflection(state: &StateEvent, zero: DQuat) -> DVec3 {
    shortest(zero.conjugate() * quaternion(state.q)).to_scaled_axis()
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
            let state = StateEvent { q: [q.w, q.x, q.y, q.z], ..StateEvent::default() };
            // The tolerance is the rounding of a few products of numbers below 1.
            assert!((deflection(&state, zero) - DVec3::new(0.3, 0.0, 0.0)).length() < 1e-15);
        }
    }
}
