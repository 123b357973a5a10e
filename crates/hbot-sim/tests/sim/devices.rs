//! The devices, rigs and loads that several tests use.

use hbot_core::design::device::{Device, WheelSpec};
use hbot_core::design::rig::{Joint, Limits, Methods, OdometryMethod, Rig, RigParts, Zero};
use hbot_core::{Quat, Vec3};
use hbot_sim::plant::{Load, Plant, PlantState, Sine, SpringDamper, Sum};
use hbot_testing::prototype::{device, device_with, of_the_task};

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
    let plant = Plant::new(&device_with(of_the_task)).unwrap();
    let spring = SpringDamper { stiffness: 4.0, damping: 0.05, reference: Quat::IDENTITY };
    let swing = |axis: Vec3, hertz: f64| Sine { amplitude: axis, hertz };
    (plant, Sum(spring, Sum(swing(Vec3::X * 0.5, 2.0), swing(Vec3::Y * 0.3, 3.0))))
}

pub(crate) fn brisk() -> PlantState {
    PlantState {
        q: hbot_core::rotation::exp(Vec3::new(0.4, -1.1, 0.7)),
        omega: Vec3::new(1.0, 2.0, 3.0),
        steer: [0.3, -0.5, 1.1, -2.0, 0.9, 2.4, -0.2, 0.8],
        ..PlantState::default()
    }
}

/// Returns the prototype as the tests of the controllers need it: absolute encoders on the steer
/// joints, and a gear and a reversed motor on each drive joint. The rig of `rigs/prototype.toml`
/// has none of these.
pub(crate) fn rig() -> Rig {
    let steer = Joint { zero: Zero::Absolute, continuous: 0.073, ..Joint::new(16384, 0.93) };
    let drive = Joint {
        gear: 17.0,
        reversed: true,
        zero: Zero::Assume,
        continuous: 0.023,
        ..Joint::new(16384, 0.14)
    };
    let parts = RigParts::new(device()).with_joints(steer, drive);
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
