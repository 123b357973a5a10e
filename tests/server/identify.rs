//! A simulated rig that is not as drawn, from a recording to a rig file that drifts less: `hbot
//! server --built`, `hbot rig identify`.

use std::fs::{File, Permissions};
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use std::time::Duration;

use assert_cmd::assert::Assert;
use hbot_config::RigConfig;
use hbot_core::Quat;
use hbot_identify::compare::Geometry;
use hbot_record::reader::Item;
use hbot_record::{Exact, Reader, Topic};

use crate::process::*;

/// A hand that turns the sphere about all axes, and no effect: the motors rest.
const HAND: &str =
    "name = \"a hand\"\n[simulate.hand]\nstiffness = 30\ndamping = 0.3\namplitude = 2.0\nrate = 0.3\n";
const DRAWING: &str = include_str!("../../rigs/prototype.toml");

/// The prototype as it came out of the workshop.
fn built() -> String {
    [
        ("axis = [1, 0, -1] ", "axis = [1.008, 0.011, -0.994] "),
        ("axis = [-1, 0, -1] ", "axis = [-1.003, -0.006, -1.004] "),
        ("cone = 0.1745     #", "cone = 0.1812     #"),
        ("cone = 0.1745      #", "cone = 0.1689      #"),
        ("toe = 0           #", "toe = 0.0071      #"),
        ("toe = 0            #", "toe = -0.0052      #"),
        ("radius = 0.0155   #", "radius = 0.01563  #"),
        ("radius = 0.0155    #", "radius = 0.01541   #"),
    ]
    .into_iter()
    .fold(
        DRAWING.replace("zero = \"assume\" ", "zero_offset = 0.0083\nzero = \"assume\" "),
        |text, (old, new)| {
            assert!(text.contains(old), "the prototype's file has no {old:?}");
            text.replacen(old, new, 1)
        },
    )
}

fn run(folder: &Path, args: &str) -> Assert {
    run_as(hbot(), folder, args)
}

/// Runs a command as on a disk that takes `blocks` blocks of 512 bytes of each file.
fn limited(blocks: u32, folder: &Path, args: &str) -> Assert {
    let mut shell = std::process::Command::new("sh");
    let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" \"$@\"");
    shell.args(["-c", &script]).arg(hbot().get_program());
    run_as(shell, folder, args)
}

fn run_as(command: std::process::Command, folder: &Path, args: &str) -> Assert {
    assert_cmd::Command::from_std(command)
        .current_dir(folder)
        .env("XDG_STATE_HOME", folder)
        .args(args.split(' '))
        .timeout(Duration::from_secs(300))
        .assert()
}

fn record(folder: &Path, rig: &str, seconds: u32, run_file: &str) {
    run(
        folder,
        &format!(
            "server --listen 127.0.0.1:0 --rig {rig} --built true.toml --scene hand.toml --time virtual --duration {seconds} --record {run_file}"
        ),
    )
    .success();
}

/// Reads the orientations that the loop has computed.
fn orientations(file: &Path) -> Vec<Quat> {
    let mut reader = Reader::new(File::open(file).expect("recorded")).expect("a recording");
    let mut all = Vec::new();
    while let Some(item) = reader.next().expect("readable") {
        if let Item::Message { topic, data, .. } = item
            && topic == Topic::Exact.name()
            && let Ok(Exact::Tick(tick)) = Exact::read(&data)
        {
            all.push(tick.1.state.q);
        }
    }
    all
}

fn geometry(folder: &Path, file: &str) -> Geometry {
    let config = RigConfig::from_path(&folder.join(file)).expect("a legal rig file");
    let (device, joints) = (config.rig.device, config.rig.joints);
    let whole = |i: usize| {
        let joint = &joints[2 * i];
        joint.whole_counts(config.zero_offsets[2 * i]) * joint.radians_per_count()
    };
    Geometry { device, zeros: (0..device.wheels().len()).map(whole).collect() }
}

