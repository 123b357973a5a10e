//! What is known of the rig's imperfections, so that the control law can feed it forward: friction,
//! torque constants, cogging, and a sphere whose weight is off centre.

use super::legal::{self, RigError};
use crate::design::device::MAX_JOINTS;
use crate::real::{Real, Vec3};

/// Largest number of harmonics of a motor's cogging.
pub const MAX_HARMONICS: usize = 4;

/// Measured imperfections of a rig, and how much of its friction is fed forward. The default knows
/// of none, and then nothing is fed forward.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Compensation {
    /// Imperfections of the joints, in the order steer, drive of each wheel.
    pub joints: [Imperfect; MAX_JOINTS],
    /// Friction between the sphere and its cage. Its torque is one on the sphere, N m, and its rate
    /// is the angular speed of the sphere, rad/s.
    pub sphere: Friction,
    /// Weight of the sphere times the position of its centre of mass relative to the centre of the
    /// sphere, in the sphere's axes, N m. The weight's torque on the sphere has at most this size.
    pub imbalance: Vec3,
    /// Fraction of the friction that is fed forward, at most 0.9. With all of it, an error of the
    /// measurement could drive the sphere.
    pub part: Real,
    /// Rate of a joint, and of the sphere, at which a third of the dry friction is fed forward,
    /// rad/s. Below it, the fed torque falls to zero with the third power of the rate.
    pub smoothing: Real,
}

/// Measured imperfections of a joint and its motor.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Imperfect {
    /// Friction of the joint, with its motor and gear.
    pub friction: Friction,
    /// Torque that the motor makes for each N m that its controller is commanded to make.
    pub torque_scale: Real,
    /// Part of the motor's torque that its gear loses while it turns under load.
    #[cfg_attr(feature = "exact", serde(skip))]
    pub gear_loss: Real,
    /// Torque that the motor's magnets make at the joint without current. Harmonics with the
    /// amplitude 0 are not used.
    pub cogging: [Harmonic; MAX_HARMONICS],
}

/// Friction: a dry part of constant size against the motion, and a part in proportion to the rate.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Friction {
    /// Coulomb friction, N m.
    pub coulomb: Real,
    /// Viscous friction, N m s/rad.
    pub viscous: Real,
}

/// One harmonic of the cogging of a motor. It makes the torque `amplitude` sin(`per_turn` x +
/// `phase`) at the joint, N m. x is the angle of the encoder, which is the joint's angle times its
/// gear ratio.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Harmonic {
    /// Number of periods in a turn of the encoder.
    pub per_turn: u32,
    /// Largest torque of the harmonic at the joint, N m.
    pub amplitude: Real,
    /// Phase at the angle zero of the joint, rad.
    pub phase: Real,
}

impl Default for Imperfect {
    /// Returns a joint without friction and cogging, whose motor makes the commanded torque.
    fn default() -> Self {
        Self {
            friction: Friction::default(),
            torque_scale: 1.0,
            gear_loss: 0.0,
            cogging: [Harmonic::default(); MAX_HARMONICS],
        }
    }
}

impl Default for Compensation {
    /// Returns a rig without imperfections. Of friction, 85 % would be fed forward, with a
    /// smoothing of 0.005 rad/s.
    fn default() -> Self {
        Self {
            joints: [Imperfect::default(); MAX_JOINTS],
            sphere: Friction::default(),
            imbalance: Vec3::ZERO,
            part: 0.85,
            smoothing: 0.005,
        }
    }
}

impl Friction {
    /// Returns true if there is friction.
    #[must_use]
    pub fn is_some(&self) -> bool {
        self.coulomb != 0.0 || self.viscous != 0.0
    }

    fn checks(&self) -> [Option<RigError>; 2] {
        [
            legal::COULOMB.check("friction.coulomb", self.coulomb),
            legal::VISCOUS.check("friction.viscous", self.viscous),
        ]
    }
}

impl Compensation {
    /// Returns true if there is anything to feed forward.
    #[must_use]
    pub fn is_some(&self) -> bool {
        let plain = |joint: &Imperfect| {
            !joint.friction.is_some()
                && joint.torque_scale == 1.0
                && joint.gear_loss == 0.0
                && joint.cogging.iter().all(|harmonic| harmonic.amplitude == 0.0)
        };
        self.sphere.is_some() || self.imbalance != Vec3::ZERO || !self.joints.iter().all(plain)
    }

    pub(super) fn mistakes(&self, joints: usize) -> impl Iterator<Item = RigError> + '_ {
        let of_joints = self.joints[..joints].iter().enumerate().flat_map(|(i, joint)| {
            joint.mistakes().map(move |mistake| RigError { joint: Some(i), ..mistake })
        });
        let sphere = self.sphere.checks().into_iter().flatten().map(|mistake| RigError {
            field: if mistake.field == "friction.coulomb" {
                "sphere.friction.coulomb"
            } else {
                "sphere.friction.viscous"
            },
            ..mistake
        });
        let imbalance = self.imbalance.to_array();
        of_joints
            .chain(sphere)
            .chain(imbalance.into_iter().filter_map(|x| legal::IMBALANCE.check("sphere.imbalance", x)))
            .chain(legal::COMPENSATED.check("compensation.friction", self.part))
            .chain(legal::SMOOTHING.check("compensation.smoothing", self.smoothing))
    }
}

impl Imperfect {
    /// Returns an error for every number that is out of its range. These errors do not say which
    /// joint it is.
    pub fn mistakes(&self) -> impl Iterator<Item = RigError> + use<> {
        let cogging = self.cogging;
        let harmonics = cogging.into_iter().flat_map(|harmonic| {
            [
                legal::COGGING.check("cogging.amplitude", harmonic.amplitude),
                legal::PHASE.check("cogging.phase", harmonic.phase),
                if harmonic.amplitude == 0.0 {
                    None
                } else {
                    legal::PER_TURN.check("cogging.per_turn", harmonic.per_turn as Real)
                },
            ]
            .into_iter()
            .flatten()
        });
        self.friction
            .checks()
            .into_iter()
            .flatten()
            .chain(legal::TORQUE_SCALE.check("torque_scale", self.torque_scale))
            .chain(legal::GEAR_LOSS.check("gear_loss", self.gear_loss))
            .chain(harmonics)
    }
}
