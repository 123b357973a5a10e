//! The simulated rig as a whole: its time, its hand, and repeatability.

use hbot_sim::rig::SimulatedRigError;

use crate::prelude::*;

fn config() -> SimulatedConfig {
    SimulatedConfig::new(&rig())
}

#[test]
fn joints_and_device_must_fit() {
    let mut config = config();
    config.joints.pop();
    let error = SimulatedRig::new(&config).unwrap_err();
    assert_eq!(error, SimulatedRigError::Joints { given: 3, wanted: 4 });
    assert!(error.to_string().contains("3 joints"), "{error}");
}

/// In virtual time, a tick of 1 ms is one step of 1 ms: the state of the rig equals, bit by bit,
/// that of its plant simulated alone.
#[test]
fn a_tick_is_a_step() {
    let mut rig = SimulatedRig::new(&config()).unwrap();
    rig.set_state(brisk());
    let plant = Plant::new(&config().device).unwrap();
    let (mut state, mut reply) = (brisk(), Vec::new());
    let mut tau = [0.0; 16];
    for k in 1..=100u32 {
        let torque = [0.1, 0.05, -0.1, 0.02].map(|t: f32| t * k as f32 * 0.01);
        rig.receive(u64::from(k) * MS, &frame(&ToController::Command(command(k, true, &torque))), &mut reply);
        plant.step(Method::Rk4, &mut state, 0.0, 1e-3, &tau, &Vec3::ZERO);
        tau = *rig.joint_torque();
        assert_eq!(*rig.state(), state, "tick {k}");
    }
}

#[test]
fn looks_do_not_matter() {
    let mut config = config();
    config.phenomena.hand = Some(Hand::default());
    let run = |looks: &[u64]| {
        let mut rig = SimulatedRig::new(&config).unwrap();
        for at in looks {
            rig.advance_to(*at);
        }
        *rig.state()
    };
    let even = run(&(1..=1000).map(|k| k * MS).collect::<Vec<_>>());
    let uneven = run(&(1..=700).map(|k| k * k * 1_000_000_000 / 490_000).collect::<Vec<_>>());
    let rare = run(&(1..=20).map(|k| k * 50 * MS).collect::<Vec<_>>());
    for other in [uneven, rare] {
        assert!((even.omega - other.omega).length() < 1e-9, "{} {}", even.omega, other.omega);
        assert!((even.steer[0] - other.steer[0]).abs() < 1e-9);
    }
    assert!(even.omega.length() > 0.1, "the hand moves the sphere: {}", even.omega);
}

#[test]
fn a_clock_that_jumps_moves_the_plant_by_a_tenth_of_a_second_and_one_that_goes_back_not_at_all() {
    let mut rig = SimulatedRig::new(&config()).unwrap();
    rig.advance_to(30_000 * MS);
    assert_eq!(rig.simulated_s(), 0.1);
    rig.advance_to(20_000 * MS);
    assert_eq!(rig.simulated_s(), 0.1);
    rig.advance_to(30_001 * MS);
    assert_eq!(rig.simulated_s(), 0.101);
    rig.set_clock(90_000 * MS);
    rig.advance_to(90_001 * MS);
    assert_eq!(rig.simulated_s(), 0.102);
}

/// A hand takes hold of a turning sphere and later lets go. Orientation and angular velocity do not
/// jump, and the hand's inertia is added and removed.
#[test]
fn a_hand_takes_hold_and_lets_go() {
    let mut rig = SimulatedRig::new(&config()).unwrap();
    let bare = rig.dynamics().sphere_inertia();
    rig.set_state(PlantState { omega: Vec3::new(0.0, 0.5, 0.0), ..PlantState::default() });
    rig.advance_to(100 * MS);
    let before = *rig.state();
    rig.set_hand(Some(Hand::default()));
    assert_eq!(*rig.state(), before);
    assert_eq!(rig.dynamics().sphere_inertia(), bare + 2e-3);
    let grip = *rig.grip().unwrap();
    assert_eq!(grip.target(rig.simulated_s()).q, before.q);
    // The hand stops the sphere (damping ratio 0.05 / 2 / sqrt(3 x 5.5e-3), time constant 0.2 s),
    // then moves it.
    let mut widest: f64 = 0.0;
    for k in 100..20_000 {
        rig.advance_to(k * MS);
        if k > 3000 {
            let target = grip.target(rig.simulated_s());
            widest = widest.max(hbot_core::rotation::angle_between(rig.state().q, target.q));
        }
    }
    // The inertia makes the sphere lag: M d²q/dt² / K, 6e-3 x 0.25 x (2 pi 0.25)² / 3, some mrad
    // about each axis.
    assert!(widest > 1e-4 && widest < 0.02, "{widest}");
    let before = *rig.state();
    rig.set_hand(None);
    assert_eq!((*rig.state(), rig.dynamics().sphere_inertia()), (before, bare));
    let energy = rig.dynamics().energy(rig.state());
    rig.advance_to(20_100 * MS);
    assert!((rig.dynamics().energy(rig.state()) / energy - 1.0).abs() < 1e-6, "free again");
}

#[test]
fn an_external_torque_acts() {
    let mut rig = SimulatedRig::new(&config()).unwrap();
    rig.set_external(Vec3::Y * 0.01);
    rig.advance_to(50 * MS);
    let work = 0.01 * hbot_core::rotation::log(rig.state().q).y;
    let energy = rig.dynamics().energy(rig.state());
    assert!(energy > 0.0 && (energy / work - 1.0).abs() < 1e-3, "{energy} {work}");
}
