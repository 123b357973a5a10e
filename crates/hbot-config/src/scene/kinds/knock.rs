//! The knock of an effect: a short vibration when the sphere meets a wall or falls into a notch.

use hbot_core::render::effects::{self, Kind, Knocking};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{IdleKey, idle_keys};

/// What the sphere sounds like when it meets a wall or falls into a notch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Knock {
    /// There is no knock.
    #[default]
    None,
    /// Like rubber: 0.03 N m/(rad/s), 18 Hz, 17 ms.
    Rubber,
    /// Like wood: 0.02 N m/(rad/s), 100 Hz, 12.5 ms.
    Wood,
    /// Like metal: 0.04 N m/(rad/s), 300 Hz, 11 ms.
    Metal,
    /// With the values of `knock_amplitude`, `knock_frequency` and `knock_decay_s`.
    Own,
}

/// The keys of effects that knock.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct KnockKeys {
    /// What the sphere sounds like when it meets a wall or falls into a notch or an orientation: a
    /// short vibration against the impact.
    knock: Knock,
    // The unit is not written as that of a damping, because a warning names the keys with that unit
    // as cures.
    /// With `knock = "own"`: torque of the knock for each rad/s of the speed of the impact.
    #[schemars(range(min = 0.0, max = 0.2), extend("unit" = "N m/(rad/s)"))]
    knock_amplitude: f64,
    /// With `knock = "own"`: frequency of the knock. Above a third of the loop's rate it is not
    /// rendered well.
    #[schemars(range(min = 5.0, max = 1000.0), extend("unit" = "Hz"))]
    knock_frequency: f64,
    /// With `knock = "own"`: time in which the knock falls to 1/e.
    #[schemars(range(min = 0.001, max = 0.1), extend("unit" = "s"))]
    knock_decay_s: f64,
}

/// The knock of wood, whose numbers are also the defaults of a knock of one's own.
const WOOD: effects::Knock = effects::Knock { amplitude: 0.02, frequency: 100.0, decay: 0.0125 };

impl Default for KnockKeys {
    fn default() -> Self {
        let effects::Knock { amplitude, frequency, decay } = WOOD;
        Self {
            knock: Knock::None,
            knock_amplitude: amplitude,
            knock_frequency: frequency,
            knock_decay_s: decay,
        }
    }
}

impl KnockKeys {
    /// Returns the core's knock. Returns `None` if there is none.
    ///
    /// Frequencies and decay times are those that persons found most real on a haptic display
    /// (Okamura, Cutkosky and Dennerlein 2001: rubber, wood, aluminium; the decay rates are 60, 80
    /// and 90 1/s). Amplitudes are in their order of strength for the sphere of the prototype;
    /// chosen here.
    fn values(&self) -> Option<effects::Knock> {
        let knock = |amplitude, frequency, decay| Some(effects::Knock { amplitude, frequency, decay });
        match self.knock {
            Knock::None => None,
            Knock::Rubber => knock(0.03, 18.0, 1.0 / 60.0),
            Knock::Wood => Some(WOOD),
            Knock::Metal => knock(0.04, 300.0, 1.0 / 90.0),
            Knock::Own => knock(self.knock_amplitude, self.knock_frequency, self.knock_decay_s),
        }
    }

    /// Returns the effect `law` with this knock: `plain` if there is none, and otherwise
    /// `knocking`.
    pub(super) fn added_to<L>(
        &self,
        law: L,
        plain: fn(L) -> Kind,
        knocking: fn(Knocking<L>) -> Kind,
    ) -> Kind {
        match self.values() {
            None => plain(law),
            Some(knock) => knocking(Knocking { law, knock }),
        }
    }

    /// Returns the parameters that have no effect because the knock is not `own`.
    pub(super) fn idle(&self) -> Vec<IdleKey> {
        if self.knock == Knock::Own {
            return Vec::new();
        }
        idle_keys(&["knock_amplitude", "knock_frequency", "knock_decay_s"], "knock", "set knock = \"own\"")
    }
}
