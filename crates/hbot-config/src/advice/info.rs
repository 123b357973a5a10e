//! A rig, its limits, its loop and its abilities in the words of an answer to `info`.

use hbot_api::{
    EnergyInfo, InfoOk, JointInfo, LimitsInfo, LoopInfo, PassivityInfo, RigInfo, SphereInfo, TractionInfo,
    WheelInfo,
};

use super::told::{Told, ToldLoop};
use crate::RigConfig;

impl From<&InfoOk> for Told {
    /// Takes the numbers by which the server that gave the answer judges scenes. An older server
    /// does not tell its loop.
    fn from(info: &InfoOk) -> Self {
        let sampled = info.render.as_ref().and_then(|render| render.sampled.clone());
        Self {
            rate_hz: info.rig.rate_hz,
            simulated: info.rig.simulated,
            torque: info.limits.torque,
            torque_rate: info.limits.torque_rate,
            speed: info.limits.speed,
            passive: info.limits.passivity.is_some(),
            sampled: sampled.map(ToldLoop::from),
        }
    }
}

impl From<LoopInfo> for ToldLoop {
    fn from(info: LoopInfo) -> Self {
        let LoopInfo { delay_ticks, lag_s, lead_s, rate_lag_s, rate_weights, inertia, axes } = info;
        Self {
            delay: delay_ticks,
            lag: lag_s,
            lead: lead_s,
            rate_lag: rate_lag_s,
            taps: rate_weights,
            inertia,
            axes,
        }
    }
}

impl From<ToldLoop> for LoopInfo {
    fn from(told: ToldLoop) -> Self {
        let ToldLoop { delay, lag, lead, rate_lag, taps, inertia, axes } = told;
        Self {
            delay_ticks: delay,
            lag_s: lag,
            lead_s: lead,
            rate_lag_s: rate_lag,
            rate_weights: taps,
            inertia,
            axes,
        }
    }
}

/// Returns the description of a rig: its sphere, wheels and tick rate.
#[must_use]
pub fn told_rig(config: &RigConfig, simulated: bool) -> RigInfo {
    let device = &config.rig.device;
    let joint = |j: usize| {
        let joint = &config.rig.joints[j];
        JointInfo { peak: joint.peak, continuous: joint.continuous }
    };
    let wheels = device.wheels().iter().enumerate().map(|(i, wheel)| {
        let spec = wheel.spec();
        WheelInfo {
            name: config.wheels.get(i).cloned(),
            axis: spec.axis.to_array(),
            cone: spec.cone,
            toe: spec.toe,
            radius: spec.radius,
            steer: joint(2 * i),
            drive: joint(2 * i + 1),
        }
    });
    RigInfo {
        name: config.name.clone(),
        simulated,
        rate_hz: config.rate_hz,
        sphere: SphereInfo { radius: device.sphere_radius(), mass: device.sphere_mass() },
        wheels: wheels.collect(),
    }
}

/// Returns the limits of a rig.
#[must_use]
pub fn told_limits(config: &RigConfig) -> LimitsInfo {
    let limits = &config.rig.limits;
    LimitsInfo {
        torque: limits.torque,
        torque_rate: limits.torque_rate,
        speed: limits.speed,
        slip: limits.slip,
        energy: limits.energy.map(|energy| EnergyInfo { burst: energy.burst, power: energy.power }),
        traction: limits
            .traction
            .map(|traction| TractionInfo { mu: traction.mu, normal_force: traction.normal_force }),
        passivity: config.rig.methods.passivity.map(|limit| PassivityInfo {
            allowance: limit.allowance,
            store: limit.store,
            damping: limit.damping,
        }),
        enable_max_angle: limits.enable_max_angle,
        align_rate: limits.align_rate,
        reference_rate: limits.reference_rate,
        max_age_ticks: limits.max_age_ticks,
    }
}
