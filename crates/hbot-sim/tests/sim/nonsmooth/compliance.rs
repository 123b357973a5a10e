//! Contacts and a cage that give way: energy, frequencies, and the limits of stiff parts.

use hbot_core::WheelSpec;
use hbot_sim::phenomena::{Compliance, Gear};

use crate::prelude::*;

const START: Vec3 = Vec3::new(1.0, 2.0, -1.5);

fn with(compliance: Compliance) -> Phenomena {
    Phenomena { compliance: Some(compliance), ..Phenomena::default() }
}

/// Returns parts of the given stiffness, N/m, without damping.
fn undamped(stiffness: f64) -> Compliance {
    Compliance {
        contact_stiffness: stiffness,
        contact_damping: 0.0,
        cage_stiffness: 2.0 * stiffness,
        cage_damping: 0.0,
    }
}

/// Runs `steps` steps of `h` seconds under alternating joint torques, which then cease, and calls
/// `see` with the energy after each step without torque.
fn shaken(phenomena: &Phenomena, h: f64, steps: u32, mut see: impl FnMut(f64)) -> PlantState {
    let mut state = PlantState { omega: START, ..PlantState::default() };
    let mut dynamics = Dynamics::new(&device(), phenomena, Method::Rk4, &state).unwrap();
    for i in 0..steps {
        let torque = if i < 20 { 0.05 * f64::from(i % 3) - 0.05 } else { 0.0 };
        let tau = core::array::from_fn(|j| if j < 4 { torque } else { 0.0 });
        dynamics.step(&mut state, f64::from(i) * h, h, &tau, Vec3::ZERO, None);
        assert!(dynamics.effort().unwrap().converged, "{phenomena:?}, step {i}");
        if i >= 20 {
            see(dynamics.energy(&state));
        }
    }
    state
}

/// Without damping the energy is constant at any stiffness and any step, also far above the
/// frequency that a step can resolve.
#[test]
fn without_damping_the_energy_is_constant() {
    for stiffness in [1.0e3, 1.0e5, 1.0e7, 1.0e9] {
        for h in [1.0e-5, 2.5e-4, 1.0e-3] {
            let (mut first, mut worst) = (None, 0.0_f64);
            shaken(&with(undamped(stiffness)), h, 4000, |energy| {
                worst = worst.max((energy / *first.get_or_insert(energy) - 1.0).abs());
            });
            // What the solver leaves of each step, at most 64 estimated rounding errors, adds up
            // over 4000 steps.
            assert!(worst < 1e-9, "{stiffness:e} N/m, {h:e} s: {worst:e}");
        }
    }
}

/// With damping, and with contacts that slide, no step adds energy, and all elastic energy is lost
/// in the end.
#[test]
fn with_damping_the_energy_never_grows() {
    for stiffness in [1.0e3, 1.0e5, 1.0e9] {
        for damping in [1.0, 1.0e3, 1.0e5] {
            for slip in [None, Some(Slip::default()), Some(Slip { mu: 0.01, normal_force: 10.0 })] {
                let parts =
                    Compliance { contact_damping: damping, cage_damping: damping, ..undamped(stiffness) };
                let phenomena = Phenomena { slip, ..with(parts) };
                let mut before = f64::INFINITY;
                shaken(&phenomena, 2.5e-4, 2000, |energy| {
                    // The tolerance is what the solver leaves of a step.
                    assert!(energy <= before * (1.0 + 1e-11), "{phenomena:?}: {before:e} {energy:e}");
                    before = energy;
                });
            }
        }
    }
}

/// Dry friction acts at the speed at the end of a step, springs at the mean of both. So with both,
/// a step can add energy, but the sum of energy and h c |v| / 2 never grows. c |v| is the power of
/// the friction.
#[test]
fn with_dry_friction_the_energy_grows_by_no_more_than_half_a_step_of_friction() {
    let (torque, h) = (5.0e-3, 2.5e-4);
    let phenomena = Phenomena { cage_friction: Some(CageFriction { torque }), ..with(undamped(1.0e5)) };
    let mut state = PlantState { omega: START, ..PlantState::default() };
    let mut dynamics = Dynamics::new(&device(), &phenomena, Method::Rk4, &state).unwrap();
    let bounded = |dynamics: &Dynamics, state: &PlantState| {
        dynamics.energy(state) + 0.5 * h * torque * state.omega.length()
    };
    let mut before = bounded(&dynamics, &state);
    let start = before;
    for i in 0..8000 {
        dynamics.step(&mut state, f64::from(i) * h, h, &[0.0; 16], Vec3::ZERO, None);
        let now = bounded(&dynamics, &state);
        assert!(now <= before + 1e-11 * start, "step {i}: {before:e} {now:e}");
        before = now;
    }
    // The sphere came to rest. What is left rings between wheels and sphere.
    assert!(before < 0.05 * start, "{before:e} of {start:e}");
}

