//! Tests of rig files: the prototype's values, defaults and methods (here), one case for each kind
//! of mistake (`mistakes`), and the keys of motor controllers and ports (`controllers`).

mod controllers;
mod mistakes;

use hbot_config::rig::{Port, Protocol};
use hbot_config::{LoadError, Override, RigConfig};
use hbot_core::design::rig::{
    AllocationMethod, LeadTime, Methods, OdometryMethod, PassivityLimit, PathFit, RateEstimate, Zero,
};
use hbot_core::inputs::OnClientLost;
use serde_json::json;

use crate::{folder, toml_files};

const LEAST: &str = r#"
sphere = { radius = 0.1, mass = 0.5 }
[[wheel]]
axis = [1, 0, -1]
cone = 0.17
radius = 0.015
steer = { counts_per_turn = 4096, peak = 1, continuous = 0.1 }
drive = { counts_per_turn = 4096, peak = 1, continuous = 0.1 }
[[wheel]]
axis = [-1, 0, -1]
cone = 0.17
radius = 0.015
steer = { counts_per_turn = 4096, peak = 1, continuous = 0.1 }
drive = { counts_per_turn = 4096, motor = false }
"#;

fn said(from: &str, to: &str) -> String {
    assert!(LEAST.contains(from), "{from}");
    said_of(&LEAST.replacen(from, to, 1))
}

fn said_of(text: &str) -> String {
    RigConfig::from_toml(text, "x.toml").expect_err(text).to_string()
}

#[test]
fn every_file_in_rigs_loads() {
    for path in toml_files("rigs") {
        RigConfig::from_path(&path).unwrap_or_else(|error| panic!("{error}"));
    }
}

#[test]
fn the_prototype_is_built_in_and_is_the_paper_s() {
    let config = RigConfig::prototype();
    assert_eq!(config, RigConfig::from_path(&folder("rigs/prototype.toml")).unwrap());
    assert_eq!(config.name, "Hbot prototype");
    assert_eq!(config.wheels, ["A", "B"]);
    assert_eq!(config.controllers, [0, 1, 2, 3]);
    let device = &config.rig.device;
    assert_eq!((device.sphere_radius(), device.sphere_mass()), (0.102, 0.467));
    for (wheel, side) in device.wheels().iter().zip([1.0, -1.0]) {
        let spec = wheel.spec();
        assert_eq!((spec.cone, spec.toe, spec.radius), (0.1745, 0.0, 0.0155));
        assert_eq!((spec.steer_inertia, spec.drive_inertia, spec.axial_inertia), (2.7e-5, 3.5e-6, 0.0));
        let axis = hbot_core::Vec3::new(side, 0.0, -1.0) * std::f64::consts::FRAC_1_SQRT_2;
        // The tolerance is the rounding of a unit vector, twice.
        assert!((spec.axis - axis).length() < 4.0 * f64::EPSILON);
    }
    for (i, joint) in config.rig.joints[..device.joints()].iter().enumerate() {
        let steer = i % 2 == 0;
        assert_eq!(joint.counts_per_turn, 16384);
        assert_eq!(joint.gear, if steer { 1.0 } else { 17.0 });
        assert_eq!((joint.peak, joint.continuous), if steer { (0.93, 0.073) } else { (0.14, 0.023) });
        assert!(!joint.reversed && (!steer || joint.zero == Zero::Assume));
    }
    let traction = config.rig.limits.traction.unwrap();
    assert_eq!((traction.mu, traction.normal_force), (0.8, 10.0));
    assert_eq!((config.rig.timing.period_ns, config.rig.timing.timeout_ticks), (1_000_000, 20));
    assert_eq!((config.link.port, config.link.watchdog_ms), (Port::Sim, 50));
}

