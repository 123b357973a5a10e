//! `hbot rig test` and `hbot rig calibrate` are stopped while motors make torque: the last command
//! to the motor controllers is zero torque.

use hbot_testing::far::Far;
use std::os::unix::process::ExitStatusExt as _;
use std::process::{Child, Stdio};

use hbot_config::RigConfig;

use crate::process::*;

/// Number of attempts to stop a joint test while it makes torque. If the machine is busy for longer
/// than the watchdog time of the controllers, the test ends before it is stopped.
const ATTEMPTS: u32 = 50;

fn start(far: &Far, args: &[&str]) -> Child {
    hbot()
        .args(["rig"])
        .args(args)
        .args(["--port", &far.path])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the binary runs")
}

fn push(far: &Far) -> Child {
    // The torque is so small that the joint does not turn far enough to end the test.
    let child = start(far, &["test", "--joint", "1", "--torque", "0.00002"]);
    eventually("torque", || far.pushed());
    child
}

/// Sends `signal` while a joint test makes torque. Returns the signal that ended the program, and
/// its messages.
fn stopped_by(signal: Signal) -> (Option<i32>, String) {
    for _ in 0..ATTEMPTS {
        let far = Far::start(&RigConfig::prototype());
        let child = push(&far);
        // The program may have ended in the meantime.
        let _ = kill_process(Pid::from_child(&child), signal);
        let output = child.wait_with_output().expect("it ends");
        far.ends_still();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        if output.status.signal().is_some() {
            return (output.status.signal(), said);
        }
    }
    panic!("{signal:?} has not ended it in {ATTEMPTS} attempts");
}

#[test]
fn a_rig_test_that_is_stopped_leaves_zero_torque_on_the_line() {
    for signal in STOPPING {
        let (ended, said) = stopped_by(signal);
        // This tells a shell to end a loop that tests one joint after another.
        assert_eq!(ended, Some(Signal::INT.as_raw()), "{signal:?}: {said}");
        assert!(said.contains("stopped by a signal: motors are off"), "{said}");
    }
}

#[test]
fn a_rig_test_that_is_killed_leaves_zero_torque_on_the_line() {
    for signal in [Signal::KILL, Signal::ABORT] {
        let (ended, _) = stopped_by(signal);
        assert_eq!(ended, Some(signal.as_raw()));
    }
}

#[test]
fn a_rig_test_whose_reader_is_gone_leaves_zero_torque_on_the_line() {
    let far = Far::start(&RigConfig::prototype());
    let mut child = push(&far);
    (child.stdout, child.stderr) = (None, None);
    let _ = kill_process(Pid::from_child(&child), Signal::PIPE);
    child.wait().expect("it ends");
    far.ends_still();
}

#[test]
fn a_calibration_that_is_stopped_ends_with_motors_off() {
    for signal in STOPPING {
        let far = Far::start(&RigConfig::prototype());
        let child = start(&far, &["calibrate", "--seconds", "600"]);
        eventually("it begins", || far.count() >= 10);
        kill_process(Pid::from_child(&child), signal).expect("it is there");
        let output = child.wait_with_output().expect("it ends");
        assert_eq!(output.status.signal(), Some(Signal::INT.as_raw()), "{signal:?}");
        assert!(!far.any_after(0, |command| command.enable));
        far.ends_still();
    }
}
