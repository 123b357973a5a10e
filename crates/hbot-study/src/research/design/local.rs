//! Figures of a design at one posture.

use hbot_core::allocation::ContactArms;
use hbot_core::design::kinematics::Posture;
use hbot_core::{Device, MAX_JOINTS, Mat3, Vec3};

/// A device with precomputed data, so that its figures can be computed quickly at many postures.
#[derive(Debug, Clone)]
pub(super) struct RatedDevice {
    pub(super) device: Device,
    /// Largest torque of each joint, N m; 0 for a joint without a motor.
    pub(super) peak: [f64; MAX_JOINTS],
    inertia: [f64; MAX_JOINTS],
    /// Inverse 1/w of each joint's default weight in the allocation of joint torques, m².
    give: [f64; MAX_JOINTS],
    arms: Vec<ContactArms>,
}

/// A figure of a design that depends on the posture. For some figures a larger value is better, for
/// others a smaller one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Quantity {
    /// The spectral index of the matrix G: its smallest singular value divided by its largest.
    Conditioning,
    /// The largest torque that the motors can make in every direction, N m. It is limited by the
    /// worst direction.
    Torque,
    /// The largest eigenvalue of the sphere's apparent inertia, kg m².
    Inertia,
    /// The largest contact force for a torque of 1 N m in the worst direction, N.
    Load,
}

impl Quantity {
    pub(super) const ALL: [Self; 4] = [Self::Conditioning, Self::Torque, Self::Inertia, Self::Load];

    /// Returns whether the value `a` of this figure is worse than the value `b`.
    pub(super) fn worse(self, a: f64, b: f64) -> bool {
        match self {
            Self::Conditioning | Self::Torque => a < b,
            Self::Inertia | Self::Load => a > b,
        }
    }
}

impl RatedDevice {
    /// Prepares `device` for computing its figures. `peaks` are the largest torques of a steer and
    /// a drive motor, N m.
    pub(super) fn new(device: Device, peaks: [f64; 2]) -> Self {
        let (mut peak, mut inertia, mut give) = ([0.0; MAX_JOINTS], [0.0; MAX_JOINTS], [0.0; MAX_JOINTS]);
        let arms: Vec<ContactArms> =
            device.wheels().iter().map(|wheel| ContactArms::of(wheel, device.sphere_radius())).collect();
        for (i, (wheel, arms)) in device.wheels().iter().zip(&arms).enumerate() {
            let spec = wheel.spec();
            let weights = arms.weights();
            for k in 0..2 {
                peak[2 * i + k] = peaks[k];
                inertia[2 * i + k] = [spec.steer_inertia, spec.drive_inertia][k];
                give[2 * i + k] = 1.0 / weights[k];
            }
        }
        Self { device, peak, inertia, give, arms }
    }

    /// Returns the value of the figure `quantity` at the steer angles `th` (rad).
    pub(super) fn at(&self, th: &[f64], quantity: Quantity) -> f64 {
        self.of(&Posture::new(&self.device, th), quantity)
    }

    /// Returns the value of the figure `quantity` at a posture.
    pub(super) fn of(&self, posture: &Posture, quantity: Quantity) -> f64 {
        let rows = posture.rows();
        match quantity {
            Quantity::Conditioning => {
                let [least, _, largest] = eigenvalues(&gram(rows, &[1.0; MAX_JOINTS]));
                libm::sqrt(least.max(0.0) / largest)
            }
            Quantity::Torque => every_direction(rows, &self.peak),
            Quantity::Inertia => self.device.sphere_inertia() + eigenvalues(&gram(rows, &self.inertia))[2],
            Quantity::Load => self.load(rows),
        }
    }

    /// Returns the largest contact force for a torque of 1 N m on the sphere in the worst
    /// direction, N. The controller allocates this torque to the joints at least cost, as it does
    /// while no motor is at its limit.
    fn load(&self, rows: &[Vec3]) -> f64 {
        // tau = W⁻¹ G A⁻¹ T with A = Gᵀ W⁻¹ G.
        let inverse = gram(rows, &self.give).inverse();
        let mut most = 0.0_f64;
        for (i, (pair, arms)) in rows.chunks_exact(2).zip(&self.arms).enumerate() {
            let [steer, drive] = [pair[0] * self.give[2 * i], pair[1] * self.give[2 * i + 1]];
            // f = H⁻ᵀ tau is linear in the torque T, so it can be written with two rows a and b.
            let roll = drive / arms.roll;
            let axial = (steer + roll * arms.cross) / arms.steer;
            let [a, b] = [inverse * axial, inverse * roll];
            most = most.max(largest_of_pair(a.dot(a), a.dot(b), b.dot(b)));
        }
        libm::sqrt(most)
    }
}

