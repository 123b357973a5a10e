//! The simulated rig behind a pseudo-terminal, in wall time.

use std::fs::File;
use std::io::{Read, Write};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use hbot_link::{ControllerFlags, Decoder, Feedback};
use hbot_sim::phenomena::Link;
use hbot_sim::pty::{PtyOptions, PtyRig, spawn_pty};
use hbot_sim::served::ServeError;
use hbot_testing::patience::{PATIENCE, eventually};

use rustix::event::{PollFd, PollFlags, poll};

use crate::prelude::*;

fn spawn() -> PtyRig {
    let rig = SimulatedRig::new(&SimulatedConfig::new(&rig())).unwrap();
    spawn_pty(rig, PtyOptions::default()).unwrap()
}

/// The host's end of the line: the pseudo-terminal, opened like any serial port.
struct Port {
    file: File,
    decoder: Decoder<FromController>,
}

impl Port {
    fn open(rig: &PtyRig) -> Self {
        let file = File::options().read(true).write(true).open(rig.path()).unwrap();
        Self { file, decoder: Decoder::default() }
    }

    /// Returns the next message from the rig, or `None` if none arrives within the given time.
    fn next(&mut self, within: Duration) -> Option<FromController> {
        let mut answer = None;
        while answer.is_none() {
            let mut fds = [PollFd::new(&self.file, PollFlags::IN)];
            if poll(&mut fds, Some(&within.try_into().unwrap())).unwrap() == 0 {
                return None;
            }
            let mut buffer = [0; 512];
            let count = self.file.read(&mut buffer).unwrap();
            self.decoder.feed(&buffer[..count], |result| assert_eq!(answer.replace(result.unwrap()), None));
        }
        answer
    }

    fn ask(&mut self, message: &ToController) -> FromController {
        self.file.write_all(&frame(message)).unwrap();
        self.next(PATIENCE).unwrap()
    }

    fn command(&mut self, sequence: u32, enable: bool, torque: f32) -> Feedback {
        match self.ask(&ToController::Command(command(sequence, enable, &[0.0, torque, 0.0, torque]))) {
            FromController::Feedback(feedback) => feedback,
            FromController::Description(description) => panic!("{description:?}"),
        }
    }
}

#[test]
fn a_host_describes_commands_and_reads() {
    let rig = spawn();
    let mut port = Port::open(&rig);
    let FromController::Description(description) = port.ask(&ToController::Describe) else { panic!() };
    assert_eq!(description.joints.len(), 4);
    for sequence in 0..200 {
        let feedback = port.command(sequence, true, 0.05);
        assert_eq!((feedback.sequence, feedback.joints.len()), (sequence, 4));
    }
    let moved = rig.call(|rig| rig.state().drive[0]).unwrap();
    assert!(moved < 0.0, "drives are reversed: {moved}");
    let rig = rig.stop().unwrap();
    assert_eq!(rig.refused_frames(), 0);
}

#[test]
fn the_watchdog_runs_in_wall_time_with_nobody_writing() {
    let rig = spawn();
    let mut port = Port::open(&rig);
    port.ask(&ToController::Describe);
    assert!(port.command(1, true, 0.1).flags.contains(ControllerFlags::ENABLED));
    let start = Instant::now();
    eventually("torque off", || rig.call(|rig| rig.joint_torque()[1] == 0.0).unwrap());
    assert!(start.elapsed() > Duration::from_millis(5), "not before its time");
    let flags = port.command(2, true, 0.1).flags;
    assert!(flags.contains(ControllerFlags::WATCHDOG_EXPIRED) && !flags.contains(ControllerFlags::ENABLED));
    assert!(!port.command(3, false, 0.1).flags.contains(ControllerFlags::WATCHDOG_EXPIRED));
    assert!(port.command(4, true, 0.1).flags.contains(ControllerFlags::ENABLED));
}

#[test]
fn the_hand_goes_on_with_nobody_writing() {
    let rig = spawn();
    rig.post(|rig| rig.set_hand(Some(Hand::default()))).unwrap();
    eventually("the hand turns the sphere", || rig.call(|rig| rig.state().omega.length()).unwrap() >= 0.01);
}

#[test]
fn a_port_is_closed_and_opened_again() {
    let rig = spawn();
    for sequence in 0..3 {
        let mut port = Port::open(&rig);
        assert_eq!(port.command(sequence, false, 0.0).sequence, sequence);
    }
}

#[test]
fn it_stops_at_once_and_its_start_can_be_seen() {
    let (sender, started) = channel();
    let options = PtyOptions {
        idle: Duration::from_secs(3600),
        on_start: Box::new(move || sender.send(std::thread::current().name().map(str::to_owned)).unwrap()),
    };
    let rig = SimulatedRig::new(&SimulatedConfig::new(&rig())).unwrap();
    let rig = spawn_pty(rig, options).unwrap();
    assert_eq!(started.recv_timeout(PATIENCE).unwrap().as_deref(), Some("hbot-sim"));
    rig.call(|rig| rig.set_external(Vec3::X)).unwrap();
    let start = Instant::now();
    rig.stop().unwrap();
    assert!(start.elapsed() < PATIENCE);
}

#[test]
fn a_panic_in_a_call_ends_the_thread_and_is_named() {
    let rig = spawn();
    let error = rig.call(|_| panic!("on purpose")).unwrap_err();
    assert!(matches!(error, ServeError::Stopped), "{error}");
    eventually("the thread has failed", || rig.failure().is_some());
    let told = rig.failure().unwrap().to_owned();
    assert!(told.ends_with("has panicked: on purpose"), "{told}");
    assert!(matches!(rig.stop(), Err(ServeError::Panicked(reason)) if reason == "on purpose"));
}

/// On a line with latency, an answer arrives when it is due and not before. The host writes nothing
/// meanwhile, and the rig's thread would otherwise sleep.
#[test]
fn a_late_answer_comes_by_itself() {
    let options = PtyOptions { idle: Duration::from_secs(3600), ..PtyOptions::default() };
    let rig = spawn_pty(SimulatedRig::new(&SimulatedConfig::new(&rig())).unwrap(), options).unwrap();
    let late =
        Link { latency_s: 0.05, command_latency_s: 0.05, jitter_s: 0.0, loss: 0.0, corrupt: 0.0, seed: 1 };
    rig.call(move |rig| rig.set_link(Some(late))).unwrap();
    let mut port = Port::open(&rig);
    let start = Instant::now();
    assert!(matches!(port.ask(&ToController::Describe), FromController::Description(_)));
    assert!(start.elapsed() >= Duration::from_millis(100), "{:?}", start.elapsed());
}
