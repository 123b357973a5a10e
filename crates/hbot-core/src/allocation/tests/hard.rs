//! Joints that differ by many orders of magnitude, that are nearly parallel, or that are weak in
//! one direction. These tests count digits, so they need 64 bits.

use super::*;
use crate::allocation::{dual, facets, problem::Problem, weak};
use crate::count::Count;

/// A generator of pseudo-random numbers (SplitMix64), so that every run tries the same problems.
struct Rng(u64);

impl Rng {
    fn between(&mut self, from: Real, to: Real) -> Real {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^= z >> 31;
        from + (to - from) * ((z >> 11) as Real / 9_007_199_254_740_992.0)
    }

    fn whole(&mut self, from: i32, to: i32) -> i32 {
        from + self.between(0.0, Real::from(to - from)) as i32
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.between(-1.0, 1.0), self.between(-1.0, 1.0), self.between(-1.0, 1.0))
    }

    /// Returns 5 to 16 joints whose costs are 10 to a power between `-orders` and `orders`.
    fn joints(&mut self, orders: i32) -> (Vec<Vec3>, JointLimits) {
        let n = self.whole(5, 17) as usize;
        let rows = (0..n).map(|_| self.vector()).collect();
        let mut limits = JointLimits::NONE;
        for k in 0..n {
            limits.peak[k] = self.between(0.1, 1.0);
            limits.weight[k] = Real::powi(10.0, self.whole(-orders, orders + 1));
        }
        (rows, limits)
    }
}

/// Checks that the allocation reaches the largest torque, and keeps its direction, if the costs of
/// the joints differ by ten orders of magnitude.
#[test]
fn costs_that_differ_by_ten_orders_leave_the_largest_torque() {
    let mut rng = Rng(5);
    let mut tried = 0;
    while tried < 1500 {
        let (mut rows, limits) = rng.joints(5);
        let (axis, part) = (rng.vector().normalize(), rng.between(0.2, 1.2));
        if tried % 4 == 0 {
            rows.truncate(3);
        }
        if margin(&rows, &limits) < 0.1 {
            continue;
        }
        tried += 1;
        let wanted = axis * (part * capability(&rows, &limits, axis));
        let found = allocate(&rows, &limits, wanted);
        check_limits(&rows, &limits, &found).unwrap();
        assert!(!found.deficient, "{tried}: {found:?}");
        assert!(fabs(found.scale - Real::min(1.0, 1.0 / part)) <= ROUNDING, "{tried}: {part}, {found:?}");
        let off = (made(&rows, &found) - wanted * found.scale).length();
        assert!(off <= ROUNDING * wanted.length(), "{tried}: {off:e}, {found:?}");
    }
}

/// Checks that the torque has the wanted direction and the stated size, however different the costs
/// are. With sixty orders of magnitude, rounding hides which torques are the cheapest.
#[test]
fn no_costs_turn_the_torque() {
    let mut rng = Rng(30);
    for tried in 0..400 {
        let (rows, limits) = rng.joints(30);
        let wanted = rng.vector() * rng.between(0.1, 4.0);
        if margin(&rows, &limits) < 0.1 {
            continue;
        }
        let found = allocate(&rows, &limits, wanted);
        check_limits(&rows, &limits, &found).unwrap();
        assert!(!found.deficient && found.scale > 0.0, "{tried}: {found:?}");
        let off = (made(&rows, &found) - wanted * found.scale).length();
        assert!(off <= ROUNDING * wanted.length(), "{tried}: {off:e}, {found:?}");
    }
}

