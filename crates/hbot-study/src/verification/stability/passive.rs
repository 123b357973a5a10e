//! The passive border: the stiffness at which a sine that is imposed on a sampled wall can first
//! draw energy from it.

use core::f64::consts::PI;

use hbot_plot::{Lines, Series};

use super::{Border, borders, micro};
use crate::context::Context;
use crate::report::Report;

/// Loop rates at which the largest passive stiffness is measured, Hz.
const RATES: [u32; 3] = [500, 1000, 4000];
/// Values of the viscous damping of the mechanics that are simulated, N m s/rad. The damping that
/// the virtual wall renders is separate.
const OWN: [f64; 2] = [0.01, 0.03];
/// Values of the damping that the virtual wall renders, N m s/rad. They can be negative.
const DAMPING: [f64; 3] = [0.0, 0.005, -0.005];
/// Largest allowed relative difference between the measured and the predicted passive stiffness.
const WITHIN: f64 = 0.1;
/// Number of frequencies at which the wall is moved. None of them is a simple fraction of the
/// Nyquist frequency, because such a sine would always be sampled at the same few phases.
const SINES: usize = 160;
/// Number of ticks for which each sine is simulated.
const TICKS: usize = 40_000;

/// Returns the damping that the mechanics need to absorb the energy that a virtual wall delivers
/// while it is moved along a sine. The sine advances by `phi` rad per tick.
///
/// The period of the loop is taken as 1 s. The first result is the damping needed per unit of the
/// wall's stiffness (1 N m/rad), and the second per unit of the wall's damping (1 N m s/rad), both
/// in N m s/rad.
fn asked(phi: f64, delay: usize) -> [f64; 2] {
    let first = delay + 1;
    // The sum goes from one zero crossing to another, so that the spring stores nothing at either
    // end.
    let last = first + ((TICKS as f64 * phi / PI).floor() * PI / phi).round() as usize;
    let at = |k: usize| libm::sin(phi * (k as f64 - first as f64));
    let (mut work, mut lost) = ([0.0; 2], 0.0);
    for k in first..last {
        let moved = at(k + 1) - at(k);
        let read = at(k - delay);
        // The torque on the sphere times its turn is the energy that the wall gives out.
        work[0] += -read * moved;
        work[1] += -(read - at(k - delay - 1)) * moved;
        // The hand moves at a constant rate during a tick.
        lost += moved * moved;
    }
    work.map(|work| work / lost)
}

pub(super) fn study(context: &Context, report: &mut Report) {
    context.part("the passive border");
    report.heading("The passive border");
    report.say(
        "A wall is moved by sines of every frequency up to Nyquist's; over a long time it must not give out more than the device's own damping takes up. Between two readings \
         the hand goes at an even pace: of all ways from one to the next that is the one which the damping takes least from, so it is the hardest. The \
         stiffness at which the first sine draws energy is found by simulation, beside Colgate and Schenkel: K = 2 (b - |B|)/h without delay, and with delay and B = 0 \
         K = b/(h (1/2 + D)). A wall's damping costs passivity near Nyquist's frequency, where its difference of readings comes half a turn late; a negative one \
         costs it at low ones.",
    );
    report.family("border_passive_{rate}hz_delay{d}_own{b}_wall{B} | N m/rad | stiffness from which an imposed sine draws energy; own and wall damping in 1e-6 N m s/rad, minus where negative; `measured` and `predicted` in the row");
    let (mut found, mut series) = (Vec::new(), Vec::new());
    for delay in 0..=2 {
        let needs = needs(delay);
        let line = |name: String, k: usize| {
            Series::new(name, needs.iter().map(|(phi, need)| (phi / PI, need[k])).collect(), [delay, 3][k])
        };
        series.push(line(format!("stiffness, D = {delay}, over K h"), 0));
        if delay == 0 {
            series.push(line("damping, D = 0, over B".to_owned(), 1).open(true));
        }
        for (rate, own) in RATES.into_iter().flat_map(|rate| OWN.map(|own| (rate, own))) {
            // With a delay the formula is that of an undamped wall.
            let walls = if delay == 0 { &DAMPING[..] } else { &DAMPING[..1] };
            found.extend(walls.iter().map(|damping| measured(&needs, delay, rate, own, *damping)));
        }
    }
    let worst = borders(report, &found);
    report.lines(
        "border_passive",
        "Own damping that a device needs to take up what an imposed sine draws from a wall",
        Lines::new("What imposed sines draw", "frequency over Nyquist's", "own damping asked for", series),
    );
    report.check_within("the passive border is that of Colgate and Schenkel", worst, WITHIN);
}

/// Returns the damping that the mechanics need so that no sinusoidal motion draws energy from a
/// virtual wall. Each entry holds a frequency, as phase per tick in rad, and the damping needed at
/// it: per unit of the wall's stiffness, and per unit of the wall's damping.
fn needs(delay: usize) -> Vec<(f64, [f64; 2])> {
    (0..SINES)
        // The frequencies are dense near both ends, where the worst ones are.
        .map(|k| PI * 0.5 * (1.0 - libm::cos(PI * (k as f64 + 0.618) / (SINES as f64 + 0.2))))
        .filter(|phi| *phi > 0.02)
        .map(|phi| (phi, asked(phi, delay)))
        .collect()
}

/// Returns the largest stiffness of a virtual wall at which no sinusoidal motion draws energy from
/// it, measured and predicted. `needs` holds, for each frequency, the damping that the mechanics
/// need. `own` is the damping that they have.
fn measured(needs: &[(f64, [f64; 2])], delay: usize, rate: u32, own: f64, damping: f64) -> Border {
    let period = 1.0 / f64::from(rate);
    // b >= K h s + B d must hold for every sine.
    let drawn = needs.iter().map(|(_, need)| need).filter(|n| n[0] > 0.0);
    let most = drawn.map(|n| (own - damping * n[1]) / (period * n[0]));
    let measured = most.fold(f64::INFINITY, f64::min);
    let predicted = (own - damping.abs()) / (period * (0.5 + delay as f64));
    let sign = if damping < 0.0 { "minus" } else { "" };
    let (b, wall) = (micro(own), micro(damping.abs()));
    let id = format!("border_passive_{rate}hz_delay{delay}_own{b}_wall{sign}{wall}");
    Border { id, rate, delay, own, damping, measured, predicted }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At one frequency, the damping that the mechanics need agrees with the formula of Colgate and
    /// Schenkel. It is h/2 per unit of the wall's stiffness at any frequency, and -cos(phi) per
    /// unit of the wall's damping.
    #[test]
    fn a_sine_draws_what_the_formula_says() {
        for phi in [0.1, 1.0, 2.3, 3.0] {
            let [stiffness, damping] = asked(phi, 0);
            // The tolerance covers the energy left in the spring at the end, up to half a tick from
            // zero, and the uneven distribution of the phases of 40,000 ticks.
            assert!((stiffness - 0.5).abs() < 1e-3, "{phi}: {stiffness}");
            assert!((damping + libm::cos(phi)).abs() < 1e-3, "{phi}: {damping}");
            // With one tick of delay the formula gives sin(3/2 phi) / (2 sin(phi/2)).
            let late = asked(phi, 1)[0];
            assert!((late - 0.5 * libm::sin(1.5 * phi) / libm::sin(0.5 * phi)).abs() < 1e-3, "{phi}: {late}");
        }
    }
}
