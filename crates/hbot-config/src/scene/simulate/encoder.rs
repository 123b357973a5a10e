//! Simulated errors of the encoders.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Encoders with coarse resolution, periodic errors or a wrong zero. Rounding to whole encoder
/// counts (`counts_per_turn`) is simulated even without this table.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Encoder {
    /// Number of encoder counts by which a reading changes at a time.
    #[schemars(range(min = 1, max = 1000000))]
    pub step: u32,
    /// Amplitude of the error that repeats with every turn of the encoder, rad of the encoder.
    #[schemars(range(min = 0.0, max = 0.1), extend("unit" = "rad"))]
    pub turn_error: f64,
    /// Largest error of a joint's zero in either direction, rad of the joint. It acts from the time
    /// when the zero is found.
    #[schemars(range(min = 0.0, max = 1.0), extend("unit" = "rad"))]
    pub index_error: f64,
    /// Seed of the random numbers for the phases and zero errors.
    #[schemars(range(min = 0, max = u32::MAX))]
    pub seed: u32,
}

impl Default for Encoder {
    fn default() -> Self {
        // A disc 5 micrometres off centre, with a track of 10 mm radius; assumed.
        Self { step: 1, turn_error: 5.0e-4, index_error: 0.0, seed: 1 }
    }
}
