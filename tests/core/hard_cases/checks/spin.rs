//! Steering at 1,000 rad/s, counts that wrap, and turns between readings so large that their
//! direction is unknown.

use super::super::core::design::kinematics::Posture;
use super::super::core::design::rig::OdometryMethod::Magnus4;
use super::super::core::inputs::Command;
use super::super::core::motion::odometry::{advance, turn};
use super::super::core::safety::mode::{Cause, Mode};
use super::super::core::{Quat, Real, rotation};
use super::machine::{ReadRig, device, rig, wheels};

/// Returns the joint angle of one count, rad.
fn unit(joint: usize) -> f64 {
    core::f64::consts::TAU / rig().joints[joint].counts()
}

#[test]
fn steering_at_a_thousand_rad_per_s_is_followed() {
    const RATES: [f64; 4] = [1000.0, 300.0, -1000.0, 200.0];
    const TICKS: u32 = 1000;
    let mut machine = ReadRig::idle();
    for (rate, of) in machine.rates.iter_mut().zip(RATES) {
        *rate = of as Real;
    }
    // The reference follows the path of the joints in steps of 1/64 tick. It uses the rounded
    // counts, so that only the method is compared.
    let device = device(&wheels());
    let mut fine = Quat::IDENTITY;
    let mut worst: Real = 0.0;
    let mut last = [0.0; 4];
    for k in 1..=TICKS {
        let angles: [f64; 4] = core::array::from_fn(|j| {
            let count = (RATES[j] * 1e-3 * f64::from(k) / unit(j)).round();
            machine.counts[j] = count as i64 as i32;
            count * unit(j)
        });
        let state = machine.step(|_| {}).state;
        assert_eq!((state.mode, state.cause), (Mode::Idle, None), "tick {k}");
        for s in 0..64 {
            let delta: [Real; 4] = core::array::from_fn(|j| ((angles[j] - last[j]) / 64.0) as Real);
            let at = |j: usize| {
                ((last[j] + (angles[j] - last[j]) * f64::from(s) / 64.0) % core::f64::consts::TAU) as Real
            };
            fine = advance(fine, turn(&device, Magnus4, &[at(0), at(2)], &delta));
        }
        last = angles;
        worst = worst.max(rotation::angle_between(state.q, fine));
        // The steer angle is that of the counts, for any number of turns before.
        let turned = f64::from(machine.counts[0] % 16384) * unit(0);
        let off = rotation::wrap_angle(state.angle[0] - turned as Real);
        assert!(off.abs() <= 16.0 * Real::EPSILON, "tick {k}: {off:e}");
    }
    println!("1000 ticks of 1 rad: {worst:e} rad off");
    // The bound is the error of Magnus 4 with steps of 1 rad.
    assert!(worst < 0.1, "{worst:e}");
    // With torque enabled this is too fast, and torque ends in the tick in which it is measured.
    let mut machine = ReadRig::active();
    let omega = super::super::core::Vec3::Y * 172.0;
    machine.rates = Posture::new(&device, &[0.0; 2]).inverse(omega);
    assert!(machine.rates[0].abs().max(machine.rates[2].abs()) > 500.0);
    let outputs = machine.step(|_| {});
    assert_eq!((outputs.state.mode, outputs.state.cause), (Mode::Fault, Some(Cause::Overspeed)));
    assert!(!outputs.drive.enable);
}

#[test]
fn counts_that_wrap_change_no_bit() {
    for sign in [1, -1_i32] {
        let [mut plain, mut wrapping] = [0, 1].map(|_| ReadRig::idle());
        // As many whole turns as fit into the counter; the test then goes beyond.
        let start: [i32; 4] = core::array::from_fn(|j| {
            let turn = if j % 2 == 0 { 16384 } else { 278_528 };
            sign * (i32::MAX / turn * turn)
        });
        wrapping = ReadRig { tick: 1, ..wrapping };
        wrapping.controller = super::super::core::Controller::new(rig());
        wrapping.counts[..4].copy_from_slice(&start);
        wrapping.step(|_| {});
        let mut wrapped = 0;
        for k in 1..=400 {
            for j in 0..4 {
                let by = sign * k * if j % 2 == 0 { 1500 } else { 9000 };
                plain.counts[j] = by;
                wrapping.counts[j] = start[j].wrapping_add(by);
                wrapped += u32::from(wrapping.counts[j].signum() == -sign);
            }
            assert_eq!(plain.step(|_| {}).state, wrapping.step(|_| {}).state, "tick {k}");
        }
        assert!(wrapped > 100, "some joint did pass 2^31");
    }
}

#[test]
fn half_a_turn_in_a_tick_is_a_fault_and_no_guess() {
    for joint in 0..4 {
        let half = if joint % 2 == 0 { 8192 } else { 139_264 };
        for (by, fault) in [
            (half - 1, false),
            (half, true),
            (half + 1, true),
            (2 * half - 1, true),
            (2 * half, true),
            (i32::MAX, true),
            (i32::MIN, true),
        ] {
            for by in [by, by.wrapping_neg()] {
                // The test runs without torque, because with torque the speed limit is narrower.
                let mut machine = ReadRig::idle();
                let before = machine.step(|_| {}).state;
                machine.counts[joint] = by;
                let outputs = machine.step(|_| {});
                let cause = outputs.state.cause;
                if fault {
                    assert_eq!(cause, Some(Cause::ImplausibleFeedback), "joint {joint} by {by}");
                    assert!(!outputs.drive.enable);
                    assert_eq!(outputs.state.q, before.q, "no turn is made of it");
                    machine.run(3);
                    assert_eq!(machine.step(|_| {}).state.q, before.q);
                    machine.command(Command::Reset);
                    assert_eq!(machine.step(|_| {}).state.mode, Mode::Idle);
                } else {
                    assert_ne!(cause, Some(Cause::ImplausibleFeedback), "joint {joint} by {by}");
                }
            }
        }
    }
}
