extern crate std;

mod eased;

use super::*;
use crate::design::device::{Device, WheelSpec};
use crate::design::rig::{AllocationMethod, Joint, Methods, RateEstimate, RigParts, Traction, Zero};
use crate::inputs::{Command, JointReadings};
use crate::real::{Mat3, sincos};
use crate::render::effects::{Anchor, Damper, Effect, Kind, Spring, SpringLaw};
use crate::safety::mode::Mode;

fn device() -> Device {
    let wheel = |side: Real| WheelSpec {
        axis: Vec3::new(side, 0.0, -1.0),
        cone: 0.1745,
        radius: 0.0155,
        ..WheelSpec::default()
    };
    Device::new(0.102, 0.467, &[wheel(1.0), wheel(-1.0)]).unwrap()
}

/// Returns a scene with a spring of 4 N m/rad and a damper.
fn scene() -> CompiledScene {
    let stiffness = Mat3::from_diagonal(Vec3::splat(4.0));
    let spring = Spring::new(SpringLaw::Geodesic, stiffness, Mat3::ZERO, Quat::IDENTITY, Anchor::Absolute);
    let damper = Damper::new(Mat3::from_diagonal(Vec3::splat(0.05)));
    let kinds = [Kind::Spring(spring.unwrap()), Kind::Damper(damper.unwrap())];
    CompiledScene::new(1, &[Effect::new(0, 1, kinds[0]), Effect::new(1, 1, kinds[1])]).unwrap()
}

/// Returns the inputs of tick `tick`. The joints swing, every 50th reading is missing, and the rig
/// is enabled in tick 1. The motors go off and on again in the run.
fn swinging(rig: &Rig, tick: u64) -> Inputs {
    let mut inputs = Inputs::quiet(tick);
    let mut reading = JointReadings::new(tick as u32, [0; MAX_JOINTS], [0.0; MAX_JOINTS]);
    for i in 0..rig.device.joints() {
        let swing = 0.3 + 0.1 * i as Real;
        let (sin, cos) = sincos(tick as Real * 0.006 + i as Real);
        reading.counts[i] = (swing * sin * 2000.0) as i32;
        reading.rates[i] = swing * cos * 12_000.0 * rig.joints[i].radians_per_count().abs();
    }
    inputs.feedback = (tick % 50 != 49).then_some(reading);
    let command = match tick {
        1 | 1900 => Some(Command::Enable),
        1800 => Some(Command::Disable),
        _ => None,
    };
    if let Some(command) = command {
        inputs.commands.push(command).unwrap();
    }
    inputs
}

/// The tick is compiled twice, once for exactly two wheels. Both copies must give the same bits.
#[test]
fn both_copies_of_the_tick_give_the_same_bits() {
    let joint = |peak| Joint { zero: Zero::Assume, ..Joint::new(16384, peak) };
    let reversed = Joint { gear: 17.0, reversed: true, ..joint(0.14) };
    let exact = Methods { rate: RateEstimate::Difference, ..Methods::EXACT };
    let clipped = Methods { allocation: AllocationMethod::Clipped, ..Methods::BALANCED };
    // Strong motors, weak motors that saturate, and drive joints without motors.
    for (steer, drive) in [(0.93, reversed), (0.02, joint(0.01)), (0.93, joint(0.0))] {
        for (methods, grip) in [(Methods::FAST, 5.0), (Methods::BALANCED, 8.0), (exact, 2.0), (clipped, 8.0)]
        {
            let mut parts = RigParts::new(device()).with_joints(joint(steer), drive);
            parts.limits.traction = Some(Traction { mu: 1.0, normal_force: grip });
            parts.limits.thermal_time = Some(1.0e5);
            // These joints do not move like those of a turning sphere, so the wheels seem to slip.
            parts.limits.slip = 100.0;
            let rig = Rig::new(RigParts { methods, ..parts }).unwrap();
            let (mut two, mut any, scene) = (Controller::new(rig), Controller::new(rig), scene());
            let mut active = 0;
            for tick in 0..3000 {
                let inputs = swinging(&rig, tick);
                let fixed = two.tick_of(Two, &scene, &inputs);
                let counted = any.tick_of(rig.device.count(), &scene, &inputs);
                // As text, because a comparison of numbers does not tell -0 from 0.
                assert_eq!(
                    std::format!("{fixed:?}"),
                    std::format!("{counted:?}"),
                    "tick {tick}, {methods:?}"
                );
                let acts = fixed.state.mode == Mode::Active && fixed.state.torque != Vec3::ZERO;
                active += usize::from(acts);
            }
            assert!(active > 1000, "{active} ticks with torque, {methods:?}, {steer} N m");
        }
    }
}

/// A torque that is not finite, in any one of its numbers, is not sent. The allocation makes no
/// such torque, so it is given here.
#[test]
fn a_torque_that_is_not_finite_is_a_fault_and_no_torque() {
    let joint = Joint::new(16384, 2.0);
    let rig = Rig::new(RigParts::new(device()).with_joints(joint, joint)).unwrap();
    let sent = |alter: &dyn Fn(&mut Made)| {
        let mut controller = Controller::new(rig);
        let mut made = Made { torque: Vec3::X, joints: [0.1; MAX_JOINTS], ..Made::NOTHING };
        alter(&mut made);
        controller.made = made;
        controller.send(Two, 1);
        (controller.machine.cause, controller.made.torque, controller.drive(Two).torque)
    };
    let whole = sent(&|_| ());
    assert_eq!((whole.0, whole.1, whole.2[3]), (None, Vec3::X, 0.1));
    let stopped = (Some(Cause::NonFinite), Vec3::ZERO, [0.0; MAX_JOINTS]);
    for bad in [Real::NAN, Real::INFINITY, Real::NEG_INFINITY] {
        for j in 0..4 {
            assert_eq!(sent(&|made| made.joints[j] = bad), stopped, "{bad} at joint {j}");
        }
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            assert_eq!(sent(&|made| made.torque += axis * bad), stopped, "{bad} about {axis}");
        }
        let both = |made: &mut Made| (made.torque.x, made.joints[0]) = (bad, bad);
        assert_eq!(sent(&both), stopped, "{bad}");
    }
}

/// Checks that the table of memory sizes in the documentation of the crate is correct. It lists
/// the sizes for a 64-bit machine.
#[test]
#[cfg(target_pointer_width = "64")]
fn a_controller_takes_as_much_memory_as_the_docs_say() {
    let width = if size_of::<Real>() == 8 { "f64" } else { "f32" };
    let row = std::format!(
        "//! | {width} | {} | {} | {} |",
        size_of::<Controller>(),
        size_of::<Orientation>(),
        size_of::<CompiledScene>()
    );
    assert!(include_str!("../lib.rs").contains(&row), "{row}");
}
