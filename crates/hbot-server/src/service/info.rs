//! What `info` answers: the rig, what it can render and at what limits, and what runs.

use hbot_config::rig::OnClientLost;
use hbot_config::{RigConfig, RunningScene};
use hbot_core::allocation::{ContactArms, JointLimits, capability};
use hbot_core::kinematics::Posture;
use hbot_core::{MAX_JOINTS, MAX_WHEELS, Vec3};
use serde_json::{Value, json};

use hbot_host::sample::Sample;
use hbot_host::stiffness::{Expected, USUAL_DAMPING};

/// What stiffness to expect of the loop; null where the inertias of a wheel contradict each other.
fn render(config: &RigConfig) -> Option<Value> {
    let expected = Expected::of(config)?;
    let [most, _] = expected.most();
    Some(json!({
        "inertia": expected.inertia,
        "damping": USUAL_DAMPING,
        "stiffness_stable": expected.stable(USUAL_DAMPING),
        "stiffness_most": most,
    }))
}

/// The parts that do not change while the server runs.
pub(super) struct Info {
    fixed: Value,
    limits: JointLimits,
}

impl Info {
    pub(super) fn new(config: &RigConfig, accuracy: &str, simulated: bool) -> Self {
        let rig = &config.rig;
        let device = &rig.device;
        let mut limits = JointLimits { peak: [0.0; MAX_JOINTS], weight: [1.0; MAX_JOINTS] };
        for (i, wheel) in device.wheels().iter().enumerate() {
            let weights = ContactArms::of(wheel, device.sphere_radius()).weights();
            for (j, weight) in weights.into_iter().enumerate() {
                limits.weight[2 * i + j] = weight;
                limits.peak[2 * i + j] = rig.joints[2 * i + j].peak;
            }
        }
        let joint = |j: usize| json!({"peak": rig.joints[j].peak, "continuous": rig.joints[j].continuous});
        let wheels: Vec<Value> = device
            .wheels()
            .iter()
            .enumerate()
            .map(|(i, wheel)| {
                let spec = wheel.spec();
                json!({
                    "name": config.wheels.get(i),
                    "axis": spec.axis.to_array(),
                    "cone": spec.cone,
                    "toe": spec.toe,
                    "radius": spec.radius,
                    "steer": joint(2 * i),
                    "drive": joint(2 * i + 1),
                })
            })
            .collect();
        let limit = &rig.limits;
        let traction = limit.traction.map(|t| json!({"mu": t.mu, "normal_force": t.normal_force}));
        let mut fixed = json!({
            "rig": {
                "name": config.name,
                "simulated": simulated,
                "rate_hz": config.rate_hz,
                "sphere": {"radius": device.sphere_radius(), "mass": device.sphere_mass()},
                "wheels": wheels,
            },
            "limits": {
                "torque": limit.torque,
                "torque_rate": limit.torque_rate,
                "speed": limit.speed,
                "slip": limit.slip,
                "energy": limit.energy.map(|e| json!({"burst": e.burst, "power": e.power})),
                "traction": traction,
                "enable_max_angle": limit.enable_max_angle,
                "align_rate": limit.align_rate,
                "reference_rate": limit.reference_rate,
                "max_age_ticks": limit.max_age_ticks,
            },
            "render": render(config),
            "accuracy": accuracy,
            "on_client_lost": match config.api.on_client_lost {
                OnClientLost::Ramp => "ramp",
                OnClientLost::Keep => "keep",
                OnClientLost::Fault => "fault",
            },
            "effects": hbot_config::scene::kinds(),
        });
        if simulated {
            fixed["phenomena"] = json!(hbot_config::scene::phenomena());
        }
        Self { fixed, limits }
    }

    /// The whole answer. `capability` is the largest torque along n1, n2 and n3 at the posture of `sample`, N m; null
    /// before the first.
    pub(super) fn answer(&self, config: &RigConfig, scene: &RunningScene, sample: Option<&Sample>) -> Value {
        let mut answer = self.fixed.clone();
        answer["scene"] = scene.file().to_json();
        answer["capability"] = json!(sample.map(|sample| {
            let device = &config.rig.device;
            let mut steering = [0.0; MAX_WHEELS];
            for (i, th) in steering.iter_mut().enumerate() {
                *th = sample.state.angle[2 * i];
            }
            let posture = Posture::new(device, &steering[..device.wheels().len()]);
            Vec3::AXES.map(|axis| capability(posture.rows(), &self.limits, axis))
        }));
        answer
    }
}
