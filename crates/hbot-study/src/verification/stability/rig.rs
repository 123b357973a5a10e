//! The whole loop: the largest stable stiffness of a spring that the controller renders on the
//! simulated prototype.

use hbot_config::RigConfig;
use hbot_core::{Vec3, rotation};
use hbot_plot::short;
use hbot_sim::phenomena::Phenomena;
use serde_json::json;

use super::search::{RESOLUTION, Swing, bisected};
use super::{border, micro};
use crate::context::Context;
use crate::report::{Report, row};
use crate::whole::{START_S, Whole, inertia, prototype, refine, spring};

/// Loop rates at which the stability limit is measured, Hz.
const RATES: [u32; 3] = [1000, 2000, 4000];
/// Damping of the rendered spring, N m s/rad.
const DAMPING: [f64; 3] = [0.005, 0.01, 0.02];
/// Largest allowed relative difference between the measured stability limit and that of the
/// formula, which is the first order in B h/J.
const WITHIN: f64 = 0.1;
/// Largest allowed relative difference between the measured stability limit and that of the
/// characteristic polynomial, which has all orders. It covers half the resolution of the search and
/// what the polynomial leaves out: the sphere's inertia varies by some 1e-4 with the posture on the
/// way.
const EXACTLY: f64 = 2.0e-4;
/// Amplitude of the initial swing, rad. It is so small that the torques stay far below their
/// limits.
const THROWN: f64 = 0.01;
/// How many times as fine the encoders are as the prototype's. With the prototype's counts their
/// rounding alone changes a swing by more than a stiffness does that is off the border by the
/// resolution.
const FINER: u32 = 256;
/// Time for which the swing is observed, s.
const WATCH_S: f64 = 3.0;

/// Returns whether a swing of the sphere about n1 grows. The control loop of the rig `config`
/// renders a spring of the given stiffness (N m/rad) and damping (N m s/rad).
fn grows(config: &RigConfig, stiffness: f64, damping: f64) -> bool {
    let mut whole = Whole::new(config, spring(stiffness, damping), Phenomena::default());
    whole.run(START_S);
    whole.tap(Vec3::X * (THROWN * libm::sqrt(stiffness / inertia(&config.rig.device, Vec3::X))));
    let watch = whole.ticks(WATCH_S);
    let mut swing = Swing::new(watch);
    for _ in 0..watch {
        whole.step(None);
        swing.see(rotation::log(whole.rig().state().q).x);
    }
    swing.grows()
}

/// Returns the stiffness at which the characteristic polynomial `z (z - 1)² + k (z + 1)/2 + d (z -
/// 1)` has a root on the unit circle, N m/rad, with k = K h²/J and d = B h/J. It is that of a free
/// inertia `inertia` (kg m²) on a spring and damper one tick late (docs/internals/borders.md).
fn by_eigenvalues(rate: u32, damping: f64, inertia: f64) -> f64 {
    let h = 1.0 / f64::from(rate);
    // The border is k = u - u² with u = d - k/2, so u² - 3 u + 2 d = 0.
    let d = damping * h / inertia;
    let u = 0.5 * (3.0 - libm::sqrt(9.0 - 8.0 * d));
    (u - u * u) * inertia / (h * h)
}

/// Stability limit of a spring that the whole loop renders, N m/rad.
struct Limit {
    rate: u32,
    damping: f64,
    /// By simulation.
    measured: f64,
    /// By the formula B/(h (1/2 + D)).
    predicted: f64,
    /// By the characteristic polynomial.
    eigenvalues: f64,
}

impl Limit {
    fn find(rate: u32, damping: f64) -> Self {
        let predicted = damping * f64::from(rate) / 1.5;
        let mut config = prototype(&[("loop.rate_hz", json!(rate))]);
        refine(&mut config, FINER);
        let grows = |stiffness| grows(&config, stiffness, damping);
        let measured = bisected([0.5 * predicted, 2.0 * predicted], RESOLUTION, grows);
        let eigenvalues = by_eigenvalues(rate, damping, inertia(&config.rig.device, Vec3::X));
        Self { rate, damping, measured, predicted, eigenvalues }
    }

    fn row(&self) -> Vec<String> {
        let Self { rate, damping, measured, predicted, eigenvalues } = self;
        let fine = |x: f64| format!("{x:.4}");
        row([
            rate.to_string(),
            short(*damping),
            fine(*measured),
            fine(*predicted),
            fine(measured / predicted),
            fine(*eigenvalues),
            fine(measured / eigenvalues),
        ])
    }
}