/// Checks that the allocation finds a torque on the border of the reachable set, if two joints turn
/// the sphere about axes that differ by only 1e-8 to 1e-6. These two joints make a very narrow
/// facet. The torque is on a long edge of this facet, where one of the two joints is at its limit.
#[test]
fn two_joints_that_are_nearly_parallel_lose_no_torque() {
    let mut rng = Rng(4);
    let mut tried = 0;
    while tried < 400 {
        let n = rng.whole(5, 9) as usize;
        let mut rows: Vec<Vec3> = (0..n).map(|_| rng.vector()).collect();
        let apart = Real::powi(10.0, rng.whole(-8, -5));
        rows[1] = rows[0] * rng.between(0.5, 1.0) + rng.vector() * apart;
        let one = limits(&[1.0; MAX_JOINTS], &[1.0; MAX_JOINTS]);
        let normal = rows[0].cross(rows[1]);
        let mut border = rows[0] + rows[1] * [0.0, 0.5, -0.5, -0.2][rng.whole(0, 4) as usize];
        for row in &rows[2..] {
            border += *row * row.dot(normal).signum();
        }
        if margin(&rows, &one) < 0.1 || border.length() < 0.5 {
            continue;
        }
        tried += 1;
        let found = allocate(&rows, &one, border * 2.0);
        check_limits(&rows, &one, &found).unwrap();
        assert!(fabs(found.scale - 0.5) <= ROUNDING, "{tried}: {apart:e}, {found:?}");
        let off = (made(&rows, &found) - border).length();
        assert!(off <= ROUNDING, "{tried}: {apart:e}, {off:e}, {found:?}");
    }
}

/// Checks the torque that leaves through the narrow facet of two rows whose angle is near the
/// rounding of their normal.
#[test]
fn a_facet_without_accurate_digits_does_not_turn_the_torque() {
    let rows = [
        Vec3::new(0.9700843932974481, -0.7273618564455036, 0.1642043602409553),
        Vec3::new(0.7760675146375094, -0.5818894851563776, 0.1313634881923175),
        Vec3::new(-0.11454360768288696, 0.44071515155446583, 0.6800756972844246),
        Vec3::new(-0.622192311166262, 0.9976092769292486, 0.2711259443340768),
        Vec3::new(0.16013107028423423, 0.7045864752267945, 0.3302277945558485),
    ];
    let one = limits(&[1.0; MAX_JOINTS], &[1.0; MAX_JOINTS]);
    let wanted = Vec3::new(2.797268549471634, -0.09554148200060775, 0.43369178007754683);
    let found = allocate(&rows, &one, wanted);
    check_limits(&rows, &one, &found).unwrap();
    let off = (made(&rows, &found) - wanted * found.scale).length();
    assert!(off <= ROUNDING * wanted.length(), "{off:e}, {found:?}");
    assert!(found.scale > 0.4, "half of the torque is the largest: {found:?}");
}

/// Checks the symmetry of joints that are exactly alike: of all solutions, the cheapest one gives
/// them the same torque, within the limits and on the border.
#[test]
fn equal_joints_share_equally() {
    let directions = [
        Vec3::X,
        Vec3::Y,
        -Vec3::Z,
        Vec3::new(1.0, 1.0, 0.0),
        Vec3::new(0.0, 1.0, -1.0),
        Vec3::new(1.0, 0.0, 1.0),
    ];
    let one = limits(&[1.0; MAX_JOINTS], &[1.0; MAX_JOINTS]);
    let mut rng = Rng(6);
    for tried in 0..600 {
        let n = rng.whole(5, 17) as usize;
        let rows: Vec<Vec3> = (0..n).map(|_| directions[rng.whole(0, 6) as usize]).collect();
        let wanted = [0; 3].map(|_| Real::from(rng.whole(-8, 9)));
        let found = allocate(&rows, &one, Vec3::from_array(wanted));
        for i in 0..n {
            for j in 0..i {
                let off = fabs(found.torque[i] - found.torque[j]);
                assert!(rows[i] != rows[j] || off <= ROUNDING, "{tried}: {wanted:?}, {rows:?}, {found:?}");
            }
        }
    }
}

