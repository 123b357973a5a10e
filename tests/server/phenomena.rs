//! The influence of a scene's `[simulate]` table on a whole server, in virtual time.

use std::future::Future;
use std::time::Duration;

use hbot_config::{RigConfig, SceneFile};
use hbot_core::design::kinematics::Posture;
use hbot_core::safety::mode::{Cause, Mode};
use hbot_core::{CompiledScene, Inputs, MAX_JOINTS, Outputs};
use hbot_server::server::{ServerOptions, Time};
use hbot_testing::server::recorded;
use tokio::io::{AsyncBufReadExt as _, AsyncWriteExt as _, BufReader};
use tokio::net::TcpStream;

use crate::process::hbot;

pub(crate) struct Tick {
    pub(crate) inputs: Inputs,
    pub(crate) outputs: Outputs,
}

/// Runs a server with `scene` on `rig` and returns all of its ticks. It runs for `seconds`, or
/// until the future that `meanwhile` makes from its address completes.
pub(crate) fn run<F: Future<Output = ()> + Send + 'static>(
    rig: RigConfig,
    scene: &str,
    seconds: Option<u64>,
    meanwhile: impl FnOnce(std::net::SocketAddr) -> F,
) -> Vec<Tick> {
    let scene = SceneFile::from_toml(scene, "scene.toml").unwrap_or_else(|mistakes| panic!("{mistakes}"));
    let options = ServerOptions::new(rig, scene, Time::Virtual);
    let duration = seconds.map(Duration::from_secs);
    let note =
        |_: &CompiledScene, inputs: &Inputs, outputs: &Outputs| Tick { inputs: *inputs, outputs: *outputs };
    recorded(ServerOptions { duration, ..options }, note, meanwhile)
}

fn undisturbed(scene: &str, seconds: u64) -> Vec<Tick> {
    run(RigConfig::prototype(), scene, Some(seconds), |_| std::future::pending())
}

/// A line that loses 1 % and damages 1 % of the frames in each direction, with latency and jitter,
/// causes no fault.
#[test]
fn a_hundredth_of_all_frames_lost_and_damaged_is_no_fault() {
    const N: f64 = 20_000.0;
    let ticks = undisturbed(
        r#"
        [[effect]]
        id = "spring"
        kind = "spring"
        stiffness = 1
        damping = 0.02
        [simulate]
        hand = {}
        link = { loss = 0.01, corrupt = 0.01 }
        "#,
        20,
    );
    assert_eq!(ticks.len(), N as usize);
    let mut modes: Vec<Mode> = ticks.iter().map(|t| t.outputs.state.mode).collect();
    modes.dedup();
    assert!(modes.ends_with(&[Mode::Enabling, Mode::Active]), "{modes:?}");
    assert!(ticks.iter().all(|tick| tick.outputs.state.cause.is_none()));

    // An answer is missing if its command or the answer itself was lost or damaged: 4 %, within
    // four standard deviations.
    let lost = 1.0 - 0.99_f64.powi(4);
    let missing = ticks.iter().filter(|tick| tick.inputs.feedback.is_none()).count() as f64;
    assert!((missing - N * lost).abs() < 4.0 * (N * lost).sqrt(), "{missing} of {N}");
    let corrupt: f64 = ticks.iter().map(|tick| f64::from(tick.inputs.corrupt_frames)).sum();
    assert!((corrupt - 0.01 * N).abs() < 4.0 * (0.01 * N).sqrt(), "{corrupt} of {N}");
    // The default latency delays answers by a tick, but not the answers to commands that arrive in
    // time.
    let on_time =
        |tick: &&Tick| tick.inputs.feedback.is_some_and(|f| u64::from(f.sequence) + 2 == tick.inputs.tick);
    let on_time = ticks.iter().filter(on_time).count() as f64;
    assert_eq!(on_time, N - missing);
    // The hand moves the sphere all the time.
    assert!(ticks.last().expect("ticks").outputs.state.omega.length() > 0.05);
}

/// Sends each line and waits for its answer. After the answer to `load_scene` it also waits for
/// three states.
async fn talk(address: std::net::SocketAddr, lines: &[&str]) {
    let mut stream = TcpStream::connect(address).await.expect("the server listens");
    let (reader, mut writer) = stream.split();
    let mut said = BufReader::new(reader).lines();
    for line in lines {
        writer.write_all(format!("{line}\n").as_bytes()).await.expect("sent");
        let (mut answered, mut states) = (false, 0);
        while !answered || (line.contains("load_scene") && states < 3) {
            let said = said.next_line().await.expect("an answer").expect("an answer");
            assert!(!said.contains("\"error\""), "{said}");
            answered |= said.contains("\"ok\"");
            states += u32::from(answered && said.contains("\"state\""));
        }
    }
}

