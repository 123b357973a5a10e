//! The largest stiffness that a loop keeps stable in a scene.

use serde_json::Value;

use super::finding::{Finding, Why};
use super::judge::Judge;
use crate::{RunningScene, SceneFile};

/// A border is computed to this part of it.
const RESOLUTION: f64 = 0.03;
/// Below this stiffness a border is 0, N m/rad: it could not be seen on a slider, and without
/// damping so soft a spring is stable only because the judge lets a swing grow by 5 % per second.
const NOTHING: f64 = 0.2;

/// Largest stiffness of an effect that is judged, N m/rad. Scene files allow no more.
const SEARCHED: f64 = 1000.0;

/// Where a stiffness is in a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StiffnessKey {
    /// Index of the effect.
    pub effect: usize,
    /// Index on the diagonal if the value is a matrix.
    pub axis: Option<usize>,
}

/// The largest stiffness with which a loop keeps a scene stable.
#[derive(Debug, Clone, PartialEq)]
pub struct StiffnessBorder {
    /// Id of the effect.
    pub effect: String,
    /// Index on the diagonal if the stiffness is a matrix.
    pub axis: Option<usize>,
    /// The stiffness, N m/rad.
    pub stiffness: f64,
}

impl StiffnessKey {
    /// Returns the scene, as JSON, with the stiffness `value` in this place.
    #[must_use]
    pub fn put(self, scene: &Value, value: Value) -> Value {
        let mut scene = scene.clone();
        let place = &mut scene["effect"][self.effect]["stiffness"];
        match self.axis {
            Some(k) => place[k][k] = value,
            None => *place = value,
        }
        scene
    }
}

impl Judge {
    /// Returns the largest stiffness at `key` with which the loop keeps the scene stable, N m/rad;
    /// at most `most`, above which no spring is stable. `scene` is a scene file as JSON. Returns
    /// `None` if it is not legal, or if the stiffness has no effect because of the gain.
    #[must_use]
    pub fn stiffness_border(&self, scene: &Value, key: StiffnessKey, most: f64) -> Option<f64> {
        let gain = scene["effect"][key.effect]["gain"].as_f64().unwrap_or(1.0);
        if gain > 0.0 { border(self, scene, key, (most / gain).min(SEARCHED)) } else { None }
    }

    /// Returns the border of each stiffness in the scene, the rest of the scene unchanged: one for
    /// a number, one for each axis of a matrix.
    #[must_use]
    pub fn stiffness_borders(&self, scene: &SceneFile, most: f64) -> Vec<StiffnessBorder> {
        let json = scene.to_json();
        let mut found = Vec::new();
        for (effect, law) in scene.effects().iter().enumerate() {
            let axes = match &json["effect"][effect]["stiffness"] {
                Value::Number(_) => vec![None],
                Value::Array(_) => vec![Some(0), Some(1), Some(2)],
                _ => Vec::new(),
            };
            found.extend(axes.into_iter().filter_map(|axis| {
                let stiffness = self.stiffness_border(&json, StiffnessKey { effect, axis }, most)?;
                Some(StiffnessBorder { effect: law.id().to_owned(), axis, stiffness })
            }));
        }
        found
    }
}

/// Searches the border between 0 and `most`. The part of a stiffness that is stable is exact
/// for a spring, and a first guess for other laws.
fn border(judge: &Judge, scene: &Value, key: StiffnessKey, most: f64) -> Option<f64> {
    /// The guesses come near within a few steps. Halving alone needs fewer than these.
    const STEPS: u32 = 24;
    let (mut low, mut high, mut probe) = (0.0, f64::INFINITY, most);
    for _ in 0..STEPS {
        if low > 0.0 && high <= (1.0 + 1.5 * RESOLUTION) * low {
            break;
        }
        let Some(part) = stable_part(judge, scene, key, probe)? else {
            low = probe;
            if low >= most {
                return Some(most);
            }
            probe = (low * (1.0 + RESOLUTION)).min(0.5 * (low + high));
            continue;
        };
        high = probe;
        if part * high < NOTHING || high < NOTHING {
            return Some(0.0);
        }
        let guess = part * high;
        probe = if guess > low { guess.min(0.99 * high) } else { 0.5 * (low + high) };
    }
    Some(low)
}

/// Returns the part of the stiffness `x` at `key` that the loop keeps stable: `Some(None)` if
/// it keeps all of it, and `None` if the scene cannot be judged.
fn stable_part(judge: &Judge, scene: &Value, key: StiffnessKey, x: f64) -> Option<Option<f64>> {
    let file = SceneFile::from_json(key.put(scene, x.into())).ok()?;
    let found = judge.findings(&RunningScene::new().load(file));
    let part = |finding: &Finding| match finding.why {
        Why::Stiff { cure, .. } => Some(cure.own),
        // No stiffness helps.
        Why::Damped { .. } => Some(0.0),
        Why::Rings { .. } | Why::Bounces { .. } | Why::Turning { .. } => None,
    };
    let own = found.iter().filter(|finding| finding.effect == key.effect);
    Some(own.filter_map(part).reduce(f64::min))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RigConfig;
    use crate::advice::Abilities;

    /// Another spring takes room from the first: together they may be no stiffer.
    #[test]
    fn the_border_of_a_spring_is_lower_beside_another_spring() {
        let mut rig = RigConfig::prototype();
        rig.rig = rig.rig.with(|parts| parts.lead = None).expect("legal");
        let judge = Abilities::of(&rig).judge.expect("legal inertias");
        let spring = |id: &str, stiffness: &str| {
            format!("[[effect]]\nid = '{id}'\nkind = 'spring'\nstiffness = {stiffness}\ndamping = 0.02\n")
        };
        let borders = |text: &str| {
            let scene = SceneFile::from_toml(text, "x.toml").unwrap_or_else(|error| panic!("{error}"));
            judge.stiffness_borders(&scene, 1000.0)
        };
        let alone = borders(&spring("a", "1"));
        assert_eq!((alone.len(), alone[0].effect.as_str(), alone[0].axis), (1, "a", None));
        let both = borders(&[spring("a", "1"), spring("b", "0.5").replace("0.02", "0")].concat());
        assert_eq!(both.iter().map(|border| border.effect.as_str()).collect::<Vec<_>>(), ["a", "b"]);
        let lost = alone[0].stiffness - both[0].stiffness;
        assert!((0.3..0.7).contains(&lost), "{alone:?} {both:?}");
        let apart = borders(&spring("a", "[1, 2, 3]"));
        assert_eq!(apart.iter().map(|border| border.axis).collect::<Vec<_>>(), [Some(0), Some(1), Some(2)]);
        let off = borders(&spring("a", "1\ngain = 0"));
        assert_eq!(off, []);
    }
}