/// Returns the matrix Gᵀ diag(weights) G, where `rows` are the rows of G.
pub(super) fn gram(rows: &[Vec3], weights: &[f64; MAX_JOINTS]) -> Mat3 {
    let mut sum = Mat3::ZERO;
    for (row, weight) in rows.iter().zip(weights) {
        let scaled = *row * *weight;
        sum.x_axis += scaled * row.x;
        sum.y_axis += scaled * row.y;
        sum.z_axis += scaled * row.z;
    }
    sum
}

/// Returns the radius of the largest ball of torques that joints limited to `peak` can make, N m.
///
/// The torques form a zonotope, the sum of tau_k g_k, and the radius is the distance of its nearest
/// facet. Every facet is spanned by two rows, and its distance is the sum of |g.n| peak along its
/// normal n.
pub(super) fn every_direction(rows: &[Vec3], peak: &[f64; MAX_JOINTS]) -> f64 {
    let mut scaled = [Vec3::ZERO; MAX_JOINTS];
    let mut count = 0;
    for (row, peak) in rows.iter().zip(peak).filter(|(_, peak)| **peak > 0.0) {
        scaled[count] = *row * *peak;
        count += 1;
    }
    let scaled = &scaled[..count];
    let mut least = f64::INFINITY;
    for (j, b) in scaled.iter().enumerate() {
        for a in &scaled[..j] {
            let normal = a.cross(*b);
            let size = normal.length();
            // Parallel rows span no facet. Other pairs of rows give the bound instead.
            if size > 1.0e-12 * a.length() * b.length() {
                let reach: f64 = scaled.iter().map(|row| row.dot(normal).abs()).sum();
                least = least.min(reach / size);
            }
        }
    }
    if least.is_finite() { least } else { 0.0 }
}