/// A scene replaces the phenomena of a running rig by those that it names and removes the others. A
/// scene without the table changes nothing.
#[test]
fn phenomena_change_with_the_scene() {
    let late = r#"
        [simulate]
        link = { latency_s = 0.003, jitter_s = 0, loss = 0, corrupt = 0 }
    "#;
    let ticks = run(RigConfig::prototype(), late, None, |address| async move {
        let lines = [
            r#"{"id": 1, "op": "hello", "version": 1, "name": "a test"}"#,
            r#"{"id": 2, "op": "acquire"}"#,
            r#"{"id": 3, "op": "subscribe", "every": 20}"#,
            r#"{"id": 4, "op": "load_scene", "scene": {"name": "left as it is"}}"#,
            r#"{"id": 5, "op": "load_scene", "scene": {"name": "ideal", "simulate": {}}}"#,
            r#"{"id": 6, "op": "load_scene", "scene": {"name": "late", "simulate": {"link": {"latency_s": 0.0015, "jitter_s": 0, "loss": 0, "corrupt": 0}}}}"#,
            r#"{"id": 7, "op": "load_scene", "scene": {"name": "ideal", "simulate": {"motor": {}}}}"#,
            r#"{"id": 8, "op": "load_scene", "scene": {"name": "left as it is"}}"#,
        ];
        talk(address, &lines).await;
    });
    let age = |tick: &Tick| tick.inputs.feedback.map(|f| tick.inputs.tick - u64::from(f.sequence));
    let mut ages: Vec<u64> = ticks.iter().filter_map(age).collect();
    ages.dedup();
    // In virtual time every answer takes one tick. A latency adds its whole ticks.
    assert_eq!(ages, [4, 1, 2, 1]);
    assert!(ticks.iter().all(|tick| tick.outputs.state.cause.is_none()));
}

/// Runs a hand that turns the sphere hard. `slip` is a line of the scene that limits the contact
/// forces; without it they are unlimited.
fn shoved(slip: &str) -> Vec<Tick> {
    undisturbed(
        &format!(
            r#"
            [[effect]]
            id = "spring"
            kind = "spring"
            stiffness = 2
            damping = 0.05
            [simulate]
            hand = {{ stiffness = 10, amplitude = 1, rate = 0.5 }}
            {slip}
            "#
        ),
        6,
    )
}

/// With contacts that slip, the fault occurs in the first tick whose slip is above the limit, and
/// not before. In the motion without slip, the measured slip comes only from the encoder counts,
/// and there is no fault.
#[test]
fn slip_is_seen_and_is_a_fault_at_its_limit() {
    let limit = RigConfig::prototype().rig.limits.slip;
    let slip = |tick: &Tick| tick.outputs.state.slip;

    let held = shoved("");
    assert!(held.iter().all(|tick| tick.outputs.state.cause.is_none()));
    let seen = held.iter().map(slip).fold(0.0, f64::max);
    // Rates have 32 bits: at 100 rad/s and radius R that is an error of 1e-6 m/s. The geometry is
    // half a tick old.
    assert!(seen < 0.1 * limit, "{seen} m/s");
    let firm = shoved("slip = {}");
    assert!(firm.iter().all(|tick| tick.outputs.state.cause.is_none()), "mu N of 8 N holds this");

    // With a tenth of the grip the wheels slip.
    let loose = shoved("slip = { mu = 0.08 }");
    let fault = loose.iter().position(|tick| tick.outputs.state.cause.is_some()).expect("it slips");
    assert_eq!(loose[fault].outputs.state.cause, Some(Cause::Slip));
    assert!(slip(&loose[fault]) > limit);
    assert_eq!(loose[fault].outputs.drive.torque, [0.0; 16], "zero torque in the same tick");
    let active = loose.iter().position(|tick| tick.outputs.state.mode == Mode::Enabling).expect("it starts");
    for tick in &loose[active + 1..fault] {
        assert!(slip(tick) <= limit, "{} m/s and no fault", slip(tick));
    }
}

/// A scene whose torque changes its sign quickly, with gears that have play.
fn geared() -> String {
    include_str!("../../scenes/heavy-door.toml").to_owned() + "\n[simulate.gear]\n[simulate.hand]\n"
}

