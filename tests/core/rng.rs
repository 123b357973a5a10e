//! Random numbers that are equal on every machine and in every run.

/// The random number generator SplitMix64 (Steele, Lea and Flood 2014).
pub struct Rng(pub u64);

impl Rng {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, n: u64) -> u64 {
        self.next() % n
    }

    /// Returns a random number, uniform between `low` and `high`. It has 53 bits, so it is exact
    /// and equal everywhere.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * ((self.next() >> 11) as f64 / (1_u64 << 53) as f64)
    }

    /// Returns a random vector, uniform in the cube of half-width `size`.
    pub fn vector(&mut self, size: f64) -> hbot_core::Vec3 {
        hbot_core::Vec3::new(self.between(-size, size), self.between(-size, size), self.between(-size, size))
    }

    pub fn once_in(&mut self, n: u64) -> bool {
        self.below(n) == 0
    }
}
