//! Interior singularities compared with a search over steer angles, and the margin of the motors
//! (physics notes, section 3).

use crate::prelude::*;
use hbot_core::design::device::DeviceError;
use hbot_core::design::singularity::{
    Indices, Meeting, actuation_margin, closest_approach, interior_margin_over_all,
};
use hbot_testing::prototype::wheels as prototype_wheels;

/// A contact circle: the points at the angle `cone` from `axis`.
#[derive(Debug, Clone, Copy)]
struct Circle {
    axis: Vec3,
    cone: f64,
}

impl Circle {
    /// Returns the point at the steer angle `t`, which counts from an arbitrary zero.
    fn at(&self, t: f64) -> Vec3 {
        let e1 = self.axis.any_orthonormal_vector();
        let e2 = self.axis.cross(e1);
        let (s, c) = t.sin_cos();
        self.axis * self.cone.cos() + (e1 * c + e2 * s) * self.cone.sin()
    }

    /// Returns the angle between the line through `u` and the centre and this circle, rad.
    fn off(&self, u: Vec3) -> f64 {
        [u, -u]
            .map(|u| (u.dot(self.axis).clamp(-1.0, 1.0).acos() - self.cone).abs())
            .into_iter()
            .fold(9.0, f64::min)
    }

    fn wheel(&self) -> WheelSpec {
        WheelSpec { axis: self.axis, cone: self.cone, ..prototype_wheels()[0] }
    }
}

fn direction(rng: &mut Rng) -> Vec3 {
    loop {
        let v = rng.vector(1.0);
        if (0.01..1.0).contains(&v.length_squared()) {
            return v.normalize();
        }
    }
}

fn circle(rng: &mut Rng) -> Circle {
    Circle { axis: direction(rng), cone: rng.between(0.1, 3.0) }
}

/// Returns a random circle that goes through `u` or through `-u`.
fn through(rng: &mut Rng, u: Vec3) -> Circle {
    loop {
        let axis = direction(rng);
        let cone = axis.dot(u).acos();
        if (0.1..core::f64::consts::PI - 0.1).contains(&cone) {
            let cone = if rng.once_in(2) { cone } else { core::f64::consts::PI - cone };
            return Circle { axis, cone };
        }
    }
}

/// Returns the smallest distance of a line through the centre from all circles, rad. It tries `n`
/// lines through the first circle.
fn brute_force(circles: &[Circle], n: u32) -> f64 {
    let step = core::f64::consts::TAU / f64::from(n);
    (0..n)
        .map(|k| {
            let u = circles[0].at(step * f64::from(k));
            circles[1..].iter().map(|c| c.off(u)).fold(0.0, f64::max)
        })
        .fold(9.0, f64::min)
}

fn judged(circles: &[Circle]) -> Result<Device, DeviceError> {
    let wheels: Vec<WheelSpec> = circles.iter().map(Circle::wheel).collect();
    Device::new(0.1, 0.5, &wheels)
}

/// Lines are tried every 2 pi / 4000 = 1.6 mrad. A distance that is truly zero is therefore found
/// as less than half of that, and a larger result means that the distance is not zero.
#[test]
fn two_and_three_wheels_are_judged_like_brute_force_judges_them() {
    const GRID: f64 = core::f64::consts::TAU / 4000.0;
    let mut rng = Rng(7);
    let (mut legal, mut singular) = ([0; 2], [0; 2]);
    for case in 0..600 {
        let wheels = 2 + case % 2;
        let circles: Vec<Circle> = (0..wheels).map(|_| circle(&mut rng)).collect();
        let distance = brute_force(&circles, 4000);
        let verdict = judged(&circles);
        if distance > GRID {
            assert!(verdict.is_ok(), "{wheels} wheels, {distance} rad apart: {verdict:?}");
            legal[wheels - 2] += 1;
        } else if wheels == 2 {
            // Two circles this close nearly always cross. Circles that only touch are left to the
            // next test.
            let crosses = brute_force(&circles, 400_000) < GRID / 90.0;
            assert_eq!(verdict.is_err(), crosses, "{distance} rad apart");
            singular[0] += 1;
        }
    }
    assert!(legal[0] > 20 && legal[1] > 100 && singular[0] > 100, "{legal:?} {singular:?}");
}

#[test]
fn wheels_that_can_all_reach_one_line_are_refused() {
    let mut rng = Rng(8);
    for case in 0..400 {
        let wheels = 2 + case % 4;
        let u = direction(&mut rng);
        let circles: Vec<Circle> = (0..wheels).map(|_| through(&mut rng, u)).collect();
        let verdict = judged(&circles);
        assert!(matches!(verdict, Err(DeviceError::InteriorSingular { .. })), "{wheels} wheels: {verdict:?}");
        // If one circle is 10 mrad smaller, three or more circles no longer share a line, except by
        // chance.
        if wheels > 2 {
            let mut apart = circles;
            apart[0].cone -= 0.01;
            if brute_force(&apart, 20_000) > 1e-3 {
                assert!(judged(&apart).is_ok(), "{wheels} wheels");
            }
        }
    }
}

