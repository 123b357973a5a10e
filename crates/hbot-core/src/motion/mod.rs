//! From encoder counts to the motion of the sphere: joint angles and [`rates`], the turn of the
//! sphere along a [`path`] ([`odometry`]), its orientation.

pub(crate) mod encoder;
pub(crate) mod joints;
pub mod odometry;
pub(crate) mod orientation;
pub mod path;
pub mod rates;
