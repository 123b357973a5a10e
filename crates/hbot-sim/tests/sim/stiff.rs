//! Smooth phenomena that are too stiff for an explicit step: the plant stays finite, and moves as
//! the equations say.

use hbot_config::RigConfig;
use hbot_core::MAX_JOINTS;
use hbot_core::outputs::Drive;
use hbot_sim::exchange::Exchange;
use hbot_sim::hand::Grip;
use hbot_sim::phenomena::{Eccentric, Gear, Motor, WheelModules};

use crate::prelude::*;

/// A hand with much damping and no inertia, on a sphere far off centre. On the prototype, damping
/// divided by inertia is 3086 1/s, so the classic Runge-Kutta rule is unstable at 1 ms.
fn stiff_hand() -> Phenomena {
    Phenomena {
        motor: Some(Motor { torque_scale: 0.95, drive_no_load_rate: 0.0011, ..Motor::default() }),
        hand: Some(Hand { damping: 10.0, inertia: 0.0, amplitude: 3.0, rate: 0.25, ..Hand::default() }),
        eccentric: Some(Eccentric { offset: [-0.1, 0.1, 0.1] }),
        ..Phenomena::default()
    }
}

/// Two scenes in turn, the first with a stiff hand, the second with gears of little efficiency. The
/// state of the plant became NaN in the first, and the second panicked.
#[test]
fn two_legal_scenes_in_turn_keep_the_plant_finite() {
    let config = RigConfig::prototype();
    let rig = SimulatedRig::new(&SimulatedConfig::new(&config.rig)).unwrap();
    let joints = config.rig.device.joints();
    let mut exchange = Exchange::new(rig, joints);
    let geared = Phenomena {
        gear: Some(Gear { efficiency: 0.01, ..Gear::default() }),
        wheel_modules: Some(WheelModules { mass: 100.0 }),
        eccentric: Some(Eccentric::default()),
        ..Phenomena::default()
    };
    let mut torque = [0.0; MAX_JOINTS];
    torque[..4].copy_from_slice(&[-0.9, 0.14, 0.9, -0.1]);
    for tick in 0..4000_u32 {
        if tick % 1000 == 0 {
            let next = if tick % 2000 == 0 { stiff_hand() } else { geared };
            exchange.rig_mut().set_phenomena(next);
        }
        exchange.tick(u64::from(tick) * 1_000_000, tick, &Drive { enable: true, torque });
        let (state, finite) = (exchange.rig().state(), exchange.rig().joint_rates());
        // The hand's target turns at up to 10 rad/s about each axis, and the weights that fall give
        // no more than the square root of twice their energy of 100 J over the least inertia.
        let speed = state.omega.length();
        assert!(speed < 300.0 && finite.iter().all(|rate| rate.is_finite()), "tick {tick}: {speed} rad/s");
    }
}

fn after(phenomena: &Phenomena, h: f64) -> PlantState {
    let device = device();
    let mut state = PlantState { omega: Vec3::new(1.0, -2.0, 0.5), ..PlantState::default() };
    let mut dynamics = Dynamics::new(&device, phenomena, Method::Rk4, &state).unwrap();
    assert!(!dynamics.is_nonsmooth());
    let grip = phenomena.hand.map(|hand| {
        dynamics.set_sphere_inertia(device.sphere_inertia() + hand.inertia);
        Grip::new(hand, 0.0, rotation::exp(Vec3::new(0.3, 0.2, -0.4)))
    });
    let steps = (0.2 / h).round() as u32;
    let mut tau = [0.0; MAX_JOINTS];
    tau[..4].copy_from_slice(&[0.1, -0.02, -0.2, 0.03]);
    for i in 0..steps {
        dynamics.step(&mut state, f64::from(i) * h, h, &tau, Vec3::new(0.1, 0.2, 0.3), grip.as_ref());
    }
    state
}

/// With steps of 1 ms, which are too long for an explicit method, the plant ends where the explicit
/// method ends with steps of a microsecond.
#[test]
fn a_stiff_plant_moves_as_with_short_steps() {
    let viscous = JointFriction { coulomb: 0.0, breakaway: 0.0, viscous: 10.0, ..JointFriction::default() };
    let light = Hand { stiffness: 100.0, damping: 10.0, inertia: 0.0, ..Hand::default() };
    for phenomena in [
        Phenomena { motor: None, ..stiff_hand() },
        Phenomena { hand: Some(light), ..Phenomena::default() },
        Phenomena { joint_friction: Some(viscous), ..Phenomena::default() },
        Phenomena { joint_friction: Some(viscous), hand: Some(light), ..Phenomena::default() },
    ] {
        let (long, short) = (after(&phenomena, 1.0e-3), after(&phenomena, 1.0e-6));
        let apart = rotation::angle_between(long.q, short.q);
        let turned = rotation::angle_between(long.q, PlantState::default().q);
        // The scheme is of order 1. In its steps of 250 us, the decay of the first speed takes a
        // step longer, and later the sphere follows its load by half a step late.
        assert!(apart < 250.0e-6 * 3.0 + 0.01 * turned, "{apart:e} of {turned}: {phenomena:?}");
        assert!((long.omega - short.omega).length() < 0.03 * (1.0 + short.omega.length()), "{phenomena:?}");
    }
}
