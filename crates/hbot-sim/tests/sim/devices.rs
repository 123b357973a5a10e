//! The devices, rigs and loads that several tests use.

use hbot_core::device::{Device, WheelSpec};
use hbot_core::rig::{Joint, Limits, Methods, OdometryMethod, Rig, RigParts, Zero};
use hbot_core::{Quat, Vec3};
use hbot_sim::plant::{Load, Plant, PlantState, Sine, SpringDamper, Sum};

/// Returns a device with the prototype's geometry (physics notes, section 12), wheels of radius
/// `radius` and the given inertias of their joints.
pub(crate) fn prototype(radius: f64, steer_inertia: f64, drive_inertia: f64) -> Device {
    let s = core::f64::consts::FRAC_1_SQRT_2;
    let wheel = |x: f64| WheelSpec {
        axis: Vec3::new(x, 0.0, -s),
        cone: 0.1745,
        toe: 0.0,
        radius,
        steer_inertia,
        drive_inertia,
        axial_inertia: 0.0,
    };
    Device::new(0.102, 0.467, &[wheel(s), wheel(-s)]).unwrap()
}

/// Returns a device of `count` wheels with toe angles, whose inertias couple the steer and the
/// drive joint.
pub(crate) fn toed(count: usize) -> Device {
    let wheel = |i: usize| {
        let turn = 2.4 * i as f64;
        WheelSpec {
            axis: Vec3::new(turn.cos(), turn.sin(), -1.0 + 0.1 * i as f64),
            cone: 0.25 + 0.02 * i as f64,
            toe: 0.4 - 0.1 * i as f64,
            radius: 0.02,
            steer_inertia: 4.0e-5,
            drive_inertia: 6.0e-6,
            axial_inertia: 5.0e-6,
        }
    };
    Device::new(0.1, 0.4, &(0..count).map(wheel).collect::<Vec<_>>()).unwrap()
}

/// Returns the plant and the load of the task by which simulators are compared: the prototype, a
/// spring with damper, and two sinusoidal torques.
pub(crate) fn task() -> (Plant, impl Load) {
    let plant = Plant::new(&prototype(0.0102, 3.105_468_222_7e-5, 3.5202e-6)).unwrap();
    let spring = SpringDamper { stiffness: 4.0, damping: 0.05, reference: Quat::IDENTITY };
    let swing = |axis: Vec3, hertz: f64| Sine { amplitude: axis, hertz };
    (plant, Sum(spring, Sum(swing(Vec3::X * 0.5, 2.0), swing(Vec3::Y * 0.3, 3.0))))
}

/// Returns a state in which the sphere and all joints move.
pub(crate) fn brisk() -> PlantState {
    PlantState {
        q: hbot_core::rotation::exp(Vec3::new(0.4, -1.1, 0.7)),
        omega: Vec3::new(1.0, 2.0, 3.0),
        steer: [0.3, -0.5, 1.1, -2.0, 0.9, 2.4, -0.2, 0.8],
        ..PlantState::default()
    }
}

/// Returns the configuration of the prototype, with absolute encoders on the steer joints, and a
/// gear and a reversed motor on each drive joint.
pub(crate) fn rig() -> Rig {
    let steer = Joint { zero: Zero::Absolute, continuous: 0.073, ..Joint::new(16384, 0.93) };
    let drive = Joint {
        gear: 17.0,
        reversed: true,
        zero: Zero::Assume,
        continuous: 0.023,
        ..Joint::new(16384, 0.14)
    };
    let parts = RigParts::new(prototype(0.0155, 2.7e-5, 3.5e-6)).with_joints(steer, drive);
    let limits = Limits {
        torque: 1.0,
        torque_rate: 100.0,
        speed: 20.0,
        slip: 0.1,
        align_rate: 0.1,
        reference_rate: 1.0,
        max_age_ticks: 20,
        ..Limits::default()
    };
    let methods = Methods { odometry: OdometryMethod::Magnus4, ..Methods::BALANCED };
    Rig::new(RigParts { limits, methods, ..parts }).expect("a legal rig")
}
