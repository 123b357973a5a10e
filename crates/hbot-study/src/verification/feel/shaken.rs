//! Scenes that shake by themselves, with and without the passivity stage.

use hbot_config::SceneFile;
use hbot_core::Vec3;
use hbot_sim::phenomena::{Hand, Phenomena};
use hbot_sim::plant::PlantState;
use serde_json::{Value, json};

use crate::context::{Context, Interrupted};
use crate::report::Report;
use crate::whole::{Whole, prototype};

/// Angular velocity after a tap, rad/s in N.
const TAP: Vec3 = Vec3::new(0.3, 0.6, 0.15);

/// The scenes, each with its name.
fn cases() -> Vec<(&'static str, Value)> {
    let spring = |i: usize, k: f64, b: f64| json!({"id": format!("s{i}"), "kind": "spring", "anchor": "here", "stiffness": k, "damping": b});
    let one = |effect: Value| Value::Array(vec![effect]);
    vec![
        ("spring 10, damping 0.02", one(spring(0, 10.0, 0.02))),
        ("spring 40, damping 0.01", one(spring(0, 40.0, 0.01))),
        (
            "20 springs of 20 N m/rad, damping 0.002",
            Value::Array((0..20).map(|i| spring(i, 20.0, 0.002)).collect()),
        ),
        (
            "spring 40, damping about one axis",
            one(
                json!({"id": "s", "kind": "spring", "anchor": "here", "stiffness": 40, "damping": [[0.1, 0, 0], [0, 0, 0], [0, 0, 0]]}),
            ),
        ),
        (
            "spring 300, a wall never touched",
            json!([spring(0, 300.0, 0.0), {"id": "w", "kind": "end_stop", "cone": 2.7, "stiffness": 1, "damping": 0.7}]),
        ),
        (
            "spring 40, damper 0.1 beyond 100 rad/s",
            json!([spring(0, 40.0, 0.0), {"id": "d", "kind": "damper", "damping": 0.1, "deadband": 100}]),
        ),
        (
            "spring 40, detents that damp",
            json!([spring(0, 40.0, 0.0), {"id": "d", "kind": "detents", "axis": [1, 0, 0], "strength": 0, "damping": 0.1}]),
        ),
        (
            "end_stop 200, cone 0, damping 0.45",
            one(
                json!({"id": "w", "kind": "end_stop", "cone": 0, "anchor": "here", "stiffness": 200, "damping": 0.45}),
            ),
        ),
        ("snaps 0.9, width 0.01", one(json!({"id": "s", "kind": "snaps", "strength": 0.9, "width": 0.01}))),
        (
            "magnet 0.9, width 0.01",
            one(json!({"id": "m", "kind": "magnet", "anchor": "here", "strength": 0.9, "width": 0.01})),
        ),
        (
            "magnet 0.9, width 0.1",
            one(json!({"id": "m", "kind": "magnet", "anchor": "here", "strength": 0.9, "width": 0.1})),
        ),
        (
            "magnet 0.15, width 0.02",
            one(json!({"id": "m", "kind": "magnet", "anchor": "here", "strength": 0.15, "width": 0.02})),
        ),
        ("texture 500 waves, 0.9", one(json!({"id": "t", "kind": "texture", "waves": 500, "depth": 0.9}))),
        ("detents 30, 0.9", one(json!({"id": "d", "kind": "detents", "count": 30, "strength": 0.9}))),
        ("detents 720, 0.9", one(json!({"id": "d", "kind": "detents", "count": 720, "strength": 0.9}))),
        ("friction 0.3 (defaults)", one(json!({"id": "f", "kind": "friction", "torque": 0.3}))),
        (
            "friction 0.3, stiffness 100",
            one(json!({"id": "f", "kind": "friction", "torque": 0.3, "stiffness": 100})),
        ),
        (
            "friction 0.9, stiffness 1000, damping 0",
            one(json!({"id": "f", "kind": "friction", "torque": 0.9, "stiffness": 1000, "damping": 0})),
        ),
        (
            "pendulum 100 kg at 10 m, g 100",
            one(json!({"id": "p", "kind": "pendulum", "mass": 100, "centre": [0, 0, -10], "gravity": 100})),
        ),
        ("spring 400", one(spring(0, 400.0, 0.02))),
        ("spring 300", one(spring(0, 300.0, 0.0))),
    ]
}

pub(super) fn study(context: &Context, _report: &mut Report) -> Result<(), Interrupted> {
    for (name, effects) in cases() {
        context.go_on()?;
        if let Ok(only) = std::env::var("ONLY") {
            if !name.contains(&only) {
                continue;
            }
        }
        print!("{name:44}");
        for hand in [None, Some(Hand { amplitude: 0.0, ..Hand::default() })] {
            for guard in [false, true] {
                let scene = json!({"name": "case", "effect": effects});
                let scene = SceneFile::from_json(scene).unwrap_or_else(|e| panic!("{name}: {e}"));
                let config = prototype(&[("loop.passivity", json!(guard))]);
                let phenomena = Phenomena { hand, ..Phenomena::default() };
                let mut whole = Whole::with(&config, scene, phenomena, PlantState::default());
                for _ in 0..800 {
                    whole.step(None);
                }
                let state = PlantState { omega: TAP, ..*whole.rig().state() };
                whole.rig_mut().set_state(state);
                let (mut most, mut sum, mut torque) = (0.0_f64, 0.0, 0.0);
                for k in 0..3500 {
                    let told = whole.step(None).state;
                    let w = whole.rig().state().omega.length();
                    most = most.max(w);
                    if k >= 2000 {
                        sum += w * w;
                        torque += told.torque.length_squared();
                    }
                }
                print!(
                    " | {:5.2} max {:5.2}, {:.2} N m",
                    (sum / 1500.0_f64).sqrt(),
                    most,
                    (torque / 1500.0_f64).sqrt()
                );
            }
        }
        println!();
    }
    Ok(())
}
