//! The keys of a rig file that say how the rig differs from an ideal one, so that the control law
//! can feed it forward: friction, cogging, torque constants, imbalance.

use hbot_core::Vec3;
use hbot_core::design::device::MAX_JOINTS;
use hbot_core::design::rig::{self as core, MAX_HARMONICS, legal};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::file::{Joint, RigFile};

/// Measured friction, of a joint or of the sphere in its cage.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Friction {
    /// Coulomb friction: the constant torque against a motion.
    #[schemars(range(min = legal::COULOMB.least, max = legal::COULOMB.most), extend("unit" = legal::COULOMB.unit))]
    pub(crate) coulomb: f64,
    /// Viscous friction: the part of the torque that grows with the rate.
    #[schemars(range(min = legal::VISCOUS.least, max = legal::VISCOUS.most), extend("unit" = legal::VISCOUS.unit))]
    pub(crate) viscous: f64,
}

/// One harmonic of the cogging of a motor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Harmonic {
    /// Number of periods in one turn of the encoder.
    #[schemars(range(min = legal::PER_TURN.least as u32, max = legal::PER_TURN.most as u32))]
    pub(crate) per_turn: u32,
    /// Largest torque of the harmonic, at the joint.
    #[schemars(range(min = legal::COGGING.least, max = legal::COGGING.most), extend("unit" = legal::COGGING.unit))]
    pub(crate) amplitude: f64,
    /// Phase of the harmonic: the torque is amplitude sin(per_turn x + phase), where x is the angle
    /// of the joint times `gear`.
    #[serde(default)]
    #[schemars(range(min = legal::PHASE.least, max = legal::PHASE.most), extend("unit" = legal::PHASE.unit))]
    pub(crate) phase: f64,
}

/// The value of the key `compensation`: true or false, or a table with the parameters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum Compensation {
    Switch(bool),
    Table(CompensationTable),
}

/// How much of the rig's friction is fed forward.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct CompensationTable {
    /// Fraction of the measured friction that is fed forward. If absent: 0.85.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64", range(min = legal::COMPENSATED.least, max = legal::COMPENSATED.most))]
    pub(crate) friction: Option<f64>,
    /// Rate at which a third of the dry friction is fed forward. In slower motion less is fed, so
    /// with small loads a smaller value leaves less hysteresis. If absent: three times the noise of
    /// the joint rates that the counts make, at least 0.005.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64", range(min = legal::SMOOTHING.least, max = legal::SMOOTHING.most), extend("unit" = legal::SMOOTHING.unit))]
    pub(crate) smoothing: Option<f64>,
}

impl From<Friction> for core::Friction {
    fn from(friction: Friction) -> Self {
        Self { coulomb: friction.coulomb, viscous: friction.viscous }
    }
}

impl Joint {
    /// Returns the imperfections that the file says of this joint.
    pub(crate) fn imperfect(&self) -> core::Imperfect {
        let mut cogging = [core::Harmonic::default(); MAX_HARMONICS];
        for (place, harmonic) in cogging.iter_mut().zip(&self.cogging) {
            let Harmonic { per_turn, amplitude, phase } = *harmonic;
            *place = core::Harmonic { per_turn, amplitude, phase };
        }
        let friction = self.friction.unwrap_or_default().into();
        core::Imperfect { friction, torque_scale: self.torque_scale, gear_loss: self.gear_loss, cogging }
    }
}

/// Returns whether the file says how the fed friction is smoothed.
pub(super) fn says_smoothing(compensation: &Compensation) -> bool {
    matches!(compensation, Compensation::Table(CompensationTable { smoothing: Some(_), .. }))
}

/// Returns what the file says of the rig's imperfections. Returns `None` if it says nothing, or if
/// `loop.compensation` is false.
pub(super) fn compile(file: &RigFile) -> Option<core::Compensation> {
    let table = match file.r#loop.compensation {
        Compensation::Switch(false) => return None,
        Compensation::Switch(true) => CompensationTable::default(),
        Compensation::Table(table) => table,
    };
    let usual = core::Compensation::default();
    let mut joints = [core::Imperfect::default(); MAX_JOINTS];
    let all = file.wheel.iter().flat_map(|wheel| [&wheel.steer, &wheel.drive]);
    for (place, joint) in joints.iter_mut().zip(all) {
        *place = joint.imperfect();
    }
    let known = core::Compensation {
        joints,
        sphere: file.sphere.friction.unwrap_or_default().into(),
        imbalance: Vec3::from_array(file.sphere.imbalance),
        part: table.friction.unwrap_or(usual.part),
        smoothing: table.smoothing.unwrap_or(usual.smoothing),
    };
    known.is_some().then_some(known)
}
