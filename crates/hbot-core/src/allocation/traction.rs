//! The contact forces that joint torques cause, and the traction limit (physics notes, sections 2
//! and 7).

use super::Allocation;
use crate::design::device::{MAX_WHEELS, Wheel};
use crate::real::{Real, sqrt};

/// Lever arms of a wheel's two joints at its contact with the sphere, m. They are the entries of
/// the matrix H = \[\[steer, 0\], \[-cross, roll\]\] and constants of the design.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct ContactArms {
    /// Lever arm of the steer joint along the wheel's axle, R l.c2 = R sin a cos b, m. It is the
    /// speed of the contact along the axle per unit of the steer rate.
    pub steer: Real,
    /// Lever arm of the steer joint across the wheel's axle, R l.c1 = R sin a sin b, m. It is the
    /// speed of the contact against the rolling direction per unit of the steer rate. 0 without a
    /// toe angle.
    pub cross: Real,
    /// Lever arm of the drive joint, m. It is the wheel radius r, or the speed of the contact along
    /// the rolling direction per unit of the drive rate.
    pub roll: Real,
}

impl ContactArms {
    /// Returns the lever arms of the joints of `wheel` on a sphere of radius `sphere_radius` (m).
    #[must_use]
    pub fn of(wheel: &Wheel, sphere_radius: Real) -> Self {
        Self {
            steer: sphere_radius * wheel.axis_along_roll(),
            cross: sphere_radius * wheel.axis_along_axle(),
            roll: wheel.spec().radius,
        }
    }

    /// Returns the default cost weights of the wheel's steer and drive joint, 1/m²: w_th = 1/(R
    /// sin a cos b)² and w_ph = 1/r².
    ///
    /// Without a toe angle, the sum of w tau² with these weights equals the sum of the squared
    /// contact forces. The least-cost joint torques then cause the smallest contact forces.
    #[must_use]
    pub fn weights(&self) -> [Real; 2] {
        [1.0 / (self.steer * self.steer), 1.0 / (self.roll * self.roll)]
    }

    /// Returns the force that the joint torques of the wheel (N m) cause at its contact, N, along
    /// the contact directions c1 and c2: f = H⁻ᵀ tau.
    ///
    /// For a moving sphere, first subtract the torques that accelerate the joints' own inertia:
    /// pass tau - J_q dzd/dt.
    #[inline]
    #[must_use]
    pub fn force(&self, steer_torque: Real, drive_torque: Real) -> [Real; 2] {
        let along_roll = drive_torque / self.roll;
        [(steer_torque + self.cross * along_roll) / self.steer, along_roll]
    }
}

/// Returns the load of the most loaded contact: its force |f_i| divided by `grip`. Above 1 a wheel
/// would slip.
///
/// The joint torques `tau` (N m; steer, drive of each wheel) cause the contact forces f_i. `grip`
/// is the largest force that a contact holds without slip, N: friction coefficient mu times normal
/// force N. Returns 0 if there is no force, and infinity if there is a force but `grip` is not
/// positive.
#[inline]
#[must_use]
pub fn traction(arms: &[ContactArms], tau: &[Real], grip: Real) -> Real {
    let mut square: Real = 0.0;
    for (arm, pair) in arms.iter().take(MAX_WHEELS).zip(tau.chunks_exact(2)) {
        let [f1, f2] = arm.force(pair[0], pair[1]);
        square = square.max(f1 * f1 + f2 * f2);
    }
    match square {
        0.0 => 0.0,
        _ if grip > 0.0 => sqrt(square) / grip,
        _ => Real::INFINITY,
    }
}

impl Allocation {
    /// Scales all joint torques down by one factor, so that the force at every contact is at most
    /// `grip` (N). Returns the load of the most loaded contact before the scaling, as a fraction of
    /// `grip`.
    ///
    /// `grip` is the friction coefficient mu times the normal force N. The torque on the sphere
    /// keeps its direction and only becomes smaller.
    #[inline]
    pub fn limit_traction(&mut self, arms: &[ContactArms], grip: Real) -> Real {
        let load = traction(arms, &self.torque, grip);
        if load > 1.0 {
            let keep = 1.0 / load;
            for tau in &mut self.torque {
                *tau *= keep;
            }
            self.scale *= keep;
        }
        load
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::device::MAX_JOINTS;
    use crate::real::fabs;

    const TOED: ContactArms = ContactArms { steer: 0.0177, cross: -0.004, roll: 0.0155 };

    fn allocation(tau: [Real; 4]) -> Allocation {
        let mut torque = [0.0; MAX_JOINTS];
        torque[..4].copy_from_slice(&tau);
        Allocation { torque, scale: 0.8, deficient: false }
    }

    #[test]
    fn forces_do_the_work_of_the_torques() {
        // f.s = tau.zd for any joint rates zd, with the slip velocity s = H zd.
        let ([f1, f2], [a, b]) = (TOED.force(0.3, -0.1), [1.7, -4.0]);
        let work = f1 * (TOED.steer * a) + f2 * (-TOED.cross * a + TOED.roll * b);
        assert!(fabs(work - (0.3 * a - 0.1 * b)) < 16.0 * Real::EPSILON);
    }

    #[test]
    fn a_load_above_the_grip_scales_everything() {
        let arms = [TOED; 2];
        let mut loaded = allocation([0.1, 0.1, -0.4, 0.02]);
        let load = loaded.limit_traction(&arms, 8.0);
        assert!(load > 1.0);
        assert!(fabs(loaded.scale * load - 0.8) < 4.0 * Real::EPSILON);
        assert!(fabs(loaded.torque[2] * load + 0.4) < 4.0 * Real::EPSILON);
        // The rounding of one square root and one quotient.
        assert!(fabs(traction(&arms, &loaded.torque, 8.0) - 1.0) < 4.0 * Real::EPSILON);
    }

    #[test]
    fn a_light_load_changes_nothing() {
        let before = allocation([0.01, 0.01, -0.04, 0.002]);
        let mut after = before;
        assert!(after.limit_traction(&[TOED; 2], 8.0) < 1.0);
        assert_eq!(after, before);
    }

    #[test]
    fn without_grip_there_is_no_torque() {
        let mut slippery = allocation([0.1, 0.1, -0.4, 0.02]);
        assert_eq!(slippery.limit_traction(&[TOED; 2], 0.0), Real::INFINITY);
        assert_eq!((slippery.torque, slippery.scale), ([0.0; MAX_JOINTS], 0.0));
        let mut still = allocation([0.0; 4]);
        assert_eq!(still.limit_traction(&[TOED; 2], 0.0), 0.0);
        assert_eq!(still.scale, 0.8);
    }

    #[test]
    fn default_weights_weigh_contact_forces() {
        let straight = ContactArms { cross: 0.0, ..TOED };
        let [w_th, w_ph] = straight.weights();
        let [f1, f2] = straight.force(0.3, -0.1);
        let (cost, squares) = (w_th * 0.09 + w_ph * 0.01, f1 * f1 + f2 * f2);
        assert!(fabs(cost - squares) < 16.0 * Real::EPSILON * squares);
    }
}
