//! Computes the torque of a scene while a virtual sphere swings about an axis or is held still.

use std::f64::consts::{PI, TAU};

use hbot_core::render::Renderer;
use hbot_core::render::around::{Spot, Swing};
use hbot_core::render::effects::{Anchor, Effect, Motion, Span};
use hbot_core::{CompiledScene, Mat3, Quat, Vec3, rotation};

use crate::{RigConfig, RunningScene, SceneFile};

/// Duration of one swing from one half turn to the other and back, s.
const SWING_S: f64 = 8.0;
/// Duration of the motion to the start of the swing, s.
const LEAD_S: f64 = 1.0;
const DT: f64 = 1.0e-3;
/// Durations for which the sphere is held still, s, the longest first.
const STILL_S: [f64; 3] = [12.0, 2.5, 0.8];
/// A curve that turns back more often than this would be drawn as a band.
const MOST_TURNS: usize = 30;
/// Number of points of a curve against time.
const MOST_POINTS: usize = 2500;

/// The points of a curve.
pub type Points = Vec<(f64, f64)>;

/// A scene whose torque is computed, with the loop of the prototype.
#[derive(Debug)]
pub struct Probe {
    renderer: Renderer,
    scene: CompiledScene,
    names: Vec<String>,
}

/// Torque about an axis, N m, against the angle about it, rad, for both directions of a swing.
#[derive(Debug)]
pub struct Curves {
    /// From minus half a turn to half a turn.
    pub forth: Vec<(f64, f64)>,
    /// And back.
    pub back: Vec<(f64, f64)>,
}

