//! The whole loop: the largest stable stiffness of a spring that the controller renders on the
//! simulated prototype.

use hbot_core::{Vec3, rotation};
use hbot_plot::short;
use hbot_sim::phenomena::Phenomena;

use super::whole::{Loop, Wanted};
use super::{border, micro};
use crate::context::{Context, Interrupted};
use crate::report::{Report, row};

/// Loop rates at which the stability limit is measured, Hz.
const RATES: [u32; 3] = [1000, 2000, 4000];
/// Damping of the rendered spring, N m s/rad.
const DAMPING: [f64; 3] = [0.005, 0.01, 0.02];
/// Largest allowed relative difference between the measured and the predicted stability limit.
const WITHIN: f64 = 0.1;
/// Number of bisections in the search for the stability limit. They narrow a range of a factor of 4
/// to 1 %.
const HALVINGS: u32 = 7;
/// Amplitude of the initial swing, rad. It is a few hundred encoder counts, and small enough that
/// the torques stay far below their limits.
const THROWN: f64 = 0.01;
/// Time for which the swing is observed, s.
const WATCH_S: f64 = 1.5;

/// Returns whether a swing of the sphere about n1 grows. The control loop runs at `rate` Hz and
/// renders a spring of the given stiffness (N m/rad) and damping (N m s/rad).
fn grows(rate: u32, stiffness: f64, damping: f64) -> bool {
    let mut run =
        Loop::new(&Wanted { rate, stiffness, damping, phenomena: Phenomena::default(), guard: false });
    run.tap(Vec3::X * (THROWN * libm::sqrt(stiffness / run.inertia())));
    let watch = run.ticks(WATCH_S);
    let (mut early, mut late) = (0.0_f64, 0.0_f64);
    for k in 0..watch {
        run.step();
        let angle = rotation::log(run.state().q).length();
        if k < watch / 5 {
            early = early.max(angle);
        } else if k > 4 * (watch / 5) {
            late = late.max(angle);
        }
    }
    !(late <= early)
}

pub(super) fn study(context: &Context, report: &mut Report) -> Result<(), Interrupted> {
    context.part("the whole loop")?;
    report.heading("The whole loop");
    report.say(
        "The prototype's controller, its line and its simulated rig in lock-step, without friction: the stiffness from which a small swing about n1 grows, beside \
         B/(h (1/2 + D)). The torque of a reading acts one period after it, D = 1, in virtual time as on the wire (docs/performance.md). The ideal rig has no damping of its own; \
         a real one has, and stands more.",
    );
    report.family("border_rig_{rate}hz_damping{B} | N m/rad | stiffness of a spring from which the whole simulated loop swings up; damping in 1e-6 N m s/rad; `measured` and `predicted` in the row");
    let mut table = vec![row(["Hz", "B, N m s/rad", "measured, N m/rad", "predicted", "ratio"])];
    let mut worst = 0.0_f64;
    let rates = if context.quick { &RATES[..1] } else { &RATES[..] };
    for rate in rates {
        for damping in DAMPING {
            context.go_on()?;
            let predicted = damping * f64::from(*rate) / 1.5;
            let (mut low, mut high) = (0.5 * predicted, 2.0 * predicted);
            for _ in 0..HALVINGS {
                let middle = (low * high).sqrt();
                if grows(*rate, middle, damping) { high = middle } else { low = middle }
            }
            let measured = (low * high).sqrt();
            border(report, format!("border_rig_{rate}hz_damping{}", micro(damping)), measured, predicted);
            worst = worst.max((measured / predicted - 1.0).abs());
            let numbers = [damping, measured, predicted, measured / predicted].map(short);
            table.push(row([rate.to_string()].into_iter().chain(numbers)));
        }
    }
    report.table(&table);
    report.check_within("the whole loop swings up from B/(h (1/2 + D)), D = 1,", worst, WITHIN);
    Ok(())
}
