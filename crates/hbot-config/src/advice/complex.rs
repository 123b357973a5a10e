//! Complex numbers, as far as the determinant of a loop needs them.

use std::ops::{Add, Mul, Sub};

/// A complex number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Complex {
    pub(super) re: f64,
    pub(super) im: f64,
}

impl Complex {
    pub(super) fn real(re: f64) -> Self {
        Self { re, im: 0.0 }
    }

    pub(super) fn polar(radius: f64, angle: f64) -> Self {
        let (sine, cosine) = angle.sin_cos();
        Self { re: radius * cosine, im: radius * sine }
    }

    pub(super) fn size(self) -> f64 {
        (self.re * self.re + self.im * self.im).sqrt()
    }

    pub(super) fn inverse(self) -> Self {
        let square = self.re * self.re + self.im * self.im;
        Self { re: self.re / square, im: -self.im / square }
    }

    /// Returns the angle of the number, rad, -pi to pi.
    pub(super) fn angle(self) -> f64 {
        self.im.atan2(self.re)
    }
}

impl Add for Complex {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { re: self.re + other.re, im: self.im + other.im }
    }
}

impl Add<f64> for Complex {
    type Output = Self;
    fn add(self, other: f64) -> Self {
        Self { re: self.re + other, ..self }
    }
}

impl Sub for Complex {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self { re: self.re - other.re, im: self.im - other.im }
    }
}

impl Mul for Complex {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self { re: self.re * other.re - self.im * other.im, im: self.re * other.im + self.im * other.re }
    }
}

impl Mul<f64> for Complex {
    type Output = Self;
    fn mul(self, other: f64) -> Self {
        Self { re: self.re * other, im: self.im * other }
    }
}

/// Returns the determinant of a matrix of three rows.
pub(super) fn determinant(m: &[[Complex; 3]; 3]) -> Complex {
    let minor = |i: usize, k: usize| m[1][i] * m[2][k] - m[1][k] * m[2][i];
    m[0][0] * minor(1, 2) - m[0][1] * minor(0, 2) + m[0][2] * minor(0, 1)
}