impl Probe {
    /// Takes a scene. Its effects have faded in and are anchored at the identity.
    #[must_use]
    pub fn new(file: &SceneFile) -> Self {
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
    #[must_use]
    pub fn parts(&self) -> Vec<(String, Self)> {
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

    /// Returns the orientation at which the effects are anchored, if the first one with a reference
    /// pulls to `reference`. Returns `None` if this does not show: that effect is absolute, and
    /// another one is anchored where the sphere was.
    #[must_use]
    pub fn anchor(&self, reference: Quat) -> Option<Quat> {
        let mut targets = self.scene.effects().iter().filter_map(|effect| effect.kind.reference());
        match targets.next() {
            Some((turn, Anchor::Here)) => Some(turn.conjugate() * reference),
            _ => targets.all(|(_, anchor)| anchor == Anchor::Absolute).then_some(Quat::IDENTITY),
        }
    }

    /// Returns the torque of the scene in frame N, N m, at each of these motions, one tick of
    /// `period_s` after the other. Effects are anchored at `anchor`.
    #[must_use]
    pub fn along(
        &self,
        anchor: Quat,
        period_s: f64,
        motions: impl Iterator<Item = (Quat, Vec3)>,
    ) -> Vec<Vec3> {
        let mut renderer = self.renderer.clone();
        renderer.adopt(&self.scene, anchor);
        let motions = motions.map(|(q, omega)| Motion { q, omega }).enumerate();
        motions
            .map(|(tick, motion)| renderer.render(&self.scene, &motion, tick as u64, period_s, 1.0))
            .collect()
    }

    /// Swings the sphere about the unit vector `axis` in frame N. Returns every `every`-th tick.
    #[must_use]
    pub fn swing(&self, axis: Vec3, every: u64) -> Curves {
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
            if tick >= lead && tick % every == 0 {
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

    /// Returns the torque about each axis of frame N, N m, against the angle about it, rad, from
    /// minus half a turn to half a turn and back. Each has about `points` points.
    #[must_use]
    pub fn about_axes(&self, points: usize) -> [Points; 3] {
        let ticks = (SWING_S / DT) as u64;
        Vec3::AXES.map(|axis| {
            let Curves { mut forth, back } = self.swing(axis, (ticks / points as u64).max(1));
            forth.extend(back);
            forth
        })
    }

    /// Holds the sphere still. Returns the duration (s), and the three components of the torque in
    /// frame N (N m) against time (s). Returns `None` if the torque does not change with time.
    ///
    /// The duration is the longest of 12, 2.5 and 0.8 s in which a component turns back at most
    /// 30 times, so that a curve can be told from a band.
    #[must_use]
    pub fn still(&self) -> Option<(f64, [Points; 3])> {
        let mut renderer = self.fresh();
        let motion = Motion { q: Quat::IDENTITY, omega: Vec3::ZERO };
        let ticks = |time: f64| (time / DT).round() as usize;
        let torques: Vec<Vec3> = (0..=ticks(STILL_S[0]))
            .map(|tick| renderer.render(&self.scene, &motion, tick as u64, DT, 1.0))
            .collect();
        if torques.iter().all(|torque| *torque == torques[0]) {
            return None;
        }
        let turns = |time: f64| (0..3).map(|k| turns(&torques[..=ticks(time)], k)).max().unwrap_or(0);
        let time = STILL_S.into_iter().find(|time| turns(*time) <= MOST_TURNS);
        let time = time.unwrap_or(STILL_S[STILL_S.len() - 1]);
        let every = (ticks(time) / MOST_POINTS).max(1);
        let curve = |k: usize| {
            let all = torques[..=ticks(time)].iter().enumerate().step_by(every);
            all.map(|(tick, torque)| (tick as f64 * DT, torque[k])).collect()
        };
        Some((time, [0, 1, 2].map(curve)))
    }

    /// Returns whether the scene has a place into which the sphere falls from all sides. Then its
    /// energy is a landscape of more than one valley. A spring has one valley only, and the notches
    /// of a dial hold about its axis alone.
    #[must_use]
    pub fn has_wells(&self) -> bool {
        // A swing this small stays in any notch.
        let swing = Swing { axes: Mat3::IDENTITY, turn: [1.0e-4; 3], speed: 1.0e-4 };
        let mut found = false;
        self.scene.places(Quat::IDENTITY, |place| {
            if place.spot == Spot::Notch {
                let around = self.scene.around(place.effect, &place, Quat::IDENTITY, &swing);
                let k = around.stiffness.to_cols_array_2d();
                // All leading minors of a positive definite matrix are positive.
                let minor = k[0][0] * k[1][1] - k[0][1] * k[1][0];
                let size = around.stiffness.x_axis.length() + around.stiffness.y_axis.length();
                let least = 1.0e-6 * size;
                found |= k[0][0] > least
                    && minor > least * least
                    && around.stiffness.determinant() > least.powi(3);
            }
        });
        found
    }

    /// Returns the smallest energy with the sphere's third axis along the unit vector `direction`,
    /// J.
    #[must_use]
    pub fn least_energy(&self, direction: Vec3) -> f64 {
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

/// Returns how often a component of the torques changes from rising to falling or back, by more
/// than a twentieth of its range.
fn turns(torques: &[Vec3], k: usize) -> usize {
    let values = || torques.iter().map(|torque| torque[k]);
    let range = values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min);
    let (mut turns, mut rises, mut extreme) = (0, true, f64::NEG_INFINITY);
    for value in values() {
        if (value > extreme) == rises {
            extreme = value;
        } else if (value - extreme).abs() > 0.05 * range {
            (turns, rises, extreme) = (turns + 1, !rises, value);
        }
    }
    turns
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::SHELF;

    /// Returns how long the picture of a scene shows a sphere that is held still, s, and whether it
    /// shows a landscape.
    fn shows(file: &SceneFile) -> (Option<f64>, bool) {
        let probe = Probe::new(file);
        (probe.still().map(|(time, _)| time), probe.has_wells())
    }

    /// A state shows only where the first effect with a reference pulls to.
    #[test]
    fn the_anchor_shows_if_the_first_reference_has_it() {
        let of = |[first, second]: [&str; 2]| {
            let effect = |id, keys| format!("[[effect]]\nid = '{id}'\nkind = 'spring'\n{keys}\n");
            let text = effect('a', first) + &effect('b', second);
            let file = SceneFile::from_toml(&text, "x.toml").unwrap_or_else(|error| panic!("{error}"));
            let turned = rotation::exp(Vec3::X * 0.7);
            Probe::new(&file).anchor(turned).map(|anchor| anchor.angle_between(turned))
        };
        let here = "anchor = 'here'";
        assert_eq!(of([here, ""]), Some(0.0));
        assert_eq!(of(["", here]), None);
        assert!((of(["", ""]).expect("it shows") - 0.7).abs() < 1e-9);
        let beside = of(["anchor = 'here'\nreference = [0, 1, 0, 0]", here]);
        assert!((beside.expect("it shows") - std::f64::consts::PI).abs() < 1e-9);
    }

    #[test]
    fn a_picture_shows_time_and_wells_if_the_law_has_them() {
        for entry in SHELF {
            let want = match entry.file {
                "metronome" => (Some(2.5), false),
                "orientation-matching" => (Some(12.0), true),
                "cube-faces" => (None, true),
                _ => (None, false),
            };
            assert_eq!(shows(&entry.scene()), want, "{}", entry.file);
        }
        let of = |effect: &str| {
            let text = format!("[[effect]]\nid = 'e'\n{effect}\n");
            shows(&SceneFile::from_toml(&text, "x.toml").unwrap_or_else(|error| panic!("{error}")))
        };
        assert_eq!(of("kind = 'vibration'\nfrequency = 40"), (Some(0.8), false));
        assert_eq!(of("kind = 'vibration'\nfrequency = 1"), (Some(12.0), false));
        assert_eq!(of("kind = 'snaps'\nset = 'tetrahedron'\nwidth = 0.01"), (None, true));
        assert_eq!(of("kind = 'detents'\ncount = 12"), (None, false));
        assert_eq!(of("kind = 'magnet'"), (None, false));
    }
}
