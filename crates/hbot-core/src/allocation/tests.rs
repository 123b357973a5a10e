extern crate std;

use std::vec::Vec;

use glam::DVec3;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::reference::Reference;
use super::*;
use crate::design::singularity::singular_values;

/// Tolerance for the direction and the scale of an allocated torque, if the rows are not close to
/// losing rank. It allows for rounding errors times a few condition numbers, which enter squared.
const ROUNDING: Real = if Real::EPSILON < 1.0e-10 { 1.0e-10 } else { 2.0e-3 };

/// Returns the settings of a property test that tries `cases` random problems. The seed is fixed,
/// so that every run tries the same problems.
fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        rng_seed: RngSeed::Fixed(4268),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

fn limits(peak: &[Real], weight: &[Real]) -> JointLimits {
    let mut limits = JointLimits::NONE;
    limits.peak[..peak.len()].copy_from_slice(peak);
    limits.weight[..weight.len()].copy_from_slice(weight);
    limits
}

/// Converts a number to `f64`. Tests use it because `Real` is `f32` in one build and `f64` in the
/// other.
fn wide<T: Into<f64>>(x: T) -> f64 {
    x.into()
}

fn made(rows: &[Vec3], allocation: &Allocation) -> Vec3 {
    rows.iter().zip(allocation.torque).map(|(g, tau)| *g * tau).sum()
}

/// Returns the ratio of the smallest to the largest singular value of the peak-scaled rows of G.
fn margin(rows: &[Vec3], limits: &JointLimits) -> Real {
    let scaled: Vec<Vec3> = rows.iter().zip(limits.peak).map(|(g, t)| *g * t).collect();
    let [most, _, least] = singular_values(&scaled);
    least / most
}

fn joints(
    count: impl Into<proptest::collection::SizeRange>,
) -> impl Strategy<Value = (Vec<Vec3>, JointLimits)> {
    let unit = -1.0..1.0 as Real;
    let joint = ([unit.clone(), unit.clone(), unit], 0.1..1.0 as Real, 0.3..3.0 as Real);
    proptest::collection::vec(joint, count).prop_map(|joints| {
        let rows = joints.iter().map(|(g, ..)| Vec3::from_array(*g)).collect();
        let peak: Vec<Real> = joints.iter().map(|(_, t, _)| *t).collect();
        let weight: Vec<Real> = joints.iter().map(|(.., w)| *w).collect();
        (rows, limits(&peak, &weight))
    })
}

/// Generates joints whose rows of G lie along the edges and diagonals of a cube, and a torque to
/// allocate. Limits and costs are equal. Such joints lead to the special cases of the allocation:
/// facets with many rows, edges, vertices and ties.
fn lattice() -> impl Strategy<Value = (Vec<Vec3>, JointLimits, Vec3)> {
    let row = prop_oneof![
        Just(Vec3::X),
        Just(Vec3::Y),
        Just(-Vec3::Z),
        Just(Vec3::new(1.0, 1.0, 0.0)),
        Just(Vec3::new(0.0, 1.0, -1.0)),
        Just(Vec3::new(1.0, 0.0, 1.0)),
    ];
    let whole = || (-4..5_i8).prop_map(Real::from);
    (proptest::collection::vec(row, 2..=MAX_JOINTS), 0..2_u8, [whole(), whole(), whole()]).prop_map(
        |(rows, dead, wanted)| {
            let mut limits = JointLimits { peak: [1.0; MAX_JOINTS], ..JointLimits::NONE };
            limits.peak[0] = Real::from(1 - dead);
            (rows, limits, Vec3::from_array(wanted))
        },
    )
}

fn check_limits(rows: &[Vec3], limits: &JointLimits, allocation: &Allocation) -> Result<(), TestCaseError> {
    prop_assert!((0.0..=1.0).contains(&allocation.scale));
    for k in 0..MAX_JOINTS {
        let limit = if k < rows.len() { limits.peak[k] } else { 0.0 };
        prop_assert!(fabs(allocation.torque[k]) <= limit, "joint {k}: {allocation:?}");
    }
    Ok(())
}

