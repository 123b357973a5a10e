//! What stiffness a rig can be expected to render: the linear border of a spring in a sampled loop, and what one count of its encoders
//! is to the hand.

use hbot_config::RigConfig;
use hbot_core::kinematics::Posture;
use hbot_core::{Device, MAX_JOINTS, Mat3, Vec3};
use hbot_sim::plant::{Plant, PlantState};

/// From a reading to its torque, ticks: the loop takes what arrived in the last tick.
pub const DELAY_TICKS: f64 = 1.0;

/// A spring's damping where one figure is to stand for all, N m s/rad: felt, and no louder than counts allow.
pub const USUAL_DAMPING: f64 = 0.02;

/// Steering angles looked at.
const SAMPLES: usize = 256;

/// What a spring's stiffness is bounded by, without any help from friction or hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StiffnessBound {
    /// The loop's period, s.
    pub period: f64,
    /// The least apparent inertia about any axis over the steering angles, kg m².
    pub inertia: f64,
    /// The most that the sphere turns while one joint moves by one count, at the steering angles zero, rad.
    pub count: f64,
}

impl StiffnessBound {
    /// Of the rig and loop of `config`. None where its inertias contradict each other.
    #[must_use]
    pub fn of(config: &RigConfig) -> Option<Self> {
        let rig = &config.rig;
        let plant = Plant::new(&rig.device).ok()?;
        let inertia = postures(&rig.device).map(|state| least(plant.apparent_inertia(&state)));
        let posture = Posture::new(&rig.device, &PlantState::default().steer[..rig.device.wheels().len()]);
        let turn = |j: usize| {
            let mut rates = [0.0; MAX_JOINTS];
            rates[j] = rig.joints[j].radians_per_count().abs();
            posture.forward(&rig.device, &rates).omega.length()
        };
        Some(Self {
            period: rig.timing.period_s(),
            inertia: inertia.fold(f64::INFINITY, f64::min),
            count: (0..rig.device.joints()).map(turn).fold(0.0, f64::max),
        })
    }

    /// The stiffness up to which a spring is stable where `damping` (N m s/rad) is its own and the device's together:
    /// damping / (h (1/2 + D)), N m/rad. It holds for a damping small beside J / h.
    #[must_use]
    pub fn stable(&self, damping: f64) -> f64 {
        damping / (self.period * (0.5 + DELAY_TICKS))
    }

    /// The stiffness that no damping of a spring can carry further, N m/rad, and the damping that carries it, N m s/rad.
    ///
    /// A free inertia whose torque is read one tick before it acts, with k = K h²/J and d = B h/J, has the characteristic polynomial
    /// z (z - 1)² + k (z + 1)/2 + d (z - 1). By Jury's conditions it is stable where k < u - u², u = d - k/2: at most
    /// k = 1/4, at d = 5/8.
    #[must_use]
    pub fn most(&self) -> [f64; 2] {
        [0.25 * self.inertia / (self.period * self.period), 0.625 * self.inertia / self.period]
    }

    /// The stiffness up to which a spring that reads whole counts is passive by the Coulomb friction `coulomb` (N m) of the device:
    /// 2 c / d (Abbott and Okamura 2005), N m/rad.
    #[must_use]
    pub fn quiet(&self, coulomb: f64) -> f64 {
        2.0 * coulomb / self.count
    }
}

/// Steering angles of the wheels, spread evenly: each by a part of the golden ratio's.
fn postures(device: &Device) -> impl Iterator<Item = PlantState> {
    let wheels = device.wheels().len();
    (0..SAMPLES).map(move |k| {
        let mut state = PlantState::default();
        for (i, th) in state.steer[..wheels].iter_mut().enumerate() {
            // Quadratic irrationals of different fields: no two wheels go in step.
            let ratio = ((4 * i + 5) as f64).sqrt();
            *th = (k as f64 * ratio).fract() * core::f64::consts::TAU;
        }
        state
    })
}

/// The least eigenvalue of a symmetric positive definite matrix: by iteration on its inverse.
fn least(matrix: Mat3) -> f64 {
    let inverse = matrix.inverse();
    let mut v = Vec3::new(0.6, 0.64, 0.48);
    for _ in 0..64 {
        v = (inverse * v).normalize();
    }
    1.0 / v.dot(inverse * v)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether a free inertia of 1 on a spring that acts a tick late comes to rest, at a period of 1.
    fn rests(stiffness: f64, damping: f64) -> bool {
        let (mut x, mut v, mut torque) = (1.0_f64, 0.0_f64, 0.0);
        for _ in 0..20_000 {
            let next = -stiffness * x - damping * v;
            (x, v) = (x + v + 0.5 * torque, v + torque);
            torque = next;
            if !(x.abs() < 1.0e3) {
                return false;
            }
        }
        x.abs() < 1.0e-3
    }

    #[test]
    fn no_damping_carries_more_than_the_most() {
        let [most, damping] = StiffnessBound { period: 1.0, inertia: 1.0, count: 1.0 }.most();
        assert!(rests(0.99 * most, damping));
        // Every damping up to where it swings up by itself.
        for k in 0..=100 {
            assert!(!rests(1.01 * most, 0.01 * f64::from(k)), "{k}");
        }
    }

    #[test]
    fn little_damping_carries_what_the_linear_border_says() {
        let expected = StiffnessBound { period: 1.0, inertia: 1.0, count: 1.0 };
        // The next order is (5/3) d/(3/2): 1 % at a damping of 0.01, and the last tenth of it dies too slowly to wait for.
        let border = expected.stable(0.01);
        assert!(rests(0.9 * border, 0.01) && !rests(1.1 * border, 0.01));
    }

    #[test]
    fn the_prototype_is_as_the_notes_have_it() {
        let config = RigConfig::prototype();
        let expected = StiffnessBound::of(&config).expect("the prototype is a plant");
        // Physics notes, section 6: lambda_min of the apparent inertia is 3.4e-3.
        assert!((expected.inertia - 3.4e-3).abs() < 0.05e-3, "{}", expected.inertia);
        // The bare sphere has 3.239e-3, which wheels only add to.
        assert!(expected.inertia > config.rig.device.sphere_inertia());
        // A count of the steering, 2 pi/16384, turns the sphere by no more than that.
        assert!(
            expected.count > 0.0 && expected.count <= core::f64::consts::TAU / 16384.0,
            "{}",
            expected.count
        );
    }

    #[test]
    fn the_least_eigenvalue_of_a_turned_diagonal() {
        let turn = Mat3::from_quat(hbot_core::rotation::exp(Vec3::new(0.3, -1.0, 0.7)));
        let matrix = turn * Mat3::from_diagonal(Vec3::new(3.0, 1.5, 2.0)) * turn.transpose();
        assert!((least(matrix) - 1.5).abs() < 1.0e-12, "{}", least(matrix));
    }
}
