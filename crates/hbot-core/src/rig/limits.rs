//! What a controller must not exceed.

use super::legal::{self, RigError};
use crate::real::Real;

/// What must not be exceeded. All positive, within the ranges of [`legal`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Largest torque on the sphere, N m (its norm).
    pub torque: Real,
    /// Largest change of that torque, N m/s.
    pub torque_rate: Real,
    /// Largest angular speed of the powered sphere, rad/s; above it: fault overspeed.
    pub speed: Real,
    /// Largest slip of the powered sphere, m/s; above it: fault slip.
    pub slip: Real,
    /// How much energy may go into the hand, and how fast; more is the fault overtorque. `None`: as much as torque and speed
    /// allow.
    pub energy: Option<EnergyLimit>,
    /// The thermal time of the motors, s: a joint whose mean square of torque over it is above that of its continuous torque is
    /// the fault thermal. `None`: heat is left to the controllers.
    pub thermal_time: Option<Real>,
    /// What the contacts hold; `None` where nobody knows.
    pub traction: Option<Traction>,
    /// How far a spring's reference may be from the orientation at enable, rad.
    pub enable_max_angle: Real,
    /// How fast an outside orientation corrects the odometry, rad/s.
    pub align_rate: Real,
    /// How fast a reference moves, rad/s.
    pub reference_rate: Real,
    /// Stream messages that name a tick older than this are refused.
    pub max_age_ticks: u32,
}

impl Default for Limits {
    /// 0.9 N m with a slope of 200 N m/s; 30 rad/s; 50 mm/s of slip; enabling within 0.5 rad of the reference, which moves by 2
    /// rad/s; corrections by 0.2 rad/s; messages of 100 ticks. Energy, heat and traction are not limited.
    fn default() -> Self {
        Self {
            torque: 0.9,
            torque_rate: 200.0,
            speed: 30.0,
            slip: 0.05,
            energy: None,
            thermal_time: None,
            traction: None,
            enable_max_angle: 0.5,
            align_rate: 0.2,
            reference_rate: 2.0,
            max_age_ticks: 100,
        }
    }
}

impl Limits {
    /// The widest limits of a legal rig: for tests and measurements in which nothing may interfere, not for a hand.
    pub const WIDEST: Self = Self {
        torque: legal::TORQUE.most,
        torque_rate: legal::TORQUE_RATE.most,
        speed: legal::SPEED.most,
        slip: legal::SLIP.most,
        energy: None,
        thermal_time: None,
        traction: None,
        enable_max_angle: legal::ENABLE_MAX_ANGLE.most,
        align_rate: legal::ALIGN_RATE.most,
        reference_rate: legal::REFERENCE_RATE.most,
        max_age_ticks: legal::MAX_AGE_TICKS.most as u32,
    };

    pub(super) fn checks(&self) -> [Option<RigError>; 13] {
        let each =
            |range: legal::Range, field, value: Option<Real>| value.and_then(|x| range.check(field, x));
        let (energy, traction) = (self.energy, self.traction);
        [
            legal::TORQUE.check("limits.torque", self.torque),
            legal::TORQUE_RATE.check("limits.torque_rate", self.torque_rate),
            legal::SPEED.check("limits.speed", self.speed),
            legal::SLIP.check("limits.slip", self.slip),
            each(legal::THERMAL_TIME, "limits.thermal_time", self.thermal_time),
            each(legal::BURST, "limits.energy.burst", energy.map(|energy| energy.burst)),
            each(legal::POWER, "limits.energy.power", energy.map(|energy| energy.power)),
            each(legal::FRICTION, "limits.traction.mu", traction.map(|traction| traction.mu)),
            each(
                legal::NORMAL_FORCE,
                "limits.traction.normal_force",
                traction.map(|traction| traction.normal_force),
            ),
            legal::ENABLE_MAX_ANGLE.check("limits.enable_max_angle", self.enable_max_angle),
            legal::ALIGN_RATE.check("limits.align_rate", self.align_rate),
            legal::REFERENCE_RATE.check("limits.reference_rate", self.reference_rate),
            legal::MAX_AGE_TICKS.check("limits.max_age_ticks", self.max_age_ticks as Real),
        ]
    }
}

/// A bound on the energy given out to the hand, as the passivity observer sees it: what is given out faster than `power` must
/// not add up to more than `burst`. Both positive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnergyLimit {
    /// Energy above what `power` allows, J.
    pub burst: Real,
    /// What may be given out for ever, W.
    pub power: Real,
}

/// The contact's friction limit, mu N.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Traction {
    /// Friction coefficient.
    pub mu: Real,
    /// Normal force of each wheel, N.
    pub normal_force: Real,
}
