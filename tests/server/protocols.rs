//! Tests that a rig and a scene produce the same torques with each protocol that a rig file can
//! name.

use std::time::Duration;

use hbot_config::RigConfig;
use hbot_config::rig::Protocol;
use hbot_core::MAX_JOINTS;
use hbot_core::safety::mode::Cause;
use hbot_sim::controller::InjectedFault;
use hbot_sim::pty::{PtyOptions, PtyRig, spawn_pty};
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};
use rustix::process::Signal;

use crate::phenomena::{Tick, run};
use crate::process::Process;
use hbot_testing::lines::JsonLines;
use hbot_testing::patience::eventually;

/// A scene in which a simulated hand turns the sphere back and forth against a spring of 0.5 N
/// m/rad.
const SCENE: &str = r#"
    [[effect]]
    id = "spring"
    kind = "spring"
    stiffness = 0.5
    damping = 0.02
    anchor = "here"

    [simulate]
    hand = { rate = 0.5 }
"#;
const SECONDS: u64 = 5;

/// Runs a server in virtual time on the prototype, whose controllers use `protocol`, with the scene
/// `SCENE`. The encoders have the resolution of those of `other`, so that two runs can be compared.
/// Returns all ticks.
pub(crate) fn felt(protocol: Protocol, other: Protocol) -> Vec<Tick> {
    let mut rig = RigConfig::prototype();
    rig.link.protocol = protocol;
    let counts = other.counts_per_turn().expect("it reports turns");
    let all = |joints: &mut [hbot_core::design::rig::Joint]| {
        joints.iter_mut().for_each(|joint| joint.counts_per_turn = counts);
    };
    rig.rig = rig.rig.with(|parts| all(&mut parts.joints)).expect("legal");
    run(rig, SCENE, Some(SECONDS), |_| std::future::pending())
}

/// Starts simulated moteus servos for `rig` behind a pseudo-terminal.
fn servos(rig: &RigConfig) -> PtyRig {
    let line = Protocol::Moteus.into();
    let config = SimulatedConfig { line, ..SimulatedConfig::new(&rig.rig) };
    let simulated = SimulatedRig::new(&config).expect("it can be simulated");
    spawn_pty(simulated, PtyOptions::default()).expect("this test needs pseudo-terminals (/dev/ptmx)")
}

/// Returns whether any motor gives torque.
fn pushes(servos: &PtyRig) -> bool {
    let torque = servos.call(|rig| *rig.joint_torque()).expect("they are there");
    torque.iter().any(|torque| *torque != 0.0)
}

/// Returns the mode of servo `id`. The question goes directly to the simulated rig, so it does not
/// disturb the server's line.
fn mode(servos: &PtyRig, id: u8) -> u8 {
    let reply = servos.call(move |rig| {
        let (mut reply, mut line) =
            (Vec::new(), format!("x\ncan send {:04x} 1100 bF ", 0x8000 + u32::from(id)));
        let crc = line[2..].bytes().fold(0_u8, |crc, byte| {
            (0..8).fold(crc ^ byte, |crc, _| if crc & 0x80 == 0 { crc << 1 } else { crc << 1 ^ 0x97 })
        });
        line += &format!("*{crc:02X}\n");
        rig.receive(0, line.as_bytes(), &mut reply);
        String::from_utf8(reply).expect("text")
    });
    let reply = reply.expect("they are there");
    let data = reply.lines().find(|line| line.starts_with("rcv")).and_then(|line| line.split(' ').nth(2));
    u8::from_str_radix(&data.unwrap_or_else(|| panic!("{reply}"))[4..6], 16).expect("a mode")
}

/// A scene with a constant torque.
pub(crate) const PUSH: &str =
    "name = \"Push\"\n[[effect]]\nid = \"push\"\nkind = \"constant\"\ntorque = [0, 0.1, 0]\n";

