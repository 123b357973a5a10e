//! Random numbers that are equal on every machine and in every run.

use hbot_core::Vec3;

/// The random number generator SplitMix64 (Steele, Lea and Flood 2014). The field is its state,
/// which starts as the seed.
pub struct Rng(pub u64);

impl Rng {
    /// Returns 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Returns a random integer from 0 to `n` - 1.
    pub fn below(&mut self, n: u64) -> u64 {
        self.bits() % n
    }

    /// Returns true once in `n` times.
    pub fn once_in(&mut self, n: u64) -> bool {
        self.below(n) == 0
    }

    /// Returns a random number, uniform in [0, 1). It has 53 bits, so it is exact and equal
    /// everywhere.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Returns true in the share `share` (0 to 1) of all calls.
    pub fn chance(&mut self, share: f64) -> bool {
        self.unit() < share
    }

    /// Returns a random number, uniform between `low` and `high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Returns a random number between `low` and `high` whose logarithm is uniformly distributed.
    pub fn decade(&mut self, low: f64, high: f64) -> f64 {
        10.0_f64.powf(self.between(low.log10(), high.log10()))
    }

    /// Returns a random vector, uniform in the cube of half-width `size`.
    pub fn vector(&mut self, size: f64) -> Vec3 {
        Vec3::new(self.between(-size, size), self.between(-size, size), self.between(-size, size))
    }
}
