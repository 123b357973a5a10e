//! Dual numbers: values with a derivative along one direction. They give exact Jacobians of the
//! reference's equations.

use core::ops::{Add, Div, Mul, Neg, Sub};

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Dual {
    pub(super) value: f64,
    pub(super) slope: f64,
}

pub(super) fn constant(value: f64) -> Dual {
    Dual { value, slope: 0.0 }
}

impl Dual {
    pub(super) fn sqrt(self) -> Self {
        let value = self.value.sqrt();
        Self { value, slope: self.slope / (2.0 * value) }
    }

    pub(super) fn sin(self) -> Self {
        Self { value: self.value.sin(), slope: self.slope * self.value.cos() }
    }

    pub(super) fn cos(self) -> Self {
        Self { value: self.value.cos(), slope: -self.slope * self.value.sin() }
    }

    pub(super) fn exp(self) -> Self {
        let value = self.value.exp();
        Self { value, slope: self.slope * value }
    }

    pub(super) fn abs(self) -> Self {
        if self.value < 0.0 { -self } else { self }
    }

    pub(super) fn max_zero(self) -> Self {
        if self.value > 0.0 { self } else { Self::default() }
    }
}

impl Add for Dual {
    type Output = Self;
    fn add(self, b: Self) -> Self {
        Self { value: self.value + b.value, slope: self.slope + b.slope }
    }
}

impl Sub for Dual {
    type Output = Self;
    fn sub(self, b: Self) -> Self {
        self + -b
    }
}

impl Neg for Dual {
    type Output = Self;
    fn neg(self) -> Self {
        Self { value: -self.value, slope: -self.slope }
    }
}

impl Mul for Dual {
    type Output = Self;
    fn mul(self, b: Self) -> Self {
        Self { value: self.value * b.value, slope: self.slope * b.value + self.value * b.slope }
    }
}

impl Mul<f64> for Dual {
    type Output = Self;
    fn mul(self, b: f64) -> Self {
        Self { value: self.value * b, slope: self.slope * b }
    }
}

impl Div for Dual {
    type Output = Self;
    fn div(self, b: Self) -> Self {
        let value = self.value / b.value;
        Self { value, slope: (self.slope - value * b.slope) / b.value }
    }
}

/// A vector of three components, each with its derivative.
pub(super) type Triple = [Dual; 3];

pub(super) fn fixed(v: [f64; 3]) -> Triple {
    v.map(constant)
}

pub(super) fn plus(a: Triple, b: Triple) -> Triple {
    core::array::from_fn(|k| a[k] + b[k])
}

pub(super) fn times(a: Triple, by: Dual) -> Triple {
    a.map(|a| a * by)
}

pub(super) fn dot(a: Triple, b: Triple) -> Dual {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: Triple, b: Triple) -> Triple {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Returns the vector v turned by the quaternion (w, x, y, z). The norm of the quaternion need not
/// be exactly 1.
pub(super) fn turned(q: [Dual; 4], v: Triple) -> Triple {
    let e = [q[1], q[2], q[3]];
    let t = times(cross(e, v), constant(2.0));
    plus(v, plus(times(t, q[0]), cross(e, t)))
}

/// Returns the solution of three linear equations by Cramer's rule. `m` holds the rows of the
/// matrix, and `b` the right-hand side.
pub(super) fn solved(m: [Triple; 3], b: Triple) -> Triple {
    let det = dot(m[0], cross(m[1], m[2]));
    let columns: [Triple; 3] = [cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])];
    core::array::from_fn(|k| (columns[0][k] * b[0] + columns[1][k] * b[1] + columns[2][k] * b[2]) / det)
}