/// Checks that the joint torques in `found` are optimal. There must be a vector y with weight times
/// torque = g.y for each joint between its limits. For a joint at a limit, g.y must be at least as
/// large in the direction of that limit. Nothing is checked if the joints between their limits do
/// not determine y.
fn check_optimal(rows: &[Vec3], limits: &JointLimits, found: &Allocation) -> Result<(), TestCaseError> {
    let free = |k: usize| fabs(found.torque[k]) < limits.peak[k] * (1.0 - ROUNDING);
    let between: Vec<usize> = (0..rows.len()).filter(|k| free(*k)).collect();
    let [most, _, least] = singular_values(&between.iter().map(|k| rows[*k]).collect::<Vec<_>>());
    if least < 0.1 * most {
        return Ok(());
    }
    let mut moment = Sym3::ZERO;
    let mut right = Vec3::ZERO;
    for k in between {
        moment.add(rows[k], 1.0);
        right += rows[k] * (limits.weight[k] * found.torque[k]);
    }
    let y = moment.adjugate().solve(right);
    let doubt = 100.0 * ROUNDING * (1.0 + y.length());
    for k in 0..rows.len() {
        let (pull, torque) = (rows[k].dot(y), limits.weight[k] * found.torque[k]);
        if free(k) {
            prop_assert!(fabs(pull - torque) <= doubt, "joint {k} pulls {pull}, gives {torque}");
        } else {
            prop_assert!(
                pull * torque.signum() >= fabs(torque) - doubt,
                "joint {k} pulls {pull}, gives {torque}"
            );
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(config(300))]

    #[test]
    fn agrees_with_trying_every_active_set(
        (rows, limits) in joints(4..=6),
        wanted in [-2.0..2.0 as Real, -2.0..2.0, -2.0..2.0],
    ) {
        prop_assume!(margin(&rows, &limits) > 0.05);
        let wanted = Vec3::from_array(wanted);
        let n = rows.len();
        let all = |x: &[Real]| x[..n].iter().map(|x| wide(*x)).collect::<Vec<f64>>();
        let wide3 = |v: &Vec3| DVec3::new(wide(v.x), wide(v.y), wide(v.z));
        let reference = Reference {
            rows: rows.iter().map(wide3).collect(),
            peak: all(&limits.peak),
            weight: all(&limits.weight),
        };
        let found = allocate(&rows, &limits, wanted);
        check_limits(&rows, &limits, &found)?;
        prop_assert!(!found.deficient);
        prop_assert!((made(&rows, &found) - wanted * found.scale).length() <= ROUNDING * wanted.length());
        let scale = reference.scale(wide3(&wanted));
        prop_assert!((wide(found.scale) - scale).abs() <= wide(ROUNDING) * scale, "{found:?} {scale}");
        // On the border the torques that make s T are unique. Inside there is a choice.
        if found.scale == 1.0 && scale == 1.0 {
            let cost: f64 = (0..n).map(|k| 0.5 * reference.weight[k] * wide(found.torque[k]).powi(2)).sum();
            let least = reference.cost(wide3(&wanted));
            prop_assert!((cost - least).abs() <= 4.0 * wide(ROUNDING) * least, "{found:?}: {cost}, not {least}");
        }
    }

    #[test]
    fn is_feasible_and_optimal_for_any_number_of_joints(
        (rows, limits) in joints(3..=MAX_JOINTS),
        axis in [-1.0..1.0 as Real, -1.0..1.0, -1.0..1.0],
        part in 0.2..1.2 as Real,
    ) {
        prop_assume!(margin(&rows, &limits) > WHOLE);
        let axis = Vec3::from_array(axis).normalize();
        let wanted = axis * (part * capability(&rows, &limits, axis));
        let found = allocate(&rows, &limits, wanted);
        check_limits(&rows, &limits, &found)?;
        prop_assert!((made(&rows, &found) - wanted * found.scale).length() <= ROUNDING * wanted.length());
        check_optimal(&rows, &limits, &found)?;
        let simple = allocate_clipped(&rows, &limits, wanted);
        check_limits(&rows, &limits, &simple)?;
        prop_assert!(simple.scale <= found.scale * (1.0 + ROUNDING));
        prop_assert!((made(&rows, &simple) - wanted * simple.scale).length() <= ROUNDING * wanted.length());
        prop_assert!(fabs(Real::min(1.0, 1.0 / part) - found.scale) <= ROUNDING, "{part}: {found:?}");
    }

    #[test]
    fn parallel_rows_add_up((pairs, limits) in joints(4), wanted in [-2.0..2.0 as Real, -2.0..2.0, -2.0..2.0]) {
        // Two directions with two joints each: the reachable set is a parallelogram, and T is
        // projected on its plane.
        let (g, h) = (pairs[0], pairs[1]);
        let rows = [g, g, h, h * -0.5];
        let normal = g.cross(h);
        prop_assume!(normal.length() > 0.2 * g.length() * h.length() && g.length() > 0.2 && h.length() > 0.2);
        let wanted = Vec3::from_array(wanted);
        let along_g = fabs(wanted.cross(h).dot(normal)) / normal.length_squared();
        let along_h = fabs(g.cross(wanted).dot(normal)) / normal.length_squared();
        let scale = Real::min(
            1.0,
            Real::min(
                (limits.peak[0] + limits.peak[1]) / along_g,
                (limits.peak[2] + 0.5 * limits.peak[3]) / along_h,
            ),
        );
        let found = allocate(&rows, &limits, wanted);
        check_limits(&rows, &limits, &found)?;
        prop_assert!(fabs(found.scale - scale) <= ROUNDING, "{found:?}, not {scale}");
        let flat = wanted - normal * (wanted.dot(normal) / normal.length_squared());
        prop_assert!((made(&rows, &found) - flat * scale).length() <= ROUNDING * 10.0);
    }

    #[test]
    fn keeps_its_promises_among_ties((rows, limits, wanted) in lattice()) {
        let found = allocate(&rows, &limits, wanted);
        check_limits(&rows, &limits, &found)?;
        let torque = made(&rows, &found);
        if found.deficient {
            // The torque made never works against the wanted one.
            prop_assert!(torque.dot(wanted) >= -ROUNDING);
        } else {
            prop_assert!((torque - wanted * found.scale).length() <= ROUNDING, "{found:?}");
        }
        let largest = if wanted == Vec3::ZERO { 1.0 } else { capability(&rows, &limits, wanted.normalize()) / wanted.length() };
        if !found.deficient {
            prop_assert!(fabs(Real::min(1.0, largest) - found.scale) <= ROUNDING);
        }
    }
}

const CUBE: [Vec3; 4] = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::new(0.6, 0.0, 0.8)];

