//! What a judge finds in a scene: which effect shakes the sphere, where, and why.

use hbot_core::Vec3;
use hbot_core::render::around::{Place, Spot};

use super::sampled::Hold;

/// A place at which the loop does not keep a scene stable.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// Index of the effect that has the largest part in it.
    pub effect: usize,
    /// The place. It may be a place of another effect.
    pub place: Place,
    /// Axis about which the sphere shakes, unit vector in frame N. `None` if it may be any.
    pub axis: Option<Vec3>,
    /// Who holds the sphere when it shakes.
    pub hold: Hold,
    /// Whether only swings that ask for more torque than the rig makes, or for a faster change of
    /// it, shake. Smaller swings are stable with more.
    pub limited: bool,
    /// Whether the place is one to which a tapped sphere turns about an axis that nothing holds.
    pub away: bool,
    /// Why it shakes.
    pub why: Why,
}

/// Why the loop does not keep a scene stable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Why {
    /// The stiffness is too large for the damping at the place.
    Stiff {
        /// Stiffness of the scene about the axis, N m/rad.
        stiffness: f64,
        /// Part of this stiffness that is stable with the damping of the scene, 0 to 1.
        stable: f64,
        /// Damping of the scene about the axis, N m s/rad.
        damping: f64,
        /// What would make it stable.
        cure: Cure,
    },
    /// The damping acts too late and shakes the sphere instead of slowing it down.
    Damped {
        /// Damping of the scene about the axis, N m s/rad.
        damping: f64,
        /// Part of this damping that is stable, 0 to 1.
        stable: f64,
        /// Part of the effect's own damping with which the scene is stable, 0 to 1.
        own: f64,
    },
    /// A free sphere swings for long after a tap.
    Rings {
        /// Damping that the effect has to add for the sphere to come to rest, N m s/rad.
        added: f64,
    },
    /// Walls throw a free sphere back and forth for long after a tap.
    Bounces {
        /// Multiple of the effect's damping with which the sphere comes to rest.
        times: f64,
    },
    /// A sphere that keeps turning gains speed over the bumps of the scene.
    Turning {
        /// Speed that it reaches, rad/s. Infinite if nothing slows it down.
        speed: f64,
        /// Damping that would keep it from gaining speed, N m s/rad.
        damping: f64,
    },
}

impl Why {
    /// Returns the part of the stiffness or damping that is stable, 0 to 1.
    fn left(&self) -> f64 {
        match self {
            Self::Stiff { stable, .. } | Self::Damped { stable, .. } => *stable,
            Self::Rings { .. } | Self::Bounces { .. } | Self::Turning { .. } => 1.0,
        }
    }
}

/// A change of one effect that makes a scene stable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cure {
    /// Part of the effect's own stiffness with which the scene is stable, 0 to 1. 0 if the others
    /// are unstable without it.
    pub own: f64,
    /// Damping that the effect has to add, N m s/rad. `None` if no damping helps.
    pub added: Option<f64>,
}

/// Returns whether a finding about `effect` at `place`, with `left` of it stable, takes the place
/// of the one that there is: which is at a place of another effect, or has more that is stable. So
/// a place that another effect adds does not change what is said of this one.
pub(super) fn is_worst(found: &[Finding], effect: usize, place: &Place, left: f64) -> bool {
    let others = |place: &Place| place.effect != effect && place.spot != Spot::Rest;
    let worse = |place: &Place, left: f64| (others(place), left);
    let other = found.iter().find(|other| other.effect == effect);
    other.is_none_or(|other| worse(place, left) < worse(&other.place, other.why.left()))
}

/// Adds a finding, unless there is a worse one of the same effect.
pub(super) fn keep(found: &mut Vec<Finding>, finding: Finding) {
    if is_worst(found, finding.effect, &finding.place, finding.why.left()) {
        match found.iter_mut().find(|other| other.effect == finding.effect) {
            Some(other) => *other = finding,
            None => found.push(finding),
        }
    }
}
