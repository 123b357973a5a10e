//! How stiff a spring can be with the filters of simulated moteus servos and ODrives, in the whole
//! loop.

use std::sync::mpsc::channel;

use hbot_config::{RigConfig, RunningScene, SceneFile};
use hbot_core::safety::mode::Mode;
use hbot_core::{Controller, Vec3};
use hbot_host::bus::{Expected, driver, late_rates};
use hbot_host::line::{Memory, SimulatorCall};
use hbot_host::rig::layout::Layout;
use hbot_host::rig::motors::Motors;
use hbot_host::run_loop::bridge::bridge;
use hbot_host::run_loop::engine::{Engine, TickTime};
use hbot_sim::controller::{EncoderFilter, Lags};
use hbot_sim::phenomena::{Motor, Phenomena};
use hbot_sim::plant::{Plant, PlantState};
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};

/// Rate of the sphere, rad/s, above which it counts as shaking some seconds after a tap of 0.8
/// rad/s.
const STILL: f64 = 0.2;

/// Returns the prototype with moteus servos whose filters have a bandwidth of `hz`, and with rates
/// that are computed by `estimate`.
fn servos(estimate: &str, hz: f64) -> RigConfig {
    rig(include_str!("../../../rigs/prototype-moteus.toml"), estimate, 0.789_409 / hz)
}

/// Returns the rig of a file with other rates and another delay of them, s, without a lead, and
/// without the passivity stage, which would hide that a spring is too stiff.
fn rig(text: &str, estimate: &str, lag: f64) -> RigConfig {
    let text = text
        .replace("rate_estimate = \"auto\"", &format!("rate_estimate = \"{estimate}\""))
        .replace("rate_lag = ", &format!("rate_lag = {lag} #"));
    let mut rig = RigConfig::from_toml(&text, "x.toml").unwrap_or_else(|e| panic!("{e}"));
    let plain = rig.rig.with(|parts| (parts.methods.passivity, parts.lead) = (None, None));
    rig.rig = plain.expect("legal");
    rig
}

/// Returns the largest rate of the sphere, rad/s, in the last of `seconds` after a tap.
fn rest(rig: &RigConfig, k: f64, b: f64, seconds: u64) -> f64 {
    let lags = Lags { torque: Some(rig.torque_lag), rate: Some(rig.rate_lag) };
    let motor = Motor { lag_s: rig.torque_lag, ..ideal() };
    let phenomena = Phenomena { motor: Some(motor), ..Phenomena::default() };
    // In a step of the plant the torque is even, so a step must be short beside the lag of the
    // motors.
    let (max_step_ns, line) = (100_000, rig.link.protocol.into());
    let new = SimulatedConfig::new(&rig.rig);
    let config = SimulatedConfig { line, lags, phenomena, max_step_ns, ..new };
    let simulated = SimulatedRig::new(&config).expect("it can be simulated");
    let (calls, inbox) = channel();
    let mut line = Memory::new(simulated, inbox);
    let layout = Layout::of(rig);
    let expected = Expected::new("test", &rig.rig, &layout, 0);
    let protocol = driver(rig.link.protocol);
    protocol.meet(&mut line, &expected).expect("they are good");
    let motors = Motors::new(vec![protocol.bus(Box::new(line), expected)], &layout, 20);
    let (end, mut service) = bridge().expect("a bridge");
    let scene = format!("[[effect]]\nid = \"s\"\nkind = \"spring\"\nstiffness = {k}\ndamping = {b}\n");
    let scene = SceneFile::from_toml(&scene, "s.toml").expect("legal");
    let scene = Box::new(RunningScene::new().load(scene));
    let mut engine = Engine::new(motors, Controller::new(rig.rig), scene, end, None).enabling(true);
    let (mut active, mut worst) = (None, 0.0_f64);
    for tick in 0.. {
        engine.tick(&TickTime {
            tick,
            t_ns: tick * 1_000_000,
            awake_ns: 0,
            lateness_ns: 0,
            late: false,
            skipped: 0,
        });
        let state = service.try_sample().expect("a sample a tick").state;
        if state.mode == Mode::Fault {
            return 1e9;
        }
        if state.mode == Mode::Active {
            active = active.or(Some(tick));
        }
        let Some(since) = active.map(|active| tick - active) else { continue };
        if since == 100 || since == 120 {
            let torque = if since == 100 { Vec3::new(0.1, 0.07, -0.05) } else { Vec3::ZERO };
            let call: SimulatorCall = Box::new(move |rig| rig.set_external(torque));
            calls.send(call).expect("the line is there");
        }
        if since > 1000 * (seconds - 1) {
            worst = worst.max(state.omega.length());
        }
        if since > 1000 * seconds {
            return worst;
        }
    }
    unreachable!()
}

