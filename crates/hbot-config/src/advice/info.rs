//! A rig and its limits in the words of an answer to `info`.

use hbot_api::{
    EnergyInfo, JointInfo, LimitsInfo, PassivityInfo, RigInfo, SphereInfo, TractionInfo, WheelInfo,
};

use crate::RigConfig;

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
