//! The width of a real number, chosen once for the whole crate.
//!
//! `hbot-core` computes in `f64`. `hbot-core-f32` compiles the same sources with the feature `f32`.
//! Everything that depends on the width is defined in this module only. Elementary functions come
//! from `libm`, never from the platform's C library, so that the same inputs give the same bits on
//! every machine.

#[cfg(not(feature = "f32"))]
mod width {
    /// A real number: `f64` in this crate, `f32` in `hbot-core-f32`.
    pub type Real = f64;
    /// A vector of three reals.
    pub type Vec3 = glam::DVec3;
    /// A 3x3 matrix of reals, stored by columns.
    pub type Mat3 = glam::DMat3;
    /// A quaternion of reals. glam stores it as x, y, z, w; files and messages use `[w, x, y, z]`.
    pub type Quat = glam::DQuat;
    pub(crate) use libm::{acos, asin, atan2, cos, exp, fabs, floor, fmod, round, sincos, sqrt};
    pub(crate) const PI: Real = core::f64::consts::PI;
}

#[cfg(feature = "f32")]
mod width {
    /// A real number: `f32` in this crate, `f64` in `hbot-core`.
    pub type Real = f32;
    /// A vector of three reals.
    pub type Vec3 = glam::Vec3;
    /// A 3x3 matrix of reals, stored by columns.
    pub type Mat3 = glam::Mat3;
    /// A quaternion of reals. glam stores it as x, y, z, w; files and messages use `[w, x, y, z]`.
    pub type Quat = glam::Quat;
    pub(crate) use libm::{
        acosf as acos, asinf as asin, atan2f as atan2, cosf as cos, expf as exp, fabsf as fabs,
        floorf as floor, fmodf as fmod, roundf as round, sincosf as sincos, sqrtf as sqrt,
    };
    pub(crate) const PI: Real = core::f32::consts::PI;
}

pub use width::*;

/// Angle of a full turn, 2 pi, rad.
pub(crate) const TURN: Real = 2.0 * PI;
