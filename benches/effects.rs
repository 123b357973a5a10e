//! Measures the time of the effects per tick. Rendering alone is measured for an empty scene, for
//! each kind of effect with default parameters, and for all kinds together. The whole tick of a
//! `Controller` is measured for the empty scene and for all kinds.
//!
//! `cargo bench --bench effects`

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use hbot_config::scene::kinds;
use hbot_config::{RigConfig, RunningScene, SceneFile};
use hbot_core::design::rig::Limits;
use hbot_core::inputs::{Command, Inputs, JointReadings};
use hbot_core::render::Renderer;
use hbot_core::render::effects::Motion;
use hbot_core::safety::mode::Mode;
use hbot_core::{CompiledScene, Controller, MAX_JOINTS, Quat, Vec3, rotation};
use serde_json::{Value, json};

fn scene(effects: &[Value]) -> CompiledScene {
    let file = SceneFile::from_json(json!({ "effect": effects })).expect("defaults are legal");
    RunningScene::new().load(file)
}

/// Returns a scene with one effect of each kind, and a second spring with another reference.
fn mixed() -> CompiledScene {
    let mut effects: Vec<Value> = kinds().iter().map(|k| json!({"id": k.name, "kind": k.name})).collect();
    effects.push(json!({"id": "other", "kind": "spring", "reference": [1, 0.1, 0, 0], "damping": 0.01}));
    scene(&effects)
}

/// Returns a sequence of motions in which the sphere never rests, so that no effect can take a
/// shortcut for a sphere at rest.
fn motions() -> Vec<Motion> {
    let turn = |k: usize| {
        let t = k as f64 * 0.01;
        Vec3::new(0.9 * t.sin(), 0.7 * (0.7 * t).cos(), 0.8 * (1.3 * t).sin())
    };
    (0..1024)
        .map(|k| {
            let (q, next) = (rotation::exp(turn(k)), rotation::exp(turn(k + 1)));
            Motion { q, omega: rotation::difference(next, q) / 1e-3 }
        })
        .collect()
}

fn rendering(c: &mut Criterion) {
    let rig = RigConfig::prototype().rig;
    let motions = motions();
    let mut group = c.benchmark_group("render");
    let single = kinds().into_iter().map(|k| (k.name, scene(&[json!({"id": "e", "kind": k.name})])));
    for (name, scene) in [("empty", CompiledScene::empty()), ("mixed", mixed())].into_iter().chain(single) {
        let mut renderer = Renderer::new(&rig);
        renderer.adopt(&scene, Quat::IDENTITY);
        let mut tick = 0_u64;
        group.bench_function(name, |b| {
            b.iter(|| {
                tick += 1;
                let motion = &motions[tick as usize % motions.len()];
                renderer.render(black_box(&scene), black_box(motion), tick, 1e-3, 1e-3)
            });
        });
    }
    group.finish();
}

fn whole_ticks(c: &mut Criterion) {
    // The joint feedback below is not that of a turning sphere, so the wheels seem to slip. The
    // limits are so wide that this is no fault. The orientation also stays near the references of
    // all effects.
    let Limits { slip, speed, enable_max_angle, .. } = Limits::WIDEST;
    let rig = RigConfig::prototype().rig;
    let rig = rig
        .with(|rig| rig.limits = Limits { slip, speed, enable_max_angle, ..rig.limits })
        .expect("a legal rig");
    let mut group = c.benchmark_group("tick");
    for (name, scene) in [("empty", CompiledScene::empty()), ("mixed", mixed())] {
        let mut controller = Controller::new(rig);
        let mut tick = 0_u64;
        let mut run = |controller: &mut Controller| {
            let phase = tick as f64 * 0.006;
            let mut counts = [0; MAX_JOINTS];
            let mut rates = [0.0; MAX_JOINTS];
            for i in 0..4 {
                counts[i] = (600.0 * (phase + i as f64).sin()) as i32;
                // The joint rate that agrees with these encoder counts at 1 kHz. If the two
                // disagreed, the controller would report a fault.
                rates[i] = 600.0 * 6.0 * (phase + i as f64).cos() * rig.joints[i].radians_per_count();
            }
            let mut inputs = Inputs::quiet(tick);
            inputs.feedback = Some(JointReadings::new(tick as u32, counts, rates));
            if tick == 1 {
                let _ = inputs.commands.push(Command::Enable);
            }
            tick += 1;
            controller.tick(&scene, &inputs)
        };
        for _ in 0..1000 {
            run(&mut controller);
        }
        assert_eq!(run(&mut controller).state.mode, Mode::Active);
        group.bench_function(name, |b| b.iter(|| black_box(run(&mut controller)).state.torque));
    }
    group.finish();
}

criterion_group!(benches, rendering, whole_ticks);
criterion_main!(benches);