#[test]
fn nothing_is_wanted_or_can_be_made() {
    let four = limits(&[1.0; 4], &[1.0; 4]);
    assert_eq!(allocate(&CUBE, &four, Vec3::ZERO), Allocation::nothing(1.0, false));
    assert_eq!(allocate(&CUBE, &four, Vec3::new(Real::NAN, 0.0, 0.0)), Allocation::nothing(0.0, false));
    assert_eq!(allocate(&CUBE, &four, Vec3::new(0.0, Real::INFINITY, 0.0)), Allocation::nothing(0.0, false));
    let dead = limits(&[0.0; 4], &[1.0; 4]);
    assert_eq!(allocate(&CUBE, &dead, Vec3::X), Allocation::nothing(0.0, true));
    assert_eq!(allocate(&CUBE, &dead, Vec3::ZERO), Allocation::nothing(1.0, false));
    assert_eq!(allocate(&[], &four, Vec3::X), Allocation::nothing(0.0, true));
    assert_eq!(capability(&CUBE, &dead, Vec3::X), 0.0);
}

#[test]
fn tiny_and_huge_torques_keep_their_direction() {
    let four = limits(&[0.9, 0.2, 0.5, 0.3], &[1.0, 2.0, 3.0, 4.0]);
    let direction = Vec3::new(1.0, -0.7, 0.2);
    // Small enough to underflow in products, but still with all digits.
    let (tiny, huge) = (Real::MIN_POSITIVE * 1.0e8, Real::MAX * 0.1);
    let rows = CUBE.map(|g| g * 30.0);
    let small = allocate(&rows, &four, direction * tiny);
    assert_eq!(small.scale, 1.0);
    assert!((made(&rows, &small) / tiny - direction).length() < ROUNDING);
    let large = allocate(&rows, &four, direction * huge);
    let largest = capability(&rows, &four, direction.normalize());
    assert!((made(&rows, &large) - direction.normalize() * largest).length() < ROUNDING * largest);
    assert!(large.scale >= 0.0 && large.scale < tiny);
}

