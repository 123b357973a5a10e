//! A constant torque. It is not the gradient of an energy: for a turn in its direction it gives out
//! its size times the angle turned.

use super::{Law, Now};
use crate::real::Vec3;

/// The frame in which a vector is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Frame {
    /// The inertial frame N.
    World,
    /// The sphere's own axes, which turn with it.
    Sphere,
}

/// An effect that makes a constant torque, in frame N or in the sphere's axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constant {
    /// Torque on the sphere, N m.
    pub torque: Vec3,
    /// Frame in which the torque is given.
    pub frame: Frame,
}

impl Law for Constant {
    type Memory = ();

    #[inline]
    fn render(&self, now: &mut Now<'_>, (): &mut ()) -> Vec3 {
        match self.frame {
            Frame::World => self.torque,
            Frame::Sphere => now.motion.q * self.torque,
        }
    }
}
