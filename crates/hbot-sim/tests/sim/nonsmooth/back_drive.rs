//! Back-drive torques. The sphere can turn about one axis of N only, and a torque about it grows
//! until the sphere turns.

use core::f64::consts::TAU;

use hbot_core::design::kinematics::Posture;

use crate::prelude::*;

/// Number of pairs of steer angles that are tested. Each wheel takes this many equally spaced
/// angles. Friction is a sum over the wheels, so its mean does not depend on how their angles are
/// paired.
const GRID: u32 = 144;
/// Number of angle steps by which the second wheel advances for one step of the first. 55 and 144
/// have no common factor, so the second wheel takes every angle once.
const SKEW: u32 = 55;
/// Increase of the torque in each step of 1 ms, N m.
const RAMP: f64 = 2.0e-5;

/// The torque at which the sphere begins to turn, averaged over the steer angles of both wheels,
/// equals the expected back-drive torque.
///
/// For a sphere that can turn only about n, friction opposes it with the torque of the cage plus c
/// |g.n| for each joint, whatever torques the hinge itself takes.
#[test]
fn back_drive_torques_are_those_of_cage_and_joints() {
    let device = device();
    let (joints, cage) = (JointFriction::default(), CageFriction::default());
    let phenomena =
        Phenomena { joint_friction: Some(joints), cage_friction: Some(cage), ..Phenomena::default() };
    for (axis, paper, notes) in [(Vec3::X, 5.0, 4.2), (Vec3::Y, 4.0, 5.0), (Vec3::Z, 4.0, 4.1)] {
        let (mut found, mut expected) = (0.0, 0.0);
        for i in 0..GRID {
            let at = |k: u32| TAU * (f64::from(k % GRID) + 0.5) / f64::from(GRID);
            let mut state = PlantState::default();
            (state.steer[0], state.steer[1]) = (at(i), at(SKEW * i));
            let rows = Posture::new(&device, &state.steer);
            let turning: f64 = rows.rows()[..4].iter().map(|row| joints.coulomb * row.dot(axis).abs()).sum();
            expected += cage.torque + turning;

            let mut dynamics = Dynamics::new(&device, &phenomena, Method::Rk4, &state).unwrap();
            assert!(dynamics.set_hinge(Some(axis)));
            let mut torque = 0.0;
            // After breaking loose the sphere gains 1e-3 rad/s or more in a step.
            while state.omega.dot(axis) < 1.0e-6 {
                torque += RAMP;
                dynamics.step(&mut state, 0.0, 1.0e-3, &[0.0; 16], axis * torque, None);
                assert!(torque < 0.1, "nothing moves");
            }
            assert!((state.omega - axis * state.omega.dot(axis)).length() < 1e-12, "the hinge gives");
            found += torque - 0.5 * RAMP;
        }
        let cells = f64::from(GRID);
        let (found, expected) = (1e3 * found / cells, 1e3 * expected / cells);
        println!("about {axis}: {found:.3} mN m, expected {expected:.3}, paper {paper}");
        // One step of the ramp is 0.5 % of the torque.
        assert!((found / expected - 1.0).abs() < 0.005, "about {axis}: {found} against {expected} mN m");
        // The physics notes give rounded numbers.
        assert!((found - notes).abs() < 0.15, "about {axis}: {found} against {notes} mN m");
    }
}
