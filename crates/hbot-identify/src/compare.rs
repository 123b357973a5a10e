//! Compares a geometry that was found with the true one: drift of the orientation, and torque.
//!
//! Counts do not show a turn of the whole frame, so two geometries that differ by one are equal
//! here.

use hbot_core::design::device::Device;
use hbot_core::design::kinematics::Posture;
use hbot_core::design::rig::OdometryMethod;
use hbot_core::motion::odometry;
use hbot_core::{MAX_JOINTS, MAX_WHEELS, Mat3, Quat, Rig, Vec3, rotation};

use crate::model::frame_at_zero;
use crate::motion::Counts;

/// Steer angles of each wheel at which torques are compared.
const ANGLES: usize = 8;

/// A geometry, and the angle of each steer joint where its encoder reads zero.
#[derive(Debug, Clone)]
pub struct Geometry {
    /// The sphere and its wheels.
    pub device: Device,
    /// Steering zeros, rad.
    pub zeros: Vec<f64>,
}

impl Geometry {
    /// Returns the orientations that odometry computes from the counts of the joints of `rig`, from
    /// the identity on.
    #[must_use]
    pub fn orientations(&self, rig: &Rig, method: OdometryMethod, counts: &[Counts]) -> Vec<Quat> {
        let n = self.device.wheels().len();
        let mut q = Quat::IDENTITY;
        let mut all = vec![q; usize::from(!counts.is_empty())];
        for pair in counts.windows(2) {
            let mut delta = [0.0; MAX_JOINTS];
            let mut th = [0.0; MAX_WHEELS];
            for j in 0..2 * n {
                let radians = rig.joints[j].radians_per_count();
                delta[j] = f64::from(pair[1][j].wrapping_sub(pair[0][j])) * radians;
                if j % 2 == 0 {
                    th[j / 2] = f64::from(pair[0][j]) * radians + self.zeros[j / 2];
                }
            }
            q = odometry::advance(q, odometry::turn(&self.device, method, &th[..n], &delta[..2 * n]));
            all.push(q);
        }
        all
    }

    /// Returns the frame of a wheel where its encoder reads zero.
    fn frame(&self, wheel: usize) -> Mat3 {
        let (sin, cos) = self.zeros[wheel].sin_cos();
        let turn = Mat3::from_cols(Vec3::new(cos, sin, 0.0), Vec3::new(-sin, cos, 0.0), Vec3::Z);
        frame_at_zero(&self.device, wheel) * turn
    }

    /// Returns the turn of the whole frame by which this geometry differs most closely from
    /// `truth`.
    #[must_use]
    pub fn turn_from(&self, truth: &Self) -> Quat {
        let n = self.zeros.len();
        let turn = |i: usize| {
            let q = Quat::from_mat3(&(self.frame(i) * truth.frame(i).transpose()));
            rotation::log(q) / n as f64
        };
        rotation::exp((0..n).map(turn).fold(Vec3::ZERO, |sum, turn| sum + turn))
    }

    /// Returns the drift at each of the orientations `found`, which this geometry computes, from
    /// the true orientations `real`, rad.
    #[must_use]
    pub fn drift(&self, truth: &Self, found: &[Quat], real: &[Quat]) -> Vec<f64> {
        let turn = self.turn_from(truth);
        let off =
            |(found, real): (&Quat, &Quat)| rotation::angle_between(*found, turn * *real * turn.conjugate());
        found.iter().zip(real).map(off).collect()
    }

    /// Returns by which fraction a stiffness is wrong in the worst direction and posture if this
    /// geometry is believed. Joint torques are those that load the contacts least.
    #[must_use]
    pub fn stiffness_error(&self, truth: &Self) -> f64 {
        let n = self.zeros.len();
        let turn = Mat3::from_quat(self.turn_from(truth));
        let mut worst = 0.0_f64;
        for k in 0..ANGLES.pow(2) {
            let at = |geometry: &Self| {
                let angle = |i: usize| {
                    let step = if i.is_multiple_of(2) { k % ANGLES } else { k / ANGLES };
                    step as f64 * std::f64::consts::TAU / ANGLES as f64 + 0.3 * i as f64 + geometry.zeros[i]
                };
                let th: [f64; MAX_WHEELS] = std::array::from_fn(|i| if i < n { angle(i) } else { 0.0 });
                Posture::new(&geometry.device, &th[..n])
            };
            let (believed, real) = (at(self), at(truth));
            let mut load = Mat3::ZERO;
            let mut given = Mat3::ZERO;
            for (j, (row, true_row)) in believed.rows().iter().zip(real.rows()).enumerate() {
                let wheel = &self.device.wheels()[j / 2];
                let lever = match j % 2 {
                    0 => self.device.sphere_radius() * wheel.axis_along_roll(),
                    _ => wheel.spec().radius,
                };
                let ease = lever * lever;
                load += outer(*row, *row) * ease;
                given += outer(*true_row, *row) * ease;
            }
            // From a torque in the believed frame to that in the true one, and back.
            let torque = given * load.inverse() * turn;
            let error = (torque + torque.transpose()) * 0.5 - Mat3::IDENTITY;
            worst = worst.max(largest(error));
        }
        worst
    }
}

fn outer(a: Vec3, b: Vec3) -> Mat3 {
    Mat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// Returns the largest eigenvalue, by size, of a small symmetric matrix.
fn largest(matrix: Mat3) -> f64 {
    let mut most = 0.0_f64;
    for start in Vec3::AXES.into_iter().chain([Vec3::ONE]) {
        let mut v = start;
        // The square of the matrix, so that two eigenvalues of opposite sign do not alternate.
        for _ in 0..40 {
            let next = matrix * (matrix * v);
            let length = next.length();
            if !(length > 1.0e-30) {
                break;
            }
            v = next / length;
        }
        most = most.max((matrix * v).length() / v.length());
    }
    most
}
