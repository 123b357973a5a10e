//! Computes the torque of a scene while a virtual sphere swings about an axis or is held still.

use std::f64::consts::{PI, TAU};

use hbot_config::{RigConfig, RunningScene, SceneFile};
use hbot_core::effects::{Effect, Motion, Span};
use hbot_core::render::Renderer;
use hbot_core::{CompiledScene, Quat, Vec3, rotation};

/// Duration of one swing from one half turn to the other and back, s.
const SWING_S: f64 = 8.0;
/// Duration of the motion to the start of the swing, s.
const LEAD_S: f64 = 1.0;
const DT: f64 = 1.0e-3;

/// A scene whose torque is computed, with the loop of the prototype.
pub(super) struct Probe {
    renderer: Renderer,
    scene: CompiledScene,
    names: Vec<String>,
}

/// Torque about an axis, N m, against the angle about it, rad, for both directions of a swing.
pub(super) struct Curves {
    pub(super) forth: Vec<(f64, f64)>,
    pub(super) back: Vec<(f64, f64)>,
}

impl Probe {
    pub(super) fn new(file: &SceneFile) -> Self {
        let names = file.effects().iter().map(|effect| effect.id().to_owned()).collect();
        let compiled = RunningScene::new().load(file.clone());
        // The plot shows the scene after its effects have faded in.
        let effects: Vec<Effect> =
            compiled.effects().iter().map(|effect| Effect { fade_s: 0.0, ..*effect }).collect();
        let end = effects.iter().map(|effect| effect.numbers.start + effect.numbers.len).max().unwrap_or(0);
        let figures = compiled.numbers(Span { start: 0, len: end });
        let scene = CompiledScene::with_numbers(compiled.revision(), &effects, figures)
            .unwrap_or_else(|error| unreachable!("the same effects and figures: {error}"));
        Self { renderer: Renderer::new(&RigConfig::prototype().rig), scene, names }
    }

    /// Returns a scene for each single effect, with the effect's id. Returns none if there is only
    /// one effect.
    pub(super) fn parts(&self) -> Vec<(String, Self)> {
        if self.names.len() < 2 {
            return Vec::new();
        }
        let part = |(i, name): (usize, &String)| {
            let part = Self {
                renderer: self.renderer.clone(),
                scene: self.scene.only(i),
                names: vec![name.clone()],
            };
            (name.clone(), part)
        };
        self.names.iter().enumerate().map(part).collect()
    }

    fn fresh(&self) -> Renderer {
        let mut renderer = self.renderer.clone();
        renderer.adopt(&self.scene, Quat::IDENTITY);
        renderer
    }

    /// Swings the sphere about the unit vector `axis` in frame N. Returns every fifth tick.
    pub(super) fn swing(&self, axis: Vec3) -> Curves {
        let mut renderer = self.fresh();
        let mut curves = Curves { forth: Vec::new(), back: Vec::new() };
        let ticks = |time: f64| (time / DT).round() as u64;
        let (lead, swing) = (ticks(LEAD_S), ticks(SWING_S));
        for tick in 0..=lead + swing {
            // Moves to the start of the swing and then swings, without a jump in rate.
            let (angle, rate) = if tick < lead {
                let pace = PI / LEAD_S;
                let phase = pace * tick as f64 * DT;
                (-0.5 * PI * (1.0 - phase.cos()), -0.5 * PI * pace * phase.sin())
            } else {
                let pace = TAU / SWING_S;
                let phase = pace * (tick - lead) as f64 * DT;
                (-PI * phase.cos(), PI * pace * phase.sin())
            };
            let motion = Motion { q: rotation::exp(axis * angle), omega: axis * rate };
            let torque = renderer.render(&self.scene, &motion, tick, DT, 1.0).dot(axis);
            if tick >= lead && tick % 5 == 0 {
                let point = (angle, torque);
                if tick <= lead + swing / 2 {
                    curves.forth.push(point);
                }
                if tick >= lead + swing / 2 {
                    curves.back.push(point);
                }
            }
        }
        curves
    }

    /// Holds the sphere still for `time` seconds. Returns the three components of the torque in
    /// frame N, N m, at every `every`th tick.
    pub(super) fn still(&self, time: f64, every: u64) -> [Vec<(f64, f64)>; 3] {
        let mut renderer = self.fresh();
        let motion = Motion { q: Quat::IDENTITY, omega: Vec3::ZERO };
        let mut curves = [const { Vec::new() }; 3];
        for tick in 0..=(time / DT).round() as u64 {
            let torque = renderer.render(&self.scene, &motion, tick, DT, 1.0).to_array();
            if tick % every == 0 {
                for (curve, x) in curves.iter_mut().zip(torque) {
                    curve.push((tick as f64 * DT, x));
                }
            }
        }
        curves
    }

    /// Returns the smallest energy with the sphere's third axis along the unit vector `direction`,
    /// J.
    pub(super) fn least_energy(&self, direction: Vec3) -> f64 {
        /// Number of turns about that axis that are tried, in steps of 5 degrees.
        const SPINS: u32 = 72;
        let renderer = self.fresh();
        let there = Quat::from_rotation_arc(Vec3::Z, direction);
        (0..SPINS)
            .filter_map(|k| {
                let spin = Quat::from_rotation_z(TAU * f64::from(k) / f64::from(SPINS));
                renderer.energy(&self.scene, there * spin)
            })
            .fold(f64::INFINITY, f64::min)
    }
}
