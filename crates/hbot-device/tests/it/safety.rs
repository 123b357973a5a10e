//! The five duties that keep people safe.

use hbot_device::{Condition, Device, Identity, JointFlags};
use hbot_link::ControllerFlags;

use crate::bench::{Bench, JOINTS, NAME, PUSH, command_frame};

#[test]
fn a_command_with_a_wrong_number_of_torques_changes_nothing() {
    for torque in [&[][..], &[0.5], &[0.5; 3]] {
        let mut bench = Bench::new();
        bench.push();
        assert_eq!(bench.command(true, 20, torque), None);
        assert_eq!(bench.command(false, 20, torque), None);
        assert!(bench.pushes());
    }
}

#[test]
fn a_command_with_a_torque_that_is_not_finite_changes_nothing() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for torque in [[bad, 0.1], [0.1, bad]] {
            let mut bench = Bench::new();
            bench.push();
            assert_eq!(bench.command(true, 20, &torque), None);
            assert_eq!(bench.command(false, 20, &torque), None);
            assert!(bench.pushes());
        }
    }
}

#[test]
fn a_damaged_command_changes_nothing_whichever_bit_is_damaged() {
    let good = command_frame(true, 20, &[0.5; 2]);
    let mut bench = Bench::new();
    bench.push();
    // Without the delimiter, whose damage only joins two frames.
    for bit in 0..8 * (good.len() - 1) {
        let mut damaged = good.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        assert_eq!(bench.send(&damaged), [], "bit {bit}");
        assert!(bench.pushes());
    }
}

/// The body of this frame has a byte too many, but its CRC is right.
#[test]
fn a_frame_with_a_byte_left_over_changes_nothing() {
    let mut bench = Bench::boot(0);
    assert_eq!(bench.send(&[1, 1, 5, 0xFF, 0x12, 0xD9, 0x41, 0]), []);
    assert_eq!(bench.device.refused(), 1);
    assert_eq!(bench.push(), ControllerFlags::UNDESCRIBED);
}

#[test]
fn invalid_commands_and_other_bytes_do_not_restart_the_watchdog() {
    let mut bench = Bench::new();
    bench.push();
    for _ in 0..19 {
        bench.pass(1);
        assert_eq!(bench.command(true, 20, &[0.5]), None);
        assert_eq!(bench.command(true, 20, &[f32::NAN, 0.5]), None);
        bench.send(&[1, 2, 3, 0]);
        bench.describe();
        assert!(bench.pushes());
    }
    bench.pass(1);
    assert!(bench.is_free());
}

#[test]
fn the_watchdog_ends_torque_when_its_time_has_passed_and_not_before() {
    for watchdog_ms in [1, 20, u16::MAX] {
        let mut bench = Bench::new();
        bench.command(true, watchdog_ms, &PUSH).unwrap();
        let time_us = u32::from(watchdog_ms) * 1000;
        bench.now_us += time_us - 1;
        bench.device.poll(bench.now_us, &mut bench.hardware);
        assert!(bench.pushes());
        assert_eq!(bench.device.watchdog_us(bench.now_us), Some(1));
        bench.now_us += 1;
        bench.device.poll(bench.now_us, &mut bench.hardware);
        assert!(bench.is_free());
        assert_eq!(bench.device.watchdog_us(bench.now_us), None);
        assert_eq!(bench.push(), ControllerFlags::WATCHDOG_EXPIRED);
    }
}

#[test]
fn each_valid_command_restarts_the_watchdog_with_its_own_time() {
    let mut bench = Bench::new();
    bench.command(true, 1, &PUSH).unwrap();
    for _ in 0..10 {
        assert_eq!(bench.push(), ControllerFlags::ENABLED);
        bench.pass(19);
        assert!(bench.pushes());
    }
    bench.command(true, 100, &PUSH).unwrap();
    bench.pass(99);
    assert!(bench.pushes());
    bench.push();
    bench.pass(20);
    assert!(bench.is_free());
}

/// A command that arrives after its predecessor's time is late, even if nobody polled in between.
#[test]
fn a_late_command_does_not_bring_torque_back() {
    let mut bench = Bench::new();
    bench.push();
    bench.now_us += 20_000;
    assert_eq!(bench.push(), ControllerFlags::WATCHDOG_EXPIRED);
    assert!(bench.is_free());
}

#[test]
fn after_the_watchdog_commands_are_answered_without_torque_until_enable_is_false() {
    let mut bench = Bench::new();
    bench.push();
    bench.pass(20);
    for _ in 0..50 {
        assert_eq!(bench.push(), ControllerFlags::WATCHDOG_EXPIRED);
        assert!(bench.is_free());
        bench.pass(1);
    }
    assert_eq!(bench.release(), ControllerFlags::empty());
    assert!(bench.is_free());
    assert_eq!(bench.push(), ControllerFlags::ENABLED);
    assert!(bench.pushes());
}

#[test]
fn the_watchdog_also_expires_while_the_joints_are_free() {
    let mut bench = Bench::new();
    bench.release();
    bench.pass(20);
    assert_eq!(bench.push(), ControllerFlags::WATCHDOG_EXPIRED);
    assert!(bench.is_free());
}

#[test]
fn a_watchdog_time_of_zero_has_expired_at_once() {
    let mut bench = Bench::new();
    let feedback = bench.command(true, 0, &PUSH).unwrap();
    assert_eq!(feedback.flags, ControllerFlags::WATCHDOG_EXPIRED);
    assert!(bench.is_free());
}

