//! The knock of an effect: a short vibration when the sphere meets a wall or falls into a notch.

use hbot_core::render::effects::{self, Kind, Knocking};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{IdleKey, idle_keys};

/// What the sphere sounds like when it meets a wall or falls into a notch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum Knock {
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

/// The values of a knock that is `own`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Own {
    pub(super) amplitude: f64,
    pub(super) frequency: f64,
    pub(super) decay_s: f64,
}

/// The default of `knock_amplitude`, N m/(rad/s). The three defaults are those of wood. The unit is
/// not written as that of a damping, because a warning names the keys with that unit as cures.
pub(super) const AMPLITUDE: f64 = 0.02;
/// The default of `knock_frequency`, Hz.
pub(super) const FREQUENCY: f64 = 100.0;
/// The default of `knock_decay_s`, s.
pub(super) const DECAY_S: f64 = 0.0125;

impl Knock {
    /// Returns the core's knock. Returns `None` if there is none.
    ///
    /// Frequencies and decay times are those that persons found most real on a haptic display
    /// (Okamura, Cutkosky and Dennerlein 2001: rubber, wood, aluminium; the decay rates are 60, 80
    /// and 90 1/s). Amplitudes are in their order of strength for the sphere of the prototype;
    /// chosen here.
    fn values(self, own: Own) -> Option<effects::Knock> {
        let knock = |amplitude, frequency, decay| Some(effects::Knock { amplitude, frequency, decay });
        match self {
            Self::None => None,
            Self::Rubber => knock(0.03, 18.0, 1.0 / 60.0),
            Self::Wood => knock(AMPLITUDE, FREQUENCY, DECAY_S),
            Self::Metal => knock(0.04, 300.0, 1.0 / 90.0),
            Self::Own => knock(own.amplitude, own.frequency, own.decay_s),
        }
    }

    /// Returns the effect `law` with this knock: `plain` if there is none, and otherwise
    /// `knocking`.
    pub(super) fn added_to<L>(
        self,
        own: Own,
        law: L,
        plain: fn(L) -> Kind,
        knocking: fn(Knocking<L>) -> Kind,
    ) -> Kind {
        match self.values(own) {
            None => plain(law),
            Some(knock) => knocking(Knocking { law, knock }),
        }
    }

    /// Returns the parameters that have no effect because the knock is not `own`.
    pub(super) fn idle(self) -> Vec<IdleKey> {
        if self == Self::Own {
            return Vec::new();
        }
        idle_keys(&["knock_amplitude", "knock_frequency", "knock_decay_s"], "knock", "set knock = \"own\"")
    }
}
