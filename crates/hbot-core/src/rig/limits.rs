//! The limits that a controller must not exceed.

use super::legal::{self, RigError};
use crate::real::Real;

/// The limits that a controller must not exceed. All are positive and within the ranges of
/// [`legal`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Largest torque on the sphere (its norm), N m.
    pub torque: Real,
    /// Largest change of the torque on the sphere, N m/s.
    pub torque_rate: Real,
    /// Largest angular speed of the sphere with motors on, rad/s. Above it the fault `overspeed`
    /// occurs.
    pub speed: Real,
    /// Largest slip of a wheel with motors on, m/s. Above it the fault `slip` occurs.
    pub slip: Real,
    /// Limit of the energy given to the hand. Above it the fault `overtorque` occurs. `None`: only
    /// the limits of torque and speed apply.
    pub energy: Option<EnergyLimit>,
    /// Thermal time of the motors, s. If the mean square of a joint's torque over this time exceeds
    /// that of its continuous torque, the fault `thermal` occurs. `None`: only the motor
    /// controllers watch the heat.
    pub thermal_time: Option<Real>,
    /// Friction limit of the contacts; `None` if it is not known.
    pub traction: Option<Traction>,
    /// Largest permitted angle between an effect's reference and the orientation at enable, rad.
    pub enable_max_angle: Real,
    /// Rate at which an outside measurement corrects the orientation, rad/s.
    pub align_rate: Real,
    /// Largest rate at which a reference moves, rad/s.
    pub reference_rate: Real,
    /// Largest age of a stream message, ticks. A message that names an older state is refused.
    pub max_age_ticks: u32,
}

impl Default for Limits {
    /// Returns the default limits: torque 0.9 N m with a change of 200 N m/s, speed 30 rad/s, slip
    /// 50 mm/s, enable within 0.5 rad of the reference. References move at 2 rad/s, and the
    /// orientation is corrected at 0.2 rad/s. Stream messages may be 100 ticks old. Energy, heat
    /// and traction are not limited.
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
    /// The widest limits that a valid rig can have. They are for tests and measurements without
    /// interference, not for a hand.
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

/// A limit on the energy given to the hand, as the passivity observer measures it. The energy given
/// out faster than `power` must not add up to more than `burst`. Both are positive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnergyLimit {
    /// Energy beyond what `power` allows, J.
    pub burst: Real,
    /// Power that may be given out forever, W.
    pub power: Real,
}

/// The friction limit mu N of a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Traction {
    /// Friction coefficient mu.
    pub mu: Real,
    /// Normal force N of each wheel, N.
    pub normal_force: Real,
}
