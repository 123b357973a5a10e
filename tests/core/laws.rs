//! Springs are gradients of their energies, dampers absorb energy, and no law depends on the sign
//! of a quaternion (physics notes, section 6).

use crate::designs::{impedance, orientation, vector};
use crate::prelude::*;
use hbot_core::render::impedance::{
    Elastic, damper, first_order_law, geodesic_law, is_impedance, quaternion_law,
};
use hbot_testing::rng::Rng;
use proptest::prelude::*;

type Law = fn(Quat, Quat, &Mat3) -> Elastic;

fn geodesic(desired: Quat, actual: Quat, stiffness: &Mat3) -> Elastic {
    geodesic_law(desired, actual, stiffness, Vec3::ZERO).0
}

const LAWS: [(&str, Law); 2] = [("quaternion", quaternion_law), ("geodesic", geodesic)];

/// Returns the largest entry of a matrix, to which torques and energies are proportional.
fn size(m: &Mat3) -> f64 {
    m.to_cols_array().iter().fold(0.0, |a: f64, x| a.max(x.abs()))
}

/// Returns the work that a torque does on the sphere along a closed path, J, by the midpoint rule
/// in `n` steps.
fn loop_work(path: impl Fn(f64) -> Quat, n: u32, torque: impl Fn(Quat) -> Vec3) -> f64 {
    let at = |k: f64| path(k / f64::from(n));
    (0..n)
        .map(|k| {
            let k = f64::from(k);
            torque(at(k + 0.5)).dot(rotation::difference(at(k + 1.0), at(k)))
        })
        .sum()
}

/// Returns a closed path through orientations up to 2.9 rad from `desired`, where the geodesic law
/// is still smooth.
fn around(desired: Quat, [a, b, c]: [Vec3; 3]) -> impl Fn(f64) -> Quat {
    move |s| {
        let (s1, c1) = (core::f64::consts::TAU * s).sin_cos();
        rotation::exp(a + b * s1 + c * c1) * desired
    }
}

proptest! {
    #[test]
    fn the_sign_of_a_quaternion_is_not_felt(desired in orientation(), actual in orientation(), k in impedance(5.0)) {
        for (name, law) in LAWS {
            let expected = law(desired, actual, &k);
            for (d, a) in [(-desired, actual), (desired, -actual), (-desired, -actual)] {
                prop_assert_eq!(law(d, a, &k), expected, "{}", name);
            }
        }
        let turn = desired.conjugate() * actual;
        prop_assert_eq!(rotation::log(-turn), rotation::log(turn));
    }

    #[test]
    fn near_its_reference_every_spring_is_stiffness_times_angle(
        desired in orientation(),
        axis in vector(1.0),
        k in impedance(5.0),
    ) {
        for angle in [1e-3, 1e-6, 1e-9] {
            let p = axis * angle;
            let q = desired * rotation::exp(p);
            for (name, law) in LAWS {
                let want = -(desired * (k * p));
                // The term of second order is half the angle. For smaller angles the rounding of a
                // unit quaternion dominates.
                let within = size(&k) * (2.0 * angle * angle + 16.0 * f64::EPSILON);
                prop_assert!((law(desired, q, &k).torque - want).length() < within, "{name} at {angle}");
            }
        }
    }

    #[test]
    fn equal_stiffness_all_around_gives_the_sine_or_the_angle(desired in orientation(), turn in vector(3.1)) {
        let k = Mat3::from_diagonal(Vec3::splat(2.0));
        let q = desired * rotation::exp(turn);
        let angle = turn.length();
        let axis = desired * turn.normalize_or_zero();
        // The tolerance is a few roundings of a torque of up to 6 N m. The cotangent in M adds none
        // near a half turn.
        let within = 64.0 * f64::EPSILON * 6.0;
        prop_assert!((quaternion_law(desired, q, &k).torque + axis * (2.0 * angle.sin())).length() < within);
        prop_assert!((geodesic(desired, q, &k).torque + axis * (2.0 * angle)).length() < within);
    }

    #[test]
    fn a_damper_never_gives_energy(
        desired in orientation(),
        d in impedance(0.1),
        omega in vector(30.0),
        omega_d in vector(30.0),
    ) {
        let relative = omega - omega_d;
        let power = damper(desired, &d, omega, omega_d).dot(relative);
        // The damper absorbs at least the smallest eigenvalue, 0.01 here, times the squared rate,
        // except for rounding.
        let rounding = 64.0 * f64::EPSILON * size(&d) * relative.length_squared();
        prop_assert!(power <= -0.00999 * relative.length_squared() + rounding, "{power} W");
    }
}

