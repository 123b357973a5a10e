//! Torque constants that differ, cogging, and a sphere out of balance, each against its closed
//! form.

use core::f64::consts::TAU;

use hbot_core::design::rig::{Compensation, Friction, Harmonic};
use hbot_sim::phenomena::{Cogging, Eccentric, Imbalance, TorqueConstants};
use oorandom::Rand64;

use crate::prelude::*;

fn with(phenomena: Phenomena) -> SimulatedRig {
    let mut config = SimulatedConfig::new(&rig());
    for joint in &mut config.joints {
        joint.reversed = false;
    }
    config.phenomena = phenomena;
    SimulatedRig::new(&config).unwrap()
}

fn drive(rig: &mut SimulatedRig, torque: [f32; 4]) {
    rig.receive(0, &frame(&ToController::Describe), &mut Vec::new());
    rig.receive(0, &frame(&ToController::Command(command(1, true, &torque))), &mut Vec::new());
}

/// Each motor has its own constant, uniform within the spread, and the sphere moves as under the
/// true torques.
#[test]
fn torque_constants_scale_the_torque_of_each_motor() {
    let constants = TorqueConstants { spread: 0.1, seed: 7 };
    let mut wrong = with(Phenomena { torque_constants: Some(constants), ..Phenomena::default() });
    let asked = [0.02_f32, -0.01, 0.015, 0.005];
    drive(&mut wrong, asked);
    let mut random = Rand64::new(7);
    let errors: [f64; 4] = core::array::from_fn(|_| 0.1 * (2.0 * random.rand_float() - 1.0));
    assert!(errors.iter().all(|e| e.abs() < 0.1) && errors.iter().any(|e| e.abs() > 0.03));
    let want: [f64; 4] = core::array::from_fn(|j| f64::from(asked[j]) * (1.0 + errors[j]));
    assert_eq!(wrong.shaft_torque()[..4], want);
    assert_eq!(wrong.joint_torque()[..4], asked.map(f64::from), "what the controllers believe");
    // The plant feels the true torques: an ideal rig with them as its torques moves alike.
    let mut state = PlantState::default();
    let mut ideal = Dynamics::new(&rig().device, &Phenomena::default(), Method::Rk4, &state).unwrap();
    let mut held = [0.0; 16];
    held[..4].copy_from_slice(&want);
    for tick in 1..=10 {
        wrong.advance_to(tick * MS);
        ideal.step(&mut state, (tick - 1) as f64 * 1e-3, 1e-3, &held, Vec3::ZERO, None);
    }
    assert_eq!(wrong.state(), &state);
    // Without an error nothing changes.
    let same = TorqueConstants { spread: 0.0, seed: 7 };
    let mut same = with(Phenomena { torque_constants: Some(same), ..Phenomena::default() });
    drive(&mut same, asked);
    assert_eq!(same.shaft_torque(), *same.joint_torque());
}

const COGS: Cogging =
    Cogging { per_turn: [7, 12], steer: [3.0e-3, 1.0e-3], drive: [2.0e-4, 1.0e-4], seed: 3 };

/// Returns the phase of harmonic `k` of joint `j`: the draws are in this order.
fn phase(j: usize, k: usize) -> f64 {
    let mut random = Rand64::new(3);
    (0..=2 * j + k).map(|_| TAU * random.rand_float()).last().unwrap()
}

/// Returns amplitude and periods per radian of harmonic `k` of joint `j`.
fn cog(j: usize, k: usize) -> (f64, f64) {
    let gear = rig().joints[j].gear;
    ([COGS.steer, COGS.drive][j % 2][k], f64::from(COGS.per_turn[k]) * gear)
}

#[test]
fn cogging_repeats_with_the_angle_of_the_encoder() {
    let mut rig = with(Phenomena { cogging: Some(COGS), ..Phenomena::default() });
    for i in -50..50 {
        let angle = f64::from(i) * 0.037;
        rig.set_state(PlantState { steer: [angle; 8], drive: [0.3 * angle; 8], ..PlantState::default() });
        let torque = rig.shaft_torque();
        for j in 0..4 {
            let x = [angle, 0.3 * angle][j % 2];
            let one = |k: usize| cog(j, k).0 * (cog(j, k).1 * x + phase(j, k)).sin();
            assert!((torque[j] - one(0) - one(1)).abs() < 1e-15, "joint {j} at {x}");
        }
    }
}