#[test]
fn wheels_on_one_circle_are_refused_with_any_wheel_that_crosses_it() {
    let mut rng = Rng(11);
    for _ in 0..100 {
        let u = direction(&mut rng);
        let [a, c] = [0; 2].map(|_| through(&mut rng, u));
        let opposite = Circle { axis: -a.axis, ..a };
        let sets: [&[Circle]; 6] =
            [&[a, a, a], &[a, opposite, a], &[a, a, c], &[a, opposite, c], &[c, a, a], &[a, a, opposite, c]];
        for circles in sets {
            let verdict = judged(circles);
            assert!(matches!(verdict, Err(DeviceError::InteriorSingular { .. })), "{circles:?}: {verdict:?}");
        }
    }
}

#[test]
fn two_wheels_of_almost_one_axis_are_refused() {
    let mut rng = Rng(12);
    for case in 0..300 {
        let apart = 10.0_f64.powf(rng.between(-8.0, -2.0));
        let (axis, cone) = (direction(&mut rng), rng.between(0.1, 1.4));
        let tilted = (axis + axis.any_orthonormal_vector() * apart).normalize();
        let (meeting, other) =
            if case % 2 == 0 { (Meeting::Collocated, tilted) } else { (Meeting::Antipodal, -tilted) };
        // The circles are equally large and not concentric, so they cross.
        let error = judged(&[Circle { axis, cone }, Circle { axis: other, cone }]).err();
        let want = DeviceError::InteriorSingular { wheels: [0, 1], meeting };
        assert_eq!(error, Some(want), "{apart:e} rad apart, cone {cone}");
    }
}

/// Where the circles of two wheels of almost one axis cross is known badly, so it must not matter
/// which wheels come first.
#[test]
fn a_common_line_is_found_in_every_order_of_the_wheels() {
    let mut rng = Rng(16);
    for _ in 0..300 {
        let u = direction(&mut rng);
        let [a, c] = [0; 2].map(|_| through(&mut rng, u));
        if a.axis.cross(c.axis).length() < 0.3 {
            continue;
        }
        let apart = 10.0_f64.powf(rng.between(-8.0, -2.0));
        let axis = (a.axis + u.cross(a.axis) * apart).normalize();
        let cone = axis.dot(u).acos();
        let same_side = a.cone.cos() * a.axis.dot(u) > 0.0;
        let b = Circle { axis, cone: if same_side { cone } else { core::f64::consts::PI - cone } };
        for circles in [[a, b, c], [b, a, c], [a, c, b], [c, a, b]] {
            let verdict = judged(&circles);
            assert!(
                matches!(verdict, Err(DeviceError::InteriorSingular { .. })),
                "{apart:e} rad apart: {verdict:?}"
            );
        }
    }
}

#[test]
fn a_line_through_the_point_where_two_circles_touch_counts() {
    let mut rng = Rng(13);
    let mut tried = 0;
    while tried < 200 {
        let u = direction(&mut rng);
        let side = u.any_orthonormal_vector();
        let cones = [0; 2].map(|_| rng.between(0.1, 2.0));
        let outside = rng.once_in(2);
        let apart = if outside { cones[0] + cones[1] } else { (cones[0] - cones[1]).abs() };
        // If the axes are far from parallel, rounding stays below the tolerance of the check.
        if !(1.0..2.1).contains(&apart) {
            continue;
        }
        tried += 1;
        // Two circles that touch at u, from outside or from inside, and a third one through u.
        let touching = |cone: f64, side: Vec3| Circle { axis: u * cone.cos() + side * cone.sin(), cone };
        let second = touching(cones[1], if outside { -side } else { side });
        let verdict = judged(&[touching(cones[0], side), second, through(&mut rng, u)]);
        assert!(matches!(verdict, Err(DeviceError::InteriorSingular { .. })), "{cones:?}: {verdict:?}");
    }
}

/// The planes of two circles meet in a straight line. If this line passes outside the sphere, the
/// circles do not cross, and it does not matter that a third plane meets the other two out there.
#[test]
fn planes_that_meet_outside_the_sphere_are_no_singularity() {
    let mut rng = Rng(14);
    let mut tried = 0;
    while tried < 100 {
        let [a, b] = [0; 2].map(|_| circle(&mut rng));
        let sign = if rng.once_in(2) { 1.0 } else { -1.0 };
        // The nearest point to the centre on the planes of circle a and of circle b or its mirror
        // image.
        let planes = Mat3::from_cols(a.axis, b.axis, a.axis.cross(b.axis)).transpose();
        let nearest = planes.inverse() * Vec3::new(a.cone.cos(), sign * b.cone.cos(), 0.0);
        let axis = direction(&mut rng);
        let height = nearest.dot(axis);
        if nearest.length() < 1.03 || height.abs() > 0.99 {
            continue;
        }
        let circles = [a, b, Circle { axis, cone: height.acos() }];
        // Each two of the circles cross somewhere, but no line meets all three.
        let crosses = |i: usize, j: usize| judged(&[circles[i], circles[j]]).is_err();
        if !(crosses(0, 1) && crosses(0, 2) && crosses(1, 2)) {
            continue;
        }
        if brute_force(&circles, 4000) > core::f64::consts::TAU / 4000.0 {
            tried += 1;
            assert!(judged(&circles).is_ok(), "{circles:?}");
        }
    }
}