/// Flanks and losses of gears act at the speed at the end of a step, and behind gears springs do so
/// too. So no step adds energy, also where a spring is too stiff for the step.
#[test]
fn behind_gears_the_energy_never_grows() {
    for stiffness in [1.0e5, 1.0e9] {
        for efficiency in [0.01, 0.5, 1.0] {
            let gear = Gear { backlash: 0.02, efficiency, rotor_share: 0.3 };
            let phenomena = Phenomena { gear: Some(gear), ..with(undamped(stiffness)) };
            let mut before = f64::INFINITY;
            shaken(&phenomena, 1.0e-3, 2000, |energy| {
                assert!(energy <= before * (1.0 + 1e-9), "{phenomena:?}: {before:e} {energy:e}");
                before = energy;
            });
        }
    }
}

/// The stiffer the parts, the less they matter: the difference from the stiffest falls in
/// proportion to the compliance. What the stiffest parts leave relative to a rig without compliance
/// is the error of the scheme, which falls with the square of the step.
#[test]
fn stiff_parts_move_as_rigid_ones() {
    let run = |phenomena: &Phenomena, h: f64| {
        let mut state = PlantState { omega: START, ..PlantState::default() };
        let mut dynamics = Dynamics::new(&device(), phenomena, Method::Rk4, &state).unwrap();
        let steps = (0.3 / h).round() as u32;
        for i in 0..steps {
            let t = f64::from(i) * h;
            let external = Vec3::new(0.05, 0.02, -0.04) * (1.0 - libm::cos(30.0 * t));
            dynamics.step(&mut state, t, h, &[0.0; 16], external, None);
        }
        state
    };
    let compliant = |stiffness, h| {
        run(&with(Compliance { contact_damping: 5.0, cage_damping: 30.0, ..undamped(stiffness) }), h)
    };
    let apart = |a: &PlantState, b: &PlantState| hbot_core::rotation::difference(a.q, b.q).length();
    let h = 5.0e-5;
    let stiffest = compliant(1.0e9, h);
    let [soft, stiff] = [1.0e4, 1.0e5].map(|stiffness| apart(&compliant(stiffness, h), &stiffest));
    // The two ring at other phases at the end, so their ratio is 10 only roughly.
    assert!(soft > 5.0 * stiff && stiff > 0.0, "{soft:e} {stiff:e}");
    let [coarse, fine] = [2.0 * h, h].map(|h| apart(&compliant(1.0e9, h), &run(&Phenomena::default(), h)));
    // Order 2: half the step, a quarter of the error, apart from the compliance that is left.
    assert!(coarse > 2.5 * fine && fine < 1.0e-7, "{coarse:e} {fine:e}");
}

/// A small ringing has the frequency of the mechanism: held sphere and cage, one wheel's drive
/// rings at sqrt(k r² / J), and the slower of two free bodies at the roots of the two-mass
/// equation.
#[test]
fn a_wheel_rings_at_the_frequency_of_its_spring() {
    let stiffness = 2.0e4;
    let parts = Compliance { cage_stiffness: 1.0e9, ..undamped(stiffness) };
    // A sphere so heavy that only the wheels move.
    let device = device_with(|wheel| WheelSpec { axial_inertia: 0.0, ..wheel });
    let mut state = PlantState::default();
    let mut dynamics = Dynamics::new(&device, &with(parts), Method::Rk4, &state).unwrap();
    dynamics.set_sphere_inertia(1.0e3);
    let wheel = device.wheels()[0].spec();
    let (h, torque) = (2.0e-5, 1.0e-3);
    let mut tau = [0.0; 16];
    tau[1] = torque;
    let (mut crossings, mut last) = (Vec::new(), 0.0);
    // Under a constant torque the wheel swings about its deflection torque / (k r²).
    let rest = torque / (stiffness * wheel.radius * wheel.radius);
    for i in 0..20_000 {
        dynamics.step(&mut state, f64::from(i) * h, h, &tau, Vec3::ZERO, None);
        let x = dynamics.encoder_angles(&state)[1] - rest;
        if last < 0.0 && x >= 0.0 {
            crossings.push(f64::from(i) + 1.0 - x / (x - last));
        }
        last = x;
    }
    let period = h * (crossings[crossings.len() - 1] - crossings[0]) / (crossings.len() - 1) as f64;
    let expected = std::f64::consts::TAU * (wheel.drive_inertia / stiffness).sqrt() / wheel.radius;
    // The midpoint rule lengthens a period by (w h)² / 12, here 1e-4 of it.
    assert!((period / expected - 1.0).abs() < 2.0e-4, "{period:e} {expected:e}");
}

