//! The caster effect of a wheel: if the sphere reverses, its heading error grows by exp(cot a x
//! angle turned) (physics notes, section 4). This is a property of the mechanism and not an error
//! of a method. It is measured here, and no other test compares trajectories across reversals.

use crate::prelude::*;
use hbot_testing::prototype::device;

fn cot() -> f64 {
    1.0 / 0.1745_f64.tan()
}

fn rates(th: [f64; 2], omega: f64) -> [f64; 2] {
    // n2 is perpendicular to both steering axes. A turn about it makes a wheel trail fully.
    let rates = Posture::new(&device(), &th).inverse(Vec3::Y * omega);
    [rates[0], rates[2]]
}

fn moved(th: [f64; 2], by: [f64; 2], h: f64) -> [f64; 2] {
    [th[0] + h * by[0], th[1] + h * by[1]]
}

/// Returns the steer angles after the sphere has turned by `angle` in either direction, rad. It
/// uses the explicit midpoint method (order 2) in steps of 1 mrad.
fn midpoint(th: [f64; 2], angle: f64) -> [f64; 2] {
    let h = angle.signum() * 1e-3;
    (0..(angle.abs() * 1e3).round() as u32).fold(th, |th, _| {
        let half = moved(th, rates(th, 1.0), 0.5 * h);
        moved(th, rates(half, 1.0), h)
    })
}

/// Returns the steer angles like [`midpoint`], by the classic Runge-Kutta method (order 4).
fn rk4(th: [f64; 2], angle: f64) -> [f64; 2] {
    let h = angle.signum() * 1e-3;
    (0..(angle.abs() * 1e3).round() as u32).fold(th, |th, _| {
        let a = rates(th, 1.0);
        let b = rates(moved(th, a, 0.5 * h), 1.0);
        let c = rates(moved(th, b, 0.5 * h), 1.0);
        let d = rates(moved(th, c, h), 1.0);
        let sum: [f64; 2] = core::array::from_fn(|i| (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]) / 6.0);
        moved(th, sum, h)
    })
}

fn apart(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).abs().max((a[1] - b[1]).abs())
}

#[test]
fn two_correct_integrators_part_by_exp_of_cot_a_times_the_angle_after_a_reversal() {
    // If the sphere rolls forwards, every heading comes into line and both methods agree to
    // rounding.
    let start = [0.3, -0.5];
    let (a, b) = (midpoint(start, 6.5), rk4(start, 6.5));
    let trailing = apart(a, b);
    assert!(trailing < 1e-13, "forwards they agree: {trailing:e}");
    // If the sphere reverses, a difference of 1e-10 rad grows by one factor in both methods, and
    // also between them.
    for angle in [0.5, 1.0, 2.0] {
        let growth = (cot() * angle).exp();
        let seeded = [b[0] + 1e-10, b[1] + 1e-10];
        let by = [
            apart(midpoint(a, -angle), midpoint(seeded, -angle)) / 1e-10,
            apart(rk4(b, -angle), rk4(seeded, -angle)) / 1e-10,
            apart(midpoint(a, -angle), rk4(seeded, -angle)) / 1e-10,
        ];
        println!("{angle} rad: {by:?}, exp(cot a x angle) = {growth}");
        // With steps of 5.7e-3 the midpoint method leaves a third power over 6 of the rate per
        // step, which is 3e-5 per radian. The rest is the last digit of 1e-10 and of the agreement
        // before.
        for by in by {
            assert!((by / growth - 1.0).abs() < 2e-3, "{angle} rad: {by}, not {growth}");
        }
    }
    // After a full turn the headings of two correct integrators are unrelated.
    let far = apart(midpoint(a, -6.5), rk4([b[0] + 1e-15, b[1] - 1e-15], -6.5));
    println!("after 6.5 rad: {far} rad apart");
    assert!(far > 0.01, "{far}");
}