pub(super) fn study(context: &Context, report: &mut Report) {
    context.part("the whole loop");
    introduce(report);
    let rates = if context.quick { &RATES[..1] } else { &RATES[..] };
    let each = rates.iter().flat_map(|rate| DAMPING.map(|damping| (*rate, damping)));
    let found: Vec<Limit> = each.map(|(rate, damping)| Limit::find(rate, damping)).collect();
    let head =
        ["Hz", "B, N m s/rad", "measured, N m/rad", "predicted", "ratio", "by eigenvalues", "ratio to that"];
    let mut table = vec![row(head)];
    for limit in &found {
        let id = format!("border_rig_{}hz_damping{}", limit.rate, micro(limit.damping));
        border(report, id, limit.measured, limit.predicted)
            .note("eigenvalues", limit.eigenvalues)
            .note("resolution", RESOLUTION);
        table.push(limit.row());
    }
    report.table(&table);
    let worst = |of: &dyn Fn(&Limit) -> f64| {
        found.iter().map(|l| (l.measured / of(l) - 1.0).abs()).fold(0.0, f64::max)
    };
    let off = worst(&|limit| limit.predicted);
    report.check(
        format!("the whole loop swings up from B/(h (1/2 + D)), D = 1, within {WITHIN}"),
        format!("{off:.4} at worst, found to {RESOLUTION}"),
        off <= WITHIN,
    );
    let off = worst(&|limit| limit.eigenvalues);
    report.check(
        format!("the whole loop swings up where its eigenvalues leave the unit circle, within {EXACTLY}"),
        format!("{off:.5} at worst, found to {RESOLUTION}"),
        off <= EXACTLY,
    );
}

fn introduce(report: &mut Report) {
    report.heading("The whole loop");
    report.say(&format!(
        "The prototype's controller, its line and its simulated rig in lock-step, without friction: the stiffness from which a small swing about n1 grows, beside \
         B/(h (1/2 + D)). The torque of a reading acts one period after it, D = 1, in virtual time as on the wire (docs/performance.md). The ideal rig has no damping; \
         a real rig has some, so it is stable with a stiffer spring. The search ends when it knows the border to {} %. The encoders are {FINER} times as fine as the prototype's, for their rounding would hide such small differences. \
         The formula is the first order in B h/J; beside it the exact border, from the eigenvalues of a free inertia on a spring and damper one tick late: z (z - 1)² + k (z + 1)/2 + d (z - 1), k = K h²/J, d = B h/J.",
        100.0 * RESOLUTION
    ));
    report.family("border_rig_{rate}hz_damping{B} | N m/rad | stiffness of a spring from which the whole simulated loop swings up; damping in 1e-6 N m s/rad; `measured`, `predicted`, `eigenvalues` and the search's `resolution` in the row");
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At the border, the polynomial has a root of length 1: exp(i phi) with cos phi = 1 - u/2,
    /// which follows from the sum of the three roots, 2.
    #[test]
    fn the_polynomial_has_a_root_on_the_unit_circle() {
        for (rate, damping) in RATES.into_iter().zip(DAMPING) {
            let (h, inertia) = (1.0 / f64::from(rate), 3.4e-3);
            let stiffness = by_eigenvalues(rate, damping, inertia);
            let (k, d) = (stiffness * h * h / inertia, damping * h / inertia);
            let cosine = 1.0 - 0.5 * (d - 0.5 * k);
            let phi = libm::acos(cosine);
            // exp(i n phi) of z³ - 2 z² + (1 + k/2 + d) z + (k/2 - d).
            let factors = [0.5 * k - d, 1.0 + 0.5 * k + d, -2.0, 1.0];
            let part = |f: fn(f64) -> f64| {
                factors.iter().enumerate().map(|(n, factor)| factor * f(n as f64 * phi)).sum::<f64>()
            };
            // Rounding errors of terms of size 1, enlarged by acos near 1.
            assert!(part(libm::cos).abs() < 1e-13 && part(libm::sin).abs() < 1e-13, "{rate} {damping}");
            // The first order is the formula.
            assert!((stiffness * h * 1.5 / damping - 1.0).abs() < d, "{rate} {damping}");
        }
    }
}