fn ideal() -> Motor {
    Motor {
        lag_s: 0.0,
        thermal_time_s: 1e9,
        steer_no_load_rate: 1e9,
        drive_no_load_rate: 1e9,
        torque_scale: 1.0,
    }
}

/// Returns the least apparent inertia of the sphere in the posture of the tests, kg m²: the inverse
/// of the largest eigenvalue of the inverse tensor, by power iteration.
fn inertia(rig: &RigConfig) -> f64 {
    let plant = Plant::new(&rig.rig.device).expect("a legal plant");
    let inverse = plant.apparent_inertia(&PlantState::default()).inverse();
    let mut v = Vec3::new(0.6, 0.64, 0.48);
    (0..64).for_each(|_| v = (inverse * v).normalize());
    1.0 / v.dot(inverse * v)
}

/// Returns whether one axis of the loop comes to rest: an inertia with the spring `k` and the
/// damping `b`, whose angle and rate pass the filter and reach the torque one tick later. The motor
/// follows the command with its lag. Everything is integrated in steps of a hundredth of a tick.
fn axis_rests(rig: &RigConfig, k: f64, b: f64) -> bool {
    const STEPS: u32 = 100;
    let (period, inertia) = (rig.rig.timing.period_s(), inertia(rig));
    let h = period / f64::from(STEPS);
    let mut filter = EncoderFilter::new(2.0 / rig.rate_lag);
    let left = (-h / rig.torque_lag).exp();
    let (mut x, mut v, mut torque, mut command) = (0.0, 1e-3, 0.0, 0.0);
    let mut late = 0.0_f64;
    for tick in 0..4000 {
        let next = -k * (x - filter.angle_behind()) - b * (v - filter.rate_behind());
        for _ in 0..STEPS {
            let after = command + (torque - command) * left;
            let acceleration = 0.5 * (torque + after) / inertia;
            let before = v;
            (x, v, torque) = (x + h * (v + 0.5 * h * acceleration), v + h * acceleration, after);
            filter.follow(h, before, v);
        }
        command = next;
        if v.abs() > 1.0 {
            return false;
        }
        late = if tick > 3500 { late.max(v.abs()) } else { 0.0 };
    }
    late < 1e-3
}

/// Returns the largest stiffness at which the model of one axis comes to rest, N m/rad. Checks that
/// it is the border of the whole loop with simulated controllers within 5 %.
fn border(rig: &RigConfig, damping: f64) -> f64 {
    let (mut low, mut high) = (10.0_f64, 1000.0_f64);
    while high / low > 1.002 {
        let middle = (low * high).sqrt();
        if axis_rests(rig, middle, damping) { low = middle } else { high = middle }
    }
    let name = rig.link.protocol.name();
    let [below, above] = [0.95, 1.05].map(|share| rest(rig, share * low, damping, 4));
    assert!(below < STILL, "{name}, {} s, 5 % below {low} N m/rad: {below} rad/s", rig.rate_lag);
    assert!(above > STILL, "{name}, {} s, 5 % above {low} N m/rad: {above} rad/s", rig.rate_lag);
    low
}

/// The dampings are those that carry most. At 200 Hz this is 57 N m/rad.
#[test]
fn springs_are_as_stiff_as_the_filters_of_the_servos_allow() {
    for (hz, damping, about) in [(200.0, 0.4, 57.0), (400.0, 0.6, 114.0), (1000.0, 1.0, 212.0)] {
        let found = border(&servos("controller", hz), damping);
        assert!((found / about - 1.0).abs() < 0.02, "{hz} Hz: {found} N m/rad");
    }
}

/// An ODrive with the vendor's bandwidth of 1000 rad/s, and with a quarter of it.
#[test]
fn springs_are_as_stiff_as_the_filters_of_odrives_allow() {
    for lag in [0.002, 0.008] {
        let rig = rig(include_str!("../../../rigs/prototype-odrive.toml"), "controller", lag);
        border(&rig, 0.3);
    }
}

/// Rates that are computed from the positions are not late, although the positions are filtered
/// too.
#[test]
fn kalman_makes_springs_stiffer_where_the_rates_of_the_servos_are_late() {
    for (hz, stiffness) in [(200.0, 100.0), (400.0, 150.0)] {
        let [late, kalman] = ["controller", "kalman"].map(|estimate| servos(estimate, hz));
        assert!(late_rates(&late).is_some() && late_rates(&kalman).is_none());
        let shakes = rest(&late, stiffness, 0.6, 4);
        assert!(shakes > STILL, "{hz} Hz: {shakes} rad/s");
        let rests = rest(&kalman, stiffness, 0.6, 4);
        assert!(rests < STILL, "{hz} Hz: {rests} rad/s");
    }
}