#[test]
fn impossible_limits_count_as_none() {
    for bad in [-1.0, 0.0, Real::NAN, Real::INFINITY] {
        let mut four = limits(&[1.0; 4], &[1.0; 4]);
        four.peak[3] = bad;
        let found = allocate(&CUBE, &four, Vec3::new(0.5, 0.5, 3.0));
        assert_eq!((found.torque[3], found.torque[2]), (0.0, 1.0));
        // At right angles to the only motor left, and far larger than any limit.
        let one = limits(&[1.0e-30, 0.0, 0.0, bad], &[1.0; 4]);
        assert_eq!(allocate(&CUBE, &one, Vec3::Y * Real::MAX).torque, [0.0; MAX_JOINTS]);
        let mut four = limits(&[1.0; 4], &[1.0; 4]);
        four.weight[3] = bad;
        assert_eq!(allocate(&CUBE, &four, Vec3::new(0.5, 0.5, 0.5)).torque[3], 0.0);
    }
}

#[test]
fn a_row_that_is_not_finite_counts_as_none() {
    let mut rows = CUBE;
    rows[3] = Vec3::new(Real::NAN, 0.0, 1.0);
    for peak in [[1.0; 4], [1.0, 1.0, 1.0, 0.0]] {
        for wanted in [Vec3::new(0.1, 0.2, 0.3), Vec3::new(1.0, 2.0, -4.0)] {
            for allocate in [allocate, allocate_clipped] {
                let found = allocate(&rows, &limits(&peak, &[1.0; 4]), wanted);
                assert_eq!(found.torque[3], 0.0);
                assert!((made(&rows[..3], &found) - wanted * found.scale).length() < ROUNDING);
                assert!(fabs(found.scale - Real::min(1.0, 1.0 / wanted.abs().max_element())) < ROUNDING);
            }
        }
    }
}

#[test]
fn dead_motors_leave_a_plane_and_then_a_line() {
    let wanted = Vec3::new(0.3, 0.2, 0.1);
    // One of four motors is dead: the others make its share, with either method.
    for allocate in [allocate, allocate_clipped] {
        let three = allocate(&CUBE, &limits(&[1.0, 1.0, 1.0, 0.0], &[1.0; 4]), wanted);
        assert!(three.scale == 1.0 && (made(&CUBE, &three) - wanted).length() < ROUNDING, "{three:?}");
    }
    // Two are dead: the component of T along the third axis is lost, the others are made unchanged.
    let plane = allocate(&CUBE, &limits(&[1.0, 1.0, 0.0, 0.0], &[1.0; 4]), wanted);
    assert!(plane.deficient && plane.scale == 1.0);
    assert!((made(&CUBE, &plane) - Vec3::new(0.3, 0.2, 0.0)).length() < ROUNDING);
    // In the plane nothing is lost, and saturation keeps the direction.
    let flat = allocate(&CUBE, &limits(&[1.0, 1.0, 0.0, 0.0], &[1.0; 4]), Vec3::new(3.0, 4.0, 0.0));
    assert!(!flat.deficient && fabs(flat.scale - 0.25) < ROUNDING);
    assert!((made(&CUBE, &flat) - Vec3::new(0.75, 1.0, 0.0)).length() < ROUNDING);
    // Three are dead: only a line is left. The moment of this row is singular only up to rounding.
    let oblique = [Vec3::new(-0.807_138_47, 0.342_084_94, 0.012_554_68), Vec3::X, Vec3::Y, Vec3::Z];
    let found = allocate(&oblique, &limits(&[0.68, 0.0, 0.0, 0.0], &[3.1; 4]), Vec3::new(-0.26, 0.82, -1.22));
    assert!(found.deficient && found.scale > 0.5 && found.torque[0] > 0.5);
    let line = allocate(&CUBE, &limits(&[0.0, 0.1, 0.0, 0.0], &[1.0; 4]), wanted);
    assert!(line.deficient && fabs(line.scale - 0.5) < ROUNDING);
    assert!((made(&CUBE, &line) - Vec3::new(0.0, 0.1, 0.0)).length() < ROUNDING);
    assert_eq!(capability(&CUBE, &limits(&[1.0, 1.0, 0.0, 0.0], &[1.0; 4]), Vec3::Z), 0.0);
    assert_eq!(capability(&CUBE, &limits(&[1.0, 1.0, 0.0, 0.0], &[1.0; 4]), Vec3::X), 1.0);
}

