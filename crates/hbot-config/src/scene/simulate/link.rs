//! A serial line that is not quite right.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A serial line that is late and loses or spoils frames, each way, from the first tick on. Frames never overtake one another.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Link {
    /// How long a frame to the host is on its way, s.
    #[schemars(range(min = 0.0, max = 0.1), extend("unit" = "s"))]
    pub latency_s: f64,
    /// How long a frame to the controllers is on its way, s.
    #[schemars(range(min = 0.0, max = 0.1), extend("unit" = "s"))]
    pub command_latency_s: f64,
    /// How much longer at most either takes, evenly distributed, s.
    #[schemars(range(min = 0.0, max = 0.1), extend("unit" = "s"))]
    pub jitter_s: f64,
    /// How probable it is that a frame is lost.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub loss: f64,
    /// How probable it is that a frame arrives with a flipped byte.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub corrupt: f64,
    /// Seed of all that is random.
    #[schemars(range(min = 0, max = u32::MAX))]
    pub seed: u32,
}

impl Default for Link {
    fn default() -> Self {
        Self {
            // A tick of 1 kHz in all (physics notes, section 8).
            latency_s: 1.0e-3,
            command_latency_s: 0.0,
            jitter_s: 1.0e-4,
            loss: 1.0e-3,
            corrupt: 1.0e-3,
            seed: 1,
        }
    }
}
