//! The slip that odometry computes from the encoders is the observable part of the true slip.

use hbot_core::Mat3;
use hbot_core::design::kinematics::Posture;
use hbot_sim::phenomena::largest_grip;

use crate::prelude::*;

/// Returns the part of the slip `s` that no angular velocity of the sphere can explain, so that
/// encoders can observe it: s - Z (ZᵀZ)⁻¹ Zᵀ s, with Z = R [-c2ᵀ; c1ᵀ] per wheel.
fn observable(device: &Device, posture: &Posture, s: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let r = device.sphere_radius();
    let (mut square, mut right) = (Mat3::ZERO, Vec3::ZERO);
    for (frame, s) in posture.frames().iter().zip(s) {
        for (row, s) in [(frame.c2 * -r, s[0]), (frame.c1 * r, s[1])] {
            square += Mat3::from_cols(row * row.x, row * row.y, row * row.z);
            right += row * s;
        }
    }
    let explained = square.inverse() * right;
    let rest = posture
        .frames()
        .iter()
        .zip(s)
        .map(|(frame, s)| [s[0] + r * frame.c2.dot(explained), s[1] - r * frame.c1.dot(explained)]);
    rest.collect()
}

fn size(slip: &[[f64; 2]]) -> f64 {
    slip.iter().flatten().fold(0.0, |m, s| s.abs().max(m))
}

/// Drives two wheels with `torque` for 30 ms. Returns the largest slip computed from the encoders,
/// and the largest true slip that encoders can observe, m/s.
fn slips(device: &Device, slip: Option<Slip>, torque: f64, h: f64) -> (f64, f64) {
    // A cage with almost no friction selects the nonsmooth plant, with or without slip.
    let phenomena =
        Phenomena { slip, cage_friction: Some(CageFriction { torque: 1e-6 }), ..Phenomena::default() };
    let mut state = PlantState { steer: [0.3, -0.4, 0.9, 0.0, 0.0, 0.0, 0.0, 0.0], ..PlantState::default() };
    let mut dynamics = Dynamics::new(device, &phenomena, Method::Rk4, &state).unwrap();
    let mut tau = [0.0; 16];
    (tau[1], tau[3]) = (torque, 0.5 * torque);
    let (mut seen, mut there) = (0.0f64, 0.0f64);
    for i in 0..(0.03 / h).round() as u32 {
        dynamics.step(&mut state, f64::from(i) * h, h, &tau, Vec3::ZERO, None);
        let posture = Posture::new(device, &state.steer);
        let wheels = device.wheels().len();
        let forward = posture.forward(device, &dynamics.encoder_rates(&state));
        // Without slip, the joint rates belong to the middle of the step. At its end, encoders see
        // the difference as slip.
        let truth = dynamics.slip(&state);
        if slip.is_some() {
            let wanted = observable(device, &posture, &truth[..wheels]);
            for (seen, wanted) in forward.slip.iter().zip(&wanted) {
                for k in 0..2 {
                    // Rounding of surface speeds up to 10 m/s.
                    assert!((seen[k] - wanted[k]).abs() < 1e-13, "{seen:?} seen, {wanted:?} there to see");
                }
            }
            there = there.max(size(&wanted));
        }
        seen = seen.max(size(&forward.slip[..wheels]));
    }
    (seen, there)
}

#[test]
fn encoders_see_what_they_can_of_slip_and_none_where_there_is_none() {
    let grip = Slip { mu: 0.5, normal_force: 2.0 };
    for (device, name) in [(device(), "prototype"), (toed(3), "three wheels")] {
        // The drive torque at which the contact, with a grip of 1 N, begins to slip.
        let limit = largest_grip(&grip) * device.wheels()[0].spec().radius;
        let h = 2.5e-4;
        let (sliding, there) = slips(&device, Some(grip), 1.5 * limit, h);
        let (held, _) = slips(&device, Some(grip), 0.3 * limit, h);
        let (without, _) = slips(&device, None, 0.3 * limit, h);
        let (finer, _) = slips(&device, None, 0.3 * limit, 0.25 * h);
        println!(
            "{name}: slip seen {sliding:.3} of {there:.3} m/s there to see; held {held:.1e}, never slipping {without:.1e}, \
             in a quarter of the step {finer:.1e}"
        );
        assert!(sliding > 0.02, "{name}: {sliding}");
        // The error of a step of order 1: a quarter of the step gives a quarter of it.
        assert!(held < 0.02 * sliding && without < 0.02 * sliding, "{name}: {held} {without}");
        assert!((without / finer / 4.0 - 1.0).abs() < 0.2, "{name}: {without} {finer}");
    }
}