#[test]
fn what_a_file_leaves_out_has_the_documented_default() {
    let config = RigConfig::from_toml(LEAST, "x.toml").unwrap();
    assert_eq!(config.name, "Hbot");
    assert_eq!(config.wheels, ["A", "B"]);
    assert_eq!(config.controllers, [0, 1, 2, 3]);
    assert_eq!((config.rate_hz, config.accuracy), (1000, "balanced"));
    let passivity = Some(PassivityLimit::of(&config.rig.device, 1e-3));
    assert_eq!(config.rig.methods, Methods { passivity, ..Methods::BALANCED });
    let joint = config.rig.joints[0];
    assert_eq!((joint.gear, joint.reversed, joint.zero), (1.0, false, Zero::Calibrate));
    assert_eq!(config.rig.joints[3].peak, 0.0, "no motor");
    let dead = LEAST.replace("motor = false", "motor = false, peak = 1, continuous = 0.1, sign = -1");
    let dead = RigConfig::from_toml(&dead, "x.toml").unwrap().rig.joints[3];
    assert_eq!(
        (dead.peak, dead.continuous, dead.reversed),
        (0.0, 0.0, true),
        "torques of a motor that is off"
    );
    let limits = config.rig.limits;
    assert_eq!((limits.torque, limits.torque_rate, limits.speed, limits.slip), (0.9, 200.0, 30.0, 0.05));
    assert_eq!((limits.enable_max_angle, limits.align_rate, limits.reference_rate), (0.5, 0.2, 2.0));
    assert_eq!((limits.max_age_ticks, limits.traction), (100, None));
    assert_eq!((config.link.protocol, config.link.baud), (Protocol::Hbot, 3_000_000));
    assert_eq!((config.link.watchdog_ms, config.link.timeout_ticks), (50, 20));
    assert_eq!(config.api.listen.to_string(), "127.0.0.1:4268");
    assert_eq!((config.api.token_file.clone(), config.api.on_client_lost), (None, OnClientLost::Ramp));
    assert!(!config.api.needs_token());
}

#[test]
fn every_choice_of_methods_is_understood() {
    for (accuracy, method, name) in [
        ("'fast'", OdometryMethod::Euler, "fast"),
        ("'balanced'", OdometryMethod::Midpoint, "balanced"),
        ("'exact'", OdometryMethod::Magnus4, "exact"),
        ("{ odometry = 'euler' }", OdometryMethod::Euler, "custom"),
        ("{ odometry = 'magnus4' }", OdometryMethod::Magnus4, "custom"),
        ("{}", OdometryMethod::Midpoint, "custom"),
    ] {
        let text =
            format!("{LEAST}\n[loop]\naccuracy = {accuracy}\nrate_estimate = 'difference'\nrate_hz = 3000");
        let config = RigConfig::from_toml(&text, "x.toml").unwrap();
        assert_eq!((config.rig.methods.odometry, config.accuracy), (method, name));
        assert_eq!(config.rig.methods.rate, RateEstimate::Difference);
        assert_eq!(config.rig.timing.period_ns, 333_333);
    }
}

