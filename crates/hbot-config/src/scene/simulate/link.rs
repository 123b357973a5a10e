//! Simulated errors of the serial line.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A serial line that delays, loses and corrupts frames in both directions, from the first tick on.
/// Frames in the same direction keep their order.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Link {
    /// Delay of a frame from the motor controllers to the PC, s.
    #[schemars(range(min = 0.0, max = 0.1), extend("unit" = "s"))]
    pub latency_s: f64,
    /// Delay of a frame from the PC to the motor controllers, s.
    #[schemars(range(min = 0.0, max = 0.1), extend("unit" = "s"))]
    pub command_latency_s: f64,
    /// Largest additional delay of a frame in either direction, s. The delay is uniformly
    /// distributed from 0.
    #[schemars(range(min = 0.0, max = 0.1), extend("unit" = "s"))]
    pub jitter_s: f64,
    /// Probability that a frame is lost.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub loss: f64,
    /// Probability that a frame arrives with one wrong byte.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub corrupt: f64,
    /// Seed of all random numbers of the line.
    #[schemars(range(min = 0, max = u32::MAX))]
    pub seed: u32,
}

impl Default for Link {
    fn default() -> Self {
        Self {
            // One tick at 1 kHz, for both directions together (physics notes, section 8).
            latency_s: 1.0e-3,
            command_latency_s: 0.0,
            jitter_s: 1.0e-4,
            loss: 1.0e-3,
            corrupt: 1.0e-3,
            seed: 1,
        }
    }
}
