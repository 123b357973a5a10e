//! A pair of numbers, one for each of two wheels.
//!
//! Both wheels go through equal operations in equal order. A compiler can therefore use
//! instructions that work on two numbers at once (SSE2, NEON). Every operation rounds separately
//! and none are fused, so the bits do not depend on these instructions.

use core::ops::{Add, Mul, Sub};

/// One number for each of the two wheels of a pair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pair(pub(crate) [f64; 2]);

impl Pair {
    /// Zero for both wheels.
    pub(crate) const ZERO: Self = Self([0.0; 2]);

    /// Returns a pair with `a` for both wheels.
    #[inline(always)]
    pub(crate) fn splat(a: f64) -> Self {
        Self([a; 2])
    }

    /// Adds the value of the first wheel to the value of the second.
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
