//! Faults that build up over time: heat of the motors, and energy delivered to the hand.

use crate::prelude::*;
use hbot_core::design::rig::EnergyLimit;

#[test]
fn a_motor_above_its_continuous_torque_is_too_hot_when_i_squared_t_says_so() {
    let thermal_time = 4.0;
    let ticks_until_hot = |factor: f64| {
        let rig = altered(&rig(), |rig| rig.limits.thermal_time = Some(thermal_time));
        // The joint with the largest load holds `factor` times its continuous torque.
        let mut probe = Bench::active(rig, spring_scene(1, 2.0, Vec3::X * 0.1));
        let torques = probe.run(10).state.joint_torque;
        let rig = altered(&rig, |rig| {
            for (joint, torque) in rig.joints.iter_mut().zip(torques).skip(1).step_by(2) {
                joint.continuous = (torque.abs() / factor).max(1e-9);
            }
        });
        let mut bench = Bench::active(rig, CompiledScene::empty());
        bench.scene = spring_scene(2, 2.0, Vec3::X * 0.1);
        (0..40_000).find(|_| bench.step().state.cause == Some(Cause::Thermal))
    };
    for factor in [1.5, 3.0] {
        let ticks = ticks_until_hot(factor).expect("hot some time");
        let square = factor * factor;
        let expected = thermal_time * (square / (square - 1.0)).ln() / DT;
        // Half the blend of the new scene (50 ms) is added, and a thousandth for the ticks.
        let off = ticks as f64 - expected;
        assert!((-20.0..80.0).contains(&off), "{factor}: {ticks} ticks, {expected} expected");
    }
    assert_eq!(ticks_until_hot(0.98), None, "below the continuous torque it works for ever");
}

#[test]
fn energy_beyond_its_limit_is_a_fault_when_it_has_added_up_and_not_before() {
    // The sphere turns along with 0.3 N m at 2 rad/s, which delivers 0.6 W to the hand. Or it turns
    // against the torque and absorbs energy.
    let ticks_until = |burst: f64, power: f64, omega: f64| {
        let rig = altered(&rig(), |rig| rig.limits.energy = Some(EnergyLimit { burst, power }));
        let mut bench = Bench::active(rig, CompiledScene::empty());
        bench.command(stream(Vec3::X * 0.3, 1_000_000));
        let found = (0..5000).find(|_| bench.turn(Vec3::X * omega).state.cause.is_some());
        if found.is_some() {
            let state = bench.step().state;
            assert_eq!((state.cause, state.torque), (Some(Cause::Overtorque), Vec3::ZERO));
            assert_eq!(
                bench.command(Command::Reset).reply(),
                Reply::Done,
                "without power nothing is given out"
            );
        }
        found
    };
    for (burst, power) in [(0.1, 0.1), (0.05, 0.4), (0.5, 0.35)] {
        let expected = burst / (0.6 - power) / DT;
        let ticks = ticks_until(burst, power, 2.0).expect("some time");
        // The tolerance covers the slew of the torque, a tick of delay of the reading, and
        // rounding.
        assert!(
            (ticks as f64 - expected).abs() <= 8.0,
            "{burst} J, {power} W: {ticks} ticks, not {expected}"
        );
    }
    assert_eq!(ticks_until(0.01, 0.61, 2.0), None, "a power that is allowed is allowed for ever");
    assert_eq!(ticks_until(0.01, 0.01, -2.0), None, "what comes in is no burst");
}

#[test]
fn energy_that_came_in_is_no_credit_for_a_burst() {
    let rig = altered(&rig(), |rig| rig.limits.energy = Some(EnergyLimit { burst: 0.1, power: 0.01 }));
    let mut bench = Bench::active(rig, CompiledScene::empty());
    bench.command(stream(Vec3::X * 0.3, 1_000_000));
    for _ in 0..3000 {
        assert_eq!(bench.turn(Vec3::X * -2.0).state.cause, None);
    }
    assert!(bench.step().state.energy < -1.0);
    let ticks = (0..1000).find(|_| bench.turn(Vec3::X * 2.0).state.cause.is_some()).expect("some time");
    assert!((160..190).contains(&ticks), "0.1 J at 0.59 W: {ticks} ticks");
}

#[test]
fn a_hot_motor_must_cool_down_before_reset() {
    let rig = altered(&rig(), |rig| {
        rig.limits.thermal_time = Some(1.0);
        rig.joints.iter_mut().for_each(|joint| joint.continuous = 1e-3);
    });
    let mut bench = Bench::active(rig, CompiledScene::empty());
    bench.scene = spring_scene(2, 2.0, Vec3::X * 0.1);
    let hot = (0..5000).map(|_| bench.step()).find(|o| o.state.cause.is_some()).expect("hot some time");
    assert_eq!((hot.state.cause, hot.state.torque), (Some(Cause::Thermal), Vec3::ZERO));
    assert!(matches!(bench.command(Command::Reset).reply(), Reply::Refused(_)));
    bench.run(1000);
    assert_eq!(bench.command(Command::Reset).reply(), Reply::Done);
}
