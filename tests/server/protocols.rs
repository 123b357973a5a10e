//! Tests that a rig and a scene produce the same torques with each protocol that a rig file can
//! name.

use std::process::Stdio;
use std::time::Duration;

use hbot_config::RigConfig;
use hbot_config::rig::Protocol;
use hbot_core::MAX_JOINTS;
use hbot_core::safety::mode::Cause;
use hbot_sim::controller::InjectedFault;

use crate::phenomena::{Tick, run};
use crate::process::*;
use crate::real::RealRig;

const MOTEUS: &str = include_str!("../../rigs/prototype-moteus.toml");
const ODRIVE: &str = include_str!("../../rigs/prototype-odrive.toml");
/// Error bit of an ODrive's expired watchdog.
const WATCHDOG: u32 = 1 << 24;

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

/// Runs a server in virtual time on the prototype, whose controllers use `protocol`. The encoders
/// have the resolution of those of `other`, so that two runs can be compared. Returns all ticks.
fn felt(protocol: Protocol, other: Protocol, scene: &str, seconds: u64) -> Vec<Tick> {
    let mut rig = RigConfig::prototype();
    rig.link.protocol = protocol;
    let counts = other.counts_per_turn().expect("it reports turns");
    let all = |joint: &mut hbot_core::design::rig::Joint| joint.counts_per_turn = counts;
    rig.rig = rig.rig.with(|parts| parts.joints.iter_mut().for_each(all)).expect("legal");
    run(rig, scene, Some(seconds), |_| std::future::pending())
}

/// Returns the number of ticks in which motors were on.
fn active(ticks: &[Tick]) -> usize {
    ticks.iter().filter(|tick| tick.outputs.drive.enable).count()
}

/// Returns the mode of the moteus servo `id`.
fn mode(rig: &RealRig, id: u8) -> u8 {
    let mut line = format!("x\ncan send {:04x} 1100 bF ", 0x8000 + u32::from(id));
    let crc = line[2..].bytes().fold(0_u8, |crc, byte| {
        (0..8).fold(crc ^ byte, |crc, _| if crc & 0x80 == 0 { crc << 1 } else { crc << 1 ^ 0x97 })
    });
    line += &format!("*{crc:02X}\n");
    let reply = rig.answer(line.into_bytes());
    let data = reply.lines().find(|line| line.starts_with("rcv")).and_then(|line| line.split(' ').nth(2));
    u8::from_str_radix(&data.unwrap_or_else(|| panic!("{reply}"))[4..6], 16).expect("a mode")
}

/// Returns the error bits that last switched the ODrive axis `id` off; 0 if a command did.
fn disarm_reason(rig: &RealRig, id: u16) -> u32 {
    let reply = rig.answer(format!("\rr{:03X}8\r", id << 5 | 3).into_bytes());
    let start = format!("t{:03X}8", id << 5 | 3);
    let line = reply.split('\r').find_map(|line| line.strip_prefix(&start));
    u32::from_str_radix(&line.unwrap_or_else(|| panic!("{reply}"))[8..], 16).expect("a word").swap_bytes()
}

/// After the server is killed or ends while its motors push, every servo is in mode 0 (stopped). A
/// servo whose watchdog had stopped it would be in mode 11.
#[test]
fn a_server_that_is_killed_or_ended_leaves_every_moteus_servo_stopped() {
    for signal in [Signal::KILL, Signal::ABORT, Signal::TERM] {
        let mut rig = RealRig::start(MOTEUS, Protocol::Moteus, |_| ());
        push(&mut rig.server.holder(), || rig.pushes());
        assert!((1..=4).all(|id| mode(&rig, id) == 10), "position mode");
        rig.server.end_by(signal);
        eventually("no torque", || !rig.pushes());
        let modes = [1, 2, 3, 4].map(|id| mode(&rig, id));
        assert_eq!(modes, [0; 4], "{signal:?}");
    }
}

/// After the server is killed or ends while its motors push, its last word has switched every axis
/// off. Without the last word, the watchdog would always have done it. One success in five attempts
/// is enough, because a busy machine can delay the last word for longer than 100 ms.
#[test]
fn a_server_that_is_killed_or_ended_leaves_every_odrive_idle_before_its_watchdog() {
    for signal in [Signal::KILL, Signal::ABORT, Signal::TERM] {
        let after = |_| {
            let mut rig = RealRig::start(ODRIVE, Protocol::Odrive, |_| ());
            push(&mut rig.server.holder(), || rig.pushes());
            rig.server.end_by(signal);
            eventually("no torque", || !rig.pushes());
            [0, 1, 2, 3].map(|id| disarm_reason(&rig, id))
        };
        let seen: Vec<_> = (0..5).map(after).take_while(|reasons| reasons != &[0; 4]).collect();
        assert!(seen.len() < 5, "{signal:?}: {seen:?}");
        assert!(seen.iter().flatten().all(|reason| [0, WATCHDOG].contains(reason)), "{signal:?}: {seen:?}");
    }
}

