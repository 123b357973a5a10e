//! Tests with serial ports that disappear and come back, on pseudo-terminals.

use std::path::Path;
use std::time::{Duration, Instant};

use hbot_sim::controller::InjectedFault;
use hbot_sim::pty::{PtyOptions, PtyRig, spawn_pty};
use hbot_sim::rig::SimulatedRig;
use hbot_testing::patience::{self, PATIENCE};
use hbot_testing::prototype::{patient, simulated_as};

use super::*;
use crate::line::serial::{Peer, Serial};

/// Starts a simulated rig behind a pseudo-terminal. `link` becomes a symbolic link to the terminal,
/// as udev creates one for a USB device.
fn plug(rig: SimulatedRig, link: &Path) -> PtyRig {
    let pty = spawn_pty(rig, PtyOptions::default()).expect("a pseudo-terminal");
    // The link does not exist yet, or leads nowhere.
    let _ = std::fs::remove_file(link);
    std::os::unix::fs::symlink(pty.path(), link).expect("a link");
    pty
}

/// Removes the pseudo-terminal of a simulated rig, as if its cable were pulled out, and returns the
/// rig. Removes `link` as well, so that the port of another test cannot be found through it.
fn unplug(pty: PtyRig, link: &Path) -> SimulatedRig {
    std::fs::remove_file(link).expect("a link");
    pty.stop().expect("it ran")
}

/// Returns a simulated rig in the mode `active`, behind the pseudo-terminal `link`. Its line is
/// reopened if it is lost.
fn plugged(link: &Path) -> (TickBench, PtyRig) {
    plugged_in(patient(), link)
}

fn plugged_in(rig: RigConfig, link: &Path) -> (TickBench, PtyRig) {
    let pty = plug(simulated_as(&rig, |_| ()), link);
    let port = link.to_str().expect("UTF-8");
    let layout = Layout::single(0..4);
    let mut line = Serial::open(port, rig.link.baud).expect("it opens");
    let expected = Expected::new(port, &rig.rig, &layout, 0);
    HbotLink.meet(&mut line, &expected).expect("it answers");
    let peer = Peer { protocol: &HbotLink, expected };
    line.keep_open(port, rig.link.baud, peer, None).expect("a thread");
    let mut bench = bench(&rig, vec![line], &layout);
    until(&mut bench, "idle", |sample| sample.state.mode == Mode::Idle);
    bench.order(Order::Enable);
    until(&mut bench, "active", |sample| sample.state.mode == Mode::Active);
    (bench, pty)
}

fn until(bench: &mut TickBench, what: &str, found: impl Fn(&Sample) -> bool) -> Sample {
    patience::until(what, || {
        let sample = bench.tick();
        // A busy machine can delay an answer. More time is allowed then, so that the line does not
        // count as silent.
        if !sample.state.fresh {
            std::thread::sleep(Duration::from_millis(10));
        }
        found(&sample).then_some(sample)
    })
}

/// Runs ticks, without waiting for answers that cannot come, until the link counts as lost.
fn until_lost(bench: &mut TickBench) -> Sample {
    patience::until("lost", || Some(bench.tick()).filter(|sample| sample.state.mode == Mode::Fault))
}

#[test]
fn a_line_that_vanishes_is_a_lost_link_and_comes_back_without_torque() {
    let folder = tempfile::tempdir().expect("a folder");
    let link = folder.path().join("hbot");
    let (mut bench, pty) = plugged(&link);
    // The cable is cut. The controllers keep their power and their zeros.
    let rig = unplug(pty, &link);
    let lost = until_lost(&mut bench);
    assert_eq!(lost.state.cause, Some(Cause::LinkLost));
    assert!(lost.counters.send_failures > 0);
    assert_eq!(bench.order(Order::Reset).state.mode, Mode::Fault, "not while it is away");
    let pty = plug(rig, &link);
    let back = until(&mut bench, "back", |sample| sample.counters.reopened == 1);
    assert_eq!(back.state.cause, Some(Cause::LinkLost), "still, until somebody resets it");
    until(&mut bench, "readings", |sample| sample.state.fresh);
    assert_eq!(bench.ticks(10).state.mode, Mode::Fault);
    assert_eq!(pty.call(|rig| *rig.joint_torque()).expect("it runs"), [0.0; 16]);
    bench.order(Order::Reset);
    until(&mut bench, "idle: the zeros are those of before", |sample| sample.state.mode == Mode::Idle);
    bench.order(Order::Enable);
    until(&mut bench, "active", |sample| sample.state.mode == Mode::Active);
}

#[test]
fn controllers_that_lost_power_while_away_come_back_without_zeros() {
    let folder = tempfile::tempdir().expect("a folder");
    let link = folder.path().join("hbot");
    let (mut bench, pty) = plugged(&link);
    let mut rig = unplug(pty, &link);
    rig.inject(InjectedFault::Reboot);
    until_lost(&mut bench);
    let _pty = plug(rig, &link);
    until(&mut bench, "back", |sample| sample.counters.reopened == 1);
    until(&mut bench, "readings", |sample| sample.state.fresh);
    // The zero `assume` is accepted only once.
    bench.order(Order::Reset);
    let state = until(&mut bench, "reset", |sample| sample.state.mode != Mode::Fault).state;
    assert_eq!(state.mode, Mode::Unreferenced);
    assert_eq!(bench.order(Order::Enable).state.mode, Mode::Unreferenced);
}

#[test]
fn other_controllers_on_a_line_that_is_back_are_not_let_in() {
    let folder = tempfile::tempdir().expect("a folder");
    let link = folder.path().join("hbot");
    let (mut bench, pty) = plugged(&link);
    drop(unplug(pty, &link));
    let other = simulated_as(&RigConfig::prototype(), |config| config.joints[2].counts_per_turn += 4);
    let other = plug(other, &link);
    let asked = Instant::now();
    while asked.elapsed() < Duration::from_secs(2) {
        assert_eq!(bench.tick().counters.reopened, 0);
        // Nothing is to happen in these 2 s, so there is no condition to wait for.
        std::thread::sleep(Duration::from_millis(5));
    }
    drop(other);
}

#[test]
fn a_line_that_takes_no_bytes_costs_no_allocation() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut bench, pty) = plugged(&folder.path().join("hbot"));
    let (go, wait) = std::sync::mpsc::channel::<()>();
    pty.post(move |_| _ = wait.recv()).expect("it runs");
    let deadline = Instant::now() + PATIENCE;
    let mut full = 0;
    // The terminal's buffers fill up, and then every write finds no room.
    while full < 1000 {
        assert!(Instant::now() < deadline, "{full} writes without room");
        let before = bench.engine.counters().send_failures;
        let moment = on_time(bench.tick);
        let info = allocation_counter::measure(|| bench.engine.tick(&moment));
        assert_eq!((info.count_total, info.count_current), (0, 0));
        bench.tick += 1;
        full += u32::from(bench.engine.counters().send_failures > before);
        while bench.end.try_sample().is_some() {}
    }
    drop(go);
}
