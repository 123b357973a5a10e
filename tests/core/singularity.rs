//! Interior singularities compared with a search over steer angles (physics notes, section 3).

use crate::rng::Rng;
use hbot_core::device::DeviceError;
use hbot_core::singularity::{Meeting, closest_approach, interior_margin_over_all};
use hbot_core::{Device, Vec3, WheelSpec};
use hbot_testing::prototype::wheels as prototype_wheels;

/// A contact circle: the points at the angle `cone` from `axis`.
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
        // Each circle goes through u or through -u.
        let circles: Vec<Circle> = (0..wheels)
            .map(|_| {
                loop {
                    let axis = direction(&mut rng);
                    let cone = axis.dot(u).acos();
                    if (0.1..core::f64::consts::PI - 0.1).contains(&cone) {
                        let cone = if rng.once_in(2) { cone } else { core::f64::consts::PI - cone };
                        break Circle { axis, cone };
                    }
                }
            })
            .collect();
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
