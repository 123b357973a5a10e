//! The simulated motor controllers as a host sees them, through bytes.

use core::f64::consts::TAU;

use hbot_link::{
    Command, ControllerFlags, Decoder, Description, Feedback, JointFlags, MAX_COMMAND_FRAME, encode,
};
use hbot_sim::controller::EncoderKind;

use crate::prelude::*;

pub(crate) const MS: u64 = 1_000_000;

pub(crate) fn frame(message: &ToController) -> Vec<u8> {
    let mut buffer = [0; MAX_COMMAND_FRAME];
    let length = encode(message, &mut buffer).unwrap();
    buffer[..length].to_vec()
}

pub(crate) fn command(sequence: u32, enable: bool, torque: &[f32]) -> Command {
    Command { sequence, enable, watchdog_ms: 20, torque: torque.iter().copied().collect() }
}

pub(crate) fn messages(bytes: &[u8]) -> Vec<FromController> {
    let mut all = Vec::new();
    Decoder::default().feed(bytes, |result| all.push(result.unwrap()));
    all
}

/// A host whose line leads to a simulated rig.
struct Host {
    rig: SimulatedRig,
}

impl Host {
    fn new(config: &SimulatedConfig) -> Self {
        Self { rig: SimulatedRig::new(config).unwrap() }
    }

    fn described(config: &SimulatedConfig) -> Self {
        let mut host = Self::new(config);
        host.describe(0).unwrap();
        host
    }

    fn send(&mut self, now_ns: u64, message: &ToController) -> Option<FromController> {
        let mut reply = Vec::new();
        self.rig.receive(now_ns, &frame(message), &mut reply);
        let mut answers = messages(&reply);
        assert!(answers.len() <= 1);
        answers.pop()
    }

    fn describe(&mut self, now_ns: u64) -> Option<Description> {
        match self.send(now_ns, &ToController::Describe)? {
            FromController::Description(description) => Some(description),
            FromController::Feedback(feedback) => panic!("{feedback:?}"),
        }
    }

    fn command(&mut self, now_ns: u64, enable: bool, torque: &[f32]) -> Option<Feedback> {
        match self.send(now_ns, &ToController::Command(command(7, enable, torque)))? {
            FromController::Feedback(feedback) => Some(feedback),
            FromController::Description(description) => panic!("{description:?}"),
        }
    }
}

fn prototype() -> SimulatedConfig {
    SimulatedConfig::new(&rig())
}

#[test]
fn torque_acts_in_the_controller_s_sense_up_to_the_peak() {
    let mut host = Host::described(&prototype());
    let feedback = host.command(0, true, &[0.5, 0.1, -2.0, -0.2]).unwrap();
    let none = JointFlags::empty();
    assert!(feedback.flags.contains(ControllerFlags::ENABLED));
    let flags: Vec<_> = feedback.joints.iter().map(|j| j.flags).collect();
    assert_eq!(flags, [none, none, JointFlags::OVERCURRENT, JointFlags::OVERCURRENT]);
    // Drives are reversed: a torque towards greater counts turns the joint in its negative sense.
    let wanted = [0.5, f64::from(-0.1f32), f64::from(-0.93f32), f64::from(0.14f32)];
    assert_eq!(host.rig.joint_torque()[..4], wanted);
    // Exactly the peak, as the line carries it, is no overcurrent.
    let feedback = host.command(MS, true, &[0.93, 0.0, 0.0, 0.0]).unwrap();
    assert_eq!(feedback.joints[0].flags, none);
    // While disabled there is no torque, whatever the command asks for.
    let feedback = host.command(2 * MS, false, &[9.0; 4]).unwrap();
    assert_eq!((feedback.flags, feedback.joints[0].flags), (ControllerFlags::empty(), none));
    assert_eq!(host.rig.joint_torque(), &[0.0; 16]);
}

#[test]
fn counts_are_the_floor_of_the_angle_with_gear_and_sign_and_wrap() {
    let mut host = Host::new(&prototype());
    let (cpt, geared) = (16384.0 / TAU, -17.0 * 16384.0 / TAU);
    for (steer, drive) in [(0.3, 0.2), (-0.3, -1e-9), (1.0, 1e5), (-4.0, -1e6), (1e3, 3e5)] {
        let state = PlantState { steer: [steer; 8], drive: [drive; 8], ..PlantState::default() };
        host.rig.set_state(state);
        let feedback = host.command(0, false, &[0.0; 4]).unwrap();
        let wrapped = |exact: f64| (exact.floor() as i64).rem_euclid(1 << 32) as u32 as i32;
        assert_eq!(feedback.joints[0].count, wrapped(steer * cpt));
        assert_eq!(feedback.joints[1].count, wrapped(drive * geared), "{drive}");
    }
    // Rates are those of the joints, with the motor controller's sign.
    let state = crate::devices::brisk();
    host.rig.set_state(state);
    let rates = host.rig.joint_rates();
    let feedback = host.command(0, false, &[0.0; 4]).unwrap();
    let told: Vec<_> = feedback.joints.iter().map(|j| j.rate).collect();
    assert_eq!(told, [rates[0] as f32, -rates[1] as f32, rates[2] as f32, -rates[3] as f32]);
    assert!(feedback.joints.iter().all(|j| j.temperature == 25.0 && j.current == 0.0));
}