/// Returns the eigenvalues of a symmetric matrix in ascending order, by the trigonometric formula
/// of Smith (1961). The errors are about as large as the rounding error of the largest eigenvalue.
pub(super) fn eigenvalues(m: &Mat3) -> [f64; 3] {
    let mean = (m.x_axis.x + m.y_axis.y + m.z_axis.z) / 3.0;
    let (x, y, z) = (m.x_axis.x - mean, m.y_axis.y - mean, m.z_axis.z - mean);
    let (xy, xz, yz) = (m.y_axis.x, m.z_axis.x, m.z_axis.y);
    let p = libm::sqrt((x * x + y * y + z * z + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0);
    if !(p > f64::EPSILON * mean.abs()) {
        return [mean; 3];
    }
    let det = x * (y * z - yz * yz) - xy * (xy * z - yz * xz) + xz * (xy * yz - y * xz);
    let angle = libm::acos((det / (2.0 * p * p * p)).clamp(-1.0, 1.0)) / 3.0;
    let largest = mean + 2.0 * p * libm::cos(angle);
    let least = mean + 2.0 * p * libm::cos(angle + core::f64::consts::TAU / 3.0);
    [least, 3.0 * mean - largest - least, largest]
}

/// Returns the larger eigenvalue of the symmetric 2 x 2 matrix [[xx, xy], [xy, yy]].
fn largest_of_pair(xx: f64, xy: f64, yy: f64) -> f64 {
    0.5 * (xx + yy + libm::hypot(xx - yy, 2.0 * xy))
}

#[cfg(test)]
mod tests {
    use super::super::space::{DEGREE, Design, Parts, WHEELS};
    use super::*;
    use crate::rng::Rng;
    use hbot_core::allocation::{JointLimits, allocate, capability, traction};
    use hbot_core::design::singularity::Indices;
    use hbot_sim::plant::{Plant, PlantState};

    const PEAKS: [f64; 2] = [0.93, 0.14];

    fn machine(design: &Design) -> RatedDevice {
        RatedDevice::new(Parts::prototype().device(design).expect("legal"), PEAKS)
    }

    fn designs() -> Vec<Design> {
        let even = |wheels| Design { wheels, cone: 0.2, toe: 0.3, tilt: 0.9, radius: 0.013 };
        WHEELS.map(even).into_iter().chain([Parts::prototype().prototype]).collect()
    }

    fn random(rng: &mut Rng) -> [f64; 4] {
        core::array::from_fn(|_| rng.between(-3.0, 3.0))
    }

    /// The figures of a design at a posture agree with those that the core and the simulated plant
    /// compute by other methods.
    #[test]
    fn figures_are_those_of_the_core_and_of_the_plant() {
        let mut rng = Rng(1);
        for design in designs() {
            let machine = machine(&design);
            let limits = JointLimits {
                peak: machine.peak,
                weight: machine.give.map(|give| if give > 0.0 { 1.0 / give } else { 1.0 }),
            };
            let plant = Plant::new(&machine.device).expect("no coupling of inertias");
            for _ in 0..100 {
                let th = random(&mut rng);
                let posture = Posture::new(&machine.device, &th);
                let index = Indices::of(posture.rows()).spectral;
                // The smallest eigenvalue of GᵀG has a rounding error in proportion to the largest
                // one.
                assert!((machine.of(&posture, Quantity::Conditioning) - index).abs() < 1e-13 / index);

                let mut state = PlantState::default();
                state.steer[..design.wheels].copy_from_slice(&th[..design.wheels]);
                let most = eigenvalues(&plant.apparent_inertia(&state))[2];
                assert!((machine.of(&posture, Quantity::Inertia) / most - 1.0).abs() < 1e-12);

                // No direction has less torque than the figure, and the normals of the facets have
                // exactly as much.
                let least = machine.of(&posture, Quantity::Torque);
                let load = machine.of(&posture, Quantity::Load);
                let mut found = f64::INFINITY;
                for _ in 0..200 {
                    let way = Vec3::from_array(rng.direction());
                    let can = capability(posture.rows(), &limits, way);
                    assert!(can >= least * (1.0 - 1e-12), "{can} along {way}, {least} at least");
                    // The torque is so small that no motor reaches its limit.
                    let made = allocate(posture.rows(), &limits, way * 1e-3);
                    let force = 1e3 * traction(&machine.arms, &made.torque, 1.0);
                    assert!(force <= load * (1.0 + 1e-9), "{force} N per N m, {load} at most");
                }
                for (i, a) in posture.rows().iter().enumerate() {
                    for (j, b) in posture.rows()[..i].iter().enumerate() {
                        let n = (*a * machine.peak[i]).cross(*b * machine.peak[j]);
                        found = found.min(capability(posture.rows(), &limits, n / n.length()));
                    }
                }
                assert!((found / least - 1.0).abs() < 1e-9, "{found} against {least}");
            }
        }
    }

    /// For two wheels without toe and with r = R sin a, the conditioning is sqrt((1 - |cos g|)/2),
    /// where g is the angle between the contacts.
    #[test]
    fn two_matched_wheels_are_as_even_as_their_contacts_are_apart() {
        let cone = 12.0 * DEGREE;
        let design =
            Design { wheels: 2, cone, toe: 0.0, tilt: 45.0 * DEGREE, radius: 0.102 * libm::sin(cone) };
        let machine = machine(&design);
        let mut rng = Rng(2);
        for _ in 0..100 {
            let posture = Posture::new(&machine.device, &random(&mut rng)[..2]);
            let cos = posture.frames()[0].c3.dot(posture.frames()[1].c3);
            let expected = libm::sqrt(0.5 * (1.0 - cos.abs()));
            assert!((machine.of(&posture, Quantity::Conditioning) - expected).abs() < 1e-12);
        }
    }

    /// Three or four wheels with r = R sin a turn the sphere equally well about every axis if the
    /// angle between n3 and each contact has cos² = 1/3.
    #[test]
    fn matched_wheels_at_the_magic_angle_are_isotropic() {
        let (cone, magic) = (10.0 * DEGREE, libm::acos(libm::sqrt(1.0 / 3.0)));
        for wheels in [3, 4] {
            // All wheels steer to where their contact is lowest, towards -n3.
            let radius = 0.102 * libm::sin(cone);
            let design = Design { wheels, cone, toe: 0.0, tilt: magic + cone, radius };
            let machine = machine(&design);
            let th: Vec<f64> = machine
                .device
                .wheels()
                .iter()
                .map(|wheel| {
                    let down = |th: f64| hbot_core::design::kinematics::ContactFrame::at(wheel, th).c3.z;
                    (0..36_000)
                        .map(|k| 1.0e-2 * DEGREE * k as f64)
                        .min_by(|a, b| down(*a).total_cmp(&down(*b)))
                        .expect("angles")
                })
                .collect();
            let posture = Posture::new(&machine.device, &th);
            // The steer angles are found to 0.01 deg, which changes the index in proportion.
            assert!(machine.of(&posture, Quantity::Conditioning) > 1.0 - 3.0e-4);
            let scale = 0.102 / radius;
            let trace: f64 = posture.rows().iter().map(|row| row.length_squared()).sum();
            assert!((trace / (2.0 * wheels as f64 * scale * scale) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn eigenvalues_of_known_matrices() {
        let turn = Mat3::from_rotation_x(0.3) * Mat3::from_rotation_z(1.1);
        let m = turn * Mat3::from_diagonal(Vec3::new(5.0, 0.25, 2.0)) * turn.transpose();
        for (found, expected) in eigenvalues(&m).into_iter().zip([0.25, 2.0, 5.0]) {
            assert!((found - expected).abs() < 1e-14);
        }
        assert_eq!(eigenvalues(&Mat3::from_diagonal(Vec3::splat(3.0))), [3.0; 3]);
    }
}
