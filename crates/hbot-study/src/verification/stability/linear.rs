//! The linear border of stability: the stiffness at which the swing of a spring no longer decays.

use hbot_plot::{Lines, Series};

use super::search::{RESOLUTION, Swing, bisected};
use super::wall::Wall;
use super::{Border, borders, micro};
use crate::context::Context;
use crate::report::Report;

/// Loop rates at which the stability limit is measured, Hz.
const RATES: [u32; 4] = [500, 1000, 2000, 4000];
/// Delays from a reading to the torque computed from it that are compared, in ticks.
const DELAYS: [usize; 3] = [0, 1, 2];
/// Values of the viscous damping of the mechanics that are simulated, N m s/rad. The damping that
/// the virtual wall renders is separate.
const OWN: [f64; 3] = [0.001, 0.003, 0.01];
/// Values of the damping that the virtual wall renders, N m s/rad.
const DAMPING: [f64; 3] = [0.0, 0.003, 0.01];
/// Largest allowed relative difference between the measured and the predicted stability limit.
const WITHIN: f64 = 0.05;
/// Returns the stiffness of the wall at which a swing of the axis begins to grow, N m/rad. It is
/// found by bisection between half of the predicted stiffness `predicted` and twice this stiffness.
fn measured(wall: &Wall, predicted: f64) -> f64 {
    let grows = |stiffness| grows(&Wall { stiffness, ..*wall });
    bisected([0.5 * predicted, 2.0 * predicted], RESOLUTION, grows)
}

/// Returns whether the swing of the axis is larger late in the simulation than early in it.
fn grows(wall: &Wall) -> bool {
    // A stiffness that is off the border by the resolution changes the swing at that share of the
    // rate of the damping: by 1e-4 or more in this time.
    let pace = (wall.own + wall.damping) / (2.0 * wall.inertia);
    let ticks = ((60.0 / pace) / wall.period).clamp(4000.0, 60_000.0) as u32;
    let mut swing = Swing::new(ticks);
    wall.released(1.0, ticks as usize, |x| swing.see(x));
    swing.grows()
}

pub(super) fn study(context: &Context, report: &mut Report, inertia: f64) {
    context.part("the linear border");
    report.heading("The linear border");
    report.say(&format!(
        "The largest stiffness at which a swing dies, found by bisection to {} %, beside (b + B)/(h (1/2 + D)). The prediction is that of a short delay: it leaves out what is of \
         the next order in (b + B) h (1/2 + D)/J, here at most {:.2}, and that the wall's damping is delayed too.",
        100.0 * RESOLUTION,
        0.02 * 2.5 / (500.0 * inertia)
    ));
    report.family("border_linear_{rate}hz_delay{d}_own{b}_wall{B} | N m/rad | stiffness from which a swing grows; own and wall damping in 1e-6 N m s/rad; `measured` and `predicted` in the row");
    let found = measure(inertia);
    let worst = borders(report, &found);
    report.lines(
        "border_linear",
        "Largest stable stiffness over the loop's rate, b = 0.01 N m s/rad, B = 0",
        Lines::new("The linear border", "loop rate, Hz", "stiffness, N m/rad", lines(&found)).log([true; 2]),
    );
    report.check_within("the linear border is (b + B)/(h (1/2 + D))", worst, WITHIN);
}

/// Simulates all combinations of delay, damping and loop rate. Returns the stability limit of each,
/// measured and predicted.
fn measure(inertia: f64) -> Vec<Border> {
    let mut found = Vec::new();
    for delay in DELAYS {
        for (own, damping) in OWN.into_iter().flat_map(|own| DAMPING.map(|damping| (own, damping))) {
            for rate in RATES {
                let period = 1.0 / f64::from(rate);
                let wall = Wall { delay, damping, ..Wall::of(inertia, own, period) };
                let predicted = (own + damping) / (period * (0.5 + delay as f64));
                let measured = measured(&wall, predicted);
                let (b, wall) = (micro(own), micro(damping));
                let id = format!("border_linear_{rate}hz_delay{delay}_own{b}_wall{wall}");
                found.push(Border { id, rate, delay, own, damping, measured, predicted });
            }
        }
    }
    found
}

/// Returns the lines of a plot of the stability limit over the loop rate, simulated and predicted,
/// for each delay. The axis has the largest damping tested, and the wall has none.
fn lines(found: &[Border]) -> Vec<Series> {
    let of = |delay: usize, value: fn(&Border) -> f64| {
        let drawn = |b: &&Border| b.delay == delay && b.own == OWN[2] && b.damping == DAMPING[0];
        found.iter().filter(drawn).map(|b| (f64::from(b.rate), value(b))).collect()
    };
    let both = |delay: usize| {
        [
            Series::new(format!("D = {delay}, simulated"), of(delay, |b| b.measured), delay),
            Series::new(format!("D = {delay}, predicted"), of(delay, |b| b.predicted), delay).open(true),
        ]
    };
    DELAYS.into_iter().flat_map(both).collect()
}