/// A person whose scene has play sees the fault, and a message that play can be the cause.
#[test]
fn play_looks_like_slip_and_the_fault_says_so() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("geared.toml");
    std::fs::write(&path, geared()).expect("written");
    // Play also shakes the sphere. The guard against that would lower the torque first.
    let rig = folder.path().join("rig.toml");
    let unguarded =
        include_str!("../../rigs/prototype.toml").replace("[loop]\n", "[loop]\nshaking_guard = false\n");
    std::fs::write(&rig, unguarded).expect("written");
    let mut server = assert_cmd::Command::from_std(hbot());
    server.args(["server", "--time", "virtual", "--duration", "3", "--listen", "127.0.0.1:0", "--scene"]);
    server
        .arg(&path)
        .arg("--rig")
        .arg(&rig)
        .env("XDG_STATE_HOME", folder.path())
        .timeout(Duration::from_secs(120));
    let said = server.assert().success();
    let log = String::from_utf8_lossy(&said.get_output().stderr);
    assert!(log.contains("slip: a wheel slipped at 0.053 m/s"), "{log}");
    assert!(log.contains("A gear that crosses its play looks the same"), "{log}");
}

#[test]
fn a_server_says_what_its_first_scene_cannot_do() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("thick.toml");
    let text = "[[effect]]\nid = \"air\"\nkind = \"damper\"\ndamping = 20\n";
    std::fs::write(&path, text).expect("written");
    let mut server = assert_cmd::Command::from_std(hbot());
    server.args(["server", "--time", "virtual", "--duration", "0.1", "--listen", "127.0.0.1:0", "--scene"]);
    server.arg(&path).env("XDG_STATE_HOME", folder.path()).timeout(Duration::from_secs(120));
    let said = server.assert().success();
    let output = String::from_utf8_lossy(&said.get_output().stdout);
    assert!(
        output.contains(
            "warning  air: may shake the sphere at its rest: the damping of the scene, 20 N m s/rad"
        ),
        "{output}"
    );
}

/// Checks the slip limit of docs/simulator.md for rigs with play. The bound is the apparent slip of
/// a motor that crosses its play under the largest torque that occurred. Two wheels show half of
/// it, and both at once half of the sum.
#[test]
fn what_play_seems_to_slip_is_bounded_by_the_torque_that_crosses_it() {
    let mut rig = RigConfig::prototype();
    rig.rig = rig.rig.with(|rig| rig.limits.slip = 10.0).expect("a legal rig");
    // Play shakes the sphere as well, and the guard against that would lower the torque.
    rig.shaking_guard = false;
    let device = rig.rig.device;
    let ticks = run(rig, &geared(), Some(10), |_| std::future::pending());
    assert!(ticks.iter().all(|tick| tick.outputs.state.cause.is_none()), "nothing else is wrong");
    let gear = hbot_sim::phenomena::Gear::default();
    let (mut seen, mut bound) = (0.0_f64, 0.0_f64);
    for (i, wheel) in device.wheels().iter().enumerate() {
        let spec = wheel.spec();
        let hardest = |most: f64, tick: &Tick| most.max(tick.outputs.state.joint_torque[2 * i + 1].abs());
        let torque = ticks.iter().fold(0.0, hardest);
        let inertia = gear.rotor_share * spec.drive_inertia;
        bound += 0.5 * spec.radius * (2.0 * torque * gear.backlash / inertia).sqrt();
    }
    for tick in &ticks {
        seen = seen.max(tick.outputs.state.slip);
    }
    assert!(seen > 0.05 && seen < bound, "{seen} m/s, at most {bound} m/s");
}

/// Two wheels show at most half of the slip of one drive.
#[test]
fn two_wheels_show_half_of_what_one_drive_slips() {
    let device = RigConfig::prototype().rig.device;
    let mut most = 0.0_f64;
    for k in 0..400 {
        let th = [f64::from(k % 20), f64::from(k / 20)].map(|x| x * std::f64::consts::TAU / 20.0);
        let mut rates = [0.0; MAX_JOINTS];
        rates[1] = 1.0;
        let slip = Posture::new(&device, &th).forward(&device, &rates).slip;
        most = slip[..2].iter().map(|[u, v]| u.hypot(*v)).fold(most, f64::max);
    }
    let half = 0.5 * device.wheels()[0].spec().radius;
    // The largest value on a grid of 18 degrees is within the cosine of that angle of the true one.
    assert!(most <= half * (1.0 + 1e-9) && most > 0.95 * half, "{most} of {half} m");
}
