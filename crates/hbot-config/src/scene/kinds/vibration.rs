//! Parameters of the effect `vibration`.

use hbot_core::render::effects::{self, Kind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::target::{UP, unit_vector};
use super::{EffectKind, IdleKey, idle_keys};
use crate::document::{Report, join};

/// A vibrating torque about an axis: continuous, once, or repeated. The energy it delivers is at
/// most its amplitude times the angle that the sphere turns.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Vibration {
    /// Axis of the vibration, in frame N (fixed in space). Any length except zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    axis: [f64; 3],
    /// Peak torque of the wave.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "N m"))]
    amplitude: f64,
    /// Frequency of the wave. The loop can produce up to half its tick rate, but is accurate only
    /// up to a tenth.
    #[schemars(range(min = 0.0, max = 500.0), extend("unit" = "Hz"))]
    frequency: f64,
    /// Shape of the wave.
    wave: Wave,
    /// Time in which the vibration rises to its full amplitude.
    #[schemars(range(min = 0.0, max = 60.0), extend("unit" = "s"))]
    attack_s: f64,
    /// Time from the start, including the rise, until the vibration begins to fall. 0: it never
    /// falls.
    #[schemars(range(min = 0.0, max = 3600.0), extend("unit" = "s"))]
    hold_s: f64,
    /// Time in which the vibration falls to zero.
    #[schemars(range(min = 0.0, max = 60.0), extend("unit" = "s"))]
    release_s: f64,
    /// Time from one start of the vibration to the next. 0: it does not repeat.
    #[schemars(range(min = 0.0, max = 3600.0), extend("unit" = "s"))]
    repeat_s: f64,
}

/// The shape of a vibration's wave.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Wave {
    /// A sine wave.
    Sine,
    /// A square wave: the torque switches between its peak in one direction and its peak in the
    /// other.
    Square,
    /// A sawtooth wave: the torque rises slowly and falls at once.
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

    fn idle(&self) -> Vec<IdleKey> {
        let starts_again_before_it_falls = self.repeat_s > 0.0 && self.repeat_s <= self.hold_s;
        if self.hold_s == 0.0 {
            idle_keys(&["release_s"], "hold_s", "set hold_s above 0")
        } else if starts_again_before_it_falls {
            idle_keys(&["hold_s", "release_s"], "repeat_s", "set hold_s below repeat_s")
        } else {
            Vec::new()
        }
    }
}
