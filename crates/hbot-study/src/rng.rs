//! Pseudo-random numbers that are equal in every run, by splitmix64 (Steele, Lea and Flood 2014).

/// A generator of pseudo-random numbers. The field is its state, which starts as the seed.
#[derive(Debug, Clone)]
pub(crate) struct Rng(pub(crate) u64);

impl Rng {
    /// Returns a random number that is uniformly distributed in [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Returns a random number that is uniformly distributed between `low` and `high`.
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Returns a random unit vector. All directions are equally likely.
    pub(crate) fn direction(&mut self) -> [f64; 3] {
        let z = self.between(-1.0, 1.0);
        let (s, c) = libm::sincos(self.between(0.0, core::f64::consts::TAU));
        let r = libm::sqrt(1.0 - z * z);
        [r * c, r * s, z]
    }
}