/// Checks that the search for the least cost finds the same torques from any start, near and far.
/// From far away, all joints begin at their limits.
#[test]
fn the_search_finds_the_same_from_any_start() {
    let mut rng = Rng(8);
    for tried in 0..100 {
        let (rows, limits) = rng.joints(1);
        if margin(&rows, &limits) < 0.1 {
            continue;
        }
        let mut problem = Problem {
            n: rows.len(),
            rank: 3,
            rows: [Vec3::ZERO; MAX_JOINTS],
            give: limits.weight.map(|weight| 0.1 / weight),
            rounding: 1.0e-14,
        };
        problem.rows[..rows.len()].copy_from_slice(&rows);
        let direction = rng.vector();
        let target = direction * (facets::nearest(&problem, direction).reach * rng.between(0.3, 0.95));
        let near = dual::clipped(&problem, target, Vec3::ZERO).unwrap();
        let made: Vec3 = rows.iter().zip(near).map(|(row, x)| *row * x).sum();
        assert!((made - target).length() <= ROUNDING, "{tried}: {made} for {target}");
        for start in [direction * 1.0e3, direction * -1.0e3, rng.vector() * 1.0e6] {
            let far = dual::clipped(&problem, target, start);
            let far = far.unwrap_or_else(|| panic!("{tried}: nothing from {start}"));
            let off = near.iter().zip(far).map(|(a, b)| fabs(a - b)).fold(0.0, Real::max);
            assert!(off <= 1.0e-8, "{tried}: {off:e} from {start}");
        }
    }
}

/// Checks the level to which the strength of a direction is compared, against its definition: the
/// strongest direction, or five times the strongest wheel if this is less. A wheel with one motor
/// does not count.
#[test]
fn strength_is_relative_to_the_wheels() {
    let mut rng = Rng(7);
    let mut by_wheels = 0;
    for tried in 0..300 {
        let (mut rows, mut limits) = rng.joints(0);
        for k in (0..rows.len()).step_by(2) {
            rows[k] *= 30.0;
        }
        for k in 0..rows.len() {
            // Every third problem has only steer motors, and every third one has some dead motors.
            if (tried % 3 == 0 && k % 2 == 1) || (tried % 3 == 1 && rng.between(0.0, 1.0) < 0.3) {
                limits.peak[k] = 0.0;
            }
        }
        let Some(reach) = Reach::of(&rows, &limits) else { continue };
        let scaled: Vec<Vec3> = rows.iter().zip(limits.peak).map(|(g, t)| *g * t).collect();
        let strongest = singular_values(&scaled)[0];
        let wheels = (0..rows.len() / 2)
            .filter(|i| limits.driven(2 * i) && limits.driven(2 * i + 1))
            .map(|i| singular_values(&scaled[2 * i..2 * i + 2])[1])
            .reduce(Real::max);
        let level = wheels.map_or(strongest, |wheel| Real::min(strongest, 5.0 * wheel));
        by_wheels += u32::from(level < strongest);
        let off = reach.level() / reach.sigma()[0] * strongest / level - 1.0;
        assert!(fabs(off) <= ROUNDING, "{tried}: {off:e}");
    }
    assert!(by_wheels > 30, "{by_wheels}");
}

/// Checks the terms of the weighted mean with numbers computed by hand. Three steer motors with the
/// rows X, 0.5 Y and b Z and equal costs have the singular values 1, 0.5 and b, and K is sqrt 3.
///
/// For b = 0.006, halfway between [`LOST`] and [`WHOLE`], half of the third direction counts. For
/// b = 0.004 it is a quarter of the way: 3/16 - 2/64 = 0.15625. For a torque of (3, 4, 2), z is
/// (3, 8) in the first two axes. So the stray torque is 0.004 sqrt 3 sqrt 73 sqrt 29 / 25 =
/// 0.0127509, at 0.5972725 of the way from 0.002 to 0.02, where the smooth step is 0.6440680.
#[test]
fn the_terms_of_the_mean_have_the_stated_weights() {
    let reach = |b: Real| {
        let rows = [Vec3::X, Vec3::ZERO, Vec3::Y * 0.5, Vec3::ZERO, Vec3::Z * b];
        Reach::of(&rows, &limits(&[1.0, 0.0, 1.0, 0.0, 1.0], &[1.0; 5])).unwrap()
    };
    let weights = |b: Real, torque: Vec3| {
        let reach = reach(b);
        weak::shares(&reach, reach.parts(torque)).map(|share| share.part)
    };
    for (weight, by_hand) in weights(0.004, Vec3::new(3.0, 4.0, 2.0)).into_iter().zip([
        0.15625,
        0.84375 * 0.644_068_0,
        0.84375 * 0.355_932_0,
        0.0,
        0.0,
        0.0,
    ]) {
        assert!(fabs(weight - by_hand) < 1.0e-6, "{weight}, not {by_hand}");
    }
    let half = weights(0.006, Vec3::X);
    assert!(fabs(half[0] - 0.5) < 1.0e-12 && fabs(half[1] + half[2] - 0.5) < 1.0e-12, "{half:?}");
}

