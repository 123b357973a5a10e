//! Tests with simulated rigs that have an error, which must be detected and named.

mod stop;
mod wiring;

use std::sync::mpsc;

use hbot_identify::calibrate::{Calibration, calibrate};
use hbot_link::ToController;
use hbot_sim::controller::InjectedFault;
use hbot_sim::phenomena::{JointFriction, Phenomena};
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};
use hbot_testing::prototype::{simulated, simulated_as};

use super::joint::{HOLD_S, Verdict, ramp, test};
use super::*;
use crate::line::{Line, Memory};

fn bench(
    spoil: impl FnOnce(&mut SimulatedConfig),
    hand: bool,
    then: impl FnOnce(&mut SimulatedRig),
) -> Bench {
    let mut simulated = simulated_as(&RigConfig::prototype(), spoil);
    if hand {
        simulated.set_hand(Some(Hand { amplitude: 0.8, rate: 0.4, ..Hand::default() }));
    }
    then(&mut simulated);
    on(Memory::new(simulated, mpsc::channel().1))
}

/// Returns a bench for the prototype rig, whose motor controllers are reached over `line`.
fn on(line: impl Line + 'static) -> Bench {
    on_rig(&RigConfig::prototype(), line)
}

fn on_rig(rig: &RigConfig, line: impl Line + 'static) -> Bench {
    let layout = Layout::single(0..rig.rig.device.joints());
    let (_, bus) = attach::met(rig, &layout, Box::new(line)).unwrap();
    Bench::new(&rig.rig, Motors::new(vec![bus], &layout, WATCHDOG_MS), true)
}

fn watched(bench: &mut Bench) -> Calibration {
    let counts: Vec<_> = (0..20_000).map(|_| bench.exchange(None).unwrap().counts).collect();
    let rig = *bench.rig();
    calibrate(&rig, &counts).unwrap()
}

#[test]
fn every_joint_of_a_good_rig_is_good() {
    for joint in 0..4 {
        for torque in [0.01, -0.01] {
            let outcome = test(&mut bench(|_| (), false, |_| ()), joint, torque, HOLD_S, 50.0).unwrap();
            assert_eq!(outcome.verdict, Verdict::Good, "{outcome:?}");
        }
    }
}

/// A slow ramp finds the torque that moves a joint, a little above its friction, and ends there.
#[test]
fn a_ramp_ends_when_the_joint_has_moved_and_says_what_moved_it() {
    let friction = JointFriction { coulomb: 5.0e-4, breakaway: 5.0e-4, ..JointFriction::default() };
    let phenomena = Phenomena { joint_friction: Some(friction), ..Phenomena::default() };
    for joint in 0..4 {
        for most in [0.02, -0.02] {
            let mut bench = bench(|config| config.phenomena = phenomena, false, |_| ());
            let outcome = ramp(&mut bench, joint, most, 50.0).unwrap();
            assert_eq!(outcome.verdict, Verdict::Good, "{outcome:?}");
            // The other joints rub too. The ramp ends by the rate: its sum differs from the counts
            // by some of them. A tick of motion at the end is allowed beyond 0.05 rad.
            assert!((0.0495..0.1).contains(&outcome.moved.abs()), "{outcome:?}");
            let size = outcome.torque * most.signum();
            assert!(size > 5.0e-4 && size < 0.02, "{outcome:?}");
        }
    }
    // A joint that does not move gets the largest torque, and no more.
    let mut stuck = bench(|config| config.joints[1].peak = 0.0, false, |_| ());
    let outcome = ramp(&mut stuck, 1, 0.02, 50.0).unwrap();
    assert!(outcome.verdict != Verdict::Good && outcome.torque <= 0.02, "{outcome:?}");
}

#[test]
fn a_joint_that_is_hot_held_or_geared_otherwise_is_named() {
    let mut hot = bench(|_| (), false, |rig| rig.inject(InjectedFault::Hot { joint: 1, on: true }));
    assert!(
        matches!(test(&mut hot, 1, 0.01, HOLD_S, 50.0).unwrap().verdict, Verdict::Complains(c) if c.overtemperature)
    );
    let mut dead = bench(|c| c.joints[1].peak = 0.0, false, |_| ());
    let outcome = test(&mut dead, 1, 0.01, HOLD_S, 50.0).unwrap();
    assert!(matches!(outcome.verdict, Verdict::Stands | Verdict::Complains(_)), "{outcome:?}");
    let mut geared = bench(|c| c.joints[1].gear = 20.0, false, |_| ());
    let Verdict::Gear(ratio) = test(&mut geared, 1, 0.01, HOLD_S, 50.0).unwrap().verdict else {
        panic!("not seen")
    };
    // The real gear is 20, the rig file states 17. Counts say 20/17 of what the rates say, to one
    // count in some thousand.
    assert!((ratio - 20.0 / 17.0).abs() < 0.01, "{ratio}");
    assert!(Verdict::Gear(ratio).to_string().contains("gear in the rig file is too small by that factor"));
    let outcome = test(&mut bench(|_| (), false, |_| ()), 1, 0.05, HOLD_S, 0.5).unwrap();
    assert_eq!(outcome.verdict, Verdict::TooFast(1));
}

