//! How the fed friction rises and falls: slowly, so that the sphere does not stick and slip.
//!
//! Friction that is fed forward as soon as a joint moves makes the joint slip: the faster it turns,
//! the less friction is left to brake it. On a spring in slow motion the sphere then stops, waits
//! and slips again, although little friction would be left in steady motion. So what is fed rises
//! more slowly than such a slip, which lasts about 0.1 s with a spring of 4 N m/rad, and it
//! outlasts a short rest. It ends at once if the joint turns back, and never exceeds what friction
//! takes.

use crate::design::device::MAX_JOINTS;
use crate::real::{Real, Vec3, fabs, sqrt};

/// Time in which the fed part of the dry friction rises from nothing to all of it, s.
const RISE_S: Real = 0.2;
/// Time in which it falls from all to nothing at rest, s.
const FALL_S: Real = 0.5;

/// The parts of the dry friction that are fed forward, and what the gears lose.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Rising {
    /// Part of each joint's dry friction, -1 to 1, with the sign of its rate.
    joints: [Real; MAX_JOINTS],
    /// Part of the sphere's dry friction, along its angular velocity.
    sphere: Vec3,
    /// Part of the torque that the gear of each joint loses: that of the rig, kept here because a
    /// recorded rig lacks it.
    pub(super) loss: [Real; MAX_JOINTS],
}

impl Rising {
    pub(super) fn new(loss: [Real; MAX_JOINTS]) -> Self {
        Self { joints: [0.0; MAX_JOINTS], sphere: Vec3::ZERO, loss }
    }

    /// Forgets all, because nothing is fed forward.
    pub(super) fn rest(&mut self) {
        (self.joints, self.sphere) = ([0.0; MAX_JOINTS], Vec3::ZERO);
    }

    /// Advances joint `j` by `dt` seconds, and returns the part of its dry friction that is fed
    /// forward. `goal` is that in steady motion.
    pub(super) fn joint(&mut self, j: usize, goal: Real, dt: Real) -> Real {
        let last = if goal * self.joints[j] >= 0.0 { fabs(self.joints[j]) } else { 0.0 };
        let size = moved(last, fabs(goal), dt);
        let sign = if goal == 0.0 { self.joints[j] } else { goal };
        self.joints[j] = if sign < 0.0 { -size } else { size };
        self.joints[j]
    }

    /// The same for the friction of the sphere.
    pub(super) fn sphere(&mut self, goal: Vec3, dt: Real) -> Vec3 {
        let length = sqrt(goal.length_squared());
        let way = if length > 0.0 {
            goal / length
        } else {
            self.sphere / sqrt(self.sphere.length_squared()).max(Real::MIN_POSITIVE)
        };
        self.sphere = way * moved(self.sphere.dot(way).max(0.0), length, dt);
        self.sphere
    }
}

/// Returns the part after `dt` seconds, if it was `last` and would be `goal` in steady motion.
fn moved(last: Real, goal: Real, dt: Real) -> Real {
    if goal > last { goal.min(last + dt / RISE_S) } else { goal.max(last - dt / FALL_S) }
}