/// Checks that an allocation is called deficient exactly if it does not make the wanted torque.
///
/// Four steer motors turn the sphere about axes of the plane, but each one is lifted or lowered by
/// a small angle. The wanted torque is in the plane, so nothing of it is lost. If the costs are
/// equal, the lifts cancel. If not, and the third axis is not controlled, it gets a stray torque.
#[test]
fn stray_torque_is_a_deficiency() {
    let mut strayed = 0;
    for lift in [1.0e-3, 3.0e-3, 6.8e-3, 2.0e-2] {
        for weight in [[1.0, 3.0, 2.0, 5.0], [1.0; 4]] {
            for size in [1.0e-6, 0.1, 3.0, 1.0e3] {
                let (mut rows, mut four) = ([Vec3::Z; 8], JointLimits::NONE);
                for (i, (angle, lift)) in
                    [(0.3, lift), (0.3, -lift), (1.9, lift), (1.9, -lift)].into_iter().enumerate()
                {
                    let (sin, cos) = crate::real::sincos(angle);
                    rows[2 * i] = Vec3::new(cos, sin, lift);
                    (four.peak[2 * i], four.weight[2 * i]) = (1.0, weight[i]);
                }
                let wanted = Vec3::new(0.3, -0.2, 0.0) * size;
                let found = allocate(&rows, &four, wanted);
                let terms: Real = rows.iter().zip(found.torque).map(|(g, tau)| g.length() * fabs(tau)).sum();
                let off = (made(&rows, &found) - wanted * found.scale).length();
                assert_eq!(found.deficient, off > 1.0e-10 * terms, "{lift}, {weight:?}, {size}: {found:?}");
                strayed += u32::from(found.deficient);
            }
        }
    }
    assert_eq!(strayed, 8, "the two smallest lifts with different costs stray");
    // A line: two steer motors that act about X, except for 1e-4. The second one costs four times
    // as much, so it makes a fifth of the torque. The torque about Y is uncontrolled.
    let rows = [Vec3::new(1.0, 1.0e-4, 0.0), Vec3::Z, Vec3::new(1.0, -1.0e-4, 0.0), Vec3::Z];
    let two = limits(&[1.0, 0.0, 1.0, 0.0], &[1.0, 1.0, 4.0, 1.0]);
    let found = allocate(&rows, &two, Vec3::X * 0.5);
    assert!(fabs(found.torque[0] - 0.4) < 1.0e-9 && fabs(found.torque[2] - 0.1) < 1.0e-9, "{found:?}");
    assert!(found.deficient && found.scale == 1.0, "{found:?}");
}

/// Checks that rounding is no deficiency: the torque of one motor, and those of two motors, are
/// made in full in every direction that these motors have.
#[test]
fn what_few_motors_can_make_is_not_deficient() {
    let mut rng = Rng(3);
    for tried in 0..100 {
        let first = rng.vector();
        let other = rng.vector();
        let second = other - first * (other.dot(first) / first.length_squared());
        let one = limits(&[1.0; 2], &[1.0; 2]);
        for (rows, wanted) in [
            (&[first][..], first * 0.3),
            (&[first, second][..], first * 0.3),
            (&[first, second][..], first * 0.3 + second * 0.2),
        ] {
            let found = allocate(rows, &one, wanted);
            assert!(!found.deficient && found.scale == 1.0, "{tried}: {found:?}");
            assert!((made(rows, &found) - wanted).length() < 1.0e-12, "{tried}: {found:?}");
        }
    }
}

