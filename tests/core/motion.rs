//! Forward and inverse kinematics of any legal device (physics notes, section 2).

use crate::designs::{device_and_steering, vector};
use crate::prelude::*;
use hbot_core::design::singularity::{Indices, interior_margin, singular_values};
use proptest::prelude::*;

proptest! {
    #[test]
    fn a_sphere_that_rolls_is_measured_without_slip((device, theta) in device_and_steering(), omega in vector(20.0)) {
        let posture = Posture::new(&device, &theta);
        let rates = posture.inverse(omega);
        let forward = posture.forward(&device, &rates);
        // Rates have the rounding of |G| w. The least-squares solution amplifies it by its
        // condition, n / sigma_min².
        let condition = device.wheels().len() as f64 / interior_margin(&posture).powi(2);
        let lever = device.wheels().iter().map(|w| 1.0 / w.axis_along_roll()).fold(1.0, f64::max);
        let within = 32.0 * f64::EPSILON * (1.0 + omega.length()) * condition * lever;
        prop_assert!((forward.omega - omega).length() < within, "{} against {omega}", forward.omega);
        for slip in forward.slip[..device.wheels().len()].as_flattened() {
            prop_assert!(slip.abs() < within, "slip {slip:e}");
        }
    }

    #[test]
    fn the_power_of_the_torque_is_that_of_the_joints(
        (device, theta) in device_and_steering(),
        omega in vector(20.0),
        tau in prop::collection::vec(-1.0..1.0_f64, 16),
    ) {
        let posture = Posture::new(&device, &theta);
        let tau = &tau[..device.joints()];
        let torque = posture.torque_on_sphere(tau);
        let rates = posture.inverse(omega);
        let power: f64 = rates.iter().zip(tau).map(|(rate, tau)| rate * tau).sum();
        // The tolerance is the rounding of each term of the double sum.
        let terms: f64 =
            posture.rows().iter().zip(tau).map(|(row, tau)| row.length() * tau.abs() * omega.length()).sum();
        prop_assert!((torque.dot(omega) - power).abs() <= 32.0 * f64::EPSILON * terms);
    }

    #[test]
    fn the_estimate_leaves_no_slip_that_another_rate_would_lessen(
        (device, theta) in device_and_steering(),
        rates in prop::collection::vec(-10.0..10.0_f64, 16),
        other in vector(1.0),
    ) {
        let posture = Posture::new(&device, &theta);
        let forward = posture.forward(&device, &rates);
        // At the least sum of squares, the slip is orthogonal to the slip that any turn of the
        // sphere makes.
        let (r, mut dot, mut size) = (device.sphere_radius(), 0.0, 0.0);
        for (frame, slip) in posture.frames().iter().zip(&forward.slip) {
            let by_turn = [-r * frame.c2.dot(other), r * frame.c1.dot(other)];
            dot += slip[0] * by_turn[0] + slip[1] * by_turn[1];
            size += r * 10.0 * (1.0 + device.sphere_radius());
        }
        let condition = device.wheels().len() as f64 / interior_margin(&posture).powi(2);
        prop_assert!(dot.abs() <= 64.0 * f64::EPSILON * size * condition, "{dot:e}");
    }

    #[test]
    fn singular_values_have_the_sum_and_product_of_the_matrix((device, theta) in device_and_steering()) {
        let posture = Posture::new(&device, &theta);
        let [a, b, c] = singular_values(posture.rows());
        prop_assert!(a >= b && b >= c && c > 0.0);
        let squares: f64 = posture.rows().iter().map(|row| row.length_squared()).sum();
        prop_assert!((a * a + b * b + c * c - squares).abs() < 64.0 * f64::EPSILON * squares);
        let indices = Indices::of(posture.rows());
        prop_assert!((0.0..=1.0).contains(&indices.spectral) && indices.spectral <= indices.frobenius);
        prop_assert!(indices.frobenius <= 1.0 + 8.0 * f64::EPSILON);
        prop_assert!((indices.manipulability * a * b * c - 1.0).abs() < 8.0 * f64::EPSILON);
    }
}
