//! Tests that the motors are off after a test that was stopped or that panicked.

use std::sync::{Arc, Mutex};

use hbot_core::allocation::{ContactArms, traction};
use hbot_core::design::kinematics::Posture;
use hbot_core::design::rig::Zero;
use hbot_testing::prototype::device_with;

use super::super::excite::{Ended, Exchange, Excitation, brake, excite};
use super::super::joint::HOLD_S;
use super::*;
use crate::bus::Heard;
use crate::line::SimulatorCall;
use crate::tests::scripted::ScriptedBus;

/// A line to simulated motor controllers that records all commands, and sets the flag `stop` after
/// `after` commands with torque.
struct Recorded {
    line: Memory,
    decoder: hbot_link::Decoder<ToController>,
    heard: Arc<Mutex<Vec<hbot_link::Command>>>,
    stop: StopFlag,
    after: usize,
}

impl Line for Recorded {
    fn read(&mut self, now_ns: u64, buffer: &mut [u8]) -> std::io::Result<usize> {
        self.line.read(now_ns, buffer)
    }

    fn write(&mut self, now_ns: u64, bytes: &[u8]) -> std::io::Result<usize> {
        let heard = &mut *self.heard.lock().unwrap();
        self.decoder.feed(bytes, |message| {
            if let Ok(ToController::Command(command)) = message {
                heard.push(command);
            }
        });
        if heard.iter().filter(|command| command.enable).count() == self.after {
            self.stop.stop();
        }
        self.line.write(now_ns, bytes)
    }
}

/// Returns a bench whose stop flag is set at its 50th command with torque, and a record of the
/// commands that its motor controllers receive.
fn recorded() -> (Bench, Arc<Mutex<Vec<hbot_link::Command>>>) {
    let (bench, heard, _) = recorded_with_calls();
    (bench, heard)
}

/// Does the same as [`recorded`], with a channel for changes of the simulated rig.
fn recorded_with_calls() -> (Bench, Arc<Mutex<Vec<hbot_link::Command>>>, mpsc::Sender<SimulatorCall>) {
    let (heard, stop) = (Arc::default(), StopFlag::default());
    let (calls, inbox) = mpsc::channel();
    let line = Recorded {
        line: Memory::new(simulated(), inbox),
        decoder: hbot_link::Decoder::new(),
        heard: Arc::clone(&heard),
        stop: stop.clone(),
        after: 50,
    };
    let mut bench = on(line);
    bench.stop = stop;
    (bench, heard, calls)
}

/// Returns how many of the recorded commands switched the motors on. Checks that the last three
/// switched them off.
fn pushes(heard: &Mutex<Vec<hbot_link::Command>>) -> usize {
    let heard = heard.lock().unwrap();
    for last in &heard[heard.len() - 3..] {
        assert!(!last.enable && last.torque.iter().all(|torque| *torque == 0.0), "{last:?}");
    }
    heard.iter().filter(|command| command.enable).count()
}

#[test]
fn a_push_that_is_stopped_goes_no_further_and_ends_with_motors_off() {
    let fixed = |bench: &mut Bench| test(bench, 1, 0.001, HOLD_S, 50.0);
    let rising = |bench: &mut Bench| ramp(bench, 1, 0.001, 50.0);
    for push in [&fixed as &dyn Fn(&mut Bench) -> Result<_, _>, &rising] {
        let (mut bench, heard) = recorded();
        assert_eq!(push(&mut bench), Err(Interrupted::Stopped));
        assert_eq!(pushes(&heard), 50, "the flag is looked at before each command");
        drop(bench);
        assert_eq!(pushes(&heard), 50);
    }
}

#[test]
fn a_panic_in_a_push_ends_with_motors_off() {
    let (bench, heard) = recorded();
    let panics = std::panic::AssertUnwindSafe(move || {
        let mut bench = bench;
        bench.exchange(Some(&[0.001; MAX_JOINTS])).unwrap();
        panic!("as a test asks: with torque on the line");
    });
    assert!(std::panic::catch_unwind(panics).is_err());
    assert_eq!(pushes(&heard), 1);
}

const GENTLE: Excitation = Excitation { seconds: 3.0, wander: 0.8, fastest: 6.0 };