#[test]
fn a_rig_that_is_not_as_drawn_is_identified_and_then_drifts_less() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    std::fs::write(folder.join("drawing.toml"), DRAWING).expect("written");
    std::fs::write(folder.join("true.toml"), built()).expect("written");
    std::fs::write(folder.join("hand.toml"), HAND).expect("written");
    record(folder, "drawing.toml", 60, "run.mcap");
    run(folder, "rig identify --rig drawing.toml run.mcap --write fitted.toml").success().stdout(
        contains("wheel A cone rad")
            .and(contains("fitted.toml: written"))
            .and(contains("not everything").not()),
    );
    run(folder, "rig identify --rig drawing.toml run.mcap")
        .success()
        .stdout(contains("nothing is written; `--out FILE.toml`"));
    let text = std::fs::read_to_string(folder.join("fitted.toml")).expect("written");
    // A disk that takes no byte leaves the old file, and no other one.
    let files = || std::fs::read_dir(folder).expect("a folder").count();
    let before = files();
    limited(0, folder, "rig identify --zeros --rig drawing.toml run.mcap --out fitted.toml")
        .code(1)
        .stderr(contains("fitted.toml: cannot be written, and stays as it was"));
    assert_eq!(std::fs::read_to_string(folder.join("fitted.toml")).expect("there"), text);
    assert_eq!(files(), before);
    assert!(text.contains("# rad, table I (10 degrees)"), "comments stay:\n{text}");
    assert!(text.contains("\ndrift = 0.0005\n"), "what such a geometry drifts:\n{text}");

    // The same hand moves the same rig, whatever the loop believes: the orientation of a loop that
    // believes the truth is the true one.
    let drift = |rig: &str| {
        let name = format!("{rig}.mcap");
        record(folder, &format!("{rig}.toml"), 30, &name);
        record(folder, "true.toml", 30, &format!("{rig}-true.mcap"));
        let [found, real] = [name, format!("{rig}-true.mcap")].map(|file| orientations(&folder.join(file)));
        let [ours, truth] = [rig, "true"].map(|rig| geometry(folder, &format!("{rig}.toml")));
        *ours.drift(&truth, &found, &real).last().expect("ticks")
    };
    let [drawn, fitted] = ["drawing", "fitted"].map(drift);
    println!("drift in 30 s: {:.1} mrad as drawn, {:.2} as found", 1e3 * drawn, 1e3 * fitted);
    // The truth itself drifts by half a count of the steer encoders, 0.2 mrad, with each turn.
    assert!(drawn > 20e-3 && fitted < 3e-3, "{drawn:e}, {fitted:e}");
}

#[test]
fn a_rig_that_cannot_be_built_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).expect("written");
    write("true.toml", &built());
    write("coarse.toml", &DRAWING.replace("counts_per_turn = 16384", "counts_per_turn = 4096"));
    write("three.toml", include_str!("../../rigs/three_wheels.toml"));
    let refused = |args: &str, why: &str| {
        let args = format!("server --listen 127.0.0.1:0 --duration 1 {args}");
        run(folder, &args).code(1).stderr(contains(why));
    };
    refused("--built true.toml --port /dev/ttyACM9", "/dev/ttyACM9 is a real rig, which is built as it is");
    refused("--built three.toml", "the rig has 2 wheels, the one that it is built as has 3");
    refused(
        "--built coarse.toml",
        "wheel[0].steer: the rig counts 16384 a turn, the one that it is built as 4096",
    );
    refused("--built nowhere.toml", "nowhere.toml");
    // In wall-clock time, too, and with an own pseudo-terminal.
    run(folder, "server --listen 127.0.0.1:0 --duration 0.2 --built true.toml").success();
    run(folder, "server --listen 127.0.0.1:0 --duration 0.2 --built true.toml --port sim:pty").success();
}

