//! Tests of the proof that watchdogs switch motors off.

use std::sync::mpsc::channel;

use hbot_host::bus::Protocol as _;
use hbot_host::bus::drivers::odrive::Odrive;
use hbot_host::line::{Line as _, SimulatorCall};
use hbot_sim::controller::InjectedFault;
use hbot_sim::rig::SimulatedRig;

use super::{Bench, Lossy, good, line, link, refusal, set};

/// Axes whose watchdogs are too short switch their motors off between two commands.
#[test]
fn watchdogs_that_expire_although_they_are_fed_are_refused() {
    for axes in [2..3, 0..4] {
        let first = axes.start;
        let said = refusal(|rig| axes.for_each(|joint| set(rig, joint, "config.watchdog_timeout", 0.001)));
        let words = "its watchdog expires although it is fed every 2 ms";
        assert!(said.contains(words) && said.contains(&format!("ODrive {first} ")), "{said}");
    }
}

/// What the watchdog of firmware 0.6 could do otherwise than that of 0.5.6.
const ONLY_ARMED: &str = "watchdog counts only while armed";
const ONLY_INPUTS: &str = "only Set_Input_* feeds the watchdog";

/// Each axis is accepted, and its firmware says by which proof.
#[test]
fn watchdogs_that_count_only_while_motors_are_on_are_proved_with_motors_on() {
    for (only_armed, only_inputs) in [(false, true), (true, false), (true, true)] {
        let (mut line, _, expected) = line(|rig| {
            for joint in 0..4 {
                // The second axis differs from the others.
                set(rig, joint, ONLY_ARMED, f64::from(only_armed && joint != 1));
                set(rig, joint, ONLY_INPUTS, f64::from(only_inputs));
            }
        });
        for _ in 0..2 {
            Odrive.meet(&mut line, &expected).unwrap_or_else(|e| panic!("{only_armed} {only_inputs}: {e}"));
            for at in 0..4 {
                let proof = if only_armed && at != 1 { "armed at zero torque" } else { "idle" };
                let name = format!("ODrive 0.6.10, watchdog seen to expire {proof}");
                assert_eq!(expected.firmware(at), Some(name), "{only_armed} {only_inputs}");
            }
        }
    }
}

/// The proof with motors on fails like the one with motors off, and leaves the motors off.
#[test]
fn watchdogs_that_do_not_switch_a_motor_off_in_time_are_refused() {
    for (name, value) in [("config.enable_watchdog", 0.0), ("config.watchdog_timeout", 0.5)] {
        let (mut line, calls, expected) = line(|rig| {
            (0..4).for_each(|joint| set(rig, joint, ONLY_ARMED, 1.0));
            set(rig, 2, name, value);
        });
        let said = Odrive.meet(&mut line, &expected).expect_err("it does not expire").to_string();
        let words = "ODrive 2 (wheel[1].steer): left alone for 140 ms it does not say that its watchdog has expired, \
                     neither idle nor with its motor on at zero torque";
        assert!(said.contains(words) && said.contains("enable_watchdog = True"), "{name}: {said}");
        let (tell, told) = channel();
        let call: SimulatorCall = Box::new(move |rig| tell.send(states(rig)).expect("the test waits"));
        calls.send(call).expect("the line is there");
        let mut buffer = [0; 4096];
        line.read(10_000_000_000, &mut buffer).expect("a line in memory");
        line.write(10_000_000_000, b"\r").expect("a line in memory");
        assert_eq!(told.recv().expect("the states"), "1111", "{name}");
    }
    // An axis that fails does not switch its motor on.
    let said = refusal(|rig| {
        (0..4).for_each(|joint| set(rig, joint, ONLY_ARMED, 1.0));
        rig.inject(InjectedFault::FailedOne { joint: 3, on: true });
    });
    let words = "ODrive 3 (wheel[1].drive): left alone for 140 ms it does not say that its watchdog has expired, and it \
                 does not switch its motor on to show it at zero torque (errors 0x20)";
    assert!(said.contains(words), "{said}");
}

/// Returns the state of each axis, as a digit.
fn states(rig: &mut SimulatedRig) -> String {
    let mut reply = Vec::new();
    // The heartbeats of the next 100 ms.
    rig.receive(10_100_000_000, b"", &mut reply);
    let text = String::from_utf8(reply).expect("text");
    let state = |id: u32| {
        let start = format!("t{:03X}8", id << 5 | 1);
        let last = text.split('\r').rfind(|line| line.starts_with(&start));
        last.map_or('?', |line| line.as_bytes()[14] as char)
    };
    (0..4).map(state).collect()
}

