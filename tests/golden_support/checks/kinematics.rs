//! Checks of contact frames, the rows of G, forward and inverse kinematics, and the margins and
//! indices.

use super::super::core::design::singularity::{Indices, boundary_determinant, interior_margin};
use super::{
    array, device, frame_condition, lever_condition, norm, posture, reals, row_condition, tolerance, vector,
    wide, worst,
};
use crate::golden_support::{Ledger, vectors};

pub fn kinematics(case: &vectors::Kinematics, ledger: &mut Ledger) {
    let device = match device(&case.device) {
        Ok(device) => device,
        Err(error) => return ledger.fail("device", error.to_string()),
    };
    let posture = posture(&device, &case.theta);
    let spec = &case.device;
    let wheels = spec.wheels.len();

    for (i, (frame, want)) in posture.frames().iter().zip(&case.contact_frames).enumerate() {
        let within = tolerance(1.0, frame_condition(&spec.wheels[i], case.theta[i]));
        for (k, column) in [frame.c1, frame.c2, frame.c3].into_iter().enumerate() {
            ledger.numbers("contact_frames", &[i, k], &array(column), &want[k], within);
        }
    }
    let frames = worst(spec, &case.theta, frame_condition);
    let rows = worst(spec, &case.theta, row_condition);

    // In a product relative errors add up.
    let levers: f64 = spec.wheels.iter().map(lever_condition).sum();
    let det: f64 = device.wheels().iter().map(|w| wide(boundary_determinant(&device, w))).product();
    ledger.number("det_h", &[], det, case.det_h, tolerance(case.det_h.abs(), levers));

    // A singular value changes by no more than the matrix, whose 2n rows are unit vectors.
    let z = (2.0 * wheels as f64).sqrt();
    ledger.number(
        "sigma_min_z",
        &[],
        wide(interior_margin(&posture)),
        case.sigma_min_z,
        tolerance(z, frames),
    );

    if posture.rows().len() != case.g.len() {
        ledger.fail("g", format!("got {} rows, expected {}", posture.rows().len(), case.g.len()));
        return;
    }
    let rates = posture.inverse(vector(case.omega));
    for (j, (row, want)) in posture.rows().iter().zip(&case.g).enumerate() {
        let condition = row_condition(&spec.wheels[j / 2], case.theta[j / 2]);
        ledger.numbers("g", &[j], &array(*row), want, tolerance(norm(want), condition));
        let scale = norm(want) * norm(&case.omega);
        ledger.number("joint_rates", &[j], wide(rates[j]), case.joint_rates[j], tolerance(scale, condition));
    }

    // w = A⁻¹ b. A relative error of A and of the terms of b is amplified by 1/lambda_min(A) times
    // the size of b's terms times the condition of A. The eigenvalues of A = sum (I - c3 c3ᵀ) are
    // between sigma_min² and n.
    let least = case.sigma_min_z * case.sigma_min_z;
    let terms: f64 = spec
        .wheels
        .iter()
        .zip(case.noisy_joint_rates.chunks_exact(2))
        .map(|(w, zd)| {
            let steer = spec.sphere_radius * w.cone.sin() * (w.toe.cos().abs() + w.toe.sin().abs());
            steer * zd[0].abs() + w.radius * zd[1].abs()
        })
        .sum();
    let condition = rows * wheels as f64 / least;
    let forward = posture.forward(&device, &reals(&case.noisy_joint_rates));
    let within = tolerance(terms / spec.sphere_radius / least, condition);
    ledger.numbers("omega_estimate", &[], &array(forward.omega), &case.omega_estimate, within);
    // Slip is the wheel's velocity minus R times w.
    let within = tolerance(terms / least.min(1.0), condition.max(1.0));
    let slip: Vec<f64> = forward.slip[..wheels].as_flattened().iter().copied().map(wide).collect();
    ledger.numbers("slip", &[], &slip, &case.slip, within);

    let got = Indices::of(posture.rows());
    let want = &case.indices;
    // A relative error of the rows changes each singular value by that part of sigma_max, times
    // sqrt 3.
    let spectral = want.lci_spectral;
    ledger.number("lci_spectral", &[], wide(got.spectral), spectral, tolerance(1.0, 2.0 * rows));
    // The smallest singular value has a relative error that is 1/spectral times as large, and
    // passes it on.
    let condition = 3.0 * rows / spectral;
    let frobenius = want.lci_frobenius;
    ledger.number("lci_frobenius", &[], wide(got.frobenius), frobenius, tolerance(frobenius, condition));
    let volume = want.manipulability;
    ledger.number("manipulability", &[], wide(got.manipulability), volume, tolerance(volume, condition));
}