#[test]
fn nothing_jumps_where_a_direction_is_lost() {
    // Three driven rows fold into a plane and out of it on the other side. The second torque is
    // larger than the three joints can make.
    let three = limits(&[1.0, 0.8, 0.7, 0.0], &[1.0, 2.0, 1.5, 1.0]);
    for wanted in [Vec3::new(0.4, -0.3, 0.02), Vec3::new(1.9, 0.7, 0.3)] {
        let steps = 20_000;
        let mut last: Option<Allocation> = None;
        let (mut fewest, mut most): (Real, Real) = (1.0, 0.0);
        for i in 0..=steps {
            let lift = 0.04 * (2.0 * (i as Real) / (steps as Real) - 1.0);
            let rows =
                [Vec3::new(1.0, 0.1, 0.0), Vec3::new(-0.2, 1.0, 0.0), Vec3::new(0.6, 0.7, lift), Vec3::X];
            let found = allocate(&rows, &three, wanted);
            if let Some(last) = last {
                // The lift changes by 4e-6 a step. A jump would have the size of a peak. The blend
                // is 0.008 wide, with a slope of 1.5.
                for k in 0..3 {
                    assert!(fabs(found.torque[k] - last.torque[k]) < 0.01, "{lift}: {last:?} to {found:?}");
                }
                assert!(fabs(found.scale - last.scale) < 0.01);
            }
            (fewest, most) = (fewest.min(found.scale), most.max(found.scale));
            // At the very edge of the blend the part that is lost is below rounding.
            let margin = margin(&rows[..3], &three);
            assert!(found.deficient || margin > 0.8 * WHOLE, "{lift}");
            assert!(!found.deficient || margin < WHOLE * (1.0 + ROUNDING), "{lift}");
            last = Some(found);
        }
        assert!(most > fewest, "the sweep must pass through the blend");
    }
}

#[test]
fn unlimited_torques_are_the_least_squares_ones() {
    // For equal weights, Gᵀ tau = T is solved by tau = G (GᵀG)⁻¹ T: two equal rows share equally.
    let rows = [Vec3::X, Vec3::X, Vec3::Y, Vec3::Z];
    let found = allocate(&rows, &limits(&[1.0; 4], &[2.0; 4]), Vec3::new(0.5, 0.25, -0.125));
    assert_eq!(found.torque[..4], [0.25, 0.25, 0.25, -0.125]);
    // If one of the two is at its limit, the other gives the rest.
    let found = allocate(&rows, &limits(&[0.125, 1.0, 1.0, 1.0], &[2.0; 4]), Vec3::new(0.5, 0.25, -0.125));
    assert_eq!(found.torque[..4], [0.125, 0.375, 0.25, -0.125]);
    assert_eq!(found.scale, 1.0);
}

#[cfg(not(feature = "f32"))]
mod hard;
mod many;