/// Whatever ends a motion by all motors, the last commands switch them off: its time, a signal, a
/// speed, a slip, a complaint, a silent line, an unknown zero, a panic.
/// A power stage has 20 ms to switch. One that stays on is told, at the end of every push too.
#[test]
fn a_motor_that_is_on_or_off_against_the_command_for_20_ms_is_told() {
    let bus = ScriptedBus::default();
    let layout = crate::rig::layout::Layout::single(0..4);
    let motors = Motors::new(vec![Box::new(bus.clone())], &layout, 20);
    let mut bench = Bench::new(&hbot_config::RigConfig::prototype().rig, motors, true);
    let says = |disobeyed| {
        let complaints = Complaints { disobeyed, ..Complaints::default() };
        let reading = Some(crate::bus::Reading { answers: 0, joints: Default::default() });
        (bus.script().report, bus.script().lasts) = (Heard { reading, complaints, ..Heard::default() }, true);
    };
    let pushes = |bench: &mut Bench| {
        let mut complains = || bench.exchange(Some(&[0.0; MAX_JOINTS])).unwrap().complaints.disobeyed;
        (0..50).position(|_| complains())
    };
    says(true);
    assert!(matches!(pushes(&mut bench), Some(20 | 21)));
    // A motor that did not come is off. Its next answer can still be to the command before.
    assert!(bench.exchange(None).is_ok());
    says(false);
    assert_eq!((pushes(&mut bench), bench.switch_off()), (None, Ok(())));
    says(true);
    assert_eq!(bench.switch_off(), Err(Interrupted::StaysOn));
    // It is told after a signal too.
    bench.stop.stop();
    assert_eq!(ramp(&mut bench, 1, 0.001, 50.0), Err(Interrupted::StaysOn));
    bench.stop = StopFlag::default();
    says(false);
    assert!(bench.exchange(None).is_ok());
    says(true);
    let off = (0..50).position(|_| bench.exchange(None) == Err(Interrupted::StaysOn));
    assert!(matches!(off, Some(20 | 21)), "{off:?}");
}

#[test]
fn every_end_of_an_excitation_leaves_the_motors_off() {
    let excited = |bench: &mut Bench, how: &Excitation| excite(bench, how, &mut |_| ());
    let (mut bench, heard) = recorded();
    assert_eq!(excited(&mut bench, &GENTLE), Err(Interrupted::Stopped));
    assert_eq!(pushes(&heard), 50, "the flag is looked at before each command");

    let (mut bench, heard) = recorded();
    bench.stop = StopFlag::default();
    assert_eq!(excited(&mut bench, &GENTLE), Ok(Ended::Done));
    assert!(pushes(&heard) > 2900, "{}", pushes(&heard));

    let (mut bench, heard) = recorded();
    bench.stop = StopFlag::default();
    let slow = Excitation { fastest: 0.05, ..GENTLE };
    assert_eq!(excited(&mut bench, &slow), Ok(Ended::TooFast));
    assert!(pushes(&heard) > 10);

    let (mut bench, heard) = recorded();
    bench.stop = StopFlag::default();
    let wrong = device_with(|wheel| hbot_core::WheelSpec { cone: 1.2 * wheel.cone, ..wheel });
    bench.rig = bench.rig.with(|rig| (rig.device, rig.limits.slip) = (wrong, 1.0e-3)).unwrap();
    assert!(matches!(excited(&mut bench, &GENTLE), Ok(Ended::Slips(_))));
    assert!(pushes(&heard) > 0);

    for unknown in [Zero::Index, Zero::Calibrate] {
        let (mut bench, heard) = recorded();
        bench.stop = StopFlag::default();
        bench.rig = bench.rig.with(|rig| rig.joints[2].zero = unknown).unwrap();
        assert_eq!(excited(&mut bench, &GENTLE), Ok(Ended::NoZero(2)));
        assert_eq!(pushes(&heard), 0);
    }

    // A hot motor and a silent line. A line that is cut hears no last command either, so here only
    // the answers are lost.
    for (fault, silent) in
        [(InjectedFault::Hot { joint: 1, on: true }, false), (InjectedFault::Mute(true), true)]
    {
        let (mut bench, heard, calls) = recorded_with_calls();
        bench.stop = StopFlag::default();
        calls.send(Box::new(move |rig| rig.inject(fault))).unwrap();
        match excited(&mut bench, &GENTLE) {
            Ok(Ended::Complains(complaints)) => assert!(!silent && complaints.overtemperature),
            ended => assert!(silent && ended == Err(Interrupted::Silent), "{ended:?}"),
        }
        drop(bench);
        pushes(&heard);
    }

    let (bench, heard) = recorded();
    let panics = std::panic::AssertUnwindSafe(move || {
        let mut bench = bench;
        let _ = excite(&mut bench, &GENTLE, &mut |_| panic!("as a test asks"));
    });
    assert!(std::panic::catch_unwind(panics).is_err());
    assert_eq!(pushes(&heard), 1);
}

