//! Encoders that are not quite right.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Encoders that are coarse, run out of centre, or are wrongly zeroed. Whole counts, `counts_per_turn` a turn, are there without it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Encoder {
    /// How many counts an encoder moves on by at once.
    #[schemars(range(min = 1, max = 1000000))]
    pub step: u32,
    /// Amplitude of the error that repeats itself with every turn of the encoder, rad of the encoder.
    #[schemars(range(min = 0.0, max = 0.1), extend("unit" = "rad"))]
    pub turn_error: f64,
    /// How far a zero may be off at most, either way, rad of the joint; it acts where a zero is taken.
    #[schemars(range(min = 0.0, max = 1.0), extend("unit" = "rad"))]
    pub index_error: f64,
    /// Seed of phases and zeros.
    #[schemars(range(min = 0, max = u32::MAX))]
    pub seed: u32,
}

impl Default for Encoder {
    fn default() -> Self {
        // A disc 5 micrometres out of centre at a track of 10 mm radius, assumed.
        Self { step: 1, turn_error: 5.0e-4, index_error: 0.0, seed: 1 }
    }
}
