//! The limits that a controller must not exceed.

use super::legal::{self, RigError};
use crate::real::Real;

/// The limits that the control law must not exceed. All values are positive and within the ranges
/// of [`legal`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Limits {
    /// Largest torque on the sphere, N m: the length of the torque vector.
    pub torque: Real,
    /// Largest rate of change of the torque on the sphere, N m/s.
    pub torque_rate: Real,
    /// Largest angular speed of the sphere while the motors are on, rad/s. A higher speed is the
    /// fault `overspeed`.
    pub speed: Real,
    /// Largest slip of a wheel while the motors are on, m/s. A larger slip is the fault `slip`.
    pub slip: Real,
    /// Limit on the energy that the rig gives to the hand. More energy is the fault `overtorque`.
    /// If `None`, only torque and speed are limited.
    pub energy: Option<EnergyLimit>,
    /// Thermal time constant of the motors, s. The fault `thermal` occurs if the mean square of a
    /// joint's torque over this time exceeds the square of its continuous torque. If `None`, only
    /// the motor controllers watch the temperature.
    pub thermal_time: Option<Real>,
    /// Friction limit of the contacts between wheels and sphere. `None` if it is not known.
    pub traction: Option<Traction>,
    /// Largest angle between an effect's reference and the sphere's orientation at which the rig
    /// can be enabled, rad.
    pub enable_max_angle: Real,
    /// Rate at which an independent measurement corrects the sphere's orientation, rad/s.
    pub align_rate: Real,
    /// Largest rate at which the reference of an effect moves, rad/s.
    pub reference_rate: Real,
    /// Largest age, in ticks, of the state from which a client computed a streamed message. A
    /// message that was computed from an older state is refused.
    pub max_age_ticks: u32,
}

impl Default for Limits {
    /// Returns the default limits: torque 0.9 N m, change of torque 200 N m/s, speed 30 rad/s, slip
    /// 50 mm/s, and enable within 0.5 rad of the reference. References move at up to 2 rad/s, and
    /// the orientation is corrected at 0.2 rad/s. Streamed messages may be 100 ticks old. Energy,
    /// heat and traction are not limited.
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
    /// The widest limits that a valid rig can have. They serve for tests and measurements in which
    /// no limit must interfere. They are not safe for a person's hand.
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

/// A limit on the energy that the rig gives to the hand, as the passivity observer measures it.
/// Energy that is given out faster than `power` must not add up to more than `burst`. Both values
/// are positive.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct EnergyLimit {
    /// Largest energy in excess of what `power` allows, J.
    pub burst: Real,
    /// Power that the rig may give to the hand continuously, W.
    pub power: Real,
}

/// The friction limit of a contact between wheel and sphere. The contact holds a tangential force
/// of at most mu times the normal force.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Traction {
    /// Friction coefficient mu.
    pub mu: Real,
    /// Normal force of each contact, N.
    pub normal_force: Real,
}