/// Cogging has a potential: kinetic energy and the sum of amplitude / n cos(n x + phase) keep their
/// sum while the sphere turns over many teeth.
#[test]
fn cogging_keeps_the_energy() {
    let mut rig = with(Phenomena { cogging: Some(COGS), ..Phenomena::default() });
    rig.set_state(PlantState { omega: Vec3::new(0.6, -0.4, 0.5), ..PlantState::default() });
    let potential = |state: &PlantState| {
        let angles = state.joints();
        let one = |j: usize, k: usize| {
            let (amplitude, per_rad) = cog(j, k);
            amplitude / per_rad * (per_rad * angles[j] + phase(j, k)).cos()
        };
        (0..4).map(|j| one(j, 0) + one(j, 1)).sum::<f64>()
    };
    let energy = |rig: &SimulatedRig| rig.dynamics().energy(rig.state()) + potential(rig.state());
    let (start, mut least, mut most) = (energy(&rig), f64::INFINITY, 0.0_f64);
    for tick in 1..=2000 {
        rig.advance_to(tick * MS);
        assert!((energy(&rig) - start).abs() < 2e-3 * start, "{} of {start} J", energy(&rig));
        let kinetic = rig.dynamics().energy(rig.state());
        (least, most) = (least.min(kinetic), most.max(kinetic));
    }
    // The teeth are felt: the kinetic energy changes by much more than the sum does.
    assert!(most - least > 0.3 * start, "{least} to {most} J");
}

/// The weight of a sphere out of balance turns it as the torque says, in the smooth and in the
/// nonsmooth plant, and moves no contact.
#[test]
fn an_imbalance_is_a_weight_and_nothing_else() {
    let torque = [0.01, -0.02, 0.005];
    let unbalanced = Phenomena { imbalance: Some(Imbalance { torque }), ..Phenomena::default() };
    let device = rig().device;
    let (ideal, plant) = (Plant::new(&device).unwrap(), Plant::with(&device, &unbalanced).unwrap());
    for axis in [Vec3::X, Vec3::Y, Vec3::new(0.5, -1.0, 2.0)] {
        let state =
            PlantState { q: rotation::exp(axis), omega: axis, steer: [0.4; 8], ..PlantState::default() };
        let weight = (state.q * Vec3::from_array(torque)).cross(-Vec3::Z);
        let want = ideal.acceleration(&state, weight, &[0.0; 16]);
        let got = plant.acceleration(&state, Vec3::ZERO, &[0.0; 16]);
        assert!((got - want).length() < 1e-12 * want.length(), "{got} instead of {want}");
        for (a, b) in plant.joint_rates(&state).iter().zip(ideal.joint_rates(&state)) {
            assert!((a - b).abs() < 1e-12, "no contact has moved");
        }
    }
    // With friction that is much less than the weight, the nonsmooth plant begins to fall alike.
    let little = JointFriction { coulomb: 1.0e-9, viscous: 0.0, breakaway: 0.0, stribeck_rate: 0.5 };
    let rough = Phenomena { joint_friction: Some(little), ..unbalanced };
    let mut states = [PlantState::default(); 2];
    for (state, phenomena) in states.iter_mut().zip([unbalanced, rough]) {
        let mut dynamics = Dynamics::new(&device, &phenomena, Method::Rk4, state).unwrap();
        for i in 0..400 {
            dynamics.step(state, f64::from(i) * 2.5e-4, 2.5e-4, &[0.0; 16], Vec3::ZERO, None);
        }
    }
    let fallen = rotation::angle_between(states[0].q, Quat::IDENTITY);
    assert!(fallen > 0.01 && rotation::angle_between(states[0].q, states[1].q) < 0.01 * fallen);
}

/// An eccentric sphere has a weight too; the two add up.
#[test]
fn imbalance_and_an_eccentric_sphere_add_up() {
    let device = rig().device;
    let offset = [3.0e-4, 0.0, -1.0e-4];
    let both = |torque| Phenomena {
        eccentric: Some(Eccentric { offset }),
        imbalance: Some(Imbalance { torque }),
        ..Phenomena::default()
    };
    // A counterweight takes the whole torque away.
    let counter = offset.map(|x| -x * device.sphere_mass() * 9.806_65);
    let plant = Plant::with(&device, &both(counter)).unwrap();
    let state = PlantState { q: rotation::exp(Vec3::new(1.0, 0.4, -0.7)), ..PlantState::default() };
    assert!(plant.acceleration(&state, Vec3::ZERO, &[0.0; 16]).length() < 1e-12);
    let heavy = Plant::with(&device, &both([0.0; 3])).unwrap();
    assert!(heavy.acceleration(&state, Vec3::ZERO, &[0.0; 16]).length() > 0.1);
}

