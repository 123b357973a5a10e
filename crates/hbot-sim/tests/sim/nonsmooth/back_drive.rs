//! Back-drive torques: each axis of N held as a hinge, a torque about it that grows slowly until the sphere turns.

use core::f64::consts::TAU;

use hbot_core::Vec3;
use hbot_core::kinematics::Posture;
use hbot_sim::phenomena::{CageFriction, JointFriction, Phenomena};
use hbot_sim::plant::{Dynamics, Method, PlantState};

use crate::devices::prototype;

/// Pairs of steering angles, on a lattice that has each wheel at this many even steps of a turn: friction is a sum over the
/// wheels, so their means do not mix.
const GRID: u32 = 144;
/// How the second wheel's angle goes with the first's: 55 and 144 have no common part.
const SKEW: u32 = 55;
/// How much the torque grows in a step of 1 ms, N m.
const RAMP: f64 = 2.0e-5;

/// The mean over both steering angles, of what a ramp finds and of what is to be expected: at a hinge about n the power of
/// all friction is that of the cage and of each joint's c |g.n|, whatever the hinge itself takes.
#[test]
fn back_drive_torques_are_those_of_cage_and_joints() {
    let device = prototype(0.0155, 2.7e-5, 3.5e-6);
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
            // A step's own turn of the sphere once it goes is 1e-3 rad/s and more.
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
        // A step of the ramp is 0.5 % of it.
        assert!((found / expected - 1.0).abs() < 0.005, "about {axis}: {found} against {expected} mN m");
        // The notes' figures are round.
        assert!((found - notes).abs() < 0.15, "about {axis}: {found} against {notes} mN m");
    }
}
