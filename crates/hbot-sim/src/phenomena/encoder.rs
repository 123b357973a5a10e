//! Encoders that are not quite right.

/// Errors of every joint's encoder.
///
/// Counts are whole with or without it: the line carries integers, `counts_per_turn` (the rig file's) of them a turn.
/// With it the encoder may be coarser than that, its disc may run out of centre, and its zero may be off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Encoder {
    /// How many counts the encoder moves on by at once, 1 to 1,000,000; default 1, as fine as the line. Counts are then
    /// multiples of it, as if there were `counts_per_turn / step` a turn.
    pub step: u32,
    /// Amplitude of the error that repeats itself with every turn of the encoder, rad of the encoder (before the gear),
    /// 0 to 0.1; default 5e-4: a disc 5 micrometres out of centre at a track of 10 mm radius, assumed. Its phase differs
    /// from joint to joint, by the seed.
    pub turn_error: f64,
    /// The most by which the zero (the index, or the mounting of an absolute encoder) may be off, rad of the joint, 0 to
    /// 1; default 0. How much of it each joint has, either way, is by the seed. It acts where a zero is taken: at
    /// power-up, where an index is passed, after a reboot.
    pub index_error: f64,
    /// Seed of phases and zeros; default 1.
    pub seed: u32,
}

impl Default for Encoder {
    fn default() -> Self {
        Self { step: 1, turn_error: 5.0e-4, index_error: 0.0, seed: 1 }
    }
}