/// A line to simulated motor controllers on which joint 1 turns the wrong way, as if two leads of
/// its motor were exchanged.
struct Exchanged(Memory);

impl Line for Exchanged {
    fn read(&mut self, now_ns: u64, buffer: &mut [u8]) -> std::io::Result<usize> {
        self.0.read(now_ns, buffer)
    }

    fn write(&mut self, now_ns: u64, bytes: &[u8]) -> std::io::Result<usize> {
        let mut decoder = hbot_link::Decoder::<ToController>::new();
        let mut result = Ok(bytes.len());
        decoder.feed(bytes, |message| {
            let Ok(mut message) = message else { return };
            if let ToController::Command(command) = &mut message {
                command.torque[1] = -command.torque[1];
            }
            let mut frame = [0; hbot_link::MAX_COMMAND_FRAME];
            let n = hbot_link::encode(&message, &mut frame).unwrap();
            result = self.0.write(now_ns, &frame[..n]).map(|_| bytes.len());
        });
        result
    }
}

#[test]
fn a_motor_whose_counts_fall_under_a_positive_torque_is_named_before_any_loop_is_closed() {
    let exchanged = || on(Exchanged(Memory::new(simulated(), mpsc::channel().1)));
    for torque in [0.01, -0.01] {
        let outcome = test(&mut exchanged(), 1, torque, HOLD_S, 50.0).unwrap();
        assert_eq!(outcome.verdict, Verdict::Reversed, "{outcome:?}");
        assert!(outcome.moved * torque < 0.0);
        assert!(outcome.verdict.to_string().contains("exchange two leads"));
        // The other joints are not affected.
        assert_eq!(test(&mut exchanged(), 3, torque, HOLD_S, 50.0).unwrap().verdict, Verdict::Good);
    }
}

/// A line on which the clock runs, and each command takes a millisecond.
struct Slow(Memory, Instant);

impl Slow {
    fn now_ns(&self) -> u64 {
        self.1.elapsed().as_nanos() as u64
    }
}

impl Line for Slow {
    fn read(&mut self, _now_ns: u64, buffer: &mut [u8]) -> std::io::Result<usize> {
        self.0.read(self.now_ns(), buffer)
    }

    fn write(&mut self, _now_ns: u64, bytes: &[u8]) -> std::io::Result<usize> {
        // Time is the subject: an exchange lasts twice its period.
        std::thread::sleep(Duration::from_millis(1));
        self.0.write(self.now_ns(), bytes)
    }
}

/// Rates are added up over the time that has passed, and what late rates do not tell yet is added.
#[test]
fn counts_and_rates_agree_on_a_slow_line_and_with_late_rates() {
    let mut slow = on(Slow(Memory::new(simulated(), mpsc::channel().1), Instant::now()));
    slow.simulated = false;
    assert_eq!(test(&mut slow, 1, 0.01, HOLD_S, 50.0).unwrap().verdict, Verdict::Good);
    let text = include_str!("../../../../../rigs/prototype-moteus.toml");
    let rig = RigConfig::from_toml(text, "x.toml").unwrap();
    let helper = Program::this("nothing");
    let mut servos = open(&rig, Truth::default(), StopFlag::default(), &helper).unwrap();
    let outcome = test(&mut servos, 1, 0.005, HOLD_S, 50.0).unwrap();
    // 3.9 ms of the 0.1 s that the test lasts would be missing. What is left comes of the
    // acceleration, which changes the rate by a tenth in that time.
    assert!((outcome.by_rate / outcome.moved - 1.0).abs() < 0.01, "{outcome:?}");
}

#[test]
fn a_joint_that_comes_to_rest_soon_is_waited_for() {
    let friction = JointFriction { coulomb: 1.0e-3, breakaway: 1.0e-3, ..JointFriction::default() };
    let phenomena = Phenomena { joint_friction: Some(friction), ..Phenomena::default() };
    let mut bench = bench(|config| config.phenomena = phenomena, false, |_| ());
    for torque in [0.01, -0.01, 0.01] {
        assert_eq!(test(&mut bench, 1, torque, HOLD_S, 50.0).unwrap().verdict, Verdict::Good);
    }
}

