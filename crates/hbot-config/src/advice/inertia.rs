//! The apparent inertia of the sphere: its own, and that of the wheels that turn with it.

use hbot_core::design::device::Device;
use hbot_core::design::kinematics::Posture;
use hbot_core::{MAX_WHEELS, Mat3, Vec3};

/// Number of postures that are examined to find the smallest inertia.
const SAMPLES: u32 = 256;

/// Number of turns by which the steer angle of each wheel advances from one sample posture to the
/// next. The values are square roots of primes. The ratio of any two is irrational, so no two
/// wheels advance together.
const TURNS_PER_SAMPLE: [f64; MAX_WHEELS] = [
    core::f64::consts::SQRT_2,
    1.732_050_807_568_877_2,
    2.236_067_977_499_79,
    2.645_751_311_064_590_7,
    3.316_624_790_355_4,
    3.605_551_275_463_989,
    4.123_105_625_617_661,
    4.358_898_943_540_674,
];

/// Returns the steer angles of sample postures that fill the space of all steer angles evenly, rad.
/// From one sample to the next, the steer angle of wheel i advances by `TURNS_PER_SAMPLE[i]` turns.
pub(super) fn postures() -> impl Iterator<Item = [f64; MAX_WHEELS]> {
    (0..SAMPLES)
        .map(|k| TURNS_PER_SAMPLE.map(|turns| (f64::from(k) * turns).fract() * core::f64::consts::TAU))
}

/// Returns the apparent inertia of the sphere in frame N at the steer angles `steer` (rad), kg m²:
/// I_s I + Gᵀ J_q G (physics notes, section 6). Returns `None` if the inertias of a wheel are
/// physically impossible.
fn apparent(device: &Device, steer: &[f64]) -> Option<Mat3> {
    let posture = Posture::new(device, steer);
    // Joint rates for a unit rate about each axis of N.
    let rates = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| posture.inverse(axis));
    let mut sum = Mat3::IDENTITY * device.sphere_inertia();
    for (i, wheel) in device.wheels().iter().enumerate() {
        let spec = wheel.spec();
        let coupling = spec.axial_inertia * wheel.axis_along_axle();
        if coupling * coupling > spec.steer_inertia * spec.drive_inertia {
            return None;
        }
        for (j, right) in rates.iter().enumerate() {
            let (th, ph) = (right[2 * i], right[2 * i + 1]);
            let momentum = [spec.steer_inertia * th + coupling * ph, coupling * th + spec.drive_inertia * ph];
            for (k, left) in rates.iter().enumerate() {
                sum.col_mut(j)[k] += left[2 * i] * momentum[0] + left[2 * i + 1] * momentum[1];
            }
        }
    }
    Some(sum)
}

/// Returns the apparent inertia of the sphere in the posture in which it is smallest about some
/// axis: the inertias about its principal axes (kg m²), and these axes in frame N as columns.
/// Returns `None` if the inertias in the rig file contradict each other.
pub(super) fn least(device: &Device) -> Option<(Vec3, Mat3)> {
    let wheels = device.wheels().len();
    let mut best: Option<(Vec3, Mat3)> = None;
    for steer in postures() {
        let found = principal(&apparent(device, &steer[..wheels])?);
        if best.is_none_or(|(inertia, _)| found.0.min_element() < inertia.min_element()) {
            best = Some(found);
        }
    }
    best
}

/// Returns the eigenvalues of a symmetric matrix and its eigenvectors as columns, by rotations of
/// Jacobi.
pub(super) fn principal(matrix: &Mat3) -> (Vec3, Mat3) {
    let (mut m, mut axes) = (*matrix, Mat3::IDENTITY);
    // Each sweep squares the size of what is off the diagonal, about, until rounding is left.
    for _ in 0..12 {
        let off = m.col(1)[0].abs() + m.col(2)[0].abs() + m.col(2)[1].abs();
        if off <= 1.0e-18 * (m.x_axis.x.abs() + m.y_axis.y.abs() + m.z_axis.z.abs()) {
            break;
        }
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let off = m.col(q)[p];
            if off == 0.0 {
                continue;
            }
            let theta = (m.col(q)[q] - m.col(p)[p]) / (2.0 * off);
            let tangent = theta.signum() / (theta.abs() + theta.hypot(1.0));
            let cosine = 1.0 / tangent.hypot(1.0);
            let sine = tangent * cosine;
            let mut turn = Mat3::IDENTITY;
            turn.col_mut(p)[p] = cosine;
            turn.col_mut(q)[q] = cosine;
            turn.col_mut(q)[p] = sine;
            turn.col_mut(p)[q] = -sine;
            m = turn.transpose() * m * turn;
            axes *= turn;
        }
    }
    (Vec3::new(m.x_axis.x, m.y_axis.y, m.z_axis.z), axes)
}
