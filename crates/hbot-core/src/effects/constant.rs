//! A torque that does not change. Not a gradient: it gives |T| times the angle turned along it.

use super::{Law, Now};
use crate::real::Vec3;

/// Which axes a vector is given in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Frame {
    /// The frame N.
    World,
    /// The sphere's own axes, turning with it.
    Sphere,
}

/// A torque that does not change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constant {
    /// N m.
    pub torque: Vec3,
    /// Its axes.
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
