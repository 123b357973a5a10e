//! Laws that hold for every motion: energy, power, unit norm, no slip.

use hbot_core::Mat3;
use hbot_core::design::kinematics::Posture;

use crate::prelude::*;

fn plants() -> Vec<(Plant, hbot_core::design::device::Device)> {
    let devices = [device(), toed(2), toed(3), toed(5), toed(8)];
    devices.into_iter().map(|device| (Plant::new(&device).unwrap(), device)).collect()
}

fn outer(a: Vec3, b: Vec3) -> Mat3 {
    Mat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// The plant uses rearranged equations. Its apparent inertia and joint rates equal those of the
/// definition, with the rows of the matrix G from the core's kinematics.
#[test]
fn apparent_inertia_and_rates_are_those_of_the_definition() {
    for (plant, device) in plants() {
        let state = brisk();
        let posture = Posture::new(&device, &state.steer);
        let mut wanted = Mat3::from_diagonal(Vec3::splat(device.sphere_inertia()));
        for (i, wheel) in device.wheels().iter().enumerate() {
            let (spec, steer, drive) = (wheel.spec(), posture.rows()[2 * i], posture.rows()[2 * i + 1]);
            let coupling = spec.axial_inertia * wheel.axis_along_axle();
            wanted += outer(steer, steer) * spec.steer_inertia + outer(drive, drive) * spec.drive_inertia;
            wanted += (outer(steer, drive) + outer(drive, steer)) * coupling;
        }
        let off = (plant.apparent_inertia(&state) - wanted)
            .to_cols_array()
            .iter()
            .fold(0.0, |m: f64, x| m.max(x.abs()));
        assert!(off < 1e-14 * wanted.x_axis.x, "{} wheels: {off:e}", plant.wheels());
        for (rate, wanted) in plant.joint_rates(&state).iter().zip(posture.inverse(state.omega)) {
            assert!((rate - wanted).abs() < 1e-13 * wanted.abs().max(1.0), "{rate} {wanted}");
        }
    }
}

/// Without torque the energy of the plant is constant: within the tolerance for the reference
/// integrator, and within an error of order h^p for a method of order p.
#[test]
fn energy_stays_without_torque() {
    for (plant, _) in plants() {
        let energy = plant.energy(&brisk());
        let mut exact = brisk();
        plant.advance_exactly(&mut exact, 0.0, 1.0, &[0.0; 16], &Vec3::ZERO, 1e-13).unwrap();
        let off = (plant.energy(&exact) / energy - 1.0).abs();
        assert!(off < 1e-11, "{} wheels, reference: {off:e}", plant.wheels());
        for method in Method::ALL {
            let drift = |h: f64| {
                let mut state = brisk();
                let mut worst: f64 = 0.0;
                for i in 0..(1.0 / h).round() as u32 {
                    plant.step(method, &mut state, f64::from(i) * h, h, &[0.0; 16], &Vec3::ZERO);
                    worst = worst.max((plant.energy(&state) / energy - 1.0).abs());
                }
                worst
            };
            // Wheels steer at up to 50 rad/s. The bound is (50 h)^p with h = 0.5 ms: 2.5e-2, 6e-4,
            // 4e-7.
            let off = drift(0.0005);
            assert!(
                off < (50.0f64 * 0.0005).powi(method.order() as i32),
                "{} wheels, {method:?}: {off:e}",
                plant.wheels()
            );
        }
    }
}

/// The energy that the plant gains equals the power supplied to it, dE/dt = T.w + tau.zd. The
/// derivative is computed by central differences.
#[test]
fn power_in_is_energy_gained() {
    for (plant, device) in plants() {
        let state = brisk();
        let torque = Vec3::new(0.2, -0.3, 0.1);
        let mut tau = [0.0; 16];
        for (j, tau) in tau.iter_mut().enumerate().take(device.joints()) {
            *tau = 0.01 * (1.0 + j as f64) * if j % 3 == 0 { -1.0 } else { 1.0 };
        }
        let rates = plant.joint_rates(&state);
        let power =
            torque.dot(state.omega) + tau.iter().zip(rates).map(|(tau, rate)| tau * rate).sum::<f64>();
        // 1/2 d/dt (w.Mw) = w.(M dw/dt + 1/2 dM/dt w), and Gᵀ J dG/dt w is 1/2 dM/dt w along w.
        let after = |h: f64| {
            let mut state = state;
            plant.step(Method::Rk4, &mut state, 0.0, h, &tau, &torque);
            plant.energy(&state)
        };
        let h = 1e-5;
        let gained = (after(h) - after(-h)) / (2.0 * h);
        // h² times a third derivative of about (50 rad/s)² times the power. Rounding is 1e-16 E /
        // h.
        assert!(
            (gained - power).abs() < 1e-5 * power.abs().max(0.1),
            "{} wheels: {gained} {power}",
            plant.wheels()
        );
    }
}

#[test]
fn the_quaternion_stays_unit() {
    let (plant, _) = plants().remove(0);
    for method in Method::ALL {
        let mut state = PlantState { omega: Vec3::new(10.0, -20.0, 5.0), ..brisk() };
        for i in 0..20_000 {
            plant.step(method, &mut state, f64::from(i) * 1e-3, 1e-3, &[0.0; 16], &(Vec3::ZERO));
            assert!(
                (state.q.length() - 1.0).abs() < 1e-15 * 4.0,
                "{method:?}, step {i}: {}",
                state.q.length()
            );
        }
    }
}

#[test]
fn the_same_bits_everywhere() {
    let (plant, load) = crate::devices::task();
    for (method, bits) in [
        (Method::SemiImplicitEuler, 0xd008_025c_7175_be67_u64),
        (Method::Midpoint, 0xfbc2_32e4_c0c2_7743_u64),
        (Method::Rk4, 0x9c7a_3e12_325f_aacc_u64),
        (Method::Rkmk4, 0x14da_120a_f50c_b0aa_u64),
    ] {
        let mut state = brisk();
        for i in 0..1000 {
            plant.step(method, &mut state, f64::from(i) * 1e-3, 1e-3, &[0.01; 16], &load);
        }
        let all = [state.q.x, state.q.y, state.q.z, state.q.w, state.omega.x, state.omega.y, state.omega.z];
        let joints = state.joints();
        let hash = all.iter().chain(&joints[..4]).fold(0xcbf2_9ce4_8422_2325_u64, |hash, x| {
            x.to_bits()
                .to_le_bytes()
                .iter()
                .fold(hash, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
        });
        assert_eq!(hash, bits, "{method:?}: {hash:#x}");
    }
}