/// Reads the shortest rig file with the lines `said` in its table `[loop]`, and returns the rig.
fn with_loop(said: &str) -> RigConfig {
    RigConfig::from_toml(&format!("{LEAST}\n[loop]\n{said}"), "x.toml").unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn paths_and_allocations_are_understood() {
    let methods = |said: &str| with_loop(&format!("accuracy = {said}\npassivity = false")).rig.methods;
    assert_eq!(methods("'exact'"), Methods::EXACT);
    assert_eq!(methods("'exact'").path, PathFit::Cubic);
    assert_eq!(methods("'fast'"), Methods::FAST);
    for (said, path, allocation) in [
        ("{ path = 'straight' }", PathFit::Straight, AllocationMethod::Exact),
        ("{ path = 'quadratic', allocation = 'clipped' }", PathFit::Quadratic, AllocationMethod::Clipped),
        ("{ path = 'cubic', allocation = 'exact' }", PathFit::Cubic, AllocationMethod::Exact),
    ] {
        assert_eq!(methods(said), Methods { path, allocation, ..Methods::BALANCED });
    }
}

#[test]
fn methods_are_named_as_in_rig_files() {
    for (odometry, path) in OdometryMethod::ALL.into_iter().zip(PathFit::ALL) {
        let (method, fit) = (odometry.name(), path.name());
        let methods =
            with_loop(&format!("accuracy = {{ odometry = '{method}', path = '{fit}' }}")).rig.methods;
        assert_eq!((methods.odometry, methods.path), (odometry, path));
    }
}

#[test]
fn every_rate_estimate_is_understood_with_its_parameters_and_no_other() {
    let window =
        |tolerance_counts, longest_ticks| RateEstimate::AdaptiveWindow { tolerance_counts, longest_ticks };
    for (said, estimate) in [
        ("'controller'", RateEstimate::Controller),
        ("{ method = 'difference' }", RateEstimate::Difference),
        ("'low_pass'", RateEstimate::LowPass { cutoff_hz: 30.0 }),
        ("{ method = 'low_pass', cutoff_hz = 12.5 }", RateEstimate::LowPass { cutoff_hz: 12.5 }),
        ("'adaptive_window'", window(1, 32)),
        ("{ method = 'adaptive_window', longest_ticks = 20 }", window(1, 20)),
        ("{ method = 'adaptive_window', tolerance_counts = 2 }", window(2, 32)),
        ("'kalman'", RateEstimate::Kalman { acceleration: 100.0 }),
        ("{ method = 'kalman', acceleration = 30 }", RateEstimate::Kalman { acceleration: 30.0 }),
    ] {
        assert_eq!(with_loop(&format!("rate_estimate = {said}")).rig.methods.rate, estimate, "{said}");
    }
    let loop_of = |said: &str| said_of(&format!("{LEAST}[loop]\nrate_estimate = {said}"));
    assert_eq!(
        loop_of("{ method = 'kalman', cutoff_hz = 3 }"),
        r#"x.toml:16:50: loop.rate_estimate.cutoff_hz: another method has this key; legal: with method = "low_pass" alone"#
    );
    assert!(loop_of("{ cutoff_hz = 3 }").contains("loop.rate_estimate.method: missing"));
    assert!(loop_of("'kalmann'").contains(r#"did you mean "kalman"?"#));
}

/// A file without the key `passivity` cannot mend a value of it.
#[test]
fn the_usual_passivity_is_legal_for_every_sphere() {
    for (radius, mass) in [(0.001, 0.001), (10.0, 1000.0)] {
        let sphere = format!("radius = {radius}, mass = {mass}");
        let text = LEAST.replace("radius = 0.1, mass = 0.5", &sphere).replace("0.015", "0.0005");
        let read = RigConfig::from_toml(&text, "x.toml").unwrap_or_else(|e| panic!("{sphere}: {e}"));
        assert!(read.rig.methods.passivity.is_some());
    }
}

#[test]
fn passivity_is_off_on_or_a_table() {
    let limit = |said: &str| with_loop(&format!("passivity = {said}")).rig.methods.passivity;
    let usual = PassivityLimit::of(&with_loop("").rig.device, 1e-3);
    assert_eq!(limit("false"), None);
    assert_eq!(limit("true"), Some(usual));
    assert_eq!(limit("{}"), Some(usual));
    assert_eq!(
        limit("{ allowance = 0, store = 0.1, damping = 0.3 }"),
        Some(PassivityLimit { allowance: 0.0, store: 0.1, damping: 0.3, strict: false })
    );
    assert_eq!(with_loop("").rig.methods.passivity, Some(usual), "on unless the file says otherwise");
    let strict = PassivityLimit::strict(&with_loop("").rig.device, 1e-3);
    assert_eq!(limit("{ strict = true }"), Some(strict));
    assert_eq!((strict.store, strict.strict), (0.5, true));
    // 2/3 m R², over four loop periods.
    let slow = with_loop("rate_hz = 250\npassivity = true").rig;
    let want = slow.device.sphere_inertia() / 4.0 / 4e-3;
    assert!((slow.methods.passivity.unwrap().damping - want).abs() < 1e-12);
}

#[test]
fn the_lead_is_off_on_or_a_table() {
    let lead = |said: &str| with_loop(&format!("lead = {said}")).rig.lead;
    let usual = LeadTime::default();
    assert_eq!(lead("false"), None);
    assert_eq!(lead("true"), Some(usual));
    assert_eq!(lead("{}"), Some(usual));
    assert_eq!(lead("{ factor = 1.2, longest_ms = 4 }"), Some(LeadTime { factor: 1.2, longest: 4e-3 }));
    assert_eq!(with_loop("").rig.lead, Some(usual), "on unless the file says otherwise");
}

#[test]
fn the_command_line_overrides_and_is_named_in_messages() {
    let load = |path, value, from| RigConfig::load(None, &[Override { path, value, from }]);
    let config = load("link.port", json!("/dev/ttyACM0"), "--port").unwrap();
    assert_eq!(config.link.port, Port::Devices(vec!["/dev/ttyACM0".to_owned()]));
    assert_eq!(config.link.watchdog_ms, 20, "the default follows the port");
    assert_eq!(load("loop.accuracy", json!("exact"), "--accuracy").unwrap().accuracy, "exact");
    let error = load("loop.rate_hz", json!(7), "--rate").unwrap_err();
    assert_eq!(error.to_string(), "--rate: loop.rate_hz: 7 is out of range; legal: 50 to 20000 Hz");
    // An override creates a table that the file does not have.
    let over = [Override { path: "api.listen", value: json!("[::]:1"), from: "--listen" }];
    assert!(RigConfig::from_toml_with(LEAST, "x.toml", &over).unwrap().api.needs_token());
}

#[test]
fn a_token_file_stands_beside_its_rig_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.toml");
    std::fs::write(&path, format!("{LEAST}[api]\ntoken_file = 'token'")).unwrap();
    assert_eq!(RigConfig::from_path(&path).unwrap().api.token_file, Some(folder.path().join("token")));
    let error = RigConfig::from_path(&folder.path().join("none.toml")).unwrap_err();
    assert!(
        matches!(error, LoadError::Read { .. }) && error.to_string().contains("none.toml: cannot be read")
    );
}

#[test]
fn an_encrypted_service_names_both_its_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.toml");
    std::fs::write(&path, format!("{LEAST}[api]\ntls = {{ certificate = 'a.pem', key = '/k/b.pem' }}"))
        .unwrap();
    let tls = RigConfig::from_path(&path).unwrap().api.tls.unwrap();
    assert_eq!((tls.certificate, tls.key), (folder.path().join("a.pem"), "/k/b.pem".into()));
    assert_eq!(RigConfig::prototype().api.tls, None);
    let lines = LEAST.lines().count();
    // The text that the column points at, and the message.
    for (table, at, what) in [
        ("{ certificate = 'a.pem' }", "{", "api.tls.key: missing; legal: a string"),
        ("{ certificate = 'a.pem', key = 1 }", "1", "api.tls.key: found 1; legal: a string"),
        ("{ certificate = 'a.pem', key = '' }", "''", "api.tls.key: "),
        ("{ certificate = 'a.pem', kei = 'b' }", "kei", "api.tls.kei: unknown key (did you mean `key`?)"),
    ] {
        let line = format!("tls = {table}");
        let said = said_of(&format!("{LEAST}[api]\n{line}\n"));
        let column = line.find(at).unwrap() + 1;
        let wanted = format!("x.toml:{}:{column}: {what}", lines + 2);
        assert!(said.lines().any(|line| line.starts_with(&wanted)), "{wanted}\n{said}");
    }
}

#[test]
fn the_loop_may_have_a_processor_of_its_own() {
    let of = |text: &str| RigConfig::from_toml(text, "x.toml").map(|config| config.cpu);
    assert_eq!(of(&format!("{LEAST}[loop]\ncpu = 3\n")), Ok(Some(3)));
    assert_eq!(of(LEAST), Ok(None));
    let said = said_of(&format!("{LEAST}[loop]\ncpu = -1\n"));
    assert!(said.contains("loop.cpu: -1 is out of range; legal: 0 to 1023"), "{said}");
}

#[test]
fn the_share_of_a_line_that_frames_take() {
    let link = RigConfig::prototype().link;
    // 60 bytes of 10 bits, 1000 times per second, at 3 Mbaud.
    assert_eq!(link.load(60, 1000), 0.2);
}

/// Checks that an absent key of a rig file has the core's default, so that programs behave alike
/// with and without a file.
#[test]
fn what_a_file_does_not_state_is_the_default_of_the_core() {
    let rig = RigConfig::from_toml(LEAST, "x.toml").unwrap().rig;
    let joint =
        hbot_core::design::rig::Joint { continuous: 0.1, ..hbot_core::design::rig::Joint::new(4096, 1.0) };
    let mut parts = hbot_core::RigParts::new(rig.device);
    parts.joints[..3].fill(joint);
    // The last joint of the shortest file has no motor.
    parts.joints[3] = hbot_core::design::rig::Joint::new(4096, 0.0);
    // The core has no passivity controller and no lead unless it is asked for. A rig file has both.
    parts.methods.passivity = Some(PassivityLimit::of(&parts.device, 1e-3));
    parts.lead = Some(LeadTime::default());
    // A program without a file knows no motors.
    parts.torque_lag = hbot_config::rig::USUAL_LAG_S;
    assert_eq!(*rig, parts);
}

/// The stiffness of a rig is limited by its latest motor. A joint without a motor has none,
/// whatever the file says.
#[test]
fn the_lag_of_a_rig_is_that_of_its_latest_motor() {
    let lag = |text: &str| RigConfig::from_toml(text, "x.toml").unwrap_or_else(|e| panic!("{e}")).torque_lag;
    assert_eq!(lag(LEAST), 5e-4, "the usual lag");
    let with = |lags: [&str; 2]| {
        let [first, last] = lags.map(|lag| format!("torque_lag = {lag}, "));
        let text = LEAST.replacen("steer = { ", &format!("steer = {{ {first}"), 1);
        text.replacen("motor = false", &format!("{last}motor = false"), 1)
    };
    assert_eq!(lag(&with(["0.002", "0.05"])), 2e-3);
    assert_eq!(lag(&with(["0", "0.05"])), 5e-4, "three motors have the usual lag");
    assert!(said("steer = { ", "steer = { torque_lag = 0.2, ").contains("wheel[0].steer.torque_lag"));
}

/// The rates of a rig are as late as those of its latest joint, with or without a motor. A joint
/// that does not name its delay has the one of its protocol.
#[test]
fn the_lag_of_the_rates_is_that_of_the_latest_joint() {
    let lag = |text: &str| RigConfig::from_toml(text, "x.toml").unwrap_or_else(|e| panic!("{e}")).rate_lag;
    assert_eq!(lag(LEAST), 0.0, "hbot's own protocol");
    assert_eq!(lag(&LEAST.replacen("motor = false", "rate_lag = 0.003, motor = false", 1)), 3e-3);
    assert_eq!(lag(&LEAST.replacen("steer = { ", "steer = { rate_lag = 0.001, ", 1)), 1e-3);
    assert!(said("steer = { ", "steer = { rate_lag = 0.2, ").contains("wheel[0].steer.rate_lag"));
    for (file, text, protocol) in [
        ("moteus", include_str!("../../../../rigs/prototype-moteus.toml"), Protocol::Moteus),
        ("odrive", include_str!("../../../../rigs/prototype-odrive.toml"), Protocol::Odrive),
    ] {
        // The file names the delay in full digits of milliseconds; without it, the protocol does.
        let without: String =
            text.lines().filter(|l| !l.starts_with("rate_lag")).fold(String::new(), |a, l| a + l + "\n");
        assert_eq!(lag(&without), protocol.rate_lag(), "{file}");
        assert!((lag(text) - protocol.rate_lag()).abs() < 5e-5 && without != text, "{file}: {}", lag(text));
        let all = text.replace("rate_lag = ", "rate_lag = 0 # ");
        assert_eq!(lag(&all), 0.0, "{file}");
    }
}