/// Checks that units do not matter. Rows, limits and torques are multiplied by powers of two, which
/// cause no rounding, so the result must be the same to the last bit. Of weights, only ratios
/// matter.
#[test]
fn units_do_not_matter() {
    let mut rng = Rng(9);
    for tried in 0..200 {
        let (mut rows, limits) = rng.joints(1);
        rows.truncate(rng.whole(2, 9) as usize);
        if tried % 2 == 1 {
            // Weak in one direction.
            rows.iter_mut().for_each(|row| row.z *= 4.0e-3);
        }
        let wanted = rng.vector() * [0.1, 1.0, 10.0][tried % 3];
        let found = allocate(&rows, &limits, wanted);
        let units = [(64.0, 1.0, 1.0), (1.0, 64.0, 1.0), (1.0, 1.0, 64.0), (0.125, 0.25, 0.5)];
        for (lever, force, cost) in units {
            let rows: Vec<Vec3> = rows.iter().map(|row| *row * lever).collect();
            let other = JointLimits {
                peak: limits.peak.map(|peak| peak * force),
                weight: limits.weight.map(|weight| weight * cost),
            };
            let again = allocate(&rows, &other, wanted * (lever * force));
            let same = Allocation { torque: found.torque.map(|tau| tau * force), ..found };
            assert_eq!(again, same, "{tried}: {lever}, {force}, {cost}");
        }
    }
}

/// Checks rows that make no torque, and products of row and limit that are too large for a number:
/// such joints count as not driven.
#[test]
fn joints_without_a_finite_torque_count_as_none() {
    for joints in [4, 6] {
        let all = limits(&[1.0; MAX_JOINTS], &[1.0; MAX_JOINTS]);
        let none: Vec<Vec3> = (0..joints).map(|_| Vec3::ZERO).collect();
        assert_eq!(allocate(&none, &all, Vec3::X), Allocation::nothing(0.0, true));
        assert_eq!(capability(&none, &all, Vec3::X), 0.0);
        let huge = 0.5 * Real::MAX;
        let rows: Vec<Vec3> = CUBE.iter().copied().cycle().take(joints).map(|row| row * huge).collect();
        let strong = limits(&[huge; MAX_JOINTS], &[1.0; MAX_JOINTS]);
        assert_eq!(allocate(&rows, &strong, Vec3::X), Allocation::nothing(0.0, true));
    }
    for direction in
        [Vec3::ZERO, Vec3::NAN, Vec3::new(Real::INFINITY, 0.0, 0.0), Vec3::new(0.0, Real::NAN, 1.0)]
    {
        assert_eq!(capability(&CUBE, &limits(&[1.0; 4], &[1.0; 4]), direction), 0.0);
    }
}