/// Under a constant torque a wheel comes to rest where contact and cage together hold it: the force
/// torque / r along c2 stretches both.
#[test]
fn the_cage_gives_way_in_series_with_the_contact() {
    for (contact, cage) in [(1.0e5, 1.0e4), (1.0e4, 1.0e5), (2.0e4, 2.0e4)] {
        let parts = Compliance {
            contact_stiffness: contact,
            contact_damping: 20.0,
            cage_stiffness: cage,
            cage_damping: 50.0,
        };
        let device = device();
        let mut state = PlantState::default();
        let mut dynamics = Dynamics::new(&device, &with(parts), Method::Rk4, &state).unwrap();
        dynamics.set_sphere_inertia(1.0e6);
        let wheel = device.wheels()[0].spec();
        let mut tau = [0.0; 16];
        tau[1] = 1.0e-3;
        for i in 0..8000 {
            dynamics.step(&mut state, f64::from(i) * 2.5e-4, 2.5e-4, &tau, Vec3::ZERO, None);
        }
        let expected = tau[1] / (wheel.radius * wheel.radius) * (1.0 / contact + 1.0 / cage);
        let ratio = state.drive[0] / expected;
        // The heavy sphere turned by 2e-4 of this meanwhile.
        assert!((ratio - 1.0).abs() < 1.0e-3, "{contact} {cage}: {ratio}");
    }
}

/// A contact carries no more than its friction allows: under a growing torque, the force on the
/// sphere stops growing at mu N.
#[test]
fn a_contact_that_gives_way_slides_at_its_limit() {
    let slip = Slip { mu: 0.5, normal_force: 4.0 };
    let phenomena = Phenomena { slip: Some(slip), ..with(Compliance::default()) };
    let mut state = PlantState::default();
    let device = device();
    let mut dynamics = Dynamics::new(&device, &phenomena, Method::Rk4, &state).unwrap();
    dynamics.set_sphere_inertia(1.0e3);
    let wheel = device.wheels()[0].spec();
    // Twice the torque that the contact can hold: half of it accelerates the wheel.
    let mut tau = [0.0; 16];
    tau[1] = 2.0 * slip.mu * slip.normal_force * wheel.radius;
    let h = 2.5e-4;
    for i in 0..400 {
        dynamics.step(&mut state, f64::from(i) * h, h, &tau, Vec3::ZERO, None);
    }
    let start = dynamics.encoder_rates(&state)[1];
    for i in 400..800 {
        dynamics.step(&mut state, f64::from(i) * h, h, &tau, Vec3::ZERO, None);
    }
    let measured = (dynamics.encoder_rates(&state)[1] - start) / (400.0 * h);
    let expected = 0.5 * tau[1] / wheel.drive_inertia;
    assert!((measured / expected - 1.0).abs() < 1e-3, "{measured} {expected}");
}

/// The default parts leave a sphere at rest at rest, and a plant without the phenomenon does not
/// know them.
#[test]
fn what_rests_stays_at_rest_and_what_is_absent_has_no_state() {
    let friction = JointFriction::default();
    let phenomena = Phenomena { joint_friction: Some(friction), ..with(Compliance::default()) };
    let mut state = PlantState::default();
    let mut dynamics = Dynamics::new(&device(), &phenomena, Method::Rk4, &state).unwrap();
    for i in 0..1000 {
        dynamics.step(&mut state, f64::from(i) * 2.5e-4, 2.5e-4, &[0.0; 16], Vec3::ZERO, None);
    }
    assert_eq!(state, PlantState::default());
    let plant = Plant::new(&device()).unwrap();
    let moving = PlantState { omega: START, ..state };
    dynamics.set_phenomena(&Phenomena { joint_friction: Some(friction), ..Phenomena::default() }, &moving);
    // Without the phenomenon all energy is that of the rolling wheels and the sphere.
    assert!((dynamics.energy(&moving) / plant.energy(&moving) - 1.0).abs() < 1e-12);
}
