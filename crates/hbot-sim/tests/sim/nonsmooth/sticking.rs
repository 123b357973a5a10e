//! Friction holds a load below its limit without any motion, and lets a load above it move.

use hbot_core::design::kinematics::Posture;
use hbot_sim::phenomena::largest_grip;

use crate::prelude::*;

fn steered() -> PlantState {
    PlantState { steer: [0.3, -0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], ..PlantState::default() }
}

/// Returns the angle by which the sphere turns in `seconds` under a constant load, rad. The load is
/// `external` on the sphere and the joint torques `tau`.
fn turn(device: &Device, phenomena: &Phenomena, external: Vec3, tau: &[f64; 16], seconds: f64) -> f64 {
    let mut state = steered();
    let mut dynamics = Dynamics::new(device, phenomena, Method::Rk4, &state).unwrap();
    for i in 0..(seconds * 1000.0) as u32 {
        dynamics.step(&mut state, f64::from(i) * 1e-3, 1e-3, tau, external, None);
        assert!(dynamics.effort().unwrap().converged, "step {i}");
    }
    rotation::angle_between(state.q, steered().q)
}

/// Checks that a load 1 % below `limit` is held for a minute, and that a load 1 % above it moves
/// the sphere within half a second.
fn holds_up_to(limit: f64, turn: impl Fn(f64, f64) -> f64, name: &str) {
    let (below, above) = (turn(0.99 * limit, 60.0), turn(1.01 * limit, 0.5));
    println!(
        "{name}: limit {limit:.4e}; a minute below turns {below:.1e} rad, half a second above {above:.1e}"
    );
    assert!(below < 1e-9, "{name}: {below:e} rad below the limit");
    assert!(above > 1e-6, "{name}: {above:e} rad above the limit");
}

/// Returns the factor by which the load `along` can grow before friction no longer holds it. Joint
/// friction holds any torque in the zonotope of `generators`, and the cage any torque in a ball of
/// radius `ball`.
///
/// The factor is the least, over all directions n, of (sum |g.n| + ball) / |along.n|, with g the
/// generators. Support functions add, and a convex body ends at the first of its half-spaces. The
/// directions are searched on a grid that is refined around the best one.
fn capacity(along: Vec3, generators: &[Vec3], ball: f64) -> f64 {
    let held = |n: Vec3| {
        (generators.iter().map(|g| g.dot(n).abs()).sum::<f64>() + ball * n.length()) / along.dot(n).abs()
    };
    let mut best = along;
    let mut reach = 2.0;
    for _ in 0..60 {
        let centre = best;
        for i in -6..=6 {
            for j in -6..=6 {
                let (u, v) = centre.normalize().any_orthonormal_pair();
                let n = centre + (u * f64::from(i) + v * f64::from(j)) * (reach / 6.0);
                if held(n) < held(best) {
                    best = n.normalize();
                }
            }
        }
        reach *= 0.7;
    }
    held(best)
}

fn joints_of(device: &Device, coulomb: f64) -> Vec<Vec3> {
    let posture = Posture::new(device, &steered().steer);
    posture.rows()[..device.joints()].iter().map(|row| *row * coulomb).collect()
}

#[test]
fn a_cage_alone() {
    let phenomena = Phenomena { cage_friction: Some(CageFriction::default()), ..Phenomena::default() };
    let device = toed(2);
    let axis = Vec3::new(1.0, -2.0, 0.5).normalize();
    holds_up_to(2e-3, |load, s| turn(&device, &phenomena, axis * load, &[0.0; 16], s), "cage");
}

#[test]
fn joints_and_cage() {
    let phenomena = Phenomena {
        cage_friction: Some(CageFriction::default()),
        joint_friction: Some(JointFriction::default()),
        ..Phenomena::default()
    };
    for (device, name) in [(device(), "prototype"), (toed(3), "three wheels with toe")] {
        let axis = Vec3::new(0.3, 1.0, -0.4).normalize();
        let limit = capacity(axis, &joints_of(&device, 2e-4), 2e-3);
        holds_up_to(limit, |load, s| turn(&device, &phenomena, axis * load, &[0.0; 16], s), name);
    }
}

