//! The choice of the factor: the border of a free sphere against the border with any hand, and
//! what late and lost readings leave of the first.

use std::f64::consts::PI;

use hbot_plot::{Lines, Series, short};

use super::axis::{Axis, Line};
use super::{DAMPING, INERTIA};
use crate::context::Context;
use crate::report::{Report, row};

const FACTORS: [f64; 7] = [0.0, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3];
const PERIOD: f64 = 1.0e-3;
const LAG: f64 = 5.0e-4;
/// Longest lead, s.
const LONGEST: f64 = 0.01;
/// Lines whose borders are compared, each with its name.
const LINES: [(&str, Line); 6] = [
    ("punctual", Line::Punctual),
    ("every tenth reading a tick late", Line::TenthLate),
    ("1 % lost", Line::Lost(0.01)),
    ("10 % lost", Line::Lost(0.1)),
    ("30 % lost", Line::Lost(0.3)),
    ("latency timer of 16 ms", Line::Together(16)),
];

/// Returns the stiffness up to which a spring gives no energy to a hand that moves by any sine up
/// to Nyquist's frequency, N m/rad, if the device has the damping [`DAMPING`].
///
/// The sine advances by f in a tick. The torque is late by y = f (1/2 + D) + atan(W lag), and
/// smaller by the lag's gain g. Between two readings the hand goes at an even pace, of which
/// damping takes the least energy. It then needs, for each N m/rad, the damping
///
/// ```text
/// g h (sin y - W t cos y) / (2 sin(f/2))
/// ```
pub(super) fn passive(lag: f64, factor: f64) -> f64 {
    let lead = factor * (1.5 * PERIOD + lag);
    let need = |k: u32| {
        let f = PI * f64::from(k) / 2000.0;
        let w = f / PERIOD;
        let y = 1.5 * f + libm::atan(w * lag);
        let gain = 1.0 / libm::sqrt(1.0 + (w * lag) * (w * lag));
        gain * PERIOD * (libm::sin(y) - w * lead * libm::cos(y)) / (2.0 * libm::sin(0.5 * f))
    };
    DAMPING / (1..2000).map(need).fold(0.0, f64::max)
}

pub(super) fn study(context: &Context, report: &mut Report) {
    context.part("the choice of the factor");
    report.heading("The choice of the factor");
    report.say(&format!(
        "One axis at 1 kHz, {INERTIA} kg m², 0.01 N m s/rad in all, motors with a lag of 0.5 ms: the first unstable spring if all readings are punctual, if every tenth comes one tick late, if exchanges are lost at random (the \
         command and its answer; the motors go on with the torque before), and behind a USB adapter that hands over readings every 16 ms. Beside it the passive border: the stiffest spring that gives \
         no energy to any hand, in motors with and without the lag. In both the rates are exact."
    ));
    report.family("lead_plane_{what}_factor{c} | N m/rad | first unstable or first active stiffness of one axis at 1 kHz with a lead of c/100 times the delay");
    let names = LINES.map(|(name, _)| name);
    let head = ["factor"].into_iter().chain(names).chain(["passive", "passive without a lag"]);
    let mut table = vec![row(head)];
    let mut series: Vec<Vec<(f64, f64)>> = vec![Vec::new(); 3];
    let mut never_worse = true;
    let mut without = [0.0; LINES.len()];
    for factor in FACTORS {
        if context.quick && ![0.0, 1.1].contains(&factor) {
            continue;
        }
        let mut cells = vec![factor.to_string()];
        for (k, (name, line)) in LINES.into_iter().enumerate() {
            let axis = Axis {
                inertia: INERTIA,
                period: PERIOD,
                lag: LAG,
                factor,
                longest: LONGEST,
                damping: DAMPING,
                line,
            };
            let border = axis.border();
            if factor == 0.0 {
                without[k] = border;
            }
            // Borders are found to a thousandth.
            never_worse &= border >= 0.998 * without[k];
            let id =
                format!("lead_plane_{}_factor{}", name.replace([' ', '%'], "_"), (100.0 * factor).round());
            report.figure(id, border);
            cells.push(short(border));
            if let Some(place) = [0, 3, 4].iter().position(|at| *at == k)
                && factor > 0.0
            {
                series[place].push((passive(LAG, factor), border));
            }
        }
        for (what, lag) in [("passive", LAG), ("passive_without_lag", 0.0)] {
            let border = passive(lag, factor);
            report.figure(format!("lead_plane_{what}_factor{}", (100.0 * factor).round()), border);
            cells.push(short(border));
        }
        table.push(row(cells));
    }
    report.table(&table);
    let series = series.into_iter().zip(["all exchanges", "10 % lost", "30 % lost"]).zip(0..);
    let series = series.map(|((points, name), k)| Series::new(name.to_owned(), points, k)).collect();
    report.lines(
        "lead_plane",
        "First unstable spring over the passive border, for factors from 0.8 (right) to 1.3",
        Lines::new("The choice of the factor", "passive border, N m/rad", "border, N m/rad", series)
            .log([false, true]),
    );
    report.check("no border is lower with a lead than without", "all factors and lines", never_worse);
}
