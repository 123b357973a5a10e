//! A simulated rig that is not as its drawing: the plant is built from another rig file than the
//! one that the loop believes.

use hbot_config::RigConfig;
use hbot_sim::controller::Lags;
use hbot_sim::phenomena::Phenomena;
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};
use thiserror::Error;

use crate::bus::field;
use crate::rig::attach::{AttachError, simulated_joints};

/// The reason why a rig cannot be simulated as another rig file describes it.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum Mismatch {
    /// The motors are real.
    #[error("{port} is a real rig, which is built as it is: --built needs the simulated one (`--port sim`)")]
    RealPort {
        /// The ports of the rig.
        port: String,
    },
    /// The two files have different numbers of wheels.
    #[error(
        "the rig has {believed} wheels, the one that it is built as has {built}: both need the same wheels"
    )]
    Wheels {
        /// Number of wheels in the rig file that the loop believes.
        believed: usize,
        /// Number of wheels in the rig file from which the simulated rig is built.
        built: usize,
    },
    /// An encoder has another number of counts per turn in one file than in the other.
    #[error(
        "{field}: the rig counts {believed} a turn, the one that it is built as {built}: both need the same counts_per_turn"
    )]
    Counts {
        /// The joint's table in the rig file, such as `wheel[0].steer`.
        field: String,
        /// Encoder counts per turn in the rig file that the loop believes.
        believed: u32,
        /// Encoder counts per turn in the rig file from which the simulated rig is built.
        built: u32,
    },
}

/// Checks that the simulated motor controllers of a rig that is built as `built` describes fit the
/// loop of `rig`.
///
/// # Errors
/// Fails if the port of `rig` is real, or if wheels or counts per turn differ.
pub fn check(rig: &RigConfig, built: &RigConfig) -> Result<(), Mismatch> {
    if !rig.link.port.is_simulated() {
        return Err(Mismatch::RealPort { port: rig.link.port.to_string() });
    }
    let [ours, theirs] = [rig, built].map(|rig| rig.rig.device.wheels().len());
    if ours != theirs {
        return Err(Mismatch::Wheels { believed: ours, built: theirs });
    }
    for j in 0..rig.rig.device.joints() {
        let [believed, built] = [rig, built].map(|rig| rig.rig.joints[j].counts_per_turn);
        if believed != built {
            return Err(Mismatch::Counts { field: field(j), believed, built });
        }
    }
    Ok(())
}

/// Creates the simulated rig that `built` describes: geometry, inertias, gears, signs, motors,
/// steering zeros, and the imperfections that it says (friction, torque constants, cogging,
/// imbalance). Its motor controllers speak the protocol of `rig`.
///
/// # Errors
/// Fails if the two do not fit ([`check`]), or if the rig cannot be simulated.
pub(crate) fn simulated_rig(
    rig: &RigConfig,
    built: &RigConfig,
    phenomena: Phenomena,
) -> Result<SimulatedRig, AttachError> {
    check(rig, built)?;
    let joints = simulated_joints(built);
    let line = rig.link.protocol.into();
    let lags = Lags { torque: Some(built.torque_lag), rate: Some(built.rate_lag) };
    Ok(SimulatedRig::new(&SimulatedConfig {
        line,
        lags,
        phenomena,
        imperfect: built.rig.compensation,
        joints,
        ..SimulatedConfig::new(&built.rig)
    })?)
}
