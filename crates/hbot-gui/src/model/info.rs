//! The answers to `info` and `stats`, read leniently: what a server does not say is not shown.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::Value;

/// What the rig is and can do.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Info {
    pub(crate) rig: Rig,
    pub(crate) limits: Limits,
    /// Largest torque about n1, n2, n3 at this posture, N m.
    pub(crate) capability: Option<[f64; 3]>,
    /// The kinds of effects.
    pub(crate) effects: Vec<Kind>,
    /// As `load_scene` takes it.
    pub(crate) scene: Value,
    /// A preset's name, or a map of methods.
    pub(crate) accuracy: Value,
    pub(crate) render: Render,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Rig {
    pub(crate) name: String,
    pub(crate) simulated: bool,
    pub(crate) rate_hz: f64,
    pub(crate) sphere: Sphere,
    pub(crate) wheels: Vec<Wheel>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Sphere {
    /// m
    pub(crate) radius: f64,
}

/// A wheel as a rig file states it.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Wheel {
    pub(crate) name: Option<String>,
    /// Steering axis in N, unit length.
    pub(crate) axis: [f64; 3],
    /// rad
    pub(crate) cone: f64,
    /// rad
    pub(crate) toe: f64,
    /// m
    pub(crate) radius: f64,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Limits {
    /// N m
    pub(crate) torque: f64,
    /// rad/s
    pub(crate) speed: f64,
    /// m/s
    pub(crate) slip: f64,
    /// rad
    pub(crate) enable_max_angle: f64,
}

/// What the rig can be expected to render. Absent from servers that do not say.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Render {
    /// Stiffness up to which the rig is expected to stay stable without damping of the scene's, N m/rad.
    pub(crate) stiffness_stable: Option<f64>,
}

/// A kind of effect and the schema of its parameters.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Kind {
    pub(crate) name: String,
    pub(crate) description: String,
    pub(crate) schema: Value,
}

/// Histograms and counters.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Stats {
    pub(crate) ticks: u64,
    pub(crate) lateness_us: Distribution,
    pub(crate) compute_us: Distribution,
    pub(crate) link_us: Distribution,
    pub(crate) age_us: Distribution,
    pub(crate) late_ticks: u64,
    pub(crate) skipped_ticks: u64,
    pub(crate) missed_ticks: u64,
    pub(crate) corrupt_frames: u64,
    pub(crate) foreign_frames: u64,
    pub(crate) send_failures: u64,
    pub(crate) dropped_samples: u64,
    pub(crate) dropped_states: u64,
    pub(crate) faults: BTreeMap<String, u64>,
    pub(crate) estops: u64,
}

/// us
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Distribution {
    pub(crate) p50: f64,
    pub(crate) p99: f64,
    pub(crate) p99_9: f64,
    pub(crate) max: f64,
}

impl Info {
    /// The kind of a name.
    pub(crate) fn kind(&self, name: &str) -> Option<&Kind> {
        self.effects.iter().find(|kind| kind.name == name)
    }

    /// The methods in use, in words.
    pub(crate) fn accuracy(&self) -> String {
        match &self.accuracy {
            Value::String(preset) => preset.clone(),
            Value::Null => "not told".to_owned(),
            methods => methods.to_string(),
        }
    }
}