/// What a rig file says of its own rig acts like the phenomenon of the same numbers, adds to other
/// phenomena, and stays when they are replaced.
#[test]
fn a_rigs_own_imperfections_are_those_of_the_phenomena_and_stay() {
    let (coulomb, viscous) = (2.0e-4, 1.0e-5);
    let friction = Friction { coulomb, viscous };
    let mut own = Compensation { imbalance: Vec3::new(4.0e-3, 0.0, 1.0e-3), ..Compensation::default() };
    own.sphere = Friction { coulomb: 1.0e-3, viscous: 0.0 };
    own.joints.iter_mut().for_each(|joint| joint.friction = friction);
    let ours = |own: Compensation, phenomena: Phenomena| {
        let config = SimulatedConfig { imperfect: Some(own), phenomena, ..SimulatedConfig::new(&rig()) };
        SimulatedRig::new(&config).unwrap()
    };
    let same = Phenomena {
        joint_friction: Some(JointFriction { coulomb, viscous, breakaway: coulomb, stribeck_rate: 0.5 }),
        cage_friction: Some(CageFriction { torque: 1.0e-3 }),
        imbalance: Some(Imbalance { torque: [4.0e-3, 0.0, 1.0e-3] }),
        ..Phenomena::default()
    };
    let moved = |mut rig: SimulatedRig| {
        rig.set_state(PlantState { omega: Vec3::new(1.0, -0.5, 0.7), ..PlantState::default() });
        rig.advance_to(100 * MS);
        *rig.state()
    };
    let theirs = moved(with(same));
    assert_eq!(moved(ours(own, Phenomena::default())), theirs);
    // Other phenomena come and go.
    let mut changed = ours(own, Phenomena { slip: Some(Slip::default()), ..Phenomena::default() });
    changed.set_phenomena(Phenomena::default());
    assert_eq!(moved(changed), theirs);
    // Half of it from each side is the whole, up to rounding.
    let half = |x: f64| 0.5 * x;
    let mut part = own;
    part.imbalance *= 0.5;
    part.sphere.coulomb = half(1.0e-3);
    part.joints.iter_mut().for_each(|joint| {
        joint.friction = Friction { coulomb: half(coulomb), viscous: half(viscous) };
    });
    let other = Phenomena {
        joint_friction: Some(JointFriction {
            coulomb: half(coulomb),
            viscous: half(viscous),
            breakaway: half(coulomb),
            stribeck_rate: 0.5,
        }),
        cage_friction: Some(CageFriction { torque: half(1.0e-3) }),
        imbalance: Some(Imbalance { torque: [2.0e-3, 0.0, 0.5e-3] }),
        ..Phenomena::default()
    };
    assert!((moved(ours(part, other)).omega - theirs.omega).length() < 1e-9);
    // One joint alone rubs, with twice the friction.
    let mut one = Compensation::default();
    one.joints[1].friction = Friction { coulomb: 4.0e-4, viscous: 0.0 };
    let slowed = moved(ours(one, Phenomena::default())).omega.length();
    let free = moved(with(Phenomena::default())).omega.length();
    assert!(slowed < free - 1e-3 && slowed > theirs.omega.length(), "{slowed} of {free}");
}

#[test]
fn a_motors_own_constant_and_cogging_act_at_its_joint() {
    let mut own = Compensation::default();
    own.joints[0].torque_scale = 0.95;
    own.joints[3].cogging[0] = Harmonic { per_turn: 2, amplitude: 1.0e-3, phase: 0.6 };
    let mut config = SimulatedConfig { imperfect: Some(own), ..SimulatedConfig::new(&rig()) };
    config.joints.iter_mut().for_each(|joint| joint.reversed = false);
    let mut rig = SimulatedRig::new(&config).unwrap();
    let mut state = PlantState::default();
    state.drive[1] = 0.3;
    rig.set_state(state);
    drive(&mut rig, [0.02, 0.01, 0.0, 0.0]);
    let torque = rig.shaft_torque();
    let gear = config.joints[3].gear;
    let cogging = 1.0e-3 * (2.0 * gear * 0.3 + 0.6).sin();
    let asked = [0.02_f32, 0.01].map(f64::from);
    for (found, want) in torque.iter().zip([0.95 * asked[0], asked[1], 0.0, cogging]) {
        assert!((found - want).abs() < 1e-15, "{torque:?}");
    }
}
