//! Figures over all steer angles: means over even samples of the torus, and worst values. A worst
//! value is searched from the worst samples.

use core::f64::consts::TAU;

use hbot_core::design::kinematics::Posture;
use hbot_core::design::singularity::interior_margin_over_all;

use super::local::{Quantity, RatedDevice};
use super::space::Design;

/// How thoroughly the figures of a design are measured over all steer angles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Effort {
    /// Number of postures at which the figures are computed.
    pub(super) samples: usize,
    /// Number of postures from which the search for the worst posture starts. They are the worst of
    /// the samples.
    pub(super) starts: usize,
}

/// Thoroughness with which the many designs of a search are measured.
pub(super) const SEARCH: Effort = Effort { samples: 256, starts: 4 };
/// Thoroughness with which reported designs are measured.
pub(super) const TOLD: Effort = Effort { samples: 4096, starts: 16 };

/// First and last step size of the search for the worst posture, rad.
const STEPS: [f64; 2] = [0.3, 1.0e-3];

/// The figures of a design over all steer angles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Measures {
    /// Mean of the spectral index over all postures.
    pub(super) gci: f64,
    /// Smallest spectral index over all postures. It is the actuation margin, as all joints have
    /// motors.
    pub(super) conditioning: f64,
    /// Peak torque that the motors can make in the worst direction at the worst posture, N m.
    pub(super) torque: f64,
    /// Peak torque in the worst direction that 95 % of the postures reach, N m.
    pub(super) torque_low: f64,
    /// Largest eigenvalue of the apparent inertia over all postures, kg m².
    pub(super) inertia: f64,
    /// Mean over all postures of the largest eigenvalue of the apparent inertia, kg m².
    pub(super) inertia_mean: f64,
    /// Largest contact force for a torque of 1 N m on the sphere, in the worst direction at the
    /// worst posture, N.
    pub(super) load: f64,
    /// Interior margin sigma_min(Z)/R over all postures, or a lower bound for it. It is the
    /// distance from an interior singularity.
    pub(super) interior: f64,
    /// Largest rates of a steer and a drive joint, relative to the sphere's angular speed.
    pub(super) speed: [f64; 2],
}

impl Measures {
    /// Measures the figures of `design` over all steer angles. `machine` is the device of the
    /// design.
    pub(super) fn of(machine: &RatedDevice, design: &Design, effort: Effort) -> Self {
        let n = effort.samples as f64;
        let mut values = [const { Vec::new() }; 4];
        let angles: Vec<Vec<f64>> = samples(design.wheels, effort.samples).collect();
        for th in &angles {
            let posture = Posture::new(&machine.device, th);
            for (values, quantity) in values.iter_mut().zip(Quantity::ALL) {
                values.push(machine.of(&posture, quantity));
            }
        }
        let [conditioning, torque, inertia, load] =
            core::array::from_fn(|k| worst(machine, Quantity::ALL[k], &angles, &values[k], effort.starts));
        let mean = |k: usize| values[k].iter().sum::<f64>() / n;
        let (gci, inertia_mean) = (mean(0), mean(2));
        values[1].sort_by(f64::total_cmp);
        let r = machine.device.sphere_radius();
        Self {
            gci,
            conditioning,
            torque,
            torque_low: values[1][effort.samples / 20],
            inertia,
            inertia_mean,
            load,
            interior: interior_margin_over_all(&machine.device),
            speed: [design.steering_speed(), design.drive_speed(r)],
        }
    }

    /// Returns the torque on the sphere at which the first contact slips, in the worst direction, N
    /// m. A contact can hold the force `grip`, N.
    pub(super) fn slips_from(&self, grip: f64) -> f64 {
        grip / self.load
    }
}

/// Returns `count` postures whose steer angles (rad) are spread evenly over all possible ones. They
/// are a Kronecker sequence of the generalised golden ratio (Roberts 2018).
pub(super) fn samples(wheels: usize, count: usize) -> impl Iterator<Item = Vec<f64>> {
    kronecker(wheels, 0.5).take(count).map(|unit| unit.iter().map(|x| x * TAU).collect())
}

/// Returns an endless sequence of points that are spread evenly over a unit cube of `dimensions`
/// dimensions. All coordinates of the first point are `start`.
pub(super) fn kronecker(dimensions: usize, start: f64) -> impl Iterator<Item = Vec<f64>> {
    // The root of x^(d + 1) = x + 1. Each iteration reduces the error by a factor of at most 1/(d +
    // 1).
    let root = (0..64).fold(1.5_f64, |x, _| libm::pow(1.0 + x, 1.0 / (dimensions as f64 + 1.0)));
    let steps: Vec<f64> = (1..=dimensions).map(|i| libm::pow(root, -(i as f64))).collect();
    (0_u64..).map(move |k| steps.iter().map(|step| (start + k as f64 * step).fract()).collect())
}

/// Returns the directions of a step in the search for the worst posture. A step changes one steer
/// angle, or two at once, because the torque has valleys along which two angles change.
fn ways(wheels: usize) -> Vec<Vec<f64>> {
    let mut all = Vec::new();
    for i in 0..wheels {
        for j in 0..=i {
            for (a, b) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
                if i == j && b < 0.0 {
                    continue;
                }
                let mut way = vec![0.0; wheels];
                way[j] = b;
                way[i] = a;
                all.push(way);
            }
        }
    }
    all
}