/// Checks that the clipped allocation scales the torques of least cost down by one factor, so that
/// the joint that exceeds its limit most comes to its limit. The last joint is dead, and its row is
/// no number.
#[test]
fn clipped_torques_are_those_of_least_cost_scaled_down() {
    let mut rng = Rng(10);
    let (mut tried, mut clipped) = (0, 0);
    while tried < 300 {
        let (mut rows, mut limits) = rng.joints(0);
        let n = rows.len() - 1;
        limits.weight = limits.weight.map(|_| rng.between(0.5, 2.0));
        let even = JointLimits { peak: limits.weight.map(|w| 1.0 / crate::real::sqrt(w)), ..limits };
        if margin(&rows[..n], &limits) < 0.15 || margin(&rows[..n], &even) < 0.15 {
            continue;
        }
        (rows[n], limits.peak[n]) = (Vec3::NAN, 0.0);
        tried += 1;
        let wanted = rng.vector() * 2.0;
        let stronger = JointLimits { peak: limits.peak.map(|peak| 1024.0 * peak), ..limits };
        let free = allocate(&rows, &stronger, wanted);
        assert_eq!(free.scale, 1.0);
        let most = (0..n).map(|k| fabs(free.torque[k]) / limits.peak[k]).fold(0.0, Real::max);
        let found = allocate_clipped(&rows, &limits, wanted);
        assert!(fabs(found.scale - Real::min(1.0, 1.0 / most)) < 1.0e-9, "{tried}: {found:?}, {most}");
        for k in 0..=n {
            assert!(fabs(found.torque[k] - free.torque[k] * found.scale) < 1.0e-9, "{tried}: {found:?}");
        }
        clipped += u32::from(most > 1.0);
    }
    assert!(clipped > 30, "{clipped}");
    // Close to a plane, it calls the other method.
    let rows = [Vec3::new(1.0, 0.1, 0.0), Vec3::new(-0.2, 1.0, 0.0), Vec3::new(0.6, 0.7, 1.0e-3)];
    let three = limits(&[1.0, 0.8, 0.7], &[1.0, 2.0, 1.5]);
    for wanted in [Vec3::new(0.4, -0.3, 0.02), Vec3::new(1.9, 0.7, 0.3)] {
        assert_eq!(allocate_clipped(&rows, &three, wanted), allocate(&rows, &three, wanted));
    }
}

/// Checks the allocation in a tick of three wheels: it uses all six joints.
#[test]
fn a_tick_of_three_wheels_uses_all_joints() {
    #[derive(Clone, Copy)]
    struct Three;
    impl Count for Three {
        fn wheels(self) -> usize {
            3
        }
    }
    let mut rng = Rng(11);
    for _ in 0..50 {
        let rows: Vec<Vec3> = (0..6).map(|_| rng.vector()).collect();
        let six = limits(&[1.0; 6], &[1.0; 6]);
        let wanted = rng.vector() * 3.0;
        let found = allocate_in_tick(Three, &rows, &six, &Gives::of(&six, 6), wanted);
        assert_eq!(found, allocate(&rows, &six, wanted));
        assert!(found.torque[4] != 0.0 && found.torque[5] != 0.0, "{found:?}");
    }
}

/// Checks four joints of which three lie in one plane except for rounding. The fourth alone makes
/// the torque out of the plane, and is at its limit. The three others must make the rest at the
/// least cost, as three joints alone do. The rows are once of size 1 and once of size 1000.
#[test]
fn three_joints_in_a_plane_do_not_fight_each_other() {
    let mut rng = Rng(12);
    for size in [1.0, 1000.0] {
        let mut tried = 0;
        while tried < 100 {
            let (a, b, last) = (rng.vector(), rng.vector(), rng.vector());
            let third = a * rng.between(-1.0, 1.0) + b * rng.between(-1.0, 1.0);
            let rows = [a, b, third, last].map(|row| row * size);
            let weight = [1.0, 2.0, 3.0, 1.5];
            let four = limits(&[1.0, 1.0, 1.0, 0.3], &weight);
            if margin(&rows, &four) < 0.1 || third.length() < 0.3 {
                continue;
            }
            tried += 1;
            let flat = (rows[0] * 0.05 + rows[1] * 0.07) * 0.5;
            let found = allocate(&rows, &four, (rows[3] * 0.3 + flat) * 2.0);
            let three = allocate(&rows[..3], &limits(&[1.0; 3], &weight[..3]), flat);
            assert!(fabs(found.scale - 0.5) < 1.0e-9 && three.scale == 1.0, "{tried}: {found:?}");
            assert!(fabs(found.torque[3] - 0.3) < 1.0e-9, "{tried}: {found:?}");
            for k in 0..3 {
                assert!(fabs(found.torque[k] - three.torque[k]) < 1.0e-6, "{tried}: {found:?}, {three:?}");
            }
        }
    }
}