#[test]
fn a_silent_host_loses_its_torque_at_the_watchdog_s_time_until_it_disables() {
    let mut host = Host::described(&prototype());
    host.command(5 * MS, true, &[0.0, 0.1, 0.0, 0.1]).unwrap();
    host.rig.advance_to(25 * MS - 1);
    assert!(host.rig.joint_torque()[1] != 0.0);
    let held = host.rig.clone();
    host.rig.advance_to(25 * MS);
    assert_eq!(host.rig.joint_torque(), &[0.0; 16]);
    // Torque stops exactly at the watchdog's time, even if the rig is advanced later. Energy is
    // constant from then on.
    let mut late = held.clone();
    late.advance_to(60 * MS);
    let energy = |rig: &SimulatedRig| rig.dynamics().energy(rig.state());
    assert!(
        (energy(&late) / energy(&host.rig) - 1.0).abs() < 1e-6,
        "{} {}",
        energy(&late),
        energy(&host.rig)
    );

    for at in [60, 61, 62] {
        let feedback = host.command(at * MS, true, &[0.0, 0.1, 0.0, 0.1]).unwrap();
        assert_eq!(feedback.flags, ControllerFlags::WATCHDOG_EXPIRED);
        assert_eq!(host.rig.joint_torque(), &[0.0; 16]);
    }
    assert_eq!(host.command(63 * MS, false, &[0.0; 4]).unwrap().flags, ControllerFlags::empty());
    let feedback = host.command(64 * MS, true, &[0.0, 0.1, 0.0, 0.1]).unwrap();
    assert_eq!(feedback.flags, ControllerFlags::ENABLED);
}

#[test]
fn faults_show_and_end() {
    let mut host = Host::new(&prototype());
    let torque = [0.0, 0.1, 0.0, 0.1];
    host.describe(0).unwrap();
    host.rig.inject(InjectedFault::Failed(true));
    assert_eq!(host.command(0, true, &torque).unwrap().flags, ControllerFlags::FAULT);
    assert_eq!(host.rig.joint_torque(), &[0.0; 16]);
    host.rig.inject(InjectedFault::Failed(false));
    // The fault is reported until the host has switched the motors off.
    assert_eq!(host.command(0, true, &torque).unwrap().flags, ControllerFlags::FAULT);
    assert_eq!(host.command(0, false, &torque).unwrap().flags, ControllerFlags::empty());
    host.rig.inject(InjectedFault::Hot { joint: 3, on: true });
    let feedback = host.command(0, true, &torque).unwrap();
    assert_eq!(
        (feedback.flags, feedback.joints[3].flags),
        (ControllerFlags::ENABLED, JointFlags::OVERTEMPERATURE)
    );

    host.rig.inject(InjectedFault::Mute(true));
    assert_eq!(host.command(10 * MS, true, &torque), None);
    host.rig.advance_to(25 * MS);
    assert!(host.rig.joint_torque()[1] != 0.0, "what a mute controller hears feeds its watchdog");
    host.rig.inject(InjectedFault::Mute(false));
    host.rig.inject(InjectedFault::Deaf(true));
    assert_eq!(host.command(26 * MS, true, &torque), None);
    assert_eq!(host.describe(26 * MS), None);
    host.rig.advance_to(30 * MS);
    assert_eq!(host.rig.joint_torque(), &[0.0; 16]);

    host.rig.inject(InjectedFault::Deaf(false));
    host.rig.set_state(PlantState::default());
    host.rig.inject(InjectedFault::Slipped { joint: 0, angle: TAU / 4.0 });
    assert_eq!(host.command(31 * MS, false, &torque).unwrap().joints[0].count, 4096);
}

/// After a reboot the counts of absolute encoders stay, those of incremental encoders restart at
/// zero, and those of indexed encoders become correct when the index mark is passed.
#[test]
fn counts_after_a_reboot() {
    let mut config = prototype();
    config.joints[2].encoder = EncoderKind::Indexed;
    let mut host = Host::new(&config);
    let at =
        |steer: f64, drive: f64| PlantState { steer: [steer; 8], drive: [drive; 8], ..PlantState::default() };
    host.rig.set_state(at(0.5, 0.25));
    let counts = |host: &mut Host| {
        let feedback = host.command(0, false, &[0.0; 4]).unwrap();
        let indexed = feedback.joints[2].flags.contains(JointFlags::INDEX_SEEN);
        (feedback.joints[0].count, feedback.joints[1].count, feedback.joints[2].count, indexed)
    };
    let count = |angle: f64, gear: f64| (angle * gear * 16384.0 / TAU).floor() as i32;
    assert_eq!(counts(&mut host), (count(0.5, 1.0), count(0.25, -17.0), count(0.5, 1.0), false));
    host.rig.inject(InjectedFault::Reboot);
    assert_eq!(counts(&mut host), (count(0.5, 1.0), 0, 0, false));
    host.rig.set_state(at(-0.1, 0.35));
    assert_eq!(counts(&mut host), (count(-0.1, 1.0), count(0.35 - 0.25, -17.0), count(-0.1, 1.0), true));
}
