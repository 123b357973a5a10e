//! The state table: every mode with every event.

mod events;

use crate::prelude::*;
use hbot_core::safety::mode::Obstacle;

const MODES: [Mode; 6] =
    [Mode::Unreferenced, Mode::Idle, Mode::Enabling, Mode::Active, Mode::Fault, Mode::Estop];

/// Creates a bench in `mode`, with its spring wound up by 0.2 rad. In mode fault, the cause is a
/// past fault of a motor controller.
fn bench_in(mode: Mode) -> Bench {
    let rig = altered(&rig(), |rig| rig.joints.iter_mut().for_each(|joint| joint.zero = Zero::Index));
    let mut bench = Bench::new(rig);
    bench.scene = spring_scene(1, 2.0, Vec3::new(0.2, 0.0, 0.0));
    bench.step();
    if mode == Mode::Unreferenced {
        return bench;
    }
    take_zeros(&mut bench);
    match mode {
        Mode::Enabling | Mode::Active => {
            bench.command(Command::Enable);
            bench.run(if mode == Mode::Active { 600 } else { 100 });
        }
        Mode::Fault => {
            bench.step_with(|inputs| complain(inputs, |c| c.fault = true));
        }
        Mode::Estop => {
            bench.command(Command::Estop);
        }
        Mode::Unreferenced | Mode::Idle => {}
    }
    assert_eq!(bench.step().state.mode, mode);
    bench
}

fn take_zeros(bench: &mut Bench) -> Outputs {
    bench.step_with(|inputs| inputs.feedback.as_mut().unwrap().index_seen = u16::MAX)
}

fn complain(inputs: &mut Inputs, which: impl Fn(&mut hbot_core::inputs::Complaints)) {
    which(&mut inputs.feedback.as_mut().unwrap().complaints);
}

fn refused(obstacle: Obstacle) -> Reply {
    Reply::Refused(Refusal::Mode(obstacle))
}

#[test]
fn commands_lead_where_the_table_says() {
    use Mode::{Active, Enabling, Estop, Fault, Idle, Unreferenced};
    let faulted = refused(Obstacle::Faulted(Cause::ControllerFault));
    let (stopped, unreferenced) = (refused(Obstacle::Stopped), refused(Obstacle::Unreferenced));
    let done = Reply::Done;
    for (from, command, to, reply) in [
        (Unreferenced, Command::Enable, Unreferenced, unreferenced),
        (Unreferenced, Command::Disable, Unreferenced, done),
        (Unreferenced, Command::Estop, Estop, done),
        (Unreferenced, Command::Reset, Unreferenced, done),
        (Idle, Command::Enable, Enabling, done),
        (Idle, Command::Disable, Idle, done),
        (Idle, Command::Estop, Estop, done),
        (Idle, Command::Reset, Idle, done),
        (Enabling, Command::Enable, Enabling, done),
        (Enabling, Command::Disable, Idle, done),
        (Enabling, Command::Estop, Estop, done),
        (Enabling, Command::Reset, Enabling, done),
        (Active, Command::Enable, Active, done),
        (Active, Command::Disable, Idle, done),
        (Active, Command::Estop, Estop, done),
        (Active, Command::Reset, Active, done),
        (Fault, Command::Enable, Fault, faulted),
        (Fault, Command::Disable, Fault, done),
        (Fault, Command::Estop, Estop, done),
        (Fault, Command::Reset, Idle, done),
        (Estop, Command::Enable, Estop, stopped),
        (Estop, Command::Disable, Estop, done),
        (Estop, Command::Estop, Estop, done),
        (Estop, Command::Reset, Idle, done),
    ] {
        let outputs = bench_in(from).command(command);
        assert_eq!((outputs.state.mode, outputs.reply()), (to, reply), "{from:?}, {command:?}");
        assert_eq!(outputs.state.cause.is_some(), to == Fault, "{from:?}, {command:?}");
        if to == Estop {
            assert_eq!(outputs.state.torque, Vec3::ZERO, "from {from:?}");
            assert!(!outputs.drive.enable);
        }
    }
}

fn provoke(cause: Cause, bench: &mut Bench) -> Outputs {
    match cause {
        Cause::LinkLost => {
            let mut last = bench.deaf();
            for _ in 0..bench.rig().timing.timeout_ticks {
                last = bench.deaf();
            }
            last
        }
        Cause::LinkCorrupt => bench.step_with(|inputs| inputs.corrupt_frames = 100),
        Cause::ControllerFault => bench.step_with(|inputs| complain(inputs, |c| c.fault = true)),
        Cause::Overtorque => bench.step_with(|inputs| complain(inputs, |c| c.overcurrent = true)),
        Cause::Thermal => bench.step_with(|inputs| complain(inputs, |c| c.overtemperature = true)),
        Cause::Overspeed => {
            let rates = bench.sphere.rates(Vec3::new(0.0, 31.0, 0.0));
            bench.step_with(|inputs| inputs.feedback.as_mut().unwrap().rates = rates)
        }
        Cause::Slip => {
            let rates = pure_slip(bench);
            bench.step_with(|inputs| inputs.feedback.as_mut().unwrap().rates = rates)
        }
        Cause::NonFinite => bench.step_with(|inputs| inputs.feedback.as_mut().unwrap().rates[1] = f64::NAN),
        Cause::ImplausibleFeedback => {
            bench.step_with(|inputs| inputs.feedback.as_mut().unwrap().rates[2] = 2e4)
        }
        Cause::Deadline => bench.step_with(|inputs| inputs.lateness_ns = 20_000_001),
        Cause::ClientLost => {
            let before = bench.command(Command::ClientLost(OnClientLost::Fault));
            assert_eq!(before.reply(), Reply::Done);
            bench.step()
        }
    }
}

