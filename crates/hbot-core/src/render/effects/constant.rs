//! A constant torque. It is not the gradient of an energy: for a turn in its direction it gives out
//! its size times the angle turned.

use super::{Law, Now};
use crate::real::Vec3;

/// The frame in which a torque is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub enum Frame {
    /// The inertial frame N, which does not turn.
    World,
    /// The axes fixed in the sphere, which turn with it.
    Sphere,
}

/// An effect that makes a constant torque on the sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Constant {
    /// Torque on the sphere, N m. It is constant in the frame that `frame` names.
    pub torque: Vec3,
    /// Frame in which the torque is constant.
    pub frame: Frame,
}

impl Law for Constant {
    type Memory = ();

    const GIVES: bool = true;
    const ELASTIC: bool = false;

    #[inline]
    fn render(&self, now: &mut Now<'_>, (): &mut ()) -> Vec3 {
        match self.frame {
            Frame::World => self.torque,
            Frame::Sphere => now.motion.q * self.torque,
        }
    }
}