/// Motors that push: the ready-made scene has a spring, and the simulated rig enables itself.
#[test]
fn a_recording_of_motors_that_push_and_one_over_tcp_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    run(folder, "server --listen 127.0.0.1:0 --time virtual --duration 20 --record pushed.mcap").success();
    run(folder, "rig identify pushed.mcap --out never.toml").code(1).stderr(contains("the motors push in"));
    run(folder, "rig identify missing.mcap").code(1).stderr(contains("missing.mcap"));
    // A rig file that is legal only with options of the command line.
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).expect("written");
    write("slow.toml", &DRAWING.replace("rate_hz = 1000", "rate_hz = 10"));
    write("deaf.toml", &DRAWING.replace("listen = \"127.0.0.1:4268\"", "listen = \"nowhere\""));
    write("geared.toml", &DRAWING.replacen("gear = 1 ", "gear = 2 ", 1));
    for rig in ["slow", "deaf"] {
        let options = format!("--rate 1000 --rig {rig}.toml --record {rig}.mcap");
        run(folder, &format!("server --listen 127.0.0.1:0 --time virtual --duration 1 {options}")).success();
    }
    let gear = "wheel[0].steer.gear is 1 in its rig file, and 2 in the given one";
    run(folder, "rig identify --rig geared.toml slow.mcap").code(1).stderr(contains(gear));
    let listen = contains("the one in it is not legal: its rig file:").and(contains(": api.listen: "));
    run(folder, "rig identify deaf.mcap").code(1).stderr(listen);
    std::fs::write(folder.join("three.toml"), include_str!("../../rigs/three_wheels.toml")).expect("written");
    run(folder, "rig identify --rig three.toml pushed.mcap")
        .code(1)
        .stderr(contains("the number of wheels is 2 in its rig file, and 3 in the given one"));
    assert!(!folder.join("never.toml").exists());
}

/// The prototype with a zero that stays, whose motors, joints and sphere are not as an ideal rig's.
fn imperfect() -> String {
    let joint = |scale: f64, coulomb: f64, viscous: f64, cogging: &str| {
        format!(
            "torque_scale = {scale}\nfriction = {{ coulomb = {coulomb}, viscous = {viscous} }}\n{cogging}"
        )
    };
    let cogging = "cogging = [{ per_turn = 7, amplitude = 2e-3, phase = 0.4 }]\n";
    let joints = [
        joint(0.95, 3.0e-4, 2.0e-5, cogging),
        joint(0.97, 1.5e-4, 8.0e-6, ""),
        joint(1.03, 2.0e-4, 1.0e-5, ""),
        joint(0.93, 2.5e-4, 1.2e-5, ""),
    ];
    let sphere = "friction = { coulomb = 1e-3 }\nimbalance = [0.004, -0.002, 0.003]\n";
    let mut text = kept().replace("[sphere]\n", &format!("[sphere]\n{sphere}"));
    let mut from = 0;
    for (j, keys) in joints.iter().enumerate() {
        let table = if j % 2 == 0 { "[wheel.steer]\n" } else { "[wheel.drive]\n" };
        let at = from + text[from..].find(table).expect("a table for each joint") + table.len();
        text.insert_str(at, keys);
        from = at;
    }
    text
}

/// The prototype's rig file with steer encoders that keep their zeros.
fn kept() -> String {
    DRAWING.replace("zero = \"assume\" ", "zero = \"absolute\" ")
}

/// The motors find what the rig file does not say, and write it as the control law reads it.
#[test]
fn motors_find_torque_constants_friction_imbalance_and_cogging() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    std::fs::write(folder.join("drawing.toml"), kept()).expect("written");
    std::fs::write(folder.join("true.toml"), imperfect()).expect("written");
    let output = run(
        folder,
        "rig identify --motors --rig drawing.toml --port sim --built true.toml --out fitted.toml",
    )
    .success()
    .stdout(contains("fitted.toml: written"));
    println!("{}", String::from_utf8_lossy(&output.get_output().stdout));
    let text = std::fs::read_to_string(folder.join("fitted.toml")).expect("written");
    assert!(text.contains("# rad, table I (10 degrees)"), "comments stay:\n{text}");
    let known = |file: &str| {
        let config = RigConfig::from_path(&folder.join(file)).expect("a legal rig file");
        config.rig.compensation.expect("imperfections")
    };
    let (found, truth) = (known("fitted.toml"), known("true.toml"));
    for j in 0..4 {
        let (found, truth) = (&found.joints[j], &truth.joints[j]);
        let near = |found: f64, truth: f64, part: f64| (found / truth - 1.0).abs() < part;
        assert!(near(found.torque_scale, truth.torque_scale, 0.01), "joint {j}: {found:?}");
        assert!(near(found.friction.coulomb, truth.friction.coulomb, 0.05), "joint {j}: {found:?}");
        assert!(near(found.friction.viscous, truth.friction.viscous, 0.2), "joint {j}: {found:?}");
        let [one, two] = [found.cogging[0], truth.cogging[0]];
        assert_eq!(one.per_turn, two.per_turn, "joint {j}");
        assert!((one.amplitude - two.amplitude).abs() < 1e-4, "joint {j}: {one:?}");
        assert!((one.phase - two.phase).abs() < 0.05, "joint {j}: {one:?}");
    }
    assert!((found.sphere.coulomb / truth.sphere.coulomb - 1.0).abs() < 0.1, "{:?}", found.sphere);
    assert!((found.imbalance - truth.imbalance).length() < 1e-4, "{}", found.imbalance);
}