/// Enables the motors through the server, and waits until they give torque.
fn push(client: &mut JsonLines, servos: &PtyRig) {
    eventually("torque", || {
        // A machine that stands still for 20 ms causes a deadline fault, which must be reset.
        client.ask(r#"{"id": 2, "op": "reset"}"#);
        client.ask(r#"{"id": 3, "op": "enable"}"#);
        pushes(servos)
    });
}

/// After the server is killed or ends while its motors push, every servo is in mode 0 (stopped). A
/// servo whose watchdog had stopped it would be in mode 11.
#[test]
fn a_server_that_is_killed_or_ended_leaves_every_moteus_servo_stopped() {
    let text = include_str!("../../rigs/prototype-moteus.toml");
    let patient = text.replace("timeout_ticks = 20", "timeout_ticks = 1000\nwatchdog_ms = 1000");
    assert_ne!(patient, text, "the time-out is written otherwise");
    let rig = RigConfig::from_toml(&patient, "patient.toml").expect("legal");
    for signal in [Signal::KILL, Signal::ABORT, Signal::TERM] {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned();
        std::fs::write(path("rig.toml"), &patient).expect("written");
        std::fs::write(path("push.toml"), PUSH).expect("written");
        let servos = servos(&rig);
        let port = servos.path().to_str().expect("UTF-8");
        let args = ["--rig", &path("rig.toml"), "--port", port, "--scene", &path("push.toml")];
        let server = Process::start(&args, folder.path());
        let mut client = JsonLines::greeted(&server.address);
        client.ask(r#"{"id": 1, "op": "acquire"}"#);
        push(&mut client, &servos);
        assert!((1..=4).all(|id| mode(&servos, id) == 10), "position mode");
        server.signal(signal);
        server.end();
        eventually("no torque", || !pushes(&servos));
        let modes: Vec<u8> = (1..=4).map(|id| mode(&servos, id)).collect();
        assert_eq!(modes, [0; 4], "{signal:?}");
    }
}

/// While motors push, the cable is unplugged and connected again. Meanwhile the servos keep or lose
/// their power. In both cases they give torque only after the client enables them again.
#[test]
fn a_line_of_moteus_servos_that_is_back_pushes_only_when_asked_anew() {
    let text = include_str!("../../rigs/prototype-moteus.toml");
    let patient = text.replace("timeout_ticks = 20", "timeout_ticks = 1000\nwatchdog_ms = 1000");
    // With an absolute zero, servos know their position even after a loss of power.
    let patient = patient.replace("zero = \"assume\"", "zero = \"absolute\"");
    let rig = RigConfig::from_toml(&patient, "patient.toml").expect("legal");
    for power_lost in [false, true] {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned();
        std::fs::write(path("rig.toml"), &patient).expect("written");
        std::fs::write(path("push.toml"), PUSH).expect("written");
        let (first, link) = (servos(&rig), path("line"));
        std::os::unix::fs::symlink(first.path(), &link).expect("a link");
        let args = ["--rig", &path("rig.toml"), "--port", &link, "--scene", &path("push.toml")];
        let server = Process::start(&args, folder.path());
        let mut client = JsonLines::greeted(&server.address);
        client.ask(r#"{"id": 1, "op": "acquire"}"#);
        push(&mut client, &first);

        std::fs::remove_file(&link).expect("it was there");
        let rig = first.stop().expect("it ran");
        let again = spawn_pty(rig, PtyOptions::default()).expect("a pseudo-terminal");
        if power_lost {
            again.call(|rig| rig.inject(InjectedFault::Reboot)).expect("they are there");
        }
        std::os::unix::fs::symlink(again.path(), &link).expect("a link");
        eventually("motors off", || (1..=4).all(|id| mode(&again, id) == 0));
        std::thread::sleep(Duration::from_millis(300));
        assert!(!pushes(&again), "nobody has asked for it");
        push(&mut client, &again);
        server.signal(Signal::TERM);
        server.end();
    }
}

/// Returns the largest difference between two runs in any joint torque, and the largest joint
/// torque, in N m.
pub(crate) fn apart(ticks: &[Tick], others: &[Tick]) -> (f64, f64) {
    let (mut most, mut largest) = (0.0_f64, 0.0_f64);
    for (tick, other) in ticks.iter().zip(others) {
        for joint in 0..MAX_JOINTS {
            let (a, b) = (tick.outputs.drive.torque[joint], other.outputs.drive.torque[joint]);
            (most, largest) = (most.max((a - b).abs()), largest.max(a.abs()));
        }
    }
    (most, largest)
}

#[test]
fn a_spring_feels_the_same_over_moteus_as_over_hbot_s_own_link() {
    let (own, moteus) = (felt(Protocol::Hbot, Protocol::Moteus), felt(Protocol::Moteus, Protocol::Moteus));
    assert!(own.len() >= 5000 && moteus.len() >= 5000, "{} and {} ticks", own.len(), moteus.len());
    for ticks in [&own, &moteus] {
        let active = ticks.iter().filter(|tick| tick.outputs.drive.enable).count();
        assert!(active > 4900, "motors were on in {active} ticks");
        let age = ticks[1000..].iter().filter_map(|tick| tick.inputs.feedback.map(|f| f.sequence));
        // Each reading answers the command of the tick before.
        assert!(age.zip(1000_u32..).all(|(answers, tick)| answers.wrapping_add(1) == tick), "ages");
    }
    let (most, largest) = apart(&own, &moteus);
    assert!(largest > 0.01, "the spring pushes: {largest} N m");
    // One step of a servo's position is 1e-5 turns, 6.3e-5 rad. The spring of 0.5 N m/rad turns it
    // into a torque of this size.
    assert!(most < 3e-5, "{most} N m apart");
}

/// Runs moteus servos for ten seconds on a line that loses a share of all lines of text in each
/// direction, and damages an equal share. Returns the number of ticks in which motors were on, and
/// the cause of the fault at the end, if any.
fn on_a_bad_line(share: f64) -> (usize, Option<Cause>) {
    let mut rig = RigConfig::prototype();
    rig.link.protocol = Protocol::Moteus;
    let counts = Protocol::Moteus.counts_per_turn().expect("it reports turns");
    let all = |joint: &mut hbot_core::design::rig::Joint| joint.counts_per_turn = counts;
    rig.rig = rig.rig.with(|parts| parts.joints.iter_mut().for_each(all)).expect("legal");
    let scene = format!(
        "{SCENE}\nlink = {{ loss = {share}, corrupt = {share}, latency_s = 0.0005, jitter_s = 0.0001, seed = 3 }}"
    );
    let ticks = run(rig, &scene, Some(10), |_| std::future::pending());
    let active = ticks.iter().filter(|tick| tick.outputs.drive.enable).count();
    (active, ticks.last().and_then(|tick| tick.outputs.state.cause))
}

/// If one in 400 lines of text is lost and one in 400 is damaged, the motors stay on. The limit is
/// lower than on hbot's own link, because a tick of four servos needs 12 lines and hbot's link
/// needs two frames.
#[test]
fn one_in_400_lines_lost_and_damaged_is_no_fault_on_moteus_servos() {
    let (active, cause) = on_a_bad_line(0.0025);
    assert!(active > 9900 && cause.is_none(), "motors on in {active} ticks, {cause:?}");
}

#[test]
fn a_hundredth_and_a_half_of_all_lines_lost_and_damaged_are_faults_on_moteus_servos() {
    for share in [0.01, 0.5] {
        let (active, cause) = on_a_bad_line(share);
        let lost = matches!(cause, Some(Cause::LinkLost | Cause::LinkCorrupt));
        assert!(active < 1000 && lost, "{share}: motors on in {active} ticks, {cause:?}");
    }
}