#[test]
fn a_joint_that_turns_already_is_not_judged_by_that() {
    let mut bench = bench(|_| (), false, |_| ());
    assert_eq!(test(&mut bench, 1, 0.01, HOLD_S, 50.0).unwrap().verdict, Verdict::Good);
    // The sphere rolls on without friction and turns every wheel. This motion says nothing about a
    // torque in the other direction.
    let outcome = test(&mut bench, 1, -0.01, HOLD_S, 50.0).unwrap();
    assert_eq!((outcome.verdict, outcome.moved), (Verdict::Turns, 0.0), "{outcome:?}");
}

/// At 0.03 rad/s the wheel would reach the end of the ramp by itself.
#[test]
fn a_wheel_that_creeps_is_not_taken_for_one_that_the_motor_turns() {
    let mut bench = bench(|_| (), false, |_| ());
    let mut asked = [0.0; MAX_JOINTS];
    asked[1] = 0.001;
    let creeps = |rate: f64| rate.abs() > 0.02;
    while !creeps(bench.exchange(Some(&asked)).unwrap().rates[1]) {}
    let rate = bench.exchange(None).unwrap().rates[1].abs();
    assert!((0.02..0.04).contains(&rate), "{rate}");
    let outcome = ramp(&mut bench, 1, 0.02, 50.0).unwrap();
    assert_eq!((outcome.verdict, outcome.torque), (Verdict::Turns, 0.0), "{outcome:?}");
}

#[test]
fn a_line_that_falls_silent_is_told() {
    let (calls, inbox) = mpsc::channel::<crate::line::SimulatorCall>();
    let mut bench = on(Memory::new(simulated(), inbox));
    assert_eq!(test(&mut bench, 1, 0.01, HOLD_S, 50.0).unwrap().verdict, Verdict::Good);
    calls.send(Box::new(|rig| rig.inject(InjectedFault::Deaf(true)))).unwrap();
    assert_eq!(test(&mut bench, 1, 0.01, HOLD_S, 50.0), Err(Interrupted::Silent));
}

/// Long enough to pull a plug.
#[test]
fn a_torque_is_held_for_as_long_as_it_is_asked_for() {
    // It moves no wheel.
    let mut bench = on(Memory::new(simulated(), mpsc::channel().1));
    for hold_s in [HOLD_S, 3.0] {
        let began = bench.time_s();
        let outcome = test(&mut bench, 1, 1.0e-6, hold_s, 50.0).unwrap();
        let lasted = bench.time_s() - began;
        assert!((hold_s..hold_s + 0.5).contains(&lasted), "{lasted} s: {outcome:?}");
    }
}

#[test]
fn a_controller_that_has_lost_power_gets_no_further_torque() {
    let (calls, inbox) = mpsc::channel::<crate::line::SimulatorCall>();
    let mut bench = on(Memory::new(simulated(), inbox));
    calls.send(Box::new(|rig| rig.inject(InjectedFault::Reboot))).unwrap();
    let outcome = test(&mut bench, 1, 0.01, HOLD_S, 50.0).unwrap();
    assert!(matches!(outcome.verdict, Verdict::Complains(complaints) if complaints.fault), "{outcome:?}");
    assert_eq!(outcome.moved, 0.0, "by the first command with torque");
}

#[test]
fn a_rig_as_its_file_has_it_is_left_alone() {
    let found = watched(&mut bench(|_| (), true, |_| ()));
    assert!(found.known && found.before < 0.01, "{found:?}");
    for wheel in &found.wheels {
        assert_eq!(wheel.wrong_sign, [false; 2]);
        // A count of the drive encoder is 2e-5 rad and a step is 0.02 rad: an error of one
        // thousandth per step, over a thousand steps.
        assert!(wheel.zero.abs() < 2e-3 && (wheel.radius / 0.0155 - 1.0).abs() < 2e-3, "{found:?}");
    }
}

#[test]
fn one_wrong_sign_is_named_whichever_it_is() {
    for joint in 0..4 {
        let mut bench = bench(|c| c.joints[joint].reversed = true, true, |_| ());
        let found = watched(&mut bench);
        let flipped: Vec<bool> = found.wheels.iter().flat_map(|wheel| wheel.wrong_sign).collect();
        assert_eq!(flipped, std::array::from_fn::<_, 4, _>(|j| j == joint), "{found:?}");
        assert!(found.before > 0.05 && found.after < 0.01, "{found:?}");
    }
}

