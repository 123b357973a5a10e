//! The phenomena of a real rig, one at a time and all together, for the experiments on the
//! simulated rig.

use hbot_sim::phenomena::{
    CageFriction, Eccentric, Encoder, Gear, JointFriction, Link, Motor, Phenomena, Pivoting, Slip,
    WheelModules,
};

/// One or more phenomena of a real rig, such as joint friction, with a name under which they are
/// reported.
pub(super) struct Effect {
    /// Name of the effect as shown in tables and plots.
    pub(super) name: &'static str,
    /// Name of the effect as used in the ids of figures.
    pub(super) id: &'static str,
    pub(super) phenomena: Phenomena,
}

/// Motors with a torque constant that is 5 % low and no other error.
const WEAK: Motor = Motor {
    torque_scale: 0.95,
    lag_s: 0.0,
    steer_no_load_rate: 1.0e5,
    drive_no_load_rate: 1.0e5,
    thermal_time_s: 1.0e5,
};

/// Returns parameters of motors that give the full torque, but with a lag and only up to a limited
/// rate.
fn slow() -> Motor {
    Motor { torque_scale: 1.0, thermal_time_s: WEAK.thermal_time_s, ..Motor::default() }
}

/// Returns parameters of motors that heat up. A hot motor is limited to its continuous torque.
fn hot() -> Motor {
    Motor { thermal_time_s: Motor::default().thermal_time_s, torque_scale: 1.0, ..WEAK }
}

/// Returns a list in which each phenomenon of a real rig acts alone, with the prototype's
/// parameters (docs/internals/physics.md, section 8). Three errors of the motors are separate
/// entries: torque constant, lag and heat.
pub(super) fn alone() -> Vec<Effect> {
    let none = Phenomena::default();
    let effect = |name, id, phenomena| Effect { name, id, phenomena };
    vec![
        effect("torque constant 5 % low", "torque_scale", Phenomena { motor: Some(WEAK), ..none }),
        effect("motors late, with back-EMF", "motor_lag", Phenomena { motor: Some(slow()), ..none }),
        effect("motors that get hot", "motor_heat", Phenomena { motor: Some(hot()), ..none }),
        effect(
            "joint friction",
            "joint_friction",
            Phenomena { joint_friction: Some(JointFriction::default()), ..none },
        ),
        effect(
            "cage friction",
            "cage_friction",
            Phenomena { cage_friction: Some(CageFriction::default()), ..none },
        ),
        effect("contacts that slip", "slip", Phenomena { slip: Some(Slip::default()), ..none }),
        effect("pivoting friction", "pivoting", Phenomena { pivoting: Some(Pivoting::default()), ..none }),
        effect(
            "sphere 0.5 mm out of centre",
            "eccentric",
            Phenomena { eccentric: Some(Eccentric::default()), ..none },
        ),
        effect(
            "weight of the wheel modules",
            "wheel_modules",
            Phenomena { wheel_modules: Some(WheelModules::default()), ..none },
        ),
        effect("gears: play and losses", "gear", Phenomena { gear: Some(Gear::default()), ..none }),
        effect(
            "encoder discs out of centre",
            "encoder",
            Phenomena { encoder: Some(Encoder::default()), ..none },
        ),
        effect("late and lossy line", "link", Phenomena { link: Some(Link::default()), ..none }),
    ]
}

/// Returns the phenomena of a real rig all together. No simulated hand holds the sphere.
pub(super) fn together() -> Phenomena {
    Phenomena {
        joint_friction: Some(JointFriction::default()),
        cage_friction: Some(CageFriction::default()),
        slip: Some(Slip::default()),
        pivoting: Some(Pivoting::default()),
        eccentric: Some(Eccentric::default()),
        wheel_modules: Some(WheelModules::default()),
        gear: Some(Gear::default()),
        // Nobody has measured the prototype's.
        compliance: None,
        torque_constants: None,
        cogging: None,
        imbalance: None,
        encoder: Some(Encoder::default()),
        motor: Some(Motor::default()),
        link: Some(Link::default()),
        hand: None,
    }
}
