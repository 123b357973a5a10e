//! The largest stiffness that a loop keeps stable in a scene.

use hbot_config::advice::{Finding, Judge, Why};
use hbot_config::{RunningScene, SceneFile};
use serde_json::Value;

/// A border is computed to this part of it.
const RESOLUTION: f64 = 0.03;
/// Below this stiffness a border is 0, N m/rad: it could not be seen on a slider, and without
/// damping so soft a spring is stable only because the judge lets a swing grow by 5 % per second.
const NOTHING: f64 = 0.2;

/// Where a stiffness is in a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Key {
    /// Index of the effect.
    pub(crate) effect: usize,
    /// Name of the parameter.
    pub(crate) name: &'static str,
    /// Index on the diagonal if the value is a matrix.
    pub(crate) axis: Option<usize>,
}

impl Key {
    /// Returns the scene with the value `value` in this place.
    pub(super) fn put(self, scene: &Value, value: Value) -> Value {
        let mut scene = scene.clone();
        let place = &mut scene["effect"][self.effect][self.name];
        match self.axis {
            Some(k) => place[k][k] = value,
            None => *place = value,
        }
        scene
    }
}

/// Searches the border between 0 and `most`. The part of a stiffness that is stable is exact
/// for a spring, and a first guess for other laws.
pub(super) fn border(judge: &Judge, scene: &Value, key: Key, most: f64) -> Option<f64> {
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
fn stable_part(judge: &Judge, scene: &Value, key: Key, x: f64) -> Option<Option<f64>> {
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
