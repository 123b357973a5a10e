//! Parameters of a vibration.

use hbot_core::effects::{self, Kind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::EffectKind;
use super::target::{UP, unit_vector};
use crate::document::{Report, join};

/// Shaking about an axis, for ever, once, or again and again. It gives energy, at most its amplitude times the path turned.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Vibration {
    /// The axis in N, of any length but zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    axis: [f64; 3],
    /// Torque at the crest of the wave.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "N m"))]
    amplitude: f64,
    /// Frequency; the loop can make waves up to half its own rate, and good ones up to a tenth.
    #[schemars(range(min = 0.0, max = 500.0), extend("unit" = "Hz"))]
    frequency: f64,
    /// The shape of the wave.
    wave: Wave,
    /// How long it takes to rise.
    #[schemars(range(min = 0.0, max = 60.0), extend("unit" = "s"))]
    attack_s: f64,
    /// How long it lasts from its start, rise included, until it dies away; 0 for ever.
    #[schemars(range(min = 0.0, max = 3600.0), extend("unit" = "s"))]
    hold_s: f64,
    /// How long it takes to die away.
    #[schemars(range(min = 0.0, max = 60.0), extend("unit" = "s"))]
    release_s: f64,
    /// When it starts again, from its start; 0 never.
    #[schemars(range(min = 0.0, max = 3600.0), extend("unit" = "s"))]
    repeat_s: f64,
}

/// The shape of the wave.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Wave {
    /// A sine.
    Sine,
    /// To and fro at once.
    Square,
    /// Slowly up and down at once.
    Saw,
}

impl Default for Vibration {
    fn default() -> Self {
        Self {
            axis: UP,
            amplitude: 0.03,
            frequency: 40.0,
            wave: Wave::Sine,
            attack_s: 0.0,
            hold_s: 0.0,
            release_s: 0.05,
            repeat_s: 0.0,
        }
    }
}

impl EffectKind for Vibration {
    const NAME: &'static str = "vibration";

    fn compile(&self, path: &str, report: &mut Report) -> Option<Kind> {
        Some(Kind::Vibration(effects::Vibration {
            axis: unit_vector(self.axis, &join(path, "axis"), report)?,
            amplitude: self.amplitude,
            frequency: self.frequency,
            wave: match self.wave {
                Wave::Sine => effects::Wave::Sine,
                Wave::Square => effects::Wave::Square,
                Wave::Saw => effects::Wave::Saw,
            },
            attack: self.attack_s,
            hold: self.hold_s,
            release: self.release_s,
            repeat: self.repeat_s,
        }))
    }
}
