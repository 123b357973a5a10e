//! From encoder counts to the motion of the sphere: joint angles and [`rates`], the turn of the
//! sphere along a [`path`] ([`odometry`]), its orientation, and how far measurements from outside
//! correct it.

pub(crate) mod encoder;
pub(crate) mod joints;
pub(crate) mod lateness;
pub mod odometry;
pub(crate) mod orientation;
pub mod path;
pub mod rates;
pub(crate) mod reference;
