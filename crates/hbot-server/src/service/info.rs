//! The answer to `info`: the rig, its limits, what it can render, and what is running.

use hbot_api::{
    ClockInfo, EnergyInfo, InfoOk, JointInfo, KindInfo, LeaseInfo, LimitsInfo, RenderInfo, RigInfo,
    SphereInfo, TractionInfo, WheelInfo,
};
use hbot_config::RigConfig;
use hbot_config::scene::Listed;
use hbot_core::allocation::{ContactArms, JointLimits, capability};
use hbot_core::kinematics::Posture;
use hbot_core::{MAX_JOINTS, MAX_WHEELS, Vec3};
use serde_json::Value;

use super::convert;
use hbot_host::clock::Origin;
use hbot_host::sample::Sample;
use hbot_host::stiffness::{StiffnessBound, USUAL_DAMPING};

/// The parts of the answer to `info` that do not change while the server runs.
pub(super) struct Info {
    fixed: InfoOk,
    limits: JointLimits,
}

impl Info {
    pub(super) fn new(config: &RigConfig, accuracy: &str, simulated: bool, origin: Origin) -> Self {
        let fixed = InfoOk {
            rig: rig(config, simulated),
            clock: Some(ClockInfo { monotonic_ns: origin.monotonic_ns, unix_ns: origin.unix_ns }),
            limits: limits(config),
            render: render(config),
            accuracy: accuracy.to_owned(),
            on_client_lost: convert::client_lost_policy(config.api.on_client_lost),
            effects: listed(hbot_config::scene::kinds()),
            phenomena: simulated.then(|| listed(hbot_config::scene::phenomena())),
            ..InfoOk::default()
        };
        Self { fixed, limits: joint_limits(config) }
    }

    /// Returns the complete answer to `info`. The largest torque about each axis is computed for
    /// the posture in `sample`, and is absent without a sample.
    pub(super) fn answer(
        &self,
        config: &RigConfig,
        scene: Value,
        sample: Option<&Sample>,
        lease: LeaseInfo,
    ) -> InfoOk {
        let capability = sample.map(|sample| {
            let device = &config.rig.device;
            let mut steering = [0.0; MAX_WHEELS];
            for (i, th) in steering.iter_mut().enumerate() {
                *th = sample.state.angle[2 * i];
            }
            let posture = Posture::new(device, &steering[..device.wheels().len()]);
            Vec3::AXES.map(|axis| capability(posture.rows(), &self.limits, axis))
        });
        InfoOk { scene, capability, lease: Some(lease), ..self.fixed.clone() }
    }
}

fn rig(config: &RigConfig, simulated: bool) -> RigInfo {
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

fn limits(config: &RigConfig) -> LimitsInfo {
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
        enable_max_angle: limits.enable_max_angle,
        align_rate: limits.align_rate,
        reference_rate: limits.reference_rate,
        max_age_ticks: limits.max_age_ticks,
    }
}

/// Returns the stiffness of springs that the rig is expected to render, or `None` if the inertias
/// of a wheel contradict each other.
fn render(config: &RigConfig) -> Option<RenderInfo> {
    let expected = StiffnessBound::of(config)?;
    let [stiffness_most, _] = expected.most();
    Some(RenderInfo {
        inertia: expected.inertia,
        damping: USUAL_DAMPING,
        stiffness_stable: expected.stable(USUAL_DAMPING),
        stiffness_most,
    })
}

fn listed(kinds: Vec<Listed>) -> Vec<KindInfo> {
    let kinds = kinds.into_iter();
    kinds
        .map(|Listed { name, description, schema }| KindInfo { name: name.to_owned(), description, schema })
        .collect()
}

/// Returns the peak torque of each joint, and the weight that the torque allocation gives to it.
fn joint_limits(config: &RigConfig) -> JointLimits {
    let (rig, device) = (&config.rig, &config.rig.device);
    let mut limits = JointLimits { peak: [0.0; MAX_JOINTS], weight: [1.0; MAX_JOINTS] };
    for (i, wheel) in device.wheels().iter().enumerate() {
        let weights = ContactArms::of(wheel, device.sphere_radius()).weights();
        for (j, weight) in weights.into_iter().enumerate() {
            limits.weight[2 * i + j] = weight;
            limits.peak[2 * i + j] = rig.joints[2 * i + j].peak;
        }
    }
    limits
}