/// While motors push, the cable is unplugged and connected again. Meanwhile the servos keep or lose
/// their power. In both cases they give torque only after the client enables them again.
#[test]
fn a_line_of_moteus_servos_that_is_back_pushes_only_when_asked_anew() {
    // With an absolute zero, servos know their position even after a loss of power.
    let text = MOTEUS.replace("zero = \"assume\"", "zero = \"absolute\"");
    for power_lost in [false, true] {
        let rig = RealRig::start(&text, Protocol::Moteus, |_| ());
        let mut client = rig.server.holder();
        push(&mut client, || rig.pushes());
        let mut rig = rig.replugged(|servos| {
            if power_lost {
                servos.inject(InjectedFault::Reboot);
            }
        });
        eventually("motors off", || (1..=4).all(|id| mode(&rig, id) == 0));
        std::thread::sleep(Duration::from_millis(300));
        assert!(!rig.pushes(), "nobody has asked for it");
        push(&mut client, || rig.pushes());
        rig.server.end_by(Signal::TERM);
    }
}

/// While `hbot reset` waits for a line that comes back, another client stops the rig.
#[test]
fn a_reset_that_waits_does_not_lift_a_stop_that_came_after_it() {
    let rig = RealRig::start(MOTEUS, Protocol::Moteus, |_| ());
    let address = rig.server.address.clone();
    let mut other = JsonLines::greeted(&address);
    let mut reset = None;
    let mut rig = rig.replugged(|_| {
        other.until(|line| line["event"] == "fault");
        let mut command = hbot();
        command.args(["reset", "--server", &address]).stdout(Stdio::piped()).stderr(Stdio::piped());
        reset = Some(command.spawn().expect("the binary runs"));
        other.until(|line| line["event"] == "lease" && line["holder"].is_string());
        other.ask(r#"{"id": 1, "op": "estop"}"#);
    });
    let output = reset.expect("it was started").wait_with_output().expect("it ends");
    let info = other.ask(r#"{"id": 2, "op": "info"}"#);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(info["ok"]["mode"] == "estop" && !output.status.success(), "{}: {said}", info["ok"]["mode"]);
    rig.server.end_by(Signal::TERM);
}

/// Returns the largest difference between two runs in any joint torque, and the largest joint
/// torque, in N m.
fn apart(ticks: &[Tick], others: &[Tick]) -> (f64, f64) {
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
fn a_spring_feels_the_same_over_moteus_and_odrives_as_over_hbot_s_own_link() {
    for protocol in [Protocol::Moteus, Protocol::Odrive] {
        let [own, other] = [Protocol::Hbot, protocol].map(|line| felt(line, protocol, SCENE, 5));
        for ticks in [&own, &other] {
            let active = active(ticks);
            assert!(ticks.len() >= 5000 && active > 4900, "on in {active} of {} ticks", ticks.len());
            let age = ticks[1000..].iter().filter_map(|tick| tick.inputs.feedback.map(|f| f.sequence));
            // Each reading answers the command of the tick before.
            assert!(age.zip(1000_u32..).all(|(answers, tick)| answers.wrapping_add(1) == tick), "ages");
        }
        let (most, largest) = apart(&own, &other);
        assert!(largest > 0.01, "the spring pushes: {largest} N m");
        // One step of a servo's position is 1e-5 turns, 6.3e-5 rad. The spring of 0.5 N m/rad turns
        // it into a torque of this size. An ODrive's position is an f32. Its steps are 2^-18 turns
        // for a motor behind a gear of 17, and 2^-22 turns without a gear.
        assert!(most < 3e-5, "{protocol:?}: {most} N m apart");
    }
}

/// Runs moteus servos for ten seconds on a line that loses a share of all lines of text in each
/// direction, and damages an equal share. Returns the number of ticks in which motors were on, and
/// the cause of the fault at the end, if any.
fn on_a_bad_line(share: f64) -> (usize, Option<Cause>) {
    let scene = format!(
        "{SCENE}\nlink = {{ loss = {share}, corrupt = {share}, latency_s = 0.0005, jitter_s = 0.0001, seed = 3 }}"
    );
    let ticks = felt(Protocol::Moteus, Protocol::Moteus, &scene, 10);
    (active(&ticks), ticks.last().and_then(|tick| tick.outputs.state.cause))
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