/// Shows that the tests above can detect a violation: a law that is not a gradient delivers energy.
#[test]
fn stiffness_times_the_rotation_vector_does_net_work_where_stiffness_is_uneven() {
    let k = Mat3::from_diagonal(Vec3::new(1.0, 4.0, 9.0));
    let path = around(Quat::IDENTITY, [Vec3::new(0.9, 0.6, -0.4), Vec3::X * 0.8, Vec3::new(0.0, 0.6, 0.6)]);
    let naive = loop_work(&path, 2000, |q| -(k * rotation::log(q)));
    assert!(naive.abs() > 0.1, "{naive} J");
    for (name, law) in LAWS {
        let work = loop_work(&path, 2000, |q| law(Quat::IDENTITY, q, &k).torque);
        assert!(work.abs() < 1e-4, "{name}: {work} J");
    }
}

#[test]
fn at_exactly_a_half_turn_the_spring_keeps_pulling_the_way_it_did() {
    let k = Mat3::from_diagonal(Vec3::splat(2.0));
    let half_turn = rotation::from_parts(0.0, Vec3::Y);
    let pi = core::f64::consts::PI;
    for side in [1.0, -1.0] {
        let branch = Vec3::Y * (side * 3.1);
        for q in [half_turn, -half_turn] {
            let (spring, p) = geodesic_law(Quat::IDENTITY, q, &k, branch);
            assert_eq!(p, Vec3::Y * (side * pi));
            assert!((spring.torque + Vec3::Y * (side * 2.0 * pi)).length() < 1e-15);
        }
    }
}

/// The first-order law is a gradient if K is isotropic. If not, it delivers energy along a closed
/// path.
#[test]
fn the_first_order_law_is_passive_for_one_stiffness_about_all_axes_only() {
    let path = around(Quat::IDENTITY, [Vec3::X * 0.1, Vec3::new(0.9, 0.2, 0.1), Vec3::new(0.0, 0.3, 0.9)]);
    let work = |k: &Mat3, law: Law| loop_work(&path, 4000, |q| law(Quat::IDENTITY, q, k).torque);
    let (even, uneven) = (Mat3::IDENTITY, Mat3::from_diagonal(Vec3::new(1.0, 4.0, 9.0)));
    // The error of the midpoint rule is about 1/n² J.
    assert!(work(&even, first_order_law).abs() < 1e-6, "{} J", work(&even, first_order_law));
    assert!(work(&uneven, quaternion_law).abs() < 1e-6, "{} J", work(&uneven, quaternion_law));
    assert!(work(&uneven, first_order_law).abs() > 0.1, "{} J", work(&uneven, first_order_law));
}

#[test]
fn the_first_order_law_is_the_exact_ones_limit_by_its_orders() {
    let axis = Vec3::new(0.6, -0.48, 0.64);
    let desired = rotation::exp(Vec3::new(1.0, 2.0, -0.5));
    for (k, order) in [(Mat3::IDENTITY, 3.0), (Mat3::from_diagonal(Vec3::new(1.0, 4.0, 9.0)), 2.0)] {
        let off = |angle: f64| {
            let q = desired * rotation::exp(axis * angle);
            [quaternion_law(desired, q, &k), geodesic(desired, q, &k)]
                .map(|exact| (exact.torque - first_order_law(desired, q, &k).torque).length())
        };
        let (coarse, fine) = (off(0.02), off(0.01));
        for (coarse, fine) in coarse.iter().zip(fine) {
            let measured = (coarse / fine).log2();
            assert!((measured - order).abs() < 0.02, "{measured}");
        }
    }
    // 2 K sin(angle/2), and the energy is the integral of that.
    let q = desired * rotation::exp(axis * 1.3);
    let got = first_order_law(desired, q, &Mat3::IDENTITY);
    assert!((got.torque + desired * axis * (2.0 * 0.65_f64.sin())).length() < 4.0 * f64::EPSILON);
    assert!((got.energy - 4.0 * (1.0 - 0.65_f64.cos())).abs() < 4.0 * f64::EPSILON);
}

/// Returns the elements of a symmetric matrix with the eigenvalues `values` and random axes.
fn with_eigenvalues(rng: &mut Rng, values: [f64; 3]) -> [[f64; 3]; 3] {
    let r = Mat3::from_quat(rotation::exp(rng.vector(3.0)));
    let m = r * Mat3::from_diagonal(Vec3::from(values)) * r.transpose();
    ((m + m.transpose()) * 0.5).to_cols_array_2d()
}

