//! A million ticks of odometry.

use super::super::core::design::rig::OdometryMethod::{self, Magnus4, Midpoint};
use super::super::core::motion::odometry::{advance, turn};
use super::super::core::{Quat, Real, Vec3, rotation};
use super::machine::{device, wheels};

const RATES: [f64; 4] = [5.0, 20.0, -7.0, -13.0];

/// Returns the orientation after `ticks` ticks of `period` seconds at constant joint rates, and the
/// largest deviation of |q|² from 1.
fn after(method: OdometryMethod, ticks: u32, period: f64) -> (Quat, Real) {
    let device = device(&wheels());
    let delta = RATES.map(|rate| (rate * period) as Real);
    let mut worst: Real = 0.0;
    let mut q = Quat::IDENTITY;
    for k in 0..ticks {
        // Steer angles are kept within a turn, as in the encoders.
        let at = |rate: f64| ((rate * period * f64::from(k)) % core::f64::consts::TAU) as Real;
        q = advance(q, turn(&device, method, &[at(RATES[0]), at(RATES[2])], &delta));
        worst = worst.max((q.length_squared() - 1.0).abs());
    }
    (q, worst)
}

#[test]
fn a_million_ticks_stay_unit_and_drift_by_their_method() {
    const TICKS: u32 = 1_000_000;
    let (midpoint, worst) = after(Midpoint, TICKS, 1e-3);
    let (magnus, worst_magnus) = after(Magnus4, TICKS, 1e-3);
    let coarse = after(Midpoint, TICKS / 2, 2e-3).0;
    let [fine, coarse] = [midpoint, coarse].map(|q| rotation::angle_between(q, magnus));
    println!(
        "|q|² - 1: {worst:e}, {worst_magnus:e}; midpoint against Magnus: {fine:e} rad, {coarse:e} rad at 2 ms"
    );
    let unit = if Real::EPSILON < 1e-10 { 1e-12 } else { 8.0 * Real::EPSILON };
    assert!(worst.max(worst_magnus) < unit, "{worst:e} {worst_magnus:e}");
    if Real::EPSILON < 1e-10 {
        // The method has order 2: steps of half the length leave a quarter of the drift.
        assert!((coarse / fine - 4.0).abs() < 0.04, "{fine:e}, {coarse:e}");
    } else {
        // The only error is one rounding per tick. The bound assumes that all have one sign.
        assert!(fine < TICKS as Real * Real::EPSILON, "{fine:e}");
    }
}

#[test]
fn turns_about_one_axis_add_up_over_a_million_ticks() {
    // The turn is not a binary fraction. After a million of them the error is rounding alone.
    let step = Vec3::new(0.6, -0.48, 0.64) * (1e-3 as Real);
    let q = (0..1_000_000).fold(Quat::IDENTITY, |q, _| advance(q, step));
    let axis = Vec3::new(0.6, -0.48, 0.64);
    let length = f64::from(step.length());
    let want = rotation::exp(axis * (((1e6 * length) % core::f64::consts::TAU) as Real));
    let off = rotation::angle_between(q, want);
    println!("{off:e} rad");
    assert!(off < 1e6 * Real::EPSILON, "{off:e}");
}
