//! Every scene of scenes/ runs on every rig of rigs/ for ten seconds, held by a simulated hand.

use crate::prelude::*;
use std::path::PathBuf;

use hbot_config::{RigConfig, RunningScene, SceneFile};
use hbot_sim::hand::Grip;
use hbot_sim::plant::{Method, Plant, PlantState};

use crate::bench::assert_finite;

fn files(folder: &str) -> Vec<PathBuf> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..").join(folder);
    let mut all: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    all.retain(|path| path.extension().is_some_and(|e| e == "toml"));
    all.sort();
    all
}

/// Results of a run.
#[derive(Default)]
struct Seen {
    /// Largest torque, N m.
    torque: f64,
    /// Largest change of the torque in a tick, N m.
    change: f64,
    /// Angle by which the sphere has turned, rad.
    turned: f64,
}

/// Runs a scene for `seconds`. Every reading is a tick old when its torque begins.
fn run(config: &RigConfig, file: &SceneFile, seconds: f64) -> Seen {
    let rig = altered(&config.rig, |rig| rig.joints.iter_mut().for_each(|joint| joint.zero = Zero::Assume));
    let scene = RunningScene::new().load(file.clone());
    let mut controller = Controller::new(rig);
    let hand = file.simulate().and_then(|simulate| simulate.hand).unwrap_or_default();
    let mut plant = Plant::new(&rig.device).unwrap();
    plant.set_sphere_inertia(plant.sphere_inertia() + hand.inertia);
    let mut state = PlantState::default();
    let grip = Grip::new(hand, 0.0, state.q);
    let h = rig.timing.period_s();
    let mut seen = Seen::default();
    let (mut tau, mut last) = ([0.0; MAX_JOINTS], Vec3::ZERO);
    for tick in 1..=(seconds / h) as u64 {
        let feedback = encoders(&rig, &state.joints(), &plant.joint_rates(&state), tick - 1);
        plant.step(Method::Rk4, &mut state, tick as f64 * h, h, &tau, &grip);
        let mut inputs = Inputs { feedback: Some(feedback), ..Inputs::quiet(tick) };
        if tick == 3 {
            inputs.commands.push(Command::Enable).unwrap();
        }
        let outputs = controller.tick(&scene, &inputs);
        assert_finite(&outputs);
        let now = &outputs.state;
        assert_eq!(now.cause, None, "{} at {tick}", file.name());
        if tick == 3 {
            assert_eq!(outputs.replies[0], Some(Reply::Done), "{}", file.name());
        }
        tau = now.joint_torque;
        seen.torque = seen.torque.max(now.torque.length());
        seen.change = seen.change.max((now.torque - last).length());
        seen.turned += state.omega.length() * h;
        last = now.torque;
        if tick as f64 * h > 1.0 {
            assert_eq!(now.mode, Mode::Active, "{}", file.name());
        }
    }
    seen
}

#[test]
fn every_scene_runs_on_every_rig() {
    let (scenes, rigs) = (files("scenes"), files("rigs"));
    assert!(scenes.len() >= 15 && !rigs.is_empty());
    for rig in &rigs {
        let config = RigConfig::load(Some(rig), &[]).unwrap_or_else(|error| panic!("{error}"));
        for path in &scenes {
            let file = SceneFile::from_path(path).unwrap_or_else(|error| panic!("{error}"));
            let seen = run(&config, &file, 10.0);
            assert!(seen.turned > 0.5, "{}: the hand turned it by {} rad", file.name(), seen.turned);
            assert!(seen.torque > 1e-3, "{}: nothing was felt", file.name());
            // The slew limit holds to rounding, and scenes of this repository stay within what a
            // rig can make.
            let limits = &config.rig.limits;
            assert!(
                seen.change <= limits.torque_rate * config.rig.timing.period_s() + 1e-12,
                "{}",
                file.name()
            );
            assert!(seen.torque <= limits.torque + 1e-12, "{}", file.name());
        }
    }
}

/// A heavy ball held only by a light hand is still calm: the virtual mass does not oscillate with
/// the delay of the loop.
#[test]
fn a_heavy_ball_is_heavier_and_calm() {
    let config = RigConfig::prototype();
    let scene = |text: &str| SceneFile::from_toml(text, "x.toml").unwrap();
    let light =
        "[simulate]\nhand = { stiffness = 0.2, damping = 0.002, inertia = 0, amplitude = 1, rate = 1 }\n";
    let empty = run(&config, &scene(light), 10.0);
    let ball = "[[effect]]\nid = 'm'\nkind = 'inertia'\nmass = 0.015\n";
    let heavy = run(&config, &scene(&format!("{ball}{light}")), 10.0);
    println!("turned {:.2} rad without, {:.2} rad with a virtual mass", empty.turned, heavy.turned);
    assert!(heavy.turned < 0.8 * empty.turned, "{} of {}", heavy.turned, empty.turned);
}
