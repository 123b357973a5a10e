//! Motions in which parts stick, slide, slip or cross their play, run by the plant or by the
//! reference.

use core::f64::consts::PI;

use hbot_sim::hand::Grip;
use hbot_sim::phenomena::{Eccentric, Gear, Pivoting, WheelModules};

use super::reference::{End, Input, Reference, Sharpness};

use crate::prelude::*;

/// A motion that both the plant and the independent reference can compute. It starts from a state
/// without slip.
pub(super) struct Scene {
    pub(super) name: &'static str,
    pub(super) device: Device,
    pub(super) phenomena: Phenomena,
    pub(super) start: PlantState,
    pub(super) input: Input,
    pub(super) seconds: f64,
    pub(super) sharpness: Sharpness,
}

impl Scene {
    pub(super) fn stepped(&self, h: f64) -> End {
        let mut state = self.start;
        let mut dynamics = Dynamics::new(&self.device, &self.phenomena, Method::Rk4, &state).unwrap();
        if let Some(grip) = &self.input.grip {
            dynamics.set_sphere_inertia(self.device.sphere_inertia() + grip.hand().inertia);
        }
        let steps = (self.seconds / h).round() as u32;
        for i in 0..steps {
            let t = f64::from(i) * h;
            let middle = t + 0.5 * h;
            let mut tau = [0.0; 16];
            tau[..4].copy_from_slice(&(self.input.tau)(middle));
            let external = Vec3::from_array((self.input.external)(middle));
            dynamics.step(&mut state, t, h, &tau, external, self.input.grip.as_ref());
            if let Some(effort) = dynamics.effort() {
                assert!(effort.converged, "{}, step {i} of {h:e} s: {effort:?}", self.name);
            }
        }
        let encoders = dynamics.encoder_angles(&state);
        End {
            q: state.q,
            joints: core::array::from_fn(|j| state.joints()[j]),
            motors: [encoders[1], encoders[3]],
        }
    }

    pub(super) fn by_reference(&self, sharpness: Sharpness) -> End {
        let (device, phenomena, input) = (&self.device, &self.phenomena, self.input);
        Reference { device, phenomena, input, sharpness }.advance(&self.start, self.seconds)
    }

    /// Returns the largest difference between two ends of the motion: in orientation, joint angles,
    /// and motor angles if gears have play, rad.
    pub(super) fn apart(&self, a: &End, b: &End) -> f64 {
        let joints = a.joints.iter().zip(b.joints).map(|(a, b)| (a - b).abs());
        let motors = a.motors.iter().zip(b.motors).map(|(a, b)| (a - b).abs());
        let motors = motors.filter(|_| self.phenomena.gear.is_some());
        joints.chain(motors).fold(rotation::angle_between(a.q, b.q), f64::max)
    }
}

pub(super) fn turned_apart(a: &End, b: &End) -> f64 {
    rotation::angle_between(a.q, b.q)
}

const SHARP: Sharpness = Sharpness { rate: 1.0e-5, flank: 1.0e2, tolerance: 1.0e-9 };

fn nothing<const N: usize>(_: f64) -> [f64; N] {
    [0.0; N]
}

/// Returns a smooth pulse: sin² over the first `length` seconds, then 0.
fn bump(t: f64, length: f64) -> f64 {
    if t < length { (PI * t / length).sin().powi(2) } else { 0.0 }
}

const IDLE: Input = Input { tau: nothing, external: nothing, grip: None };

/// Returns a scene in which a drive is pushed until its contact slips, and is then released until
/// the contact grips again.
pub(super) fn slide() -> Scene {
    Scene {
        name: "slip onset, slide and stop",
        device: device(),
        phenomena: Phenomena { slip: Some(Slip { mu: 0.5, normal_force: 2.0 }), ..Phenomena::default() },
        start: PlantState { steer: [0.3, -0.4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], ..PlantState::default() },
        input: Input { tau: |t| [0.0, 0.022 * bump(t, 0.06), 0.0, 0.0], ..IDLE },
        seconds: 0.12,
        sharpness: SHARP,
    }
}

/// Returns a scene in which the friction of joints, cage and contacts holds three quarters of the
/// load that would move the sphere.
pub(super) fn held() -> Scene {
    Scene {
        name: "sticking under load",
        device: toed(2),
        phenomena: Phenomena {
            joint_friction: Some(JointFriction {
                coulomb: 2e-3,
                breakaway: 2e-3,
                ..JointFriction::default()
            }),
            cage_friction: Some(CageFriction { torque: 0.02 }),
            slip: Some(Slip::default()),
            ..Phenomena::default()
        },
        start: PlantState::default(),
        input: Input { external: |t| [0.015 * bump(t, 0.4), 0.01 * bump(t, 0.4), 0.0], ..IDLE },
        seconds: 0.4,
        sharpness: SHARP,
    }
}

/// Returns a scene in which a slow spring pulls joints whose friction falls when they begin to
/// move, so that they stick and slip.
pub(super) fn stick_slip() -> Scene {
    let hand =
        Hand { stiffness: 3.0, damping: 0.0, inertia: 0.0, amplitude: 0.25, rate: 0.25, ..Hand::default() };
    let start = PlantState { steer: [0.3, -0.4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], ..PlantState::default() };
    Scene {
        name: "stick-slip",
        device: device(),
        phenomena: Phenomena {
            joint_friction: Some(JointFriction {
                coulomb: 2e-3,
                viscous: 5e-4,
                breakaway: 1e-2,
                stribeck_rate: 0.5,
            }),
            ..Phenomena::default()
        },
        start,
        input: Input { grip: Some(Grip::new(hand, 0.0, start.q)), ..IDLE },
        seconds: 1.2,
        sharpness: SHARP,
    }
}

