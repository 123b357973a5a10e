//! The scale of a measurement. Forces alone show ratios, so [`measure`](super::measure) believes
//! the inertia of the sphere. A known inertia that is added to the sphere shows it: it makes all
//! motors seem weaker by the same factor.

use hbot_core::Rig;
use hbot_core::design::rig::Friction;

use super::{Measured, MotorName, MotorRefusal, MotorValue};

/// Largest relative width of the interval of the sphere's inertia that still shows it.
const WIDEST: f64 = 0.1;

/// The inertia of the sphere, as an added inertia shows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SphereInertia {
    /// The inertia without what was added, divided by that of the rig file.
    pub factor: f64,
    /// Half the width of the interval of `factor` that holds the truth in 95 % of the cases.
    pub interval: f64,
}

impl Measured {
    /// Returns the values in their true scale, and the inertia of the sphere. `self` was measured
    /// with the inertia `added` (kg m², the same about all axes) on the sphere, and `rig` has the
    /// torque constants that were measured without it. The values of the sphere are those of `rig`
    /// in the true scale, because what was added can rub and be off centre.
    ///
    /// With the torque constant k in the file and k' now, (I + added) / I = k / k'.
    ///
    /// # Errors
    /// Fails if the added inertia does not show clearly.
    pub fn with_added(mut self, rig: &Rig, added: f64) -> Result<(Self, SphereInertia), MotorRefusal> {
        let known = rig.compensation.unwrap_or_default();
        // The ratio k / k' of each joint, and the interval of its logarithm. That of the file
        // counts as wide as the present one.
        let ratio = |value: &MotorValue| {
            let filed = known.joints[value.joint?].torque_scale;
            let scale = value.name == MotorName::TorqueScale && value.seen;
            scale.then_some((filed / value.found, value.interval / value.found * core::f64::consts::SQRT_2))
        };
        let ratios: Vec<(f64, f64)> = self.values.iter().filter_map(ratio).collect();
        let sum = |of: &dyn Fn(f64, f64) -> f64| {
            ratios.iter().map(|(ratio, interval)| of(*ratio, *interval) / interval.powi(2)).sum::<f64>()
        };
        let weights = sum(&|_, _| 1.0);
        let mean = sum(&|ratio, _| ratio) / weights;
        // Errors of one motion are related, so the mean is not more certain than its parts. Joints
        // that contradict each other make it less certain.
        let own = sum(&|_, interval| interval.powi(2)) / weights;
        let scatter = sum(&|ratio, _| (ratio / mean - 1.0).powi(2)) / weights;
        let interval = (own + crate::interval::NINETY_FIVE.powi(2) * scatter).sqrt() * mean / (mean - 1.0);
        if !(mean > 1.0 && interval < WIDEST) {
            return Err(MotorRefusal::Added { weaker: 1.0 - 1.0 / mean });
        }
        let factor = added / (rig.device.sphere_inertia() * (mean - 1.0));
        self.rescale(factor * mean, interval);
        self.sphere =
            Friction { coulomb: known.sphere.coulomb * factor, viscous: known.sphere.viscous * factor };
        self.imbalance = known.imbalance * factor;
        for value in self.values.iter_mut().filter(|value| value.joint.is_none()) {
            value.found = match value.name {
                MotorName::Coulomb => self.sphere.coulomb,
                MotorName::Viscous => self.sphere.viscous,
                MotorName::Imbalance(k) => self.imbalance[k],
                _ => value.found,
            };
        }
        Ok((self, SphereInertia { factor, interval: factor * interval }))
    }

    /// Multiplies all values in units of torque by `factor`, which has the relative interval
    /// `interval`.
    fn rescale(&mut self, factor: f64, interval: f64) {
        for value in &mut self.values {
            if value.name != MotorName::Loss {
                value.found *= factor;
                value.interval = (value.interval * factor).hypot(value.found * interval);
            }
        }
        for (j, joint) in self.joints.iter_mut().enumerate() {
            let seen = |name| self.values.iter().any(|it| it.joint == Some(j) && it.name == name && it.seen);
            if seen(MotorName::TorqueScale) {
                joint.torque_scale *= factor;
            }
            if seen(MotorName::Inertia) {
                self.inertia[j] *= factor;
            }
            joint.friction.coulomb *= factor;
            joint.friction.viscous *= factor;
            joint.cogging.iter_mut().for_each(|harmonic| harmonic.amplitude *= factor);
        }
        self.left *= factor;
        self.torque *= factor;
    }
}
