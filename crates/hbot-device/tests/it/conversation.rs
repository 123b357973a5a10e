//! The duties of a conversation: what is answered, and with what.

use hbot_device::{Condition, JointFlags, JointReading};
use hbot_link::{ControllerFlags, PROTOCOL_VERSION, ToController};

use crate::bench::{Bench, JOINTS, NAME, PUSH, command_frame, frame};

#[test]
fn each_describe_is_answered_with_the_identity() {
    let mut bench = Bench::boot(0);
    for _ in 0..3 {
        let description = bench.describe();
        assert_eq!((description.protocol, description.firmware.as_str()), (PROTOCOL_VERSION, NAME));
        let counts: Vec<_> = description.joints.iter().map(|joint| joint.counts_per_turn).collect();
        assert_eq!(counts, JOINTS.map(|joint| joint.counts_per_turn));
    }
}

#[test]
fn each_command_is_answered_with_its_sequence() {
    let mut bench = Bench::new();
    for sequence in [0, 7, 7, u32::MAX, 3] {
        let torque = PUSH.into_iter().collect();
        let command = hbot_link::Command { sequence, enable: true, watchdog_ms: 20, torque };
        let answers = bench.send(&frame(&ToController::Command(command)));
        let [hbot_link::FromController::Feedback(feedback)] = &answers[..] else { panic!("{answers:?}") };
        assert_eq!(feedback.sequence, sequence);
    }
}

#[test]
fn nothing_else_is_answered() {
    let mut bench = Bench::new();
    bench.push();
    // The device answers with a return value, so it cannot send without being asked.
    bench.pass(100);
    let answer_of_another = [1, 5, 0x8D, 0xEF, 2, 0xD2, 1, 0];
    for bytes in [&[0; 9][..], b"hello\0", &answer_of_another, &[7; 1000], &[0]] {
        assert_eq!(bench.send(bytes), [], "{bytes:?}");
    }
}

#[test]
fn a_description_clears_undescribed() {
    let mut bench = Bench::boot(0);
    assert_eq!(bench.release(), ControllerFlags::UNDESCRIBED);
    bench.describe();
    assert_eq!(bench.release(), ControllerFlags::empty());
}

#[test]
fn a_new_boot_is_undescribed_again() {
    let mut bench = Bench::new();
    bench.push();
    bench = Bench::boot(bench.now_us);
    assert_eq!(bench.push(), ControllerFlags::UNDESCRIBED);
}

/// The joints are read once for each command, after they were driven, and not at other times. So
/// the reading is as new as possible when it is sent.
#[test]
fn a_command_is_answered_with_a_reading_of_its_own() {
    let mut bench = Bench::new();
    bench.hardware.calls.clear();
    for k in 0..3 {
        bench.hardware.readings[1].count = k;
        let feedback = bench.command(true, 20, &PUSH).unwrap();
        assert_eq!(feedback.joints[1].count, k);
        assert_eq!(core::mem::take(&mut bench.hardware.calls), ["drive", "read"]);
    }
    bench.pass(10);
    bench.describe();
    assert_eq!(bench.hardware.calls, [""; 0]);
}

#[test]
fn readings_are_sent_unchanged_in_the_order_of_the_description() {
    let mut bench = Bench::new();
    let reading = |count, flags| JointReading { count, rate: 1.5, current: -0.25, temperature: 30.0, flags };
    for readings in [
        [reading(i32::MIN, JointFlags::INDEX_SEEN), reading(i32::MAX, JointFlags::OVERCURRENT)],
        [reading(-1, JointFlags::OVERTEMPERATURE), JointReading::default()],
        [JointReading { rate: f32::INFINITY, current: f32::MIN_POSITIVE, ..reading(0, JointFlags::empty()) };
            2],
    ] {
        bench.hardware.readings = readings;
        assert_eq!(bench.command(true, 20, &PUSH).unwrap().joints, readings);
    }
}

#[test]
fn bits_without_a_name_are_sent_as_zero() {
    let mut bench = Bench::new();
    bench.hardware.readings[0].flags = JointFlags::from_bits(0xFFF8 | 1);
    let feedback = bench.command(true, 20, &PUSH).unwrap();
    assert_eq!(feedback.joints[0].flags, JointFlags::INDEX_SEEN);
    assert_eq!(feedback.flags.bits() & 0xFFF0, 0);
}

#[test]
fn torques_reach_the_joints_in_their_order() {
    let mut bench = Bench::new();
    assert_eq!(bench.push(), ControllerFlags::ENABLED);
    assert!(bench.pushes(), "{:?}", bench.hardware.torque);
}

#[test]
fn enable_false_frees_the_joints_whatever_the_torques() {
    let mut bench = Bench::new();
    bench.push();
    assert_eq!(bench.release(), ControllerFlags::empty());
    assert!(bench.is_free());
}

#[test]
fn flags_are_those_after_the_command() {
    let mut bench = Bench::new();
    assert_eq!(bench.push(), ControllerFlags::ENABLED);
    assert_eq!(bench.release(), ControllerFlags::empty());
    bench.pass(20);
    assert_eq!(bench.release(), ControllerFlags::empty());
}

/// `ENABLED` is only set while the power stage gives the torques.
#[test]
fn enabled_means_that_the_torques_are_applied() {
    let mut bench = Bench::new();
    bench.hardware.condition = Condition::NotReady;
    assert_eq!(bench.push(), ControllerFlags::empty());
    assert!(bench.pushes(), "the power stage is told to start");
    bench.hardware.condition = Condition::Ready;
    assert_eq!(bench.push(), ControllerFlags::ENABLED);
}

#[test]
fn a_refused_frame_is_dropped_and_the_next_one_is_heard() {
    let mut bench = Bench::new();
    for refused in [&[5, 1, 1, 0][..], &[1, 1, 0], &[0xAA; 1000]] {
        let before = bench.device.refused();
        assert_eq!(bench.send(refused), []);
        assert_eq!(bench.send(&[0]), []);
        assert_eq!(bench.device.refused(), before + 1);
        assert_eq!(bench.push(), ControllerFlags::ENABLED);
    }
}

/// Bytes of a command that the server could not finish, a zero, and three commands with `enable`
/// false: this is what the helper process of a killed server sends.
#[test]
fn the_last_word_is_a_command_like_any_other() {
    let whole = command_frame(true, 20, &PUSH);
    for cut in 0..whole.len() {
        let mut bench = Bench::new();
        bench.push();
        bench.send(&whole[..cut]);
        bench.send(&[0]);
        let last = command_frame(false, 1, &[0.0; 2]);
        assert_eq!(bench.send(&last).len(), 1);
        assert!(bench.is_free());
        bench.pass(3);
        assert_eq!(bench.send(&last).len(), 1);
        bench.pass(1);
        assert_eq!(bench.push(), ControllerFlags::WATCHDOG_EXPIRED, "its watchdog time is 1 ms");
    }
}