/// Returns the worst value of the figure `quantity` over all postures. It searches from the worst
/// samples, with steps that halve.
fn worst(
    machine: &RatedDevice,
    quantity: Quantity,
    angles: &[Vec<f64>],
    values: &[f64],
    starts: usize,
) -> f64 {
    let mut order: Vec<usize> = (0..values.len()).collect();
    let by = |a: &usize, b: &usize| {
        let ascending = values[*a].total_cmp(&values[*b]);
        if quantity.worse(0.0, 1.0) { ascending } else { ascending.reverse() }
    };
    order.select_nth_unstable_by(starts - 1, by);
    order.truncate(starts);
    // Sorting makes ties between starts independent of how the selection ordered the samples.
    order.sort_unstable();
    let mut all = values[order[0]];
    let ways = ways(angles[0].len());
    for start in order {
        let (mut th, mut value) = (angles[start].clone(), values[start]);
        let mut step = STEPS[0];
        while step > STEPS[1] {
            let mut moved = false;
            for way in &ways {
                let there: Vec<f64> = th.iter().zip(way).map(|(th, way)| th + step * way).collect();
                let found = machine.at(&there, quantity);
                if quantity.worse(found, value) {
                    (th, value) = (there, found);
                    moved = true;
                }
            }
            if !moved {
                step *= 0.5;
            }
        }
        if quantity.worse(value, all) {
            all = value;
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::super::space::{DEGREE, Parts};
    use super::*;

    const PEAKS: [f64; 2] = [0.93, 0.14];

    fn measured(design: &Design, effort: Effort) -> Measures {
        let device = Parts::prototype().device(design).expect("legal");
        Measures::of(&RatedDevice::new(device, PEAKS), design, effort)
    }

    /// The prototype's figures are those of docs/internals/physics.md, sections 3, 7, 10 and 11, to
    /// the digits given there.
    #[test]
    fn the_prototype_measures_what_the_notes_say() {
        let parts = Parts::prototype();
        let told = measured(&parts.prototype, TOLD);
        assert!((told.gci - 0.646).abs() < 0.5e-3, "{}", told.gci);
        assert!((told.conditioning - 0.50).abs() < 0.5e-2, "{}", told.conditioning);
        assert!((told.load - 10.4).abs() < 0.05, "{}", told.load);
        assert!((told.slips_from(8.0) - 0.77).abs() < 0.5e-2, "{}", told.slips_from(8.0));
        // The contacts come within 70 degrees of each other at some steer angles. The margin is
        // then sqrt(1 - cos g), and f = 1/(R sin g) if one contact carries the whole load.
        let g = 90.0 * DEGREE - 2.0 * parts.prototype.cone;
        assert!((told.interior - libm::sqrt(1.0 - libm::cos(g))).abs() < 1e-9);
        let force = 1.0 / (0.102 * libm::sin(g));
        // The search ends within a milliradian of a smooth extremum.
        assert!((told.load / force - 1.0).abs() < 1e-5, "{} against {force}", told.load);
    }

    /// Measured with the few samples of a search, the figures of a design are nearly those of a
    /// reported measurement.
    #[test]
    fn few_samples_say_nearly_the_same_as_many() {
        for wheels in [2, 3, 4] {
            let design = Design { wheels, cone: 14.0 * DEGREE, toe: 0.1, tilt: 50.0 * DEGREE, radius: 0.02 };
            let (few, many) = (measured(&design, SEARCH), measured(&design, TOLD));
            for (a, b) in [(few.gci, many.gci), (few.inertia, many.inertia), (few.load, many.load)] {
                assert!((a / b - 1.0).abs() < 0.02, "{wheels} wheels: {few:?} {many:?}");
            }
            // The tolerance is wider because the torque has narrow valleys.
            assert!((few.torque / many.torque - 1.0).abs() < 0.1, "{wheels} wheels: {few:?} {many:?}");
            assert!(many.conditioning <= many.gci && many.torque <= many.torque_low);
        }
    }

    /// All figures are equal for a positive and a negative toe, because one design is the mirror
    /// image of the other.
    #[test]
    fn the_sign_of_the_toe_makes_no_difference() {
        for wheels in [2, 3, 4] {
            let [out, in_] = [0.3, -0.3].map(|toe| {
                let design = Design { wheels, cone: 0.2, toe, tilt: 0.8, radius: 0.015 };
                measured(&design, Effort { samples: 16384, starts: 16 })
            });
            // The samples are not mirror images of each other, so the means differ a little. The
            // worst values agree as far as the search finds them.
            assert!((out.gci / in_.gci - 1.0).abs() < 1e-3, "{out:?} {in_:?}");
            assert!((out.torque / in_.torque - 1.0).abs() < 0.01, "{out:?} {in_:?}");
            assert!((out.load / in_.load - 1.0).abs() < 1e-3, "{out:?} {in_:?}");
        }
    }

    #[test]
    fn samples_fill_the_torus_evenly() {
        // Each of 16 equal boxes of the plane gets its share of 1024 points, within a few.
        let mut boxes = [0; 16];
        for th in samples(2, 1024) {
            let [i, j] = [th[0], th[1]].map(|x| (4.0 * x / TAU) as usize);
            boxes[4 * i + j] += 1;
        }
        assert!(boxes.iter().all(|count| (60..=68).contains(count)), "{boxes:?}");
    }
}
