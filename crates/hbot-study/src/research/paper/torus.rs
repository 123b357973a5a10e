//! The steer angles of two wheels, which form a torus, and the choice of the joints that have
//! motors.

use core::f64::consts::TAU;

use hbot_core::design::kinematics::Posture;
use hbot_core::design::singularity::Indices;
use hbot_core::{Device, MAX_JOINTS, Vec3};

use crate::threads;

/// A choice of which of the prototype's joints have motors, in the order steer 1, drive 1, steer 2,
/// drive 2.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Motors {
    /// Name of the choice as used in the ids of figures.
    pub(super) id: &'static str,
    /// Name of the choice as shown in tables.
    pub(super) name: &'static str,
    pub(super) driven: [bool; 4],
}

/// The choice in which all four joints have motors.
pub(super) const FOUR: Motors = Motors { id: "four_motors", name: "all four", driven: [true; 4] };
/// The three motors for which the paper gives torques: drive 1 and both steers (section IV.B).
pub(super) const THREE: Motors =
    Motors { id: "three_motors", name: "no drive 2 (the paper's three)", driven: [true, true, true, false] };
/// Every choice with at least three motors.
pub(super) const CHOICES: [Motors; 5] = [
    FOUR,
    THREE,
    Motors { id: "without_drive_1", name: "no drive 1", driven: [true, false, true, true] },
    Motors { id: "without_steer_2", name: "no steer 2", driven: [true, true, false, true] },
    Motors { id: "without_steer_1", name: "no steer 1", driven: [false, true, true, true] },
];

/// Number of cells around which [`least`] refines its search.
const STARTS: usize = 8;
/// Number of refinements in [`least`]. Each one reduces the width of the searched region by the
/// factor 0.35; 0.35^20 is 1e-9.
const ZOOMS: u32 = 20;
/// Number of points on each side of the centre that one refinement of [`least`] evaluates.
const FINE: i32 = 7;

/// Explanation, for the report, of the placeholder `{motors}` in the ids of figures.
pub(super) const MOTORS: &str = "{motors}: four_motors; three_motors, the paper's steer 1, drive 1 and steer 2; without_{joint}, the other choices of three";

impl Motors {
    /// Selects the rows of the matrix G whose joints have motors. Calls `with` with these rows and
    /// returns its result.
    pub(super) fn rows<T>(&self, posture: &Posture, with: impl FnOnce(&[Vec3]) -> T) -> T {
        let mut rows = [Vec3::ZERO; MAX_JOINTS];
        let mut count = 0;
        for (row, _) in posture.rows().iter().zip(self.driven).filter(|(_, driven)| *driven) {
            rows[count] = *row;
            count += 1;
        }
        with(&rows[..count])
    }

    /// Returns the conditioning indices of G at a posture, using only the joints with motors.
    pub(super) fn indices(&self, posture: &Posture) -> Indices {
        self.rows(posture, Indices::of)
    }

    /// Returns the product of the singular values of G, using only the joints with motors. For
    /// three motors it is det G_3, which has a sign; for more it is sqrt(det GᵀG).
    pub(super) fn determinant(&self, posture: &Posture) -> f64 {
        self.rows(posture, |rows| match rows {
            [a, b, c] => a.dot(b.cross(*c)),
            more => more
                .iter()
                .enumerate()
                .flat_map(|(k, a)| {
                    more[..k].iter().enumerate().flat_map(move |(m, b)| {
                        more[..m].iter().map(move |c| a.dot(b.cross(*c)) * a.dot(b.cross(*c)))
                    })
                })
                .sum::<f64>()
                .sqrt(),
        })
    }
}

/// Returns the centre of cell `k` if a whole turn is divided into `cells` equal cells, rad.
pub(super) fn angle(k: usize, cells: usize) -> f64 {
    TAU * (k as f64 + 0.5) / cells as f64
}

/// Evaluates `value` at the centres of `cells` by `cells` equal cells of the two steer angles. In
/// the result, th_1 varies fastest.
pub(super) fn over<T: Send>(cells: usize, value: impl Fn([f64; 2]) -> T + Sync) -> Vec<T> {
    let angles: Vec<f64> = (0..cells).map(|k| angle(k, cells)).collect();
    let row = |th_2: &f64| angles.iter().map(|th_1| value([*th_1, *th_2])).collect::<Vec<T>>();
    threads::map(&angles, row).into_iter().flatten().collect()
}

/// Returns the steer angles at which `value` is smallest, and this smallest value.
///
/// The search first evaluates the centres of equal cells. It then refines around the best few of
/// them, to 1e-9 of a cell's width. It uses no descent method, because `value` can have kinks at
/// which such a method would stop.
pub(super) fn least(cells: usize, value: impl Fn([f64; 2]) -> f64 + Sync) -> ([f64; 2], f64) {
    let mut all = over(cells, |th| (th, value(th)));
    all.sort_by(|a, b| a.1.total_cmp(&b.1));
    let finer = |&(th, found): &([f64; 2], f64)| {
        let mut best = (th, found);
        let mut width = TAU / cells as f64;
        for _ in 0..ZOOMS {
            let [x, y] = best.0;
            let at = |k: i32| width * f64::from(k) / f64::from(FINE);
            let square = (-FINE..=FINE).flat_map(|i| {
                (-FINE..=FINE).map({
                    let at = &at;
                    move |j| [x + at(i), y + at(j)]
                })
            });
            let found = square.map(|th| (th, value(th))).min_by(|a, b| a.1.total_cmp(&b.1));
            best = found.filter(|found| found.1 < best.1).unwrap_or(best);
            width *= 0.35;
        }
        best
    };
    let found = all.iter().take(STARTS).map(finer).min_by(|a, b| a.1.total_cmp(&b.1));
    found.unwrap_or_else(|| unreachable!("there are cells"))
}

/// Returns the mean of `values`.
pub(super) fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (count, sum) = values.into_iter().fold((0_u32, 0.0), |(count, sum), value| (count + 1, sum + value));
    sum / f64::from(count)
}

/// Returns the posture of a device with two wheels at the steer angles `th`, rad.
pub(super) fn posture(device: &Device, th: [f64; 2]) -> Posture {
    Posture::new(device, &th)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hbot_config::RigConfig;

    #[test]
    fn the_determinant_is_the_product_of_the_singular_values() {
        let device = RigConfig::prototype().rig.device;
        for th in over(5, |th| th) {
            let posture = posture(&device, th);
            for motors in CHOICES {
                let product = 1.0 / motors.indices(&posture).manipulability;
                let determinant = motors.determinant(&posture).abs();
                // The tolerance is the rounding of a dozen products of numbers up to 40.
                assert!(
                    (determinant - product).abs() < 1e-12 * 6e4,
                    "{}: {determinant} {product}",
                    motors.id
                );
            }
        }
    }

    #[test]
    fn the_least_is_found_between_the_cells() {
        let (th, value) = least(12, |[x, y]| 2.0 + (x - 1.0).cos() - (y - 2.0).sin());
        let pi = core::f64::consts::PI;
        assert!(value < 1e-12, "{value}");
        assert!((th[0] - 1.0 - pi).abs() < 1e-6 && (th[1] - 2.0 - 0.5 * pi).abs() < 1e-6, "{th:?}");
    }
}
