//! Tests of opening a serial port, on pseudo-terminals: its settings, ports that are in use or must
//! not be opened, and a helper process that does not start.

use std::os::unix::net::UnixStream;
use std::process::Command;
use std::sync::mpsc;

use hbot_config::RigConfig;
use hbot_sim::pty::{PtyOptions, PtyRig, spawn_pty};
use hbot_testing::far::open_plainly;
use hbot_testing::patience::{eventually, until};
use hbot_testing::prototype::simulated;
use rustix::termios::{ControlModes, OptionalActions, tcgetattr, tcsetattr};

use super::*;
use crate::rig::attach;
use crate::rig::layout::Layout;

const BAUD: u32 = 115_200;

pub(super) fn port() -> (PtyRig, String) {
    let pty = spawn_pty(simulated(), PtyOptions::default()).expect("this test needs pseudo-terminals");
    let path = pty.path().to_str().expect("UTF-8").to_owned();
    (pty, path)
}

/// Another program can leave a port with settings that the link does not have. Of these settings, a
/// pseudo-terminal keeps two stop bits, flow control, and attention to the modem's lines.
#[test]
fn a_port_is_opened_with_the_settings_of_the_link_whatever_it_had() {
    let (_pty, path) = port();
    let other = open_plainly(&path);
    let mut settings = tcgetattr(&other).expect("a terminal");
    settings.control_modes |= ControlModes::CSTOPB | ControlModes::CRTSCTS;
    settings.control_modes -= ControlModes::CLOCAL;
    tcsetattr(&other, OptionalActions::Now, &settings).expect("a terminal");
    let before = tcgetattr(&other).expect("a terminal").control_modes;
    assert!(before.contains(ControlModes::CSTOPB | ControlModes::CRTSCTS), "{before:?}");
    assert!(!before.contains(ControlModes::CLOCAL), "{before:?}");

    let _line = Serial::open(&path, BAUD).expect("it opens");
    let settings = tcgetattr(&other).expect("a terminal");
    let modes = settings.control_modes;
    assert!(modes.contains(ControlModes::CREAD | ControlModes::CLOCAL | ControlModes::CS8), "{modes:?}");
    let unwanted = ControlModes::CSTOPB | ControlModes::PARENB | ControlModes::CRTSCTS;
    assert!(!modes.intersects(unwanted), "{modes:?}");
    assert_eq!(settings.output_speed(), BAUD);
}

/// A read of a silent line returns at once, bytes can be written, and a program that is started
/// later does not get the port.
#[test]
fn an_open_port_never_waits_and_no_other_program_inherits_it() {
    let (pty, path) = port();
    let mut line = Serial::open(&path, BAUD).expect("it opens");
    let flags = rustix::fs::fcntl_getfl(&line.port.as_ref().expect("it is open").line).expect("its flags");
    // Without this flag, the read below would never return.
    assert!(flags.contains(OFlags::NONBLOCK), "{flags:?}");
    assert_eq!(line.read(0, &mut [0; 16]).expect("it is open"), 0);
    // Two zeros and a byte: an empty frame, and a frame that is refused.
    assert_eq!(line.write(0, &[0, 1, 0]).expect("it is open"), 3);
    eventually("a frame is refused", || pty.call(|rig| rig.refused_frames()).expect("it runs") > 0);
    let listed = Command::new("/bin/sh").args(["-c", "ls -l /proc/self/fd"]).output().expect("a shell");
    let listed = String::from_utf8(listed.stdout).expect("UTF-8");
    assert!(listed.contains(" -> "), "no list of open files: {listed}");
    assert!(!listed.lines().any(|file| file.ends_with(&format!(" {path}"))), "{listed}");
}

/// The helper process of a killed server has the port open for a short time. A port that stays in
/// use is refused after half a second. This test takes that time because time is its subject.
#[test]
fn a_port_that_stays_in_use_is_refused_after_half_a_second() {
    let (_pty, path) = port();
    let first = Serial::open(&path, BAUD).expect("it opens");
    let begun = Instant::now();
    let refused = Serial::open(&path, BAUD).expect_err("it is in use").to_string();
    assert!(begun.elapsed() >= Duration::from_millis(500), "after {:?}", begun.elapsed());
    assert!(refused.contains("another program has it open"), "{refused}");
    drop(first);
    until("the port is free", || Serial::open(&path, BAUD).ok());
}

/// Opens the port while it is in use, for 60 ms if this machine is not busy. Returns whether it
/// opened.
fn opens_while_another_leaves(path: &str) -> bool {
    let first = until("the port is free", || Serial::open(path, BAUD).ok());
    let (begin, begun) = mpsc::channel();
    let other = std::thread::spawn(move || {
        begun.recv().expect("this test begins");
        std::thread::sleep(Duration::from_millis(60));
        drop(first);
    });
    begin.send(()).expect("the thread waits");
    let opened = Serial::open(path, BAUD).is_ok();
    other.join().expect("no panic");
    opened
}

/// The attempts are several, because a busy machine can hold up the thread that has the port open.
#[test]
fn a_port_that_another_program_closes_soon_is_opened_at_the_first_attempt() {
    let (_pty, path) = port();
    assert!((0..10).any(|_| opens_while_another_leaves(&path)));
}

/// This file must not be written, not even by root. It stands for a port of a group to which the
/// user does not belong.
#[test]
fn a_port_without_the_right_to_it_is_refused_with_how_to_get_the_right() {
    let file = "/proc/sys/kernel/ostype";
    assert!(std::path::Path::new(file).exists(), "this test needs {file}");
    let refused = Serial::open(file, BAUD).expect_err("it is read-only").to_string();
    assert!(refused.contains("ermission denied (os error 13) (`hbot doctor`"), "{refused}");
}

/// The rig is used all the same, because the controllers' own watchdogs remain.
#[test]
fn a_helper_that_does_not_start_is_a_notice_with_the_port_and_the_reason() {
    let (_pty, path) = port();
    let (rig, layout) = (RigConfig::prototype(), Layout::single(0..4));
    let mut notices = Vec::new();
    let helper = Program::shell("echo hello >&2; cat >/dev/null");
    let devices = std::slice::from_ref(&path);
    let met = attach::serial(&rig, devices, &layout, Some(&helper), false, &mut notices);
    assert_eq!(met.expect("the simulated rig answers").len(), 1);
    let [notice] = &notices[..] else { panic!("{notices:?}") };
    for words in [path.as_str(), "no helper process", "does not answer as it should", "watchdog alone"] {
        assert!(notice.contains(words), "{words:?} in {notice:?}");
    }
}

/// Outside the loop, drivers count the pauses of a line to know how long they have waited.
#[test]
fn a_pause_on_a_real_line_lasts_a_millisecond() {
    let (near, _far) = UnixStream::pair().expect("a pair of sockets");
    let mut line = Serial::of(near.into());
    let begun = Instant::now();
    (0..20).for_each(|_| line.pause());
    assert!(begun.elapsed() >= Duration::from_millis(20), "{:?}", begun.elapsed());
}

#[test]
fn what_is_no_port_is_told_in_words() {
    for (path, reason) in [("/dev/null", "it is no serial port"), ("/dev/simm", "it does not exist")] {
        let Err(error) = Serial::open(path, BAUD) else { panic!("{path} is open") };
        let error = error.to_string();
        assert!(error.starts_with(&format!("cannot open serial port {path}: {reason}\n")), "{error}");
    }
}