#[test]
fn a_joint_is_braked_within_its_torque_and_its_motor_is_off_then() {
    let (mut bench, heard) = recorded();
    bench.stop = StopFlag::default();
    test(&mut bench, 1, 0.01, HOLD_S, 50.0).unwrap();
    let rate = |bench: &mut Bench| bench.exchange(None).unwrap().rates[1].abs();
    let before = rate(&mut bench);
    heard.lock().unwrap().clear();
    brake(&mut bench, 1, 0.01).unwrap();
    assert!(heard.lock().unwrap().iter().all(|command| command.torque.iter().all(|t| t.abs() <= 0.01)));
    assert!(pushes(&heard) > 10);
    assert!(rate(&mut bench) < 0.2 * before, "{before}");
}

/// No joint torque exceeds half of the continuous torque, no contact half of its grip, the torque
/// on the sphere 30 % of the limit, and no torque changes faster than within 50 ms.
#[test]
fn an_excitation_keeps_all_limits() {
    let (mut bench, heard) = recorded();
    bench.stop = StopFlag::default();
    let rig = *bench.rig();
    let arms: Vec<ContactArms> =
        rig.device.wheels().iter().map(|wheel| ContactArms::of(wheel, rig.device.sphere_radius())).collect();
    let mut largest = [0.0_f64; 4];
    let (mut load, mut made) = (0.0_f64, 0.0_f64);
    let mut each = |now: &Exchange| {
        for (most, torque) in largest.iter_mut().zip(now.torque) {
            *most = most.max(torque.abs());
        }
        let grip = rig.limits.traction.expect("the prototype has it");
        load = load.max(traction(&arms, &now.torque[..4], grip.mu * grip.normal_force));
        let steer = [0, 2].map(|j| f64::from(now.reading.counts[j]) * rig.joints[j].radians_per_count());
        let posture = Posture::new(&rig.device, &steer);
        made = made.max(posture.torque_on_sphere(&now.torque[..4]).length());
    };
    let how = Excitation { seconds: 20.0, ..GENTLE };
    assert_eq!(excite(&mut bench, &how, &mut each), Ok(Ended::Done));
    for (j, most) in largest.into_iter().enumerate() {
        // The steers are held back by the grip of the contacts.
        let allowed = 0.5 * rig.joints[j].continuous;
        assert!(most <= allowed * (1.0 + 1e-9) && most > 0.1 * allowed, "joint {j}: {most} of {allowed} N m");
    }
    assert!(load <= 0.5 * (1.0 + 1e-6) && load > 0.1, "{load}");
    // The slew of the joints and the turn of the posture within a tick let it exceed a little.
    assert!(made <= 0.3 * rig.limits.torque * 1.05 && made > 0.01, "{made} N m");
    let heard = heard.lock().unwrap();
    for pair in heard.windows(2) {
        for j in 0..4 {
            let [before, now] =
                [0, 1].map(|k| pair[k].torque.get(j).map_or(0.0, |torque| f64::from(*torque)));
            let step = (now - before).abs();
            let allowed = 0.5 * rig.joints[j].continuous * 1.0e-3 / 0.05;
            let off = !pair[1].enable;
            assert!(off || step <= allowed * (1.0 + 1e-5), "joint {j}: {step} of {allowed} N m");
        }
    }
}
