//! Numbers that nobody should send. They are refused or cause a fault, are never passed on, and
//! leave no trace after reset.

use crate::prelude::*;

const BAD: [f64; 9] =
    [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300, f64::MAX, f64::MIN, 1e200, -1e200];

fn active() -> Bench {
    Bench::active(rig(), spring_scene(1, 2.0, Vec3::X * 0.1))
}

fn works_again(mut bench: Bench, what: &str) {
    let like_new = active().run(100).state;
    if matches!(bench.step().state.mode, Mode::Fault | Mode::Estop) {
        assert_eq!(bench.command(Command::Reset).reply(), Reply::Done, "{what}");
    }
    // The wait lets streams and rates expire. The new scene undoes any motion of the reference.
    bench.scene = spring_scene(bench.scene.revision() + 1, 2.0, Vec3::X * 0.1);
    bench.run(1200);
    assert_eq!(bench.command(Command::Enable).reply(), Reply::Done, "{what}");
    let state = bench.run(700).state;
    assert_eq!(state.mode, Mode::Active, "{what}: {:?}", state.cause);
    assert!((state.torque - like_new.torque).length() < 1e-12, "{what}: {}", state.torque);
    assert_eq!(
        (state.q, state.omega, state.energy.is_finite()),
        (like_new.q, like_new.omega, true),
        "{what}"
    );
}

#[test]
fn rates_of_joints_that_are_not_there_do_not_matter() {
    for bad in BAD {
        let mut bench = active();
        let state = bench.step_with(|inputs| inputs.feedback.as_mut().unwrap().rates[4..].fill(bad)).state;
        assert_eq!(state.mode, Mode::Active);
        assert_eq!(state.rate[4..], [0.0; MAX_JOINTS - 4]);
    }
}

#[test]
fn any_count_is_a_reading_or_a_fault() {
    for count in [i32::MIN, i32::MAX, -1, 1 << 30, 12345] {
        for joint in 0..4 {
            let mut bench = active();
            bench.step_with(|inputs| inputs.feedback.as_mut().unwrap().counts[joint] = count);
            bench.run(3);
            works_again_in_place(bench, &format!("count {count} of joint {joint}"));
        }
    }
}

/// Asserts only that the rig works again. A reading that was accepted can have turned the sphere.
fn works_again_in_place(mut bench: Bench, what: &str) {
    bench.command(Command::Disable);
    bench.command(Command::Reset);
    bench.scene = spring_scene(99, 0.0, Vec3::ZERO);
    bench.step();
    let q = bench.step().state.q;
    let kind = crate::bench::spring(2.0, 0.0, q, hbot_core::render::effects::Anchor::Absolute);
    bench.scene = hbot_core::CompiledScene::new(100, &[crate::bench::effect(0, 100, kind)]).unwrap();
    bench.run(60);
    assert_eq!(bench.command(Command::Enable).reply(), Reply::Done, "{what}");
    assert_eq!(bench.run(600).state.mode, Mode::Active, "{what}");
}

/// A rate can be any finite number, as it is limited later.
#[test]
fn a_reference_that_turns_far_too_fast_stays_without_harm() {
    for bad in BAD.into_iter().filter(|bad| bad.is_finite()) {
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            let (what, stamp, q) = (format!("{bad} about {axis}"), Stamp::default(), Quat::IDENTITY);
            let omega = Vec3::splat(0.1) + axis * bad;
            let mut bench = active();
            let turning = Command::Reference { slot: 0, epoch: 1, q, omega, valid_ticks: 50, stamp };
            assert_eq!(bench.command(turning).reply(), Reply::Done, "{what}");
            // Every tick checks that its outputs are finite.
            for _ in 0..100 {
                let state = bench.step().state;
                assert!(state.torque.length() < 2.0 + 1e-12, "{what}");
                assert!(matches!(state.cause, None | Some(Cause::NonFinite)), "{what}: {:?}", state.cause);
            }
            works_again(bench, &what);
        }
    }
}

#[test]
fn a_sum_that_is_not_finite_stops_the_motors_in_its_own_tick() {
    // The torques of a scene and of a stream can each be finite and limited, while their sum
    // overflows.
    let stiff = spring_scene(1, 1e305, Vec3::X * 0.3);
    let mut bench = Bench::active(rig(), stiff);
    let before = bench.step().state;
    assert!(before.torque.x > 1.0 && before.cause.is_none(), "{}", before.torque);
    let outputs = bench.command(crate::bench::stream(Vec3::X * f64::MAX, 5));
    assert_eq!(outputs.reply(), Reply::Done);
    assert_eq!((outputs.state.mode, outputs.state.cause), (Mode::Fault, Some(Cause::NonFinite)));
    assert!(outputs.state.torque == Vec3::ZERO && !outputs.drive.enable);
    // The cause ends with the stream.
    assert_eq!(bench.run(3).state.torque, Vec3::ZERO);
    assert_eq!(bench.command(Command::Reset).reply(), Reply::Done);
    bench.run(30);
    assert_eq!(bench.command(Command::Enable).reply(), Reply::Done);
    assert_eq!(bench.run(600).state.torque, before.torque);
}

#[test]
fn a_full_tick_of_commands_answers_each_and_takes_no_more() {
    let mut bench = active();
    let outputs = bench.step_with(|inputs: &mut Inputs| {
        for k in 0..8 {
            let stamp = Stamp { seq: Some(k), tick: None };
            let stream = Command::Stream { torque: Vec3::ZERO, valid_ticks: 1, stamp };
            assert_eq!(inputs.commands.push(stream), Ok(()));
        }
        assert_eq!(inputs.commands.push(Command::Estop), Err(Command::Estop), "given back for the next tick");
    });
    assert_eq!(outputs.replies, [Some(Reply::Done); 8]);
    assert_eq!(outputs.state.client.unwrap().seq, Some(7));
    assert_eq!(outputs.state.mode, Mode::Active);
}