/// Returns joint rates (rad/s) in which no turn of the sphere has a part, with a slip well above
/// the limit.
fn pure_slip(bench: &Bench) -> [f64; 16] {
    use hbot_core::design::kinematics::Posture;
    let device = &bench.rig().device;
    let posture = Posture::new(device, &bench.sphere.steering());
    let mut rates = [0.0; 16];
    rates[..4].copy_from_slice(&[30.0, -80.0, 20.0, 90.0]);
    let fit = posture.inverse(posture.forward(device, &rates).omega);
    core::array::from_fn(|j| rates[j] - fit[j])
}

#[test]
fn every_fault_stops_the_torque_in_its_own_tick_from_every_mode() {
    for from in MODES {
        for cause in Cause::ALL {
            let mut bench = bench_in(from);
            let powered = matches!(from, Mode::Enabling | Mode::Active);
            let was = bench.step().state;
            assert_eq!(was.torque != Vec3::ZERO, powered);
            let outputs = provoke(cause, &mut bench);
            let state = &outputs.state;
            let place = format!("{cause:?} from {from:?}: {:?} {:?}", state.mode, state.cause);
            let only_powered = matches!(cause, Cause::Overspeed | Cause::Slip);
            if only_powered && !powered {
                // A hand can spin or lift a sphere without torque.
                assert_eq!((state.mode, state.cause), (from, was.cause), "{place}");
                continue;
            }
            // The first cause stays.
            let first = if from == Mode::Fault { Cause::ControllerFault } else { cause };
            assert_eq!((state.mode, state.cause), (Mode::Fault, Some(first)), "{place}");
            assert!(state.torque == Vec3::ZERO && !outputs.drive.enable, "{place}");
            assert_eq!(outputs.drive.torque, [0.0; 16], "{place}");

            // After the cause is gone (a damaged link recovers in half a second), reset leads back,
            // and the rig works again.
            bench.run(500);
            let reset = bench.command(Command::Reset);
            assert_eq!(reset.reply(), Reply::Done, "{place}");
            let back = if from == Mode::Unreferenced { from } else { Mode::Idle };
            assert_eq!((reset.state.mode, reset.state.cause), (back, None), "{place}");
            take_zeros(&mut bench);
            assert_eq!(bench.command(Command::Enable).reply(), Reply::Done, "{place}");
            assert_eq!(bench.run(600).state.mode, Mode::Active, "{place}");
        }
    }
}

#[test]
fn while_a_cause_lasts_neither_reset_nor_enable_gets_past_it() {
    for from in [Mode::Active, Mode::Estop] {
        let mut bench = bench_in(from);
        let hot = |inputs: &mut Inputs| complain(inputs, |c| c.overtemperature = true);
        assert_eq!(bench.step_with(hot).state.cause, Some(Cause::Thermal));
        for command in [Command::Reset, Command::Enable] {
            let outputs = bench.step_with(|inputs| {
                hot(inputs);
                inputs.commands.push(command).unwrap();
            });
            assert_eq!(outputs.reply(), refused(Obstacle::Faulted(Cause::Thermal)), "{command:?}");
            assert_eq!(outputs.state.mode, Mode::Fault);
        }
        assert_eq!(bench.command(Command::Reset).reply(), Reply::Done);
    }
}

#[test]
fn a_stop_during_a_fault_stays_a_stop_and_waits_for_the_cause_to_go() {
    let mut bench = bench_in(Mode::Active);
    let hot = |inputs: &mut Inputs| complain(inputs, |c| c.overtemperature = true);
    bench.step_with(hot);
    let stop = bench.step_with(|inputs| {
        hot(inputs);
        inputs.commands.push(Command::Estop).unwrap();
    });
    assert_eq!((stop.state.mode, stop.state.cause), (Mode::Estop, None));
    assert_eq!(bench.step_with(hot).state.mode, Mode::Estop, "no new event, no fault");
    let reset = bench.step_with(|inputs| {
        hot(inputs);
        inputs.commands.push(Command::Reset).unwrap();
    });
    assert_eq!(reset.reply(), refused(Obstacle::Faulted(Cause::Thermal)));
    assert_eq!(bench.command(Command::Reset).state.mode, Mode::Idle);
}

