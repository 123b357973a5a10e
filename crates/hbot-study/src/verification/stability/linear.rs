//! The linear border of stability: the stiffness at which the swing of a spring no longer decays.

use hbot_plot::{Lines, Series};

use super::wall::Wall;
use super::{Border, borders, micro};
use crate::context::{Context, Interrupted};
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
/// Number of bisections in the search for the stability limit. They narrow a range of a factor of 4
/// to 0.1 %.
const HALVINGS: u32 = 11;

/// Returns the stiffness of the wall at which a swing of the axis begins to grow, N m/rad. It is
/// found by bisection between half of the predicted stiffness `predicted` and twice this stiffness.
pub(crate) fn measured(wall: &Wall, predicted: f64) -> f64 {
    let (mut low, mut high) = (0.5 * predicted, 2.0 * predicted);
    for _ in 0..HALVINGS {
        let middle = (low * high).sqrt();
        if grows(&Wall { stiffness: middle, ..*wall }) { high = middle } else { low = middle }
    }
    (low * high).sqrt()
}

/// Returns whether the swing of the axis is larger late in the simulation than early in it.
fn grows(wall: &Wall) -> bool {
    // If the stiffness is 0.1 % off the border, the swing changes at a tenth of the rate of the
    // damping. Peaks are read to (w h)²/8.
    let pace = (wall.own + wall.damping) / (2.0 * wall.inertia);
    let ticks = ((60.0 / pace) / wall.period).clamp(4000.0, 60_000.0) as usize;
    let (mut early, mut late) = (0.0_f64, 0.0_f64);
    let mut k = 0;
    wall.released(1.0, ticks, |x| {
        if k >= ticks / 10 && k < ticks / 5 {
            early = early.max(x.abs());
        } else if k >= 9 * ticks / 10 {
            late = late.max(x.abs());
        }
        k += 1;
    });
    // The negated comparison also counts an overflow to NaN as growth.
    !(late <= early)
}

pub(super) fn study(context: &Context, report: &mut Report, inertia: f64) -> Result<(), Interrupted> {
    context.part("the linear border")?;
    report.heading("The linear border");
    report.say(&format!(
        "The largest stiffness at which a swing dies, found by bisection, beside (b + B)/(h (1/2 + D)). The prediction is that of a short delay: it leaves out what is of \
         the next order in (b + B) h (1/2 + D)/J, here at most {:.2}, and that the wall's damping is delayed too.",
        0.02 * 2.5 / (500.0 * inertia)
    ));
    report.family("border_linear_{rate}hz_delay{d}_own{b}_wall{B} | N m/rad | stiffness from which a swing grows; own and wall damping in 1e-6 N m s/rad; `measured` and `predicted` in the row");
    let found = measure(context, inertia)?;
    let worst = borders(report, &found);
    report.lines(
        "border_linear",
        "Largest stable stiffness over the loop's rate, b = 0.01 N m s/rad, B = 0",
        Lines::new("The linear border", "loop rate, Hz", "stiffness, N m/rad", lines(&found)).log([true; 2]),
    );
    report.check_within("the linear border is (b + B)/(h (1/2 + D))", worst, WITHIN);
    Ok(())
}

/// Simulates all combinations of delay, damping and loop rate. Returns the stability limit of each,
/// measured and predicted.
fn measure(context: &Context, inertia: f64) -> Result<Vec<Border>, Interrupted> {
    let mut found = Vec::new();
    for delay in DELAYS {
        for (own, damping) in OWN.into_iter().flat_map(|own| DAMPING.map(|damping| (own, damping))) {
            for rate in RATES {
                context.go_on()?;
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
    Ok(found)
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