/// The mass in the file is an eighth too small, and so are the values of the first motion. An added
/// inertia, half of the sphere's, shows their scale.
#[test]
fn an_added_inertia_shows_the_scale_of_all_values() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).expect("written");
    let of_mass = |text: &str, mass: f64| text.replace("mass = 0.467 ", &format!("mass = {mass} "));
    write("light.toml", &of_mass(&kept(), 0.41));
    write("true.toml", &imperfect());
    write("loaded.toml", &of_mass(&imperfect(), 0.7));
    // 2/3 m R² of the added 0.233 kg.
    let motors = |args: &str| run(folder, &format!("rig identify --motors {args}"));
    motors("--rig light.toml --built true.toml --out first.toml").success();
    motors("--rig first.toml --built loaded.toml --added 1.6161e-3 --out second.toml")
        .success()
        .stdout(contains("the added inertia shows that of the sphere: 1.1"));
    let [first, second, truth] = ["first.toml", "second.toml", "true.toml"]
        .map(|file| RigConfig::from_path(&folder.join(file)).expect("legal").rig);
    // 1 % is what is asked of torque constants.
    let near = |found: f64, truth: f64| (found / truth - 1.0).abs() < 0.01;
    assert!(near(second.device.sphere_mass(), truth.device.sphere_mass()), "{}", second.device.sphere_mass());
    let [first, second, truth] = [first, second, truth].map(|rig| rig.compensation.expect("imperfections"));
    for j in 0..4 {
        let scale = |known: &hbot_core::design::rig::Compensation| known.joints[j].torque_scale;
        assert!(scale(&first) < 0.9 * scale(&truth), "joint {j}: {first:?}");
        assert!(near(scale(&second), scale(&truth)), "joint {j}: {second:?}");
    }
    assert!((second.sphere.coulomb / truth.sphere.coulomb - 1.0).abs() < 0.1, "{:?}", second.sphere);
    // Without an added inertia nothing is written.
    motors("--rig first.toml --built true.toml --added 1.6161e-3 --out never.toml")
        .code(1)
        .stdout(contains("too little to show"));
    assert!(!folder.join("never.toml").exists());
}

/// A sphere that is held, and motors whose signs are wrong, give no rig file.
#[test]
fn motors_that_turn_the_wrong_way_and_a_wrong_geometry_give_no_rig_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).expect("written");
    write("drawing.toml", &kept());
    write("flat.toml", &kept().replace("cone = 0.1745 ", "cone = 0.25 "));
    write("light.toml", &kept().replace("mass = 0.467 ", "mass = 0.2 "));
    let refused = |args: &str, why: &str| {
        let args = format!("rig identify --motors --rig drawing.toml {args} --out never.toml");
        let output = run(folder, &args).code(1);
        let output = output.get_output();
        let said = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
        assert!(said.concat().contains(why), "{said:?}");
        assert!(!folder.join("never.toml").exists());
    };
    refused("--built flat.toml", "the joints contradict each other by");
    refused("--built light.toml --seconds 20", "torque_scale: 2.3");
    refused("--speed 0.2", "turned faster than --speed allows");
    refused("--built nowhere.toml", "nowhere.toml");
    refused("--port /dev/nowhere --built drawing.toml", "is a real rig, which is built as it is");
}