#[test]
fn one_wrong_zero_is_found() {
    for (joint, angle) in [(0, 0.3), (2, -1.2), (0, 3.0)] {
        let found =
            watched(&mut bench(|_| (), true, |rig| rig.inject(InjectedFault::Slipped { joint, angle })));
        for (i, wheel) in found.wheels.iter().enumerate() {
            // The encoder reads `angle` more than the true angle.
            let expected = if 2 * i == joint { -angle } else { 0.0 };
            assert!((wheel.zero - expected).abs() < 5e-3, "{expected}: {found:?}");
            assert_eq!(wheel.wrong_sign, [false; 2]);
        }
        assert!(found.known && found.before > 5.0 * found.after, "{found:?}");
    }
}

#[test]
fn wrong_radii_and_cones_are_found_beside_a_wrong_zero() {
    let spoil = |c: &mut SimulatedConfig| {
        let mut specs: Vec<_> = c.device.wheels().iter().map(|wheel| *wheel.spec()).collect();
        specs[0].radius *= 1.03;
        specs[1].cone += 0.02;
        c.device = hbot_core::Device::new(c.device.sphere_radius(), c.device.sphere_mass(), &specs).unwrap();
    };
    let found =
        watched(&mut bench(spoil, true, |rig| rig.inject(InjectedFault::Slipped { joint: 2, angle: 0.4 })));
    let [a, b] = &found.wheels[..] else { panic!("two wheels") };
    assert!((a.radius / b.radius - 1.03).abs() < 3e-3, "{found:?}");
    assert!((b.cone - a.cone - 0.02).abs() < 5e-3, "{found:?}");
    assert!((b.zero + 0.4).abs() < 1e-2 && found.after < 0.2 * found.before, "{found:?}");
}

/// Returns the prototype rig with a third wheel, whose axis is turned by 90° about the vertical
/// relative to the other two.
fn three_wheels() -> hbot_core::Rig {
    let rig = RigConfig::prototype().rig;
    let mut specs: Vec<_> = rig.device.wheels().iter().map(|wheel| *wheel.spec()).collect();
    specs.push(hbot_core::design::device::WheelSpec {
        axis: hbot_core::Vec3::new(0.0, 1.0, -1.0),
        ..specs[0]
    });
    let device =
        hbot_core::Device::new(rig.device.sphere_radius(), rig.device.sphere_mass(), &specs).unwrap();
    rig.with(|parts| {
        parts.device = device;
        (parts.joints[4], parts.joints[5]) = (parts.joints[0], parts.joints[1]);
    })
    .unwrap()
}

#[test]
fn with_three_wheels_a_wrong_sign_and_wrong_zeros_are_found_on_each() {
    let rig = three_wheels();
    let found = |spoil: &dyn Fn(&mut SimulatedConfig), slipped: &[(usize, f64)]| {
        let rig = RigConfig { rig, ..RigConfig::prototype() };
        let mut simulated = simulated_as(&rig, spoil);
        simulated.set_hand(Some(Hand { amplitude: 0.8, rate: 0.4, ..Hand::default() }));
        for (joint, angle) in slipped {
            simulated.inject(InjectedFault::Slipped { joint: *joint, angle: *angle });
        }
        watched(&mut on_rig(&rig, Memory::new(simulated, mpsc::channel().1)))
    };
    let good = found(&|_| (), &[]);
    assert!(good.known && good.before < 0.01 && good.wheels.len() == 3, "{good:?}");
    for joint in 0..6 {
        let found = found(&|config| config.joints[joint].reversed = true, &[]);
        let flipped: Vec<bool> = found.wheels.iter().flat_map(|wheel| wheel.wrong_sign).collect();
        assert_eq!(flipped, std::array::from_fn::<_, 6, _>(|j| j == joint), "{found:?}");
        assert!(found.known && found.before > 0.05 && found.after < 0.01, "{found:?}");
    }
    // Two wheels at once: with three wheels there is enough information to tell them apart.
    let found = found(&|_| (), &[(0, 0.4), (4, -0.7)]);
    for (wheel, angle) in [(0, 0.4), (1, 0.0), (2, -0.7)] {
        // The encoder reads `angle` more than the true angle. The tolerance is that of two wheels.
        assert!((found.wheels[wheel].zero + angle).abs() < 5e-3, "{wheel}: {found:?}");
        assert_eq!(found.wheels[wheel].wrong_sign, [false; 2]);
    }
}

#[test]
fn a_sphere_that_nobody_turns_tells_nothing() {
    let rig = RigConfig::prototype().rig;
    assert_eq!(calibrate(&rig, &[[5; MAX_JOINTS]; 100]), None);
}
