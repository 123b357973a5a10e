//! From the table `[simulate]` of a scene file to the phenomena of the simulated rig.

use hbot_config::scene::Simulate;
use hbot_core::Vec3;

use crate::phenomena::{
    CageFriction, Eccentric, Encoder, Gear, Hand, JointFriction, Link, Motor, Phenomena, Pivoting, Slip,
    WheelModules,
};

/// What the simulated rig is to show for the table `[simulate]` of a scene: each phenomenon that it names, with its figures, and no
/// other.
#[must_use]
pub fn phenomena(simulate: &Simulate) -> Phenomena {
    Phenomena {
        joint_friction: simulate.joint_friction.map(|f| JointFriction {
            coulomb: f.coulomb,
            viscous: f.viscous,
            breakaway: f.breakaway,
            stribeck_rate: f.stribeck_rate,
        }),
        cage_friction: simulate.cage_friction.map(|f| CageFriction { torque: f.torque }),
        slip: simulate.slip.map(|s| Slip { mu: s.mu, normal_force: s.normal_force }),
        pivoting: simulate.pivoting.map(|p| Pivoting {
            mu: p.mu,
            normal_force: p.normal_force,
            patch_radius: p.patch_radius,
        }),
        eccentric: simulate.eccentric.map(|e| Eccentric { offset: Vec3::from_array(e.offset) }),
        wheel_modules: simulate.wheel_modules.map(|w| WheelModules { mass: w.mass }),
        gear: simulate.gear.map(|g| Gear {
            backlash: g.backlash,
            efficiency: g.efficiency,
            rotor_share: g.rotor_share,
        }),
        encoder: simulate.encoder.map(|e| Encoder {
            step: e.step,
            turn_error: e.turn_error,
            index_error: e.index_error,
            seed: e.seed,
        }),
        motor: simulate.motor.map(|m| Motor {
            torque_scale: m.torque_scale,
            lag_s: m.lag_s,
            steer_no_load_rate: m.steer_no_load_rate,
            drive_no_load_rate: m.drive_no_load_rate,
            thermal_time_s: m.thermal_time_s,
        }),
        link: simulate.link.map(|l| Link {
            latency_s: l.latency_s,
            command_latency_s: l.command_latency_s,
            jitter_s: l.jitter_s,
            loss: l.loss,
            corrupt: l.corrupt,
            seed: l.seed,
        }),
        hand: simulate.hand.map(|h| Hand {
            stiffness: h.stiffness,
            damping: h.damping,
            inertia: h.inertia,
            amplitude: h.amplitude,
            rate: h.rate,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hbot_config::SceneFile;
    use hbot_config::scene;
    use serde_json::{Map, Value, json};

    fn of(simulate: Value) -> Phenomena {
        let scene = SceneFile::from_json(json!({ "simulate": simulate })).expect("a legal scene");
        phenomena(scene.simulate().expect("a table"))
    }

    /// A file's `{}` gives the simulator's own figures, and each table the phenomenon of its name alone.
    #[test]
    fn defaults_of_files_are_those_of_the_simulator() {
        let none = Phenomena::default();
        assert_eq!(of(json!({})), none);
        let alone = |name: &str| of(json!({ name: {} }));
        let wanted = [
            ("joint_friction", Phenomena { joint_friction: Some(JointFriction::default()), ..none }),
            ("cage_friction", Phenomena { cage_friction: Some(CageFriction::default()), ..none }),
            ("slip", Phenomena { slip: Some(Slip::default()), ..none }),
            ("pivoting", Phenomena { pivoting: Some(Pivoting::default()), ..none }),
            ("eccentric", Phenomena { eccentric: Some(Eccentric::default()), ..none }),
            ("wheel_modules", Phenomena { wheel_modules: Some(WheelModules::default()), ..none }),
            ("gear", Phenomena { gear: Some(Gear::default()), ..none }),
            ("encoder", Phenomena { encoder: Some(Encoder::default()), ..none }),
            ("motor", Phenomena { motor: Some(Motor::default()), ..none }),
            ("link", Phenomena { link: Some(Link::default()), ..none }),
            ("hand", Phenomena { hand: Some(Hand::default()), ..none }),
        ];
        for (name, wanted) in wanted {
            assert_eq!(alone(name), wanted, "{name}");
        }
        assert_eq!(scene::phenomena().len(), wanted.len());
    }

    /// Every figure of every table reaches the simulator: no two files that differ in one give the same phenomena.
    #[test]
    fn every_figure_arrives() {
        for listed in scene::phenomena() {
            let default = of(json!({ listed.name: {} }));
            for (key, schema) in listed.schema["properties"].as_object().expect("a table") {
                let other = match &schema["default"] {
                    Value::Array(_) => json!([0.001, 0.002, 0.003]),
                    value if schema["type"] == "integer" => json!(value.as_u64().expect("whole") + 1),
                    value => json!(0.4 * value.as_f64().expect("a number") + 0.0017),
                };
                let table = Map::from_iter([(key.clone(), other)]);
                assert_ne!(of(json!({ listed.name: table })), default, "{}.{key}", listed.name);
            }
        }
    }
}
