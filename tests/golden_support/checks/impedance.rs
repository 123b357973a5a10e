//! Checks of Hopf coordinates, of the error vectors of two orientations, and of the laws of springs
//! and dampers.

use super::super::core::Vec3;
use super::super::core::render::impedance::{damper, geodesic_law, quaternion_law};
use super::super::core::rotation::{error_eq24, from_hopf, log};
use super::{EPS, array, matrix, norm, quaternion, real, tolerance, vector, wide, wxyz};
use crate::golden_support::{Ledger, vectors};

pub fn hopf(case: &vectors::Hopf, ledger: &mut Ledger) {
    let q = from_hopf(real(case.theta), real(case.phi), real(case.psi));
    // The sines are of angles that are rounded in proportion to their size.
    let condition = 1.0 + case.theta.abs() + case.phi.abs() + case.psi.abs();
    ledger.numbers("q", &[], &wxyz(q), &case.q, tolerance(1.0, condition));
}

pub fn impedance(case: &vectors::Impedance, ledger: &mut Ledger) {
    let (desired, actual) = (quaternion(case.q_desired), quaternion(case.q_actual));
    let (stiffness, damping) = (matrix(&case.stiffness), matrix(&case.damping));

    // The four products of q_d⁻¹ q are of order 1 at any angle, so the error is absolute. The
    // logarithm doubles the error of the angle (also near a half turn, by atan2). At a half turn it
    // multiplies the error of the direction by pi/2.
    let angle_error = 64.0 * EPS;
    let angle = norm(&case.rotation_vector);
    let vector_error = angle_error + tolerance(angle, 0.0);
    ledger.numbers("error_eq24", &[], &array(error_eq24(desired, actual)), &case.error_eq24, vector_error);
    let mut p = array(log(desired.conjugate() * actual));
    // If the angle is closer to a half turn than its error, rounding decides which way round is
    // shorter.
    let way = p.iter().zip(&case.rotation_vector).map(|(a, b)| a * b).sum::<f64>();
    let other_way = way < 0.0 && core::f64::consts::PI - angle < angle_error;
    if other_way {
        p = p.map(|x| -x);
    }
    ledger.numbers("rotation_vector", &[], &p, &case.rotation_vector, vector_error);

    let k = norm(case.stiffness.as_flattened());
    let quaternion_law = quaternion_law(desired, actual, &stiffness);
    // |2 Eᵀ| <= 2, and e is at most half the angle. Both carry the error of the product.
    let within = tolerance(norm(&case.quaternion_law.torque), 0.0) + 2.0 * k * angle_error;
    ledger.numbers(
        "quaternion_law.torque",
        &[],
        &array(quaternion_law.torque),
        &case.quaternion_law.torque,
        within,
    );
    // d(2 eᵀ K e) = 4 |K e| de, where e is only known to its error.
    let energy = |energy: f64| tolerance(energy, 1.0) + 2.0 * k * (angle + angle_error) * angle_error;
    ledger.number(
        "quaternion_law.energy",
        &[],
        wide(quaternion_law.energy),
        case.quaternion_law.energy,
        energy(case.quaternion_law.energy),
    );

    // |Mᵀ| <= 1 + pi/2 + 1, and its derivative adds |K p| times (1/2 + 2 t c) <= 2.
    let (geodesic_law, _) = geodesic_law(desired, actual, &stiffness, Vec3::ZERO);
    let within = tolerance(norm(&case.geodesic_law.torque), 0.0) + k * (3.6 + 2.0 * angle) * angle_error;
    // A spring wound the other way round pulls in the opposite direction.
    if !other_way {
        ledger.numbers(
            "geodesic_law.torque",
            &[],
            &array(geodesic_law.torque),
            &case.geodesic_law.torque,
            within,
        );
    }
    ledger.number(
        "geodesic_law.energy",
        &[],
        wide(geodesic_law.energy),
        case.geodesic_law.energy,
        energy(case.geodesic_law.energy),
    );

    let (omega, omega_d) = (vector(case.omega_actual), vector(case.omega_desired));
    let got = damper(desired, &damping, omega, omega_d);
    // Products of D, two rotations and the rates, which can nearly cancel.
    let scale = norm(case.damping.as_flattened()) * (norm(&case.omega_actual) + norm(&case.omega_desired));
    ledger.numbers("damper_torque", &[], &array(got), &case.damper_torque, tolerance(scale, 1.0));
}
