//! Tests of the whole server with ODrives: a spring gives the torques that it gives over hbot's own
//! link, and the server's last word reaches every axis.

use hbot_config::RigConfig;
use hbot_config::rig::Protocol;
use hbot_sim::pty::{PtyOptions, PtyRig, spawn_pty};
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};
use rustix::process::Signal;

use crate::process::Process;
use crate::protocols::{PUSH, apart, felt};
use hbot_testing::lines::JsonLines;
use hbot_testing::patience::eventually;

const RIG: &str = include_str!("../../rigs/prototype-odrive.toml");
/// Error bit of an expired watchdog.
const WATCHDOG: u32 = 1 << 24;

#[test]
fn a_spring_feels_the_same_over_odrives_as_over_hbot_s_own_link() {
    let own = felt(Protocol::Hbot, Protocol::Odrive);
    let odrive = felt(Protocol::Odrive, Protocol::Odrive);
    for ticks in [&own, &odrive] {
        let active = ticks.iter().filter(|tick| tick.outputs.drive.enable).count();
        assert!(ticks.len() >= 5000 && active > 4900, "motors were on in {active} of {} ticks", ticks.len());
        let age = ticks[1000..].iter().filter_map(|tick| tick.inputs.feedback.map(|f| f.sequence));
        assert!(age.zip(1000_u32..).all(|(answers, tick)| answers.wrapping_add(1) == tick), "ages");
    }
    let (most, largest) = apart(&own, &odrive);
    assert!(largest > 0.01, "the spring pushes: {largest} N m");
    // A position is an f32. Its steps are 2^-18 turns for a motor behind a gear of 17, and 2^-22
    // turns without a gear.
    assert!(most < 3e-5, "{most} N m apart");
}

/// Starts simulated ODrives for `rig` behind a pseudo-terminal. Their watchdog time is 100 ms,
/// close to the longest that the driver accepts, so that the last word can arrive first.
fn axes(rig: &RigConfig) -> PtyRig {
    let config = SimulatedConfig { line: Protocol::Odrive.into(), ..SimulatedConfig::new(&rig.rig) };
    let mut simulated = SimulatedRig::new(&config).expect("it can be simulated");
    for joint in 0..4 {
        assert!(simulated.controllers_mut().set(joint, "config.watchdog_timeout", 0.1));
    }
    spawn_pty(simulated, PtyOptions::default()).expect("this test needs pseudo-terminals (/dev/ptmx)")
}

/// Returns whether any motor gives torque.
fn pushes(axes: &PtyRig) -> bool {
    let torque = axes.call(|rig| *rig.joint_torque()).expect("they are there");
    torque.iter().any(|torque| *torque != 0.0)
}

/// Returns the error bits that last switched axis `id` off; 0 if a command did. The question goes
/// directly to the simulated rig, so it does not disturb the server's line.
fn disarm_reason(axes: &PtyRig, id: u16) -> u32 {
    let reply = axes.call(move |rig| {
        let mut reply = Vec::new();
        rig.receive(0, format!("\rr{:03X}8\r", id << 5 | 3).as_bytes(), &mut reply);
        String::from_utf8(reply).expect("text")
    });
    let (reply, start) = (reply.expect("they are there"), format!("t{:03X}8", id << 5 | 3));
    let line =
        reply.split('\r').find_map(|line| line.strip_prefix(&start)).unwrap_or_else(|| panic!("{reply}"));
    u32::from_str_radix(&line[8..], 16).expect("a word").swap_bytes()
}

/// Runs a server until its motors push, then ends it with `signal`. Returns the error bits that
/// switched each axis off, as [`disarm_reason`] does.
fn after(signal: Signal) -> Vec<u32> {
    let patient = RIG.replace("timeout_ticks = 20", "timeout_ticks = 1000");
    let rig = RigConfig::from_toml(&patient, "patient.toml").expect("legal");
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned();
    // All axes are on one line, because the simulated rig has only one.
    std::fs::write(path("rig.toml"), patient.replace("port = 1", "port = 0")).expect("written");
    std::fs::write(path("push.toml"), PUSH).expect("written");
    let axes = axes(&rig);
    let port = axes.path().to_str().expect("UTF-8");
    let args = ["--rig", &path("rig.toml"), "--port", port, "--scene", &path("push.toml")];
    let server = Process::start(&args, folder.path());
    let mut client = JsonLines::greeted(&server.address);
    client.ask(r#"{"id": 1, "op": "acquire"}"#);
    eventually("torque", || {
        client.ask(r#"{"id": 2, "op": "reset"}"#);
        client.ask(r#"{"id": 3, "op": "enable"}"#);
        pushes(&axes)
    });
    server.signal(signal);
    server.end();
    eventually("no torque", || !pushes(&axes));
    (0..4).map(|id| disarm_reason(&axes, id)).collect()
}

/// After the server is killed or ends while its motors push, its last word has switched every axis
/// off. Without the last word, the watchdog would always have done it. One success in five attempts
/// is enough, because a busy machine can delay the last word.
#[test]
fn a_server_that_is_killed_or_ended_leaves_every_odrive_idle_before_its_watchdog() {
    for signal in [Signal::KILL, Signal::ABORT, Signal::TERM] {
        // A busy machine can delay the server or its helper process for longer than 100 ms.
        let seen: Vec<Vec<u32>> =
            (0..5).map(|_| after(signal)).take_while(|reasons| reasons != &[0; 4]).collect();
        assert!(seen.len() < 5, "{signal:?}: {seen:?}");
        assert!(seen.iter().flatten().all(|reason| [0, WATCHDOG].contains(reason)), "{signal:?}: {seen:?}");
    }
}
