//! Zero and infinite friction, and masses whose ratio is a million, in steps of 1 ms.

use hbot_core::WheelSpec;

use crate::prelude::*;

/// Simulates one second in steps of 1 ms and returns the state at the end. `inertia` scales the
/// inertias of the joints, `coulomb` is the friction of the joints, and `mu` that of the contacts.
/// Checks that no step adds energy.
fn a_second(inertia: f64, coulomb: f64, mu: f64) -> PlantState {
    let device = device_with(|wheel| WheelSpec {
        steer_inertia: wheel.steer_inertia * inertia,
        drive_inertia: wheel.drive_inertia * inertia,
        ..wheel
    });
    let phenomena = Phenomena {
        joint_friction: Some(JointFriction {
            coulomb,
            breakaway: coulomb,
            viscous: 0.0,
            ..JointFriction::default()
        }),
        slip: Some(Slip { mu, normal_force: 10.0 }),
        ..Phenomena::default()
    };
    let mut state = PlantState { omega: Vec3::new(1.0, 2.0, 3.0), ..PlantState::default() };
    let mut dynamics = Dynamics::new(&device, &phenomena, Method::Rk4, &state).unwrap();
    let start = dynamics.energy(&state);
    let mut before = start;
    for i in 0..1000 {
        dynamics.step(&mut state, f64::from(i) * 1e-3, 1e-3, &[0.0; 16], Vec3::ZERO, None);
        let (now, effort) = (dynamics.energy(&state), dynamics.effort().unwrap());
        // A few times the velocity that the solver leaves of a sticking element, relative to the
        // energy at the start.
        assert!(
            now - before <= 1e-11 * start && effort.converged,
            "{inertia} {coulomb} {mu}, step {i}: {effort:?}"
        );
        before = now;
    }
    state
}

#[test]
fn friction_of_nothing_and_without_end_and_masses_a_million_apart() {
    let start = Vec3::new(1.0, 2.0, 3.0);
    for inertia in [1e-6, 1.0, 1e6] {
        // Contacts without friction do not affect the sphere.
        let free = a_second(inertia, 0.0, 0.0).omega;
        assert!((free - start).length() < 1e-12, "{inertia}: {free}");
        // Contacts and joints with unlimited friction stop the sphere completely.
        let held = a_second(inertia, 1e12, 1e12).omega;
        assert!(held.length() < 1e-11, "{inertia}: {held}");
        // The joints hold and the contacts slide: mu N at each contact stops 3.2 mN m s within
        // about 5 ms.
        let slid = a_second(inertia, 1e12, 1.0).omega;
        assert!(slid.length() < 1e-11, "{inertia}: {slid}");
        let _ = a_second(inertia, 1e-3, 0.1);
    }
}
