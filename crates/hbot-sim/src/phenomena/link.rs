//! A serial line that is not quite right.

/// What happens to every frame on the line, each way. Frames of one direction never overtake one another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Link {
    /// How long a frame to the host is on its way, s, 0 to 0.1; default 1e-3, a tick of 1 kHz (physics notes, section 8).
    pub latency_s: f64,
    /// How long a frame to the controllers is on its way, s, 0 to 0.1; default 0, so that the default is one tick in
    /// all.
    pub command_latency_s: f64,
    /// How much longer at most a frame of either direction takes, evenly distributed, s, 0 to 0.1; default 1e-4.
    pub jitter_s: f64,
    /// How probable it is that a frame is lost, 0 to 1; default 0.001.
    pub loss: f64,
    /// How probable it is that a byte of a frame that is not lost is flipped, 0 to 1; default 0.001. It is never the
    /// delimiter, so a frame's damage costs this frame and no other.
    pub corrupt: f64,
    /// Seed of all that is random; default 1.
    pub seed: u32,
}

impl Default for Link {
    fn default() -> Self {
        Self {
            latency_s: 1.0e-3,
            command_latency_s: 0.0,
            jitter_s: 1.0e-4,
            loss: 1.0e-3,
            corrupt: 1.0e-3,
            seed: 1,
        }
    }
}
