//! Two numbers side by side: one for each wheel of a pair.
//!
//! The same operations in the same order on two wheels at once is what a compiler turns into instructions for two
//! numbers by itself (SSE2, NEON). Every operation rounds on its own and none are fused, so with them or without
//! them the bits are the same.

use core::ops::{Add, Mul, Sub};

/// One number for each of two wheels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pair(pub(crate) [f64; 2]);

impl Pair {
    /// Zero in both.
    pub(crate) const ZERO: Self = Self([0.0; 2]);

    /// The same number in both.
    #[inline(always)]
    pub(crate) fn splat(a: f64) -> Self {
        Self([a; 2])
    }

    /// The sum of the two.
    #[inline(always)]
    pub(crate) fn sum(self) -> f64 {
        self.0[0] + self.0[1]
    }
}

impl Add for Pair {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self([self.0[0] + other.0[0], self.0[1] + other.0[1]])
    }
}

impl Sub for Pair {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self([self.0[0] - other.0[0], self.0[1] - other.0[1]])
    }
}

impl Mul for Pair {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self([self.0[0] * other.0[0], self.0[1] * other.0[1]])
    }
}