#[test]
fn taking_the_zeros_leads_from_unreferenced_to_idle_and_from_nowhere_else() {
    for from in MODES {
        let to = if from == Mode::Unreferenced { Mode::Idle } else { from };
        let mut bench = bench_in(from);
        take_zeros(&mut bench);
        assert_eq!(bench.step().state.mode, to, "{from:?}");
    }
}

#[test]
fn each_way_to_a_steering_zero_becomes_known_when_it_should() {
    let idle_after = |zero: Zero, seen: u16| {
        // The zero of a drive joint has no meaning.
        let zeros = [zero, Zero::Calibrate, zero];
        let rig = altered(&rig(), |rig| (0..3).for_each(|joint| rig.joints[joint].zero = zeros[joint]));
        let mut bench = Bench::new(rig);
        bench.step_with(|inputs| inputs.feedback.as_mut().unwrap().index_seen = seen).state.mode == Mode::Idle
    };
    assert!(idle_after(Zero::Assume, 0));
    assert!(idle_after(Zero::Absolute, 0));
    assert!(
        !idle_after(Zero::Index, 0)
            && !idle_after(Zero::Index, 0b0001)
            && !idle_after(Zero::Index, 0b1110 & !0b0100)
    );
    assert!(idle_after(Zero::Index, 0b0101));
    assert!(!idle_after(Zero::Calibrate, u16::MAX));
    // Nothing is known before the first reading.
    let mut deaf = Bench::new(rig());
    assert_eq!(deaf.deaf().state.mode, Mode::Unreferenced);
    assert_eq!(deaf.step().state.mode, Mode::Idle);
}

#[test]
fn a_reboot_is_a_fault_after_which_the_zeros_must_be_found_anew() {
    for (zero, after) in
        [(Zero::Absolute, Mode::Idle), (Zero::Index, Mode::Unreferenced), (Zero::Assume, Mode::Unreferenced)]
    {
        for from in MODES {
            let mut bench = bench_in(from);
            if zero != Zero::Index {
                // bench_in needs the index to distinguish unreferenced from idle.
                let zeros =
                    |rig: &mut hbot_core::RigParts| rig.joints.iter_mut().for_each(|joint| joint.zero = zero);
                bench = Bench::new(altered(&rig(), zeros));
                bench.step();
            }
            let outputs = bench.step_with(|inputs| inputs.rebooted = true);
            assert_eq!(outputs.state.mode, Mode::Fault, "{from:?}");
            assert!(outputs.state.cause == Some(Cause::ControllerFault) && !outputs.drive.enable);
            assert_eq!(bench.command(Command::Reset).state.mode, Mode::Unreferenced, "{from:?}");
            assert_eq!(bench.step().state.mode, after, "{zero:?} from {from:?}");
        }
    }
}

#[test]
fn a_mode_that_is_left_by_a_ramp_can_be_entered_again_from_within_it() {
    let mut bench = bench_in(Mode::Active);
    let full = bench.step().state.torque.length();
    bench.command(Command::Disable);
    let partly = bench.run(20).state.torque.length();
    assert!(0.4 * full < partly && partly < 0.8 * full, "{partly} of {full}");
    let back = bench.command(Command::Enable);
    assert_eq!(back.state.mode, Mode::Enabling);
    assert!((back.state.torque.length() - partly).abs() < 0.05 * full, "no step on the way back");
    assert_eq!(bench.run(500).state.mode, Mode::Active);
}

#[test]
fn a_motor_that_is_too_hot_by_its_torques_is_a_fault_wherever_it_has_torque() {
    for from in [Mode::Enabling, Mode::Active] {
        // The heat rises by more in a tick than a cold motor loses in the two ticks of the
        // refusals.
        let rig = altered(&rig(), |rig| {
            rig.joints.iter_mut().for_each(|joint| joint.continuous = 5e-4);
            rig.limits.thermal_time = Some(0.2);
        });
        let mut bench = Bench::new(rig);
        bench.scene = spring_scene(1, 2.0, Vec3::new(0.2, 0.0, 0.0));
        bench.run(2);
        assert_eq!(bench.command(Command::Enable).reply(), Reply::Done);
        // If the mode is active, the torque rises so slowly that the motor is active before it is
        // too hot.
        if from == Mode::Active {
            bench.scene = CompiledScene::empty();
            bench.run(600);
            bench.scene = spring_scene(2, 2.0, Vec3::new(0.2, 0.0, 0.0));
        }
        let hot = (0..600)
            .map(|_| (bench.step(), from))
            .find(|(outputs, _)| outputs.state.mode == Mode::Fault)
            .expect("it becomes hot")
            .0;
        assert_eq!(hot.state.cause, Some(Cause::Thermal), "{from:?}");
        assert!(hot.state.torque == Vec3::ZERO && !hot.drive.enable, "{from:?}");
        for stopped in [Command::Reset, Command::Enable] {
            assert!(matches!(bench.command(stopped).reply(), Reply::Refused(_)), "{from:?}");
        }
        assert_eq!(bench.command(Command::Estop).state.mode, Mode::Estop, "{from:?}");
        bench.run(3000);
        assert_eq!(bench.command(Command::Reset).state.mode, Mode::Idle, "cool again");
    }
}