/// In no proof does a torque other than zero reach the line, and torque mode comes before each
/// motor goes on.
#[test]
fn a_watchdog_is_proved_without_torque() {
    for lost in [None, Some("t04B8"), Some("t04E8")] {
        let (line, _calls, expected) = line(|rig| (0..4).for_each(|joint| set(rig, joint, ONLY_ARMED, 1.0)));
        let (mut on, mut mode, mut left) = (0, [false; 4], 3);
        let (tell, told) = channel();
        let loses = move |text: &str| {
            let Some(Ok(id)) = text.get(1..4).map(|id| usize::from_str_radix(id, 16)) else { return false };
            let rest = &text[1..];
            let (axis, message) = (id >> 5, id & 0x1f);
            let command = text.starts_with('t');
            if command && message == 0x0e {
                assert_eq!(&rest[4..12], "00000000", "{text}");
            }
            if command && message == 0x0b {
                assert_eq!(&rest[4..20], "0100000001000000", "{text}");
                mode[axis] = true;
            }
            if command && message == 0x07 && &rest[4..6] == "08" {
                assert!(mode[axis], "{text}");
                on += 1;
                tell.send(on).expect("the test waits");
            }
            let hit = lost.is_some_and(|lost| text.starts_with(lost)) && left > 0;
            left -= i32::from(hit);
            hit
        };
        Odrive.meet(&mut Lossy { line, loses }, &expected).unwrap_or_else(|e| panic!("{lost:?}: {e}"));
        assert!(told.try_iter().count() >= 4, "each motor was on");
    }
}

/// The watchdogs expire at 125 ms. The driver clears their errors at 150 ms. For 30 ms more,
/// heartbeats from before then arrive. They prove nothing. After the clearing, the next expired
/// watchdog is reported after more than 125 + 30 ms, which is too late.
#[test]
fn heartbeats_from_before_the_clearing_of_errors_do_not_show_that_a_watchdog_works() {
    let said = refusal(|rig| {
        (0..4).for_each(|joint| set(rig, joint, "config.watchdog_timeout", 0.125));
        rig.set_link(link(0.03));
    });
    let words = "left alone for 140 ms it does not say that its watchdog has expired";
    assert!(said.contains(words), "{said}");
}

/// The watchdog of an axis that restarts is proved as it was at bring-up: with the motor on, at
/// zero torque, while the motors are commanded off.
#[test]
fn an_axis_that_restarts_proves_its_watchdog_with_its_motor_on_if_it_did_so_before() {
    let only_armed = |rig: &mut SimulatedRig| (0..4).for_each(|joint| set(rig, joint, ONLY_ARMED, 1.0));
    let mut bench = Bench::with(only_armed);
    bench.torque[..4].copy_from_slice(&[0.02, -0.034, -0.01, 0.017]);
    bench.until(true, "on", good);
    bench.inject(InjectedFault::RebootOne(2));
    bench.until(true, "a restart is seen", |heard| heard.zeros_lost);
    // As long as the motors are commanded on, this one stays off.
    for _ in 0..500 {
        assert!(bench.tick(true).zeros_lost);
    }
    let (tell, told) = channel();
    let call: SimulatorCall = Box::new(move |rig| tell.send(rig.joint_torque()[2]).expect("heard"));
    bench.calls.send(call).expect("the line is there");
    bench.tick(true);
    assert_eq!(told.recv(), Ok(0.0));
    let mut pushed = 0.0_f64;
    for _ in 0..600 {
        let heard = bench.tick(false);
        assert!(!heard.complaints.disobeyed, "{heard:?}");
        let (tell, told) = channel();
        let call: SimulatorCall = Box::new(move |rig| tell.send(rig.joint_torque()[2]).expect("heard"));
        bench.calls.send(call).expect("the line is there");
        bench.tick(false);
        pushed = pushed.max(told.recv().expect("the torque").abs());
    }
    assert_eq!(pushed, 0.0, "N m, while its watchdog is proved");
    bench.until(false, "it is met again", good);
    // An axis whose watchdog is off stays untrusted, and its motor does not stay on.
    let call: SimulatorCall = Box::new(|rig| set(rig, 2, "config.enable_watchdog", 0.0));
    bench.calls.send(call).expect("the line is there");
    bench.inject(InjectedFault::RebootOne(2));
    bench.until(false, "a restart is seen", |heard| heard.zeros_lost);
    let mut disobeyed = 0;
    for _ in 0..1500 {
        let heard = bench.tick(false);
        assert!(heard.zeros_lost, "{heard:?}");
        disobeyed += u32::from(heard.complaints.disobeyed);
    }
    // Its motor is commanded off when the time is over. The heartbeat that says so comes within 10
    // ms.
    assert!((1..=12).contains(&disobeyed), "{disobeyed} ms");
}