/// A clock of microseconds wraps every 71 minutes, here in the middle of the watchdog's time.
#[test]
fn the_watchdog_works_when_the_clock_wraps() {
    let mut bench = Bench::boot(u32::MAX - 9_999);
    bench.describe();
    bench.push();
    bench.pass(19);
    assert!(bench.pushes());
    bench.pass(1);
    assert!(bench.is_free());
}

/// A clock that goes back is a fault of the firmware. Nobody knows how much time has passed.
#[test]
fn a_clock_that_goes_back_ends_torque() {
    let mut bench = Bench::new();
    bench.push();
    bench.now_us -= 1;
    bench.device.poll(bench.now_us, &mut bench.hardware);
    assert!(bench.is_free());
}

#[test]
fn after_boot_the_torque_is_zero() {
    let mut bench = Bench::boot(0);
    assert!(bench.is_free());
    assert_eq!(bench.hardware.calls, ["drive"]);
    bench.pass(100);
    assert!(bench.is_free());
}

#[test]
fn before_a_describe_commands_are_answered_without_torque() {
    let mut bench = Bench::boot(0);
    for _ in 0..3 {
        assert_eq!(bench.push(), ControllerFlags::UNDESCRIBED);
        assert!(bench.is_free());
    }
    bench.describe();
    assert!(bench.is_free());
    assert_eq!(bench.push(), ControllerFlags::ENABLED);
    assert!(bench.pushes());
}

/// A fault ends torque at the next poll, without waiting for a command.
#[test]
fn a_fault_ends_torque_and_is_reported() {
    let mut bench = Bench::new();
    bench.push();
    bench.hardware.condition = Condition::Fault;
    bench.device.poll(bench.now_us, &mut bench.hardware);
    assert!(bench.is_free());
    assert_eq!(bench.push(), ControllerFlags::FAULT);
    assert!(bench.is_free());
}

#[test]
fn a_fault_stays_until_its_cause_is_gone_and_enable_is_false() {
    let mut bench = Bench::new();
    bench.push();
    bench.hardware.condition = Condition::Fault;
    assert_eq!(bench.release(), ControllerFlags::FAULT);
    bench.hardware.condition = Condition::Ready;
    for _ in 0..3 {
        bench.pass(1);
        assert_eq!(bench.push(), ControllerFlags::FAULT);
        assert!(bench.is_free());
    }
    assert_eq!(bench.release(), ControllerFlags::empty());
    assert_eq!(bench.push(), ControllerFlags::ENABLED);
    assert!(bench.pushes());
}

#[test]
fn a_fault_that_lasts_only_between_two_commands_is_reported() {
    let mut bench = Bench::new();
    bench.push();
    bench.hardware.condition = Condition::Fault;
    bench.pass(1);
    bench.hardware.condition = Condition::Ready;
    assert_eq!(bench.push(), ControllerFlags::FAULT);
    assert!(bench.is_free());
}

/// Both limits hold in both directions, and the reading says that the torque is limited.
#[test]
fn no_torque_exceeds_the_peak_of_its_joint() {
    let mut bench = Bench::new();
    let over = JointFlags::OVERCURRENT;
    for sign in [1.0, -1.0] {
        let feedback = bench.command(true, 20, &[3.0 * sign, -3.0 * sign]).unwrap();
        assert_eq!(bench.hardware.torque, [1.0 * sign, -0.5 * sign]);
        assert!(feedback.joints.iter().all(|joint| joint.flags == over));
        // Exactly the peak is permitted.
        let feedback = bench.command(true, 20, &[1.0 * sign, -0.5 * sign]).unwrap();
        assert_eq!(bench.hardware.torque, [1.0 * sign, -0.5 * sign]);
        assert!(feedback.joints.iter().all(|joint| joint.flags.is_empty()));
    }
}

/// A joint at its largest temperature gets no torque, also if no command comes after the reading.
/// The others keep theirs.
#[test]
fn a_hot_joint_gets_no_torque_until_it_is_cooler() {
    for hot in [80.0, 500.0, f32::NAN, f32::INFINITY] {
        let mut bench = Bench::new();
        bench.hardware.readings[0].temperature = hot;
        bench.hardware.readings[1].temperature = 300.0;
        let feedback = bench.command(true, 20, &PUSH).unwrap();
        assert_eq!(feedback.joints[0].flags, JointFlags::OVERTEMPERATURE);
        assert_eq!(feedback.joints[1].flags, JointFlags::empty());
        assert_eq!(bench.hardware.torque, [0.0, PUSH[1]]);
        bench.push();
        assert_eq!(bench.hardware.torque, [0.0, PUSH[1]]);
        bench.hardware.readings[0].temperature = 79.9;
        bench.push();
        bench.push();
        assert!(bench.pushes());
    }
    // A joint that is too hot does not stop the other joint.
    for hot in [0, 1] {
        let mut bench = Bench::new();
        let identity = Identity::new(NAME, &[JOINTS[0]; 2]).unwrap();
        bench.device = Device::boot(identity, bench.now_us, &mut bench.hardware);
        bench.describe();
        bench.hardware.readings[hot].temperature = 80.0;
        let mut cut = PUSH;
        cut[hot] = 0.0;
        for _ in 0..2 {
            let feedback = bench.command(true, 20, &PUSH).unwrap();
            let told = feedback.joints.iter().map(|joint| joint.flags.contains(JointFlags::OVERTEMPERATURE));
            assert!(told.eq([hot == 0, hot == 1]), "joint {hot}");
            assert_eq!(bench.hardware.torque, cut, "joint {hot}");
        }
    }
}
