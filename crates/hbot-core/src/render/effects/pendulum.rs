//! An off-centre mass under gravity: T = R c x m g, V = -m g . R c.

use super::{Law, Now};
use crate::real::{Quat, Real, Vec3};
use crate::render::around::Spot;
use crate::render::outline::Outline;

/// An effect that makes the sphere feel as if it had an off-centre mass under gravity.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Pendulum {
    /// Position of the mass, m. It is fixed in the sphere and given in the sphere's axes.
    pub centre: Vec3,
    /// Weight of the mass: a force in frame N, in newton.
    pub weight: Vec3,
}

impl Law for Pendulum {
    type Memory = ();

    #[inline]
    fn render(&self, now: &mut Now<'_>, (): &mut ()) -> Vec3 {
        (now.motion.q * self.centre).cross(self.weight)
    }

    fn energy(&self, now: &mut Now<'_>, (): &()) -> Option<Real> {
        Some(-self.weight.dot(now.motion.q * self.centre))
    }

    fn places(&self, _: &[Real], visit: &mut dyn FnMut(Spot, Quat, Vec3, ())) {
        // It hangs straight down.
        let hangs = match (self.centre.try_normalize(), self.weight.try_normalize()) {
            (Some(centre), Some(down)) => Quat::from_rotation_arc(centre, down),
            _ => Quat::IDENTITY,
        };
        visit(Spot::Rest, hangs, Vec3::ZERO, ());
    }

    fn outline<'a>(&self, _: &'a [Real], visit: &mut dyn FnMut(Outline<'a>)) {
        visit(Outline::Weight(self.centre));
    }
}