/// Checks that the torque delivers the power by which the energy 1/2 pᵀ K p falls, for every motion
/// of the sphere. The rate of the sphere is J p', with the left Jacobian J of the exponential map,
/// so Jᵀ T = -K p.
#[test]
fn the_power_of_the_geodesic_torque_comes_from_its_energy() {
    let mut rng = Rng(23);
    for case in 0..400 {
        // The law uses a series for turns below 0.3 rad.
        let t = if case % 2 == 0 { rng.between(0.01, 0.3) } else { rng.between(0.3, 3.1) };
        let p = rng.vector(1.0).normalize() * t;
        let values = [0; 3].map(|_| 10.0_f64.powf(rng.between(-1.0, 1.0)));
        let k = Mat3::from_cols_array_2d(&with_eigenvalues(&mut rng, values));
        let torque = geodesic(Quat::IDENTITY, rotation::exp(p), &k).torque;
        // Jᵀ = I - (1 - cos t)/t² [p] + (t - sin t)/t³ [p]²
        let half = (0.5 * t).sin();
        let across = p.cross(torque);
        let power =
            torque - across * (2.0 * half * half / (t * t)) + p.cross(across) * ((t - t.sin()) / (t * t * t));
        let off = (power + k * p).length();
        assert!(off <= 16.0 * f64::EPSILON * size(&k) * t, "{off:e} N m at {t} rad");
    }
}

fn is_legal(m: &[[f64; 3]; 3]) -> bool {
    is_impedance(&Mat3::from_cols_array_2d(m))
}

#[test]
fn a_stiffness_is_legal_if_it_pushes_away_in_no_direction() {
    let mut rng = Rng(21);
    for _ in 0..400 {
        let most = 10.0_f64.powf(rng.between(-9.0, 6.0));
        let [a, b] = [0; 2].map(|_| most * rng.between(0.01, 1.0));
        for values in [[a, b, most], [0.0, b, most], [0.0, 0.0, most]] {
            assert!(is_legal(&with_eigenvalues(&mut rng, values)), "{values:?}");
        }
        for values in [[-a, b, most], [-a, 0.0, most], [-a, -b, most]] {
            assert!(!is_legal(&with_eigenvalues(&mut rng, values)), "{values:?}");
        }
    }
    assert!(is_legal(&[[0.0; 3]; 3]));
    for least in [f64::from_bits(1), 1e-310, f64::MIN_POSITIVE] {
        assert!(is_impedance(&Mat3::from_diagonal(Vec3::splat(least))), "{least:e}");
    }
    for k in [1e-6, 1.0, 1e6] {
        for [i, j] in [[0, 1], [0, 2], [1, 2]] {
            // The eigenvalues are 2.2 k, -0.2 k and 0. The only negative minor is that of i and j.
            let mut m = [[0.0; 3]; 3];
            (m[i][i], m[j][j], m[i][j], m[j][i]) = (k, k, 1.2 * k, 1.2 * k);
            assert!(!is_legal(&m), "{m:?}");
            (m[i][i], m[j][j]) = (0.0, 0.0);
            assert!(!is_legal(&m), "{m:?}");
        }
        for [d, e, f] in [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]] {
            // The eigenvalues are 2.1 k and twice 0.45 k. With all elements beside the diagonal
            // negated, they are twice 1.55 k and -0.1 k. Then only the determinant is negative.
            let matrix = |x: f64| [[k, d * x, e * x], [d * x, k, f * x], [e * x, f * x, k]];
            assert!(is_legal(&matrix(0.55 * k)) && !is_legal(&matrix(-0.55 * k)), "{d} {e} {f}, {k}");
        }
    }
    // Diagonals of zeros and at least one negative number.
    for bits in 1..8_u32 {
        let diagonal = [0, 1, 2].map(|k| if (bits >> k) & 1 == 1 { -1.0 } else { 0.0 });
        assert!(!is_impedance(&Mat3::from_diagonal(Vec3::from(diagonal))), "{diagonal:?}");
    }
}

#[test]
fn a_stiffness_is_symmetric_up_to_rounding_at_any_scale() {
    let mut rng = Rng(22);
    for _ in 0..100 {
        let size = 10.0_f64.powf(rng.between(-9.0, 6.0));
        let symmetric = with_eigenvalues(&mut rng, [0.2 * size, 0.5 * size, size]);
        for [i, j] in [[0, 1], [0, 2], [1, 2], [1, 0], [2, 0], [2, 1]] {
            let mut m = symmetric;
            m[i][j] *= 1.0 + 2.0 * f64::EPSILON;
            assert!(is_legal(&m), "{m:?}");
            m[i][j] += 1e-9 * size;
            assert!(!is_legal(&m), "{m:?}");
        }
    }
}
