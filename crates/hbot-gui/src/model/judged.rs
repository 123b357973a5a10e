//! What the rig keeps stable of the scene that the user sees, by the computation of the server.

use hbot_api::InfoOk;
use hbot_config::advice::{Abilities, Finding, Told, Why};
use hbot_config::{RunningScene, SceneFile};
use serde_json::Value;

use super::reach::{Reach, reach};

/// A border is computed to this part of it.
const RESOLUTION: f64 = 0.03;
/// Below this stiffness a border is 0, N m/rad: it could not be seen on a slider, and without
/// damping so soft a spring is stable only because the judge lets a swing grow by 5 % per second.
const NOTHING: f64 = 0.2;

/// Judges scenes by what a server has told of its rig, and keeps the results: a window is drawn
/// many times for each change.
#[derive(Debug, Default)]
pub(crate) struct Judged {
    told: Option<(Told, Abilities)>,
    warned: Option<(Value, Vec<String>)>,
    /// Where an effect of a scene, given by its index, reaches a limit of the torque, N m.
    reached: Option<((Value, usize, f64), Option<Reach>)>,
    /// The scenes whose borders are known, the last one first. The stiffness in question is null in
    /// them, because its border does not depend on it.
    borders: Vec<(Value, Option<f64>)>,
}

/// Where a stiffness is in a scene.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Key<'a> {
    /// Index of the effect.
    pub(crate) effect: usize,
    /// Name of the parameter.
    pub(crate) name: &'a str,
    /// Index on the diagonal if the value is a matrix.
    pub(crate) axis: Option<usize>,
}

impl Key<'_> {
    /// Returns the scene with the value `value` in this place.
    fn put(self, scene: &Value, value: Value) -> Value {
        let mut scene = scene.clone();
        let place = &mut scene["effect"][self.effect][self.name];
        match self.axis {
            Some(k) => place[k][k] = value,
            None => *place = value,
        }
        scene
    }
}

impl Judged {
    /// Takes what the server tells of its rig.
    pub(crate) fn take(&mut self, info: &InfoOk) {
        let told = Told::from(info);
        if self.told.as_ref().is_none_or(|(known, _)| *known != told) {
            *self = Self { told: Some((told.clone(), Abilities::told(told))), ..Self::default() };
        }
    }

    /// Returns the warnings of `scene`, in the words of the answer to `load_scene`. Returns none if
    /// the scene has kinds or values that the panel does not know.
    pub(crate) fn warnings(&mut self, scene: &Value) -> &[String] {
        if self.warned.as_ref().is_none_or(|(known, _)| known != scene) {
            let file = SceneFile::from_json(scene.clone()).ok();
            let abilities = self.told.as_ref().map(|(_, abilities)| abilities);
            let warnings = file.zip(abilities).map(|(file, abilities)| abilities.warnings(&file));
            self.warned = Some((scene.clone(), warnings.unwrap_or_default()));
        }
        self.warned.as_ref().map_or(&[], |(_, warnings)| warnings)
    }

    /// Returns where the effect with the index `effect` of `scene` reaches the torque `limit`, N m.
    /// Returns `None` if it has no torque at rest, or if the panel does not know the scene.
    pub(crate) fn reach(&mut self, scene: &Value, effect: usize, limit: f64) -> Option<Reach> {
        let is_known =
            |(known, of, to): &(Value, usize, f64)| known == scene && (*of, *to) == (effect, limit);
        if let Some((_, reached)) = self.reached.as_ref().filter(|(known, _)| is_known(known)) {
            return *reached;
        }
        let file = SceneFile::from_json(scene.clone()).ok();
        let found = file.and_then(|file| reach(&RunningScene::new().load(file), effect, limit));
        self.reached = Some(((scene.clone(), effect, limit), found));
        found
    }

    /// Returns the largest stiffness at `key` with which the loop keeps `scene` stable, in the unit
    /// of the parameter; at most `most`. Returns `None` if it is not known.
    pub(crate) fn border(&mut self, scene: &Value, key: Key<'_>, most: f64) -> Option<f64> {
        /// More than the rows of a panel.
        const KEPT: usize = 8;
        let blank = key.put(scene, Value::Null);
        if let Some((_, border)) = self.borders.iter().find(|(known, _)| *known == blank) {
            return *border;
        }
        let border = self.found(scene, key, most);
        self.borders.insert(0, (blank, border));
        self.borders.truncate(KEPT);
        border
    }

    /// Searches the border between 0 and `most`. The part of a stiffness that is stable is exact
    /// for a spring, and a first guess for other laws.
    fn found(&self, scene: &Value, key: Key<'_>, most: f64) -> Option<f64> {
        /// The guesses come near within a few steps. Halving alone needs fewer than these.
        const STEPS: u32 = 24;
        let (mut low, mut high, mut probe) = (0.0, f64::INFINITY, most);
        for _ in 0..STEPS {
            if low > 0.0 && high <= (1.0 + 1.5 * RESOLUTION) * low {
                break;
            }
            let Some(part) = self.stable_part(scene, key, probe)? else {
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
    fn stable_part(&self, scene: &Value, key: Key<'_>, x: f64) -> Option<Option<f64>> {
        let judge = self.told.as_ref()?.1.judge.as_ref()?;
        let file = SceneFile::from_json(key.put(scene, x.into())).ok()?;
        let found = judge.findings(&RunningScene::new().load(file));
        let part = |finding: &Finding| match finding.why {
            Why::Stiff { cure, .. } => Some(cure.own),
            // No stiffness helps.
            Why::Damped { .. } => Some(0.0),
            Why::Rings { .. } | Why::Turning { .. } => None,
        };
        let own = found.iter().filter(|finding| finding.effect == key.effect);
        Some(own.filter_map(part).reduce(f64::min))
    }
}