/// A certificate says what was measured, with intervals, and what was not.
#[test]
fn a_certificate_says_what_was_measured_and_what_was_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).expect("written");
    write("drawing.toml", &kept());
    write("true.toml", &imperfect());
    write("hand.toml", HAND);
    let page = |out: &str| {
        let file = |name: &str| std::fs::read_to_string(folder.join(out).join(name)).expect("written");
        (file("certificate.md"), file("certificate.html"))
    };
    run(folder, "rig certify drawing.toml --out bare").success().stdout(
        contains("figures have a value, 8 are not measured")
            .and(contains("drift in a turn: it needs recordings: `hbot rig certify RIG.toml RUN.mcap`"))
            .and(contains("imbalance, cogging: `hbot rig certify --motors` measures it"))
            .and(contains("certificate.md: written")),
    );
    run(folder, "rig certify drawing.toml --out bare")
        .code(1)
        .stderr(contains("bare: certificate.md is there already. Name another folder by --out"));
    std::fs::create_dir(folder.join("pictures")).expect("made");
    write("pictures/drift.svg", "a picture of somebody else");
    run(folder, "rig certify drawing.toml --out pictures")
        .code(1)
        .stderr(contains("pictures: drift.svg is there already. Name another folder by --out"));
    let (bare, _) = page("bare");
    for not in ["drift in a turn", "torque accuracy", "friction of joints and sphere", "lateness of a tick"] {
        assert!(bare.contains(&format!("| {not} | not measured |")), "{not}:\n{bare}");
    }
    assert!(bare.contains("N m/rad, with"), "the border needs no measurement:\n{bare}");

    // What was asked for and could not be measured has the exit code of a failure.
    run(folder, "rig certify drawing.toml --motors --speed 0.2 --built true.toml --out stopped")
        .code(1)
        .stdout(contains("turned faster than --speed allows"));

    record(folder, "drawing.toml", 20, "run.mcap");
    // A file behind a link keeps its place and its mode.
    let (own, link) = (folder.join("own.toml"), folder.join("named.toml"));
    write("own.toml", &kept());
    std::fs::set_permissions(&own, Permissions::from_mode(0o600)).expect("its own");
    std::os::unix::fs::symlink("own.toml", &link).expect("made");
    run(
        folder,
        "rig certify drawing.toml run.mcap --motors --built true.toml --out whole --write named.toml",
    )
    .success();
    let (whole, html) = page("whole");
    println!("{whole}");
    for said in [
        "wheel A, cone, mrad",
        "drift in a turn | ",
        "torque_scale | 1.0000 | 0.9",
        "SIMULATED",
        "bandwidth of the torque",
        "a quarter of a turn late",
    ] {
        assert!(whole.contains(said), "{said}:\n{whole}");
    }
    assert_eq!(whole.matches("not measured").count(), 1, "only lines under a load are missing:\n{whole}");
    assert!(html.contains("<svg") && html.contains("with the lead") && !html.contains("<img"));
    // A recording names the certificate of its rig.
    let named = std::fs::read_to_string(folder.join("named.toml")).expect("written");
    let name = named.lines().find_map(|line| line.strip_prefix("certificate = ")).expect("a name");
    assert!(whole.contains(name.trim_matches('"')), "{name}:\n{whole}");
    assert!(link.is_symlink());
    assert_eq!(own.metadata().expect("there").permissions().mode() & 0o777, 0o600);
    record(folder, "named.toml", 1, "named.mcap");
    run(folder, "rig certify drawing.toml named.mcap --out short")
        .code(1)
        .stdout(contains("the recordings are too short for the geometry").or(contains("moves for")));
    let mut reader =
        Reader::new(File::open(folder.join("named.mcap")).expect("recorded")).expect("a recording");
    let about = std::iter::from_fn(|| reader.next().expect("readable")).find_map(|item| match item {
        Item::About(about) => about.get("certificate").cloned(),
        _ => None,
    });
    assert_eq!(about.as_deref(), Some(name.trim_matches('"')));
    assert!(folder.join("whole/drift.svg").is_file() && folder.join("whole/stiffness.svg").is_file());
    // The same recording beside a real rig, whose file has zeros.
    let real = kept().replace("zero = \"absolute\" ", "zero_offset = 0.0083\nzero = \"absolute\" ");
    write("real.toml", &real.replacen("port = \"sim\"", "port = \"/dev/ttyACM9\"", 1));
    run(folder, "rig certify real.toml run.mcap --out real").success();
    let (real, _) = page("real");
    println!("{real}");
    assert!(real.contains("A recording is of the SIMULATED rig"), "{real}");
    assert!(real.contains("zero, mrad | 8.3000 | "), "{real}");
}