#[test]
fn the_closest_approach_of_two_circles_is_that_of_their_points() {
    let mut rng = Rng(9);
    for _ in 0..60 {
        let [a, b] = [circle(&mut rng), circle(&mut rng)];
        // A safe pair of other wheels makes the device legal, whatever these two do.
        let [c, d] = prototype_wheels();
        let device = Device::new(0.1, 0.5, &[a.wheel(), b.wheel(), c, d]).unwrap();
        const N: u32 = 500;
        let grid = core::f64::consts::TAU / f64::from(N);
        for (meeting, sign) in [(Meeting::Collocated, 1.0), (Meeting::Antipodal, -1.0)] {
            let mut nearest = 9.0_f64;
            for i in 0..N {
                let u = a.at(grid * f64::from(i));
                // The point of circle b nearest to u is on the great circle through u and the axis
                // of b.
                nearest = nearest.min(((u * sign).dot(b.axis).clamp(-1.0, 1.0).acos() - b.cone).abs());
            }
            let claimed = closest_approach(&device.wheels()[0], &device.wheels()[1], meeting);
            assert!((nearest - claimed).abs() < grid, "{meeting:?}: {nearest} against {claimed}");
        }
    }
}

#[test]
fn the_least_margin_of_two_wheels_is_met_and_never_passed() {
    let mut rng = Rng(10);
    let mut tried = 0;
    while tried < 40 {
        let circles = [circle(&mut rng), circle(&mut rng)];
        let Ok(device) = judged(&circles) else { continue };
        tried += 1;
        let distance = brute_force(&circles, 4000);
        let margin = (1.0 - distance.cos()).sqrt();
        // The grid is 1.6 mrad, and the margin changes by at most 1/sqrt 2 of the angle.
        assert!((interior_margin_over_all(&device) - margin).abs() < 1e-3, "{distance}");
    }
}

/// Returns the squares of the smallest and the largest singular value of `rows`. They are
/// eigenvalues of the sum of outer products, from the trigonometric solution of its characteristic
/// polynomial (Smith 1961).
fn extremes(rows: &[Vec3]) -> [f64; 2] {
    let mut moment = Mat3::ZERO;
    for g in rows {
        moment += Mat3::from_cols(*g * g.x, *g * g.y, *g * g.z);
    }
    let mean = (moment.x_axis.x + moment.y_axis.y + moment.z_axis.z) / 3.0;
    let rest = moment - Mat3::from_diagonal(Vec3::splat(mean));
    let size = (rest.to_cols_array().iter().map(|x| x * x).sum::<f64>() / 6.0).sqrt();
    let angle = (0.5 * (rest * (1.0 / size)).determinant()).clamp(-1.0, 1.0).acos() / 3.0;
    [angle + core::f64::consts::TAU / 3.0, angle].map(|angle| mean + 2.0 * size * angle.cos())
}

#[test]
fn the_actuation_margin_is_that_of_the_joints_with_a_motor() {
    let mut rng = Rng(15);
    let [a, b] = prototype_wheels();
    let c = WheelSpec { axis: Vec3::new(0.2, -0.7, 0.6), ..a };
    let device = Device::new(0.102, 0.467, &[a, b, c]).unwrap();
    for _ in 0..300 {
        let posture = Posture::new(&device, &[0; 3].map(|_| rng.between(-3.2, 3.2)));
        let driven = [0; 6].map(|_| !rng.once_in(3));
        let rows: Vec<Vec3> =
            posture.rows().iter().zip(driven).filter(|(_, has)| *has).map(|(row, _)| *row).collect();
        let margin = actuation_margin(&posture, &driven);
        if rows.len() < 3 {
            assert!(margin < 16.0 * f64::EPSILON, "{driven:?}: {margin}");
        } else {
            // If two eigenvalues are equal, the trigonometric solution is exact to the square root
            // of rounding.
            let [least, most] = extremes(&rows);
            assert!((margin * margin - least / most).abs() < 1e-7, "{driven:?}: {margin}");
        }
    }
    let posture = Posture::new(&device, &[0.0; 3]);
    assert_eq!(actuation_margin(&posture, &[false; 6]), 0.0);
}

#[test]
fn joints_that_turn_nothing_have_indices_of_zero() {
    let sets: [&[Vec3]; 2] = [&[], &[Vec3::ZERO; 4]];
    for rows in sets {
        let none = Indices { spectral: 0.0, frobenius: 0.0, manipulability: f64::INFINITY };
        assert_eq!(Indices::of(rows), none);
    }
}
