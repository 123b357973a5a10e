//! Two numbers side by side: one for each wheel of a pair.
//!
//! The same operations in the same order on two wheels at once. On x86-64 they are SSE2 instructions, which every
//! such machine has; elsewhere they are the same operations one by one. Both round as IEEE 754 says, operation by
//! operation (nothing is fused), so the bits are the same.

use core::ops::{Add, Mul, Neg, Sub};

#[cfg(target_arch = "x86_64")]
mod register {
    use core::arch::x86_64::{
        __m128d, _mm_add_pd, _mm_cvtsd_f64, _mm_mul_pd, _mm_set_pd, _mm_set1_pd, _mm_sub_pd, _mm_unpackhi_pd,
    };

    #[derive(Debug, Clone, Copy)]
    pub(crate) struct Pair(__m128d);

    impl Pair {
        #[inline(always)]
        pub(crate) fn new(a: f64, b: f64) -> Self {
            Self(_mm_set_pd(b, a))
        }

        #[inline(always)]
        pub(crate) fn splat(a: f64) -> Self {
            Self(_mm_set1_pd(a))
        }

        #[inline(always)]
        pub(crate) fn lanes(self) -> [f64; 2] {
            [_mm_cvtsd_f64(self.0), _mm_cvtsd_f64(_mm_unpackhi_pd(self.0, self.0))]
        }

        #[inline(always)]
        pub(super) fn add(self, other: Self) -> Self {
            Self(_mm_add_pd(self.0, other.0))
        }

        #[inline(always)]
        pub(super) fn sub(self, other: Self) -> Self {
            Self(_mm_sub_pd(self.0, other.0))
        }

        #[inline(always)]
        pub(super) fn mul(self, other: Self) -> Self {
            Self(_mm_mul_pd(self.0, other.0))
        }
    }
}

#[cfg(not(target_arch = "x86_64"))]
mod register {
    #[derive(Debug, Clone, Copy)]
    pub(crate) struct Pair([f64; 2]);

    impl Pair {
        #[inline(always)]
        pub(crate) fn new(a: f64, b: f64) -> Self {
            Self([a, b])
        }

        #[inline(always)]
        pub(crate) fn splat(a: f64) -> Self {
            Self([a, a])
        }

        #[inline(always)]
        pub(crate) fn lanes(self) -> [f64; 2] {
            self.0
        }

        #[inline(always)]
        pub(super) fn add(self, other: Self) -> Self {
            Self([self.0[0] + other.0[0], self.0[1] + other.0[1]])
        }

        #[inline(always)]
        pub(super) fn sub(self, other: Self) -> Self {
            Self([self.0[0] - other.0[0], self.0[1] - other.0[1]])
        }

        #[inline(always)]
        pub(super) fn mul(self, other: Self) -> Self {
            Self([self.0[0] * other.0[0], self.0[1] * other.0[1]])
        }
    }
}

pub(crate) use register::Pair;

impl Pair {
    /// Zero in both.
    #[inline(always)]
    pub(crate) fn zero() -> Self {
        Self::splat(0.0)
    }

    /// The sum of the two.
    #[inline(always)]
    pub(crate) fn sum(self) -> f64 {
        let [a, b] = self.lanes();
        a + b
    }
}

impl Add for Pair {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self::add(self, other)
    }
}

impl Sub for Pair {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self::sub(self, other)
    }
}

impl Mul for Pair {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self::mul(self, other)
    }
}

impl Neg for Pair {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::splat(-0.0) - self
    }
}