pub(super) fn backlash() -> Scene {
    Scene {
        name: "backlash crossing",
        device: device(),
        phenomena: Phenomena {
            gear: Some(Gear { backlash: 0.05, efficiency: 1.0, rotor_share: 0.8 }),
            ..Phenomena::default()
        },
        start: PlantState { steer: [0.3, -0.4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], ..PlantState::default() },
        input: Input { tau: |t| [0.0, 0.004 * (20.0 * PI * t).sin(), 0.0, 0.0], ..IDLE },
        seconds: 0.1,
        sharpness: SHARP,
    }
}

/// Returns a scene in which a drive crosses the play of its gear and pushes. The sphere then drives
/// it back across the play. The gear has losses in both directions.
pub(super) fn lossy() -> Scene {
    Scene {
        name: "backlash with losses",
        phenomena: Phenomena {
            joint_friction: Some(JointFriction {
                coulomb: 1e-3,
                breakaway: 1e-3,
                ..JointFriction::default()
            }),
            gear: Some(Gear { backlash: 0.05, efficiency: 0.8, rotor_share: 0.8 }),
            ..Phenomena::default()
        },
        input: Input { tau: |t| [0.0, 0.02 * bump(t, 0.06), 0.0, 0.0], ..IDLE },
        ..backlash()
    }
}

pub(super) fn cage() -> Scene {
    Scene {
        name: "cage friction",
        device: toed(2),
        phenomena: Phenomena { cage_friction: Some(CageFriction { torque: 0.02 }), ..Phenomena::default() },
        start: PlantState { omega: Vec3::new(0.6, -0.3, 0.2), ..PlantState::default() },
        input: IDLE,
        seconds: 0.4,
        sharpness: SHARP,
    }
}

/// Returns a scene in which wheels slip while their contact patches resist turning about the
/// contact normals.
pub(super) fn pivoting() -> Scene {
    Scene {
        name: "pivoting",
        device: toed(2),
        phenomena: Phenomena {
            slip: Some(Slip { mu: 0.5, normal_force: 2.0 }),
            pivoting: Some(Pivoting { mu: 0.5, normal_force: 2.0, patch_radius: 5e-3 }),
            ..Phenomena::default()
        },
        start: PlantState { omega: Vec3::new(0.4, -0.3, 0.2), ..PlantState::default() },
        input: Input { tau: |t| [0.08 * bump(t, 0.1), 0.0, 0.0, 0.0], ..IDLE },
        seconds: 0.2,
        sharpness: SHARP,
    }
}

pub(super) fn everything() -> Scene {
    let start = PlantState { omega: Vec3::new(0.3, -0.2, 0.1), ..PlantState::default() };
    Scene {
        name: "all of them",
        device: toed(2),
        phenomena: Phenomena {
            joint_friction: Some(JointFriction {
                coulomb: 1e-3,
                viscous: 1e-4,
                breakaway: 2e-3,
                stribeck_rate: 0.5,
            }),
            cage_friction: Some(CageFriction { torque: 5e-3 }),
            slip: Some(Slip { mu: 0.5, normal_force: 2.0 }),
            pivoting: Some(Pivoting { mu: 0.5, normal_force: 2.0, patch_radius: 1e-3 }),
            eccentric: Some(Eccentric { offset: [2e-3, -1e-3, 1e-3] }),
            wheel_modules: Some(WheelModules::default()),
            gear: Some(Gear { backlash: 0.02, efficiency: 0.9, rotor_share: 0.8 }),
            ..Phenomena::default()
        },
        start,
        input: Input {
            tau: |t| [0.01 * bump(t, 0.2), 0.05 * bump(t, 0.1), 0.0, -0.005 * bump(t, 0.15)],
            external: |t| [0.0, 0.03 * bump(t, 0.15), 0.0],
            grip: Some(Grip::new(Hand::default(), 0.0, start.q)),
        },
        seconds: 0.2,
        sharpness: SHARP,
    }
}

/// Returns a scene with off-centre masses and viscous joints, in which nothing sticks.
pub(super) fn smooth() -> Scene {
    Scene {
        name: "masses out of place",
        device: toed(2),
        phenomena: Phenomena {
            joint_friction: Some(JointFriction {
                coulomb: 0.0,
                viscous: 1e-4,
                breakaway: 0.0,
                stribeck_rate: 0.5,
            }),
            eccentric: Some(Eccentric { offset: [3e-3, -4e-3, 2e-3] }),
            wheel_modules: Some(WheelModules { mass: 0.05 }),
            ..Phenomena::default()
        },
        start: PlantState {
            q: rotation::exp(Vec3::new(0.4, -1.1, 0.7)),
            omega: Vec3::new(1.0, 2.0, 3.0),
            steer: [0.3, -0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            ..PlantState::default()
        },
        input: Input {
            // The inputs are constant, because a step holds them.
            tau: |_| [0.01, 0.005, -0.01, 0.003],
            external: |_| [0.05, 0.02, 0.0],
            ..IDLE
        },
        seconds: 0.5,
        sharpness: Sharpness { tolerance: 1.0e-13, ..SHARP },
    }
}