/// Friction of joints and cage holds joint torques up to the computed limit. Joint torques load the
/// sphere by Gᵀ tau, and the friction of each joint takes part of its own torque.
#[test]
fn joints_and_cage_under_joint_torques() {
    let phenomena = Phenomena {
        cage_friction: Some(CageFriction::default()),
        joint_friction: Some(JointFriction::default()),
        ..Phenomena::default()
    };
    let device = device();
    let rows = joints_of(&device, 1.0);
    let share = [1.0, -0.7, 0.4, 0.2];
    let along = rows.iter().zip(share).fold(Vec3::ZERO, |sum, (row, share)| sum + *row * share);
    let limit = capacity(along, &joints_of(&device, 2e-4), 2e-3);
    let load = |load: f64, s: f64| {
        let mut tau = [0.0; 16];
        for (tau, share) in tau.iter_mut().zip(share) {
            *tau = share * load;
        }
        turn(&device, &phenomena, Vec3::ZERO, &tau, s)
    };
    holds_up_to(limit, load, "joint torques");
}

/// With locked joints, the friction of contacts and cage holds a load up to the computed limit.
///
/// Each contact holds a disc of forces: mu N in every direction perpendicular to c3, with the lever
/// arm R. It therefore holds mu N R |n x c3|.
#[test]
fn contacts_and_cage() {
    let slip = Slip { mu: 0.5, normal_force: 2.0 };
    let phenomena = Phenomena {
        cage_friction: Some(CageFriction { torque: 0.02 }),
        joint_friction: Some(JointFriction { coulomb: 10.0, breakaway: 10.0, ..JointFriction::default() }),
        slip: Some(slip),
        ..Phenomena::default()
    };
    let device = toed(2);
    let posture = Posture::new(&device, &steered().steer);
    // Approximates the disc by a zonotope of many thin rods. Its support function is right within
    // (pi/64)²/24, 1e-4.
    let mut rods = Vec::new();
    for frame in &posture.frames()[..2] {
        for k in 0..64 {
            let (s, c) = (core::f64::consts::PI * (f64::from(k) + 0.5) / 64.0).sin_cos();
            let reach = largest_grip(&slip) * device.sphere_radius() * core::f64::consts::PI / 128.0;
            rods.push((frame.c1 * c + frame.c2 * s) * reach);
        }
    }
    let axis = Vec3::new(0.3, 1.0, -0.4).normalize();
    let limit = capacity(axis, &rods, 0.02);
    holds_up_to(limit, |load, s| turn(&device, &phenomena, axis * load, &[0.0; 16], s), "contacts and cage");
}

/// A driven wheel whose sphere is held slips when its drive torque exceeds mu N r plus the friction
/// of its joint.
#[test]
fn a_contact_under_a_drive() {
    let slip = Slip { mu: 0.5, normal_force: 2.0 };
    let phenomena = Phenomena {
        cage_friction: Some(CageFriction { torque: 10.0 }),
        joint_friction: Some(JointFriction::default()),
        slip: Some(slip),
        ..Phenomena::default()
    };
    let device = device();
    let limit = largest_grip(&slip) * 0.0155 + 2e-4;
    let angle = |torque: f64, seconds: f64| {
        let mut state = steered();
        let mut dynamics = Dynamics::new(&device, &phenomena, Method::Rk4, &state).unwrap();
        let mut tau = [0.0; 16];
        tau[1] = torque;
        for i in 0..(seconds * 1000.0) as u32 {
            dynamics.step(&mut state, f64::from(i) * 1e-3, 1e-3, &tau, Vec3::ZERO, None);
        }
        state.drive[0].abs()
    };
    holds_up_to(limit, angle, "a drive against its contact");
}
