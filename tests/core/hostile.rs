//! Numbers that nobody should send. They are refused or cause a fault, are never passed on, and
//! leave no trace after reset.

use crate::bench::{Bench, FirstReply, rig, spring_scene};
use hbot_core::design::device::MAX_JOINTS;
use hbot_core::inputs::{Command, Inputs, Stamp};
use hbot_core::outputs::{Refusal, Reply};
use hbot_core::safety::mode::{Cause, Mode};
use hbot_core::{Quat, Vec3};

const BAD: [f64; 9] =
    [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300, f64::MAX, f64::MIN, 1e200, -1e200];

fn active() -> Bench {
    Bench::active(rig(), spring_scene(1, 2.0, Vec3::X * 0.1))
}

/// Asserts that the rig behaves as it did before the bad input.
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
fn a_bad_rate_of_any_joint_is_a_fault_in_any_mode() {
    for bad in BAD {
        for joint in 0..4 {
            for mode in [Mode::Unreferenced, Mode::Idle, Mode::Active] {
                let mut bench = if mode == Mode::Active { active() } else { Bench::new(rig()) };
                if mode == Mode::Idle {
                    bench.step();
                }
                let state =
                    bench.step_with(|inputs| inputs.feedback.as_mut().unwrap().rates[joint] = bad).state;
                let cause = if bad.is_finite() { Cause::ImplausibleFeedback } else { Cause::NonFinite };
                assert_eq!((state.mode, state.cause), (Mode::Fault, Some(cause)), "{bad} from {mode:?}");
                if mode == Mode::Active {
                    works_again(bench, &format!("rate {bad} of joint {joint}"));
                }
            }
        }
    }
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

/// Returns every command that holds a number, with `bad` at each place of a number.
fn bad_commands(bad: f64) -> Vec<(String, Command)> {
    let stamp = Stamp::default();
    let mut commands = Vec::new();
    for k in 0..3 {
        let mut v = Vec3::new(0.1, 0.1, 0.1);
        v[k] = bad;
        commands.push((format!("stream {v}"), Command::Stream { torque: v, valid_ticks: 50, stamp }));
        let q = Quat::IDENTITY;
        let reference = Command::Reference { slot: 0, epoch: 1, q, omega: v, valid_ticks: 50, stamp };
        commands.push((format!("rate of a reference {v}"), reference));
    }
    for k in 0..4 {
        let mut q = [0.0, 0.0, 0.0, 1.0];
        q[k] = bad;
        let q = Quat::from_array(q);
        let reference =
            Command::Reference { slot: 0, epoch: 1, q, omega: Vec3::ZERO, valid_ticks: 50, stamp };
        commands.push((format!("reference {q}"), reference));
        commands.push((format!("alignment {q}"), Command::Align { q, weight: 1.0, tick: 3 }));
    }
    commands.push((format!("weight {bad}"), Command::Align { q: Quat::IDENTITY, weight: bad, tick: 3 }));
    commands
}

#[test]
fn a_bad_number_in_a_command_is_refused_or_stays_without_harm() {
    for bad in BAD {
        for (what, command) in bad_commands(bad) {
            let mut bench = active();
            let reply = bench.command(command).reply();
            // A torque or a rate can be any finite number, as it is limited later. An orientation
            // or a weight cannot.
            let only_large = bad.is_finite()
                && match command {
                    Command::Stream { .. } => true,
                    Command::Reference { q, .. } => q == Quat::IDENTITY,
                    _ => false,
                };
            let want = if only_large { Reply::Done } else { Reply::Refused(Refusal::NotFinite) };
            assert_eq!(reply, want, "{what}");
            // Every tick checks that its outputs are finite.
            for _ in 0..100 {
                let state = bench.step().state;
                assert!(state.torque.length() < 2.0 + 1e-12, "{what}");
                assert!(matches!(state.cause, None | Some(Cause::NonFinite)), "{what}: {:?}", state.cause);
                assert!(only_large || state.cause.is_none(), "{what}");
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
