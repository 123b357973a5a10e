//! The torque that is sent, at the limits of the rig: limit of torque, slew, traction, damping.

use crate::bench::rig_with_grip;
use crate::prelude::*;
use crate::shaping::{ROUNDING, constant};
use hbot_core::allocation::{ContactArms, traction};

#[test]
fn a_contact_at_its_limit_is_asked_for_all_that_it_holds() {
    for grip in [1.0, 4.0] {
        let rig = rig_with_grip(grip);
        let mut bench = Bench::active(rig, CompiledScene::empty());
        let arms: Vec<_> =
            rig.device.wheels().iter().map(|w| ContactArms::of(w, rig.device.sphere_radius())).collect();
        for axis in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::new(-0.6, 0.48, 0.64)] {
            bench.command(stream(axis * 2.0, 60));
            let state = bench.run(50).state;
            assert_eq!(state.mode, Mode::Active);
            // The force of the most loaded contact, N, is mu N to the rounding of some ten
            // operations.
            let force = grip * traction(&arms, &state.joint_torque[..4], grip);
            assert!((force - grip).abs() < 16.0 * f64::EPSILON * grip, "{force} N of {grip} about {axis}");
            assert_eq!(state.traction, 1.0);
        }
    }
}

#[test]
fn slew_starts_at_the_torque_that_was_sent_even_if_more_was_wanted() {
    let weak = altered(&rig(), |rig| {
        for joint in &mut rig.joints {
            joint.peak *= 0.05;
            joint.continuous = joint.peak;
        }
    });
    for rig in [weak, rig_with_grip(1.0)] {
        let mut bench = Bench::active(rig, CompiledScene::empty());
        bench.command(stream(Vec3::X * 2.0, 100));
        let sent = bench.run(50).state;
        assert!(sent.torque.length() < 0.5, "most of 2 N m cannot be made: {}", sent.torque);
        // The wanted torque is far beyond. So from the wanted torque, a step back of the slew limit
        // would change nothing.
        let next = bench.command(stream(Vec3::X * -2.0, 100)).state.torque;
        let step = TORQUE_RATE * DT;
        assert!((next.x - (sent.torque.x - step)).abs() < ROUNDING, "{} to {next}", sent.torque);
    }
}

#[test]
fn damping_of_the_passivity_controller_stays_within_the_limit_of_torque() {
    let rig = altered(&rig(), |rig| {
        (rig.limits.torque, rig.limits.torque_rate) = (0.4, 1e4);
        let limit = PassivityLimit::strict(&rig.device, DT);
        rig.methods.passivity = Some(PassivityLimit { damping: 0.5, ..limit });
    });
    let mut bench = Bench::active(rig, CompiledScene::empty());
    bench.command(stream(Vec3::X * 0.4, 2000));
    bench.run(10);
    // The hand suddenly turns the sphere along with the torque. Within two ticks that is more
    // energy than allowed.
    let omega = 25.0;
    let asked = (0..10).any(|k| {
        let state = bench.turn(Vec3::X * omega).state;
        assert!(state.torque.length() <= 0.4 + ROUNDING, "tick {k}: {}", state.torque);
        // The damping takes the torque from the limit to beyond the opposite limit, which is sent.
        let beyond = state.damping * omega > 1.1;
        assert!(!beyond || (state.torque.x + 0.4).abs() < ROUNDING, "{}", state.torque);
        beyond
    });
    assert!(asked, "no damping beyond the limit");
}

#[test]
fn damping_is_computed_from_the_torque_that_is_sent() {
    let rig = altered(&rig(), |rig| {
        (rig.limits.torque, rig.limits.torque_rate) = (0.4, 1e4);
        let limit = PassivityLimit::strict(&rig.device, DT);
        rig.methods.passivity = Some(PassivityLimit { allowance: 0.035, ..limit });
    });
    let mut bench = Bench::active(rig, constant(1, Vec3::X * 0.4));
    // The scene's torque fades while a stream gives as much again. The sum is almost twice the
    // limit, and half of it is sent.
    bench.scene = CompiledScene::empty();
    bench.command(stream(Vec3::X * 0.4, 2000));
    bench.turn(Vec3::X * 25.0);
    // A tick at 25 rad/s gives out 10 mJ. One has been measured, one is on its way, and one is
    // wanted: 30 mJ. With twice the torque wanted it would be 40 mJ.
    let state = bench.turn(Vec3::X * 25.0).state;
    assert!((state.torque - Vec3::X * 0.4).length() < ROUNDING, "{}", state.torque);
    assert_eq!(state.damping, 0.0);
    // The next tick is one too many.
    assert!(bench.turn(Vec3::X * 25.0).state.damping > 0.0);
    // Motors that are off do not damp.
    assert_eq!(bench.command(Command::Estop).state.damping, 0.0);
}

#[test]
fn a_contact_without_grip_is_overloaded_by_any_force() {
    let rig = rig();
    let arms = rig.device.wheels().iter().map(|w| ContactArms::of(w, rig.device.sphere_radius()));
    let arms: Vec<_> = arms.collect();
    for grip in [0.0, -1.0, f64::NAN] {
        assert_eq!(traction(&arms, &[0.0, 1e-3, 0.0, 0.0], grip), f64::INFINITY, "{grip}");
        assert_eq!(traction(&arms, &[0.0; 4], grip), 0.0, "{grip}");
    }
}
