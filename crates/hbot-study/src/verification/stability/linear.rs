//! The linear border of stability: the stiffness at which the swing of a spring no longer decays.

use hbot_plot::{Lines, Series, short};

use super::wall::Wall;
use super::{border, micro};
use crate::context::{Context, Interrupted};
use crate::report::{Report, row};

/// Loop rates at which the stability limit is measured, Hz.
const RATES: [u32; 4] = [500, 1000, 2000, 4000];
/// Delays from a reading to the torque computed from it that are compared, in ticks.
const DELAYS: [usize; 3] = [0, 1, 2];
/// Values of the viscous damping of the mechanics (not of the virtual wall) that are simulated, N m
/// s/rad.
const OWN: [f64; 3] = [0.001, 0.003, 0.01];
/// Values of the damping that the virtual wall renders, N m s/rad.
const DAMPING: [f64; 3] = [0.0, 0.003, 0.01];
/// Largest allowed relative deviation of the measured stability limit from the predicted one.
const WITHIN: f64 = 0.05;
/// Number of bisections in the search for the stability limit. They narrow a range of a factor of 4
/// to 0.1 %.
const HALVINGS: u32 = 11;

/// Returns the stiffness at which a swing of the axis begins to grow, N m/rad. It is found by
/// bisection between half and twice `predicted`.
pub(crate) fn measured(wall: &Wall, predicted: f64) -> f64 {
    let (mut low, mut high) = (0.5 * predicted, 2.0 * predicted);
    for _ in 0..HALVINGS {
        let middle = (low * high).sqrt();
        if grows(&Wall { stiffness: middle, ..*wall }) { high = middle } else { low = middle }
    }
    (low * high).sqrt()
}

/// Returns whether the axis swings further late in the simulation than early in it.
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
    report.family(
        "border_linear_{rate}hz_delay{d}_own{b}_wall{B}",
        "N m/rad",
        "stiffness from which a swing grows; own and wall damping in 1e-6 N m s/rad; `measured` and `predicted` in the row",
    );
    let mut table = vec![row(["Hz", "D", "b", "B", "measured, N m/rad", "predicted", "ratio"])];
    let mut worst = 0.0_f64;
    let mut lines = Vec::new();
    for delay in DELAYS {
        let mut points = [Vec::new(), Vec::new()];
        for own in OWN {
            for damping in DAMPING {
                for rate in RATES {
                    context.go_on()?;
                    let period = 1.0 / f64::from(rate);
                    let wall = Wall {
                        inertia,
                        own,
                        coulomb: 0.0,
                        step: 0.0,
                        period,
                        delay,
                        stiffness: 0.0,
                        damping,
                    };
                    let predicted = (own + damping) / (period * (0.5 + delay as f64));
                    let measured = measured(&wall, predicted);
                    let id = format!(
                        "border_linear_{rate}hz_delay{delay}_own{}_wall{}",
                        micro(own),
                        micro(damping)
                    );
                    border(report, id, measured, predicted);
                    worst = worst.max((measured / predicted - 1.0).abs());
                    if rate == 1000 {
                        let numbers = [own, damping, measured, predicted, measured / predicted].map(short);
                        table.push(row([rate.to_string(), delay.to_string()].into_iter().chain(numbers)));
                    }
                    if damping == DAMPING[0] && own == OWN[2] {
                        points[0].push((f64::from(rate), measured));
                        points[1].push((f64::from(rate), predicted));
                    }
                }
            }
        }
        for (points, what, open) in
            [(points[0].clone(), "simulated", false), (points[1].clone(), "predicted", true)]
        {
            lines.push(Series { name: format!("D = {delay}, {what}"), points, colour: delay, open });
        }
    }
    report.table(&table);
    report.plot(
        "border_linear",
        "Largest stable stiffness over the loop's rate, b = 0.01 N m s/rad, B = 0",
        Lines {
            title: "The linear border".to_owned(),
            x: "loop rate, Hz".to_owned(),
            y: "stiffness, N m/rad".to_owned(),
            log: [true; 2],
            series: lines,
            front: false,
        }
        .svg(),
    );
    report.check(
        format!("the linear border is (b + B)/(h (1/2 + D)) within {WITHIN}"),
        format!("{worst:.3} at worst"),
        worst <= WITHIN,
    );
    Ok(())
}
