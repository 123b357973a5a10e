//! What the motors' shafts do to the torques that the controllers believe: torque constants that
//! differ, and cogging.

use core::f64::consts::TAU;

use hbot_core::design::device::MAX_JOINTS;
use hbot_core::design::rig::{Compensation, MAX_HARMONICS};
use oorandom::Rand64;

use crate::phenomena::{Cogging, Phenomena, TorqueConstants};
use crate::plant::JointTorques;

/// Longest step of the plant while motors cog, ns. The rotor of the prototype's drive turns by 0.03
/// rad in it at an angular speed of the sphere of 1 rad/s.
pub(crate) const MAX_COGGING_STEP_NS: u64 = 250_000;

/// Number of harmonics that the phenomenon `cogging` gives each motor. Those of the rig's own
/// imperfections follow.
const PHENOMENAL: usize = 2;

/// The shafts of all motors, in the order steer, drive of each wheel.
#[derive(Debug, Clone)]
pub(crate) struct Shafts {
    /// True torque of each motor divided by the torque that its controller believes.
    constants: [f64; MAX_JOINTS],
    cogs: Option<[[Cog; PHENOMENAL + MAX_HARMONICS]; MAX_JOINTS]>,
}

/// One harmonic of the cogging of one motor. It makes the torque `amplitude` sin(`per_rad` x +
/// `phase`) at the joint, N m, where x is the angle of the joint, rad.
#[derive(Debug, Clone, Copy, Default)]
struct Cog {
    per_rad: f64,
    amplitude: f64,
    phase: f64,
}

impl Shafts {
    /// Returns the shafts that `phenomena` ask for, or `None` if motors are ideal in this respect.
    /// `gears` are the gear ratios of the joints.
    /// `own` are the imperfections of this very rig, which are added to the phenomena.
    pub(crate) fn new(
        phenomena: &Phenomena,
        own: Option<&Compensation>,
        gears: &[f64; MAX_JOINTS],
    ) -> Option<Box<Self>> {
        if phenomena.torque_constants.is_none() && phenomena.cogging.is_none() && own.is_none() {
            return None;
        }
        let mut constants = phenomena.torque_constants.as_ref().map_or([1.0; MAX_JOINTS], drawn);
        let mut cogs = phenomena.cogging.as_ref().map(|cogging| cogs(cogging, gears));
        for (j, joint) in own.iter().flat_map(|own| own.joints.iter().enumerate()) {
            constants[j] *= joint.torque_scale;
            for (k, harmonic) in joint.cogging.iter().enumerate().filter(|(_, it)| it.amplitude != 0.0) {
                let per_rad = f64::from(harmonic.per_turn) * gears[j];
                let cog = Cog { per_rad, amplitude: harmonic.amplitude, phase: harmonic.phase };
                cogs.get_or_insert_default()[j][PHENOMENAL + k] = cog;
            }
        }
        Some(Box::new(Self { constants, cogs }))
    }

    /// Returns whether a motor cogs, so that its torque depends on its angle.
    pub(crate) fn cog(&self) -> bool {
        self.cogs.is_some()
    }

    /// Returns the true torques of joints whose controllers believe that they make `tau`, N m. It
    /// is the mean over a step of `h` seconds (0: at this instant), in which the joints turn at
    /// `rates` (rad/s) from `angles` (rad).
    pub(crate) fn act(
        &self,
        tau: &JointTorques,
        h: f64,
        angles: &[f64; MAX_JOINTS],
        rates: &[f64; MAX_JOINTS],
    ) -> JointTorques {
        core::array::from_fn(|j| {
            let cogs = self.cogs.as_ref().map_or(&[][..], |cogs| &cogs[j]);
            let cogging = cogs
                .iter()
                .filter(|cog| cog.amplitude != 0.0)
                .map(|cog| cog.mean(angles[j], rates[j] * h))
                .sum::<f64>();
            tau[j] * self.constants[j] + cogging
        })
    }
}

impl Cog {
    /// Returns the mean torque over a turn of the joint by `turn` rad from `angle`. Its work is
    /// that of the potential.
    fn mean(&self, angle: f64, turn: f64) -> f64 {
        let half = 0.5 * turn * self.per_rad;
        let ratio = if half.abs() < 1.0e-4 { 1.0 - half * half / 6.0 } else { libm::sin(half) / half };
        self.amplitude * ratio * libm::sin(angle * self.per_rad + half + self.phase)
    }
}

/// Returns the true torque of each motor divided by the torque that its controller believes.
fn drawn(constants: &TorqueConstants) -> [f64; MAX_JOINTS] {
    let mut random = Rand64::new(u128::from(constants.seed));
    core::array::from_fn(|_| 1.0 + constants.spread * (2.0 * random.rand_float() - 1.0))
}

fn cogs(cogging: &Cogging, gears: &[f64; MAX_JOINTS]) -> [[Cog; PHENOMENAL + MAX_HARMONICS]; MAX_JOINTS] {
    let mut random = Rand64::new(u128::from(cogging.seed));
    core::array::from_fn(|j| {
        let amplitudes = if j % 2 == 0 { cogging.steer } else { cogging.drive };
        let mut cogs = [Cog::default(); PHENOMENAL + MAX_HARMONICS];
        for (k, cog) in cogs.iter_mut().enumerate().take(PHENOMENAL) {
            *cog = Cog {
                per_rad: f64::from(cogging.per_turn[k]) * gears[j],
                amplitude: amplitudes[k],
                phase: TAU * random.rand_float(),
            };
        }
        cogs
    })
}
