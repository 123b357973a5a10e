//! The energy that the motors give out after a tap, with the passivity stage and without it.

use core::f64::consts::TAU;

use hbot_core::design::rig::PassivityLimit;
use hbot_core::{Device, Vec3};
use hbot_plot::{Lines, Series, short};

use super::guarded::{BASE, TAP, Tapped, tapped};
use crate::report::{Report, row};
use crate::whole::inertia;

/// Stiffnesses of the spring for which the energy after a tap on the sphere is measured, relative
/// to the stability limit of the linear theory.
const TIMES: [f64; 7] = [0.5, 0.8, 1.5, 3.0, 6.0, 12.0, 24.0];

pub(super) fn study(report: &mut Report, device: &Device, floor: f64) {
    let limit = PassivityLimit::of(device, BASE.period());
    introduce(report, limit.allowance);
    let inertia = inertia(device, Vec3::X);
    let found = TIMES.map(|times| Given::measure(times, inertia, &limit, floor));
    let head =
        ["K over border", "K, N m/rad", "off, J", "on, J", "bound with the stage, J", "at rest off", "on"];
    let mut table = vec![row(head)];
    for Given { times, stiffness, bound, tapped } in &found {
        for (guard, tapped) in ["off", "on"].into_iter().zip(tapped) {
            let id = format!("energy_given_{}_tenths_{guard}", (10.0 * times).round() as u32);
            report.figure(id, tapped.most).note("bound", *bound);
        }
        let numbers = [*times, *stiffness, tapped[0].most, tapped[1].most, *bound].map(short);
        let rests = tapped.each_ref().map(|tapped| if tapped.settles { "yes" } else { "no" }.to_owned());
        table.push(numbers.into_iter().chain(rests).collect());
    }
    report.table(&table);
    let over =
        |value: &dyn Fn(&Given) -> f64| found.iter().map(|given| (given.times, value(given))).collect();
    let series = vec![
        Series::new("without the stage", over(&|given| given.tapped[0].most), 0),
        Series::new("with the stage", over(&|given| given.tapped[1].most), 1),
        Series::new("bound with the stage", over(&|given| given.bound), 6).open(true),
    ];
    report.lines(
        "energy_given",
        "The most energy that the motors gave out after a tap, over the stiffness",
        Lines::new("Energy given out after a tap", "stiffness over b/(h (1/2 + D))", "energy, J", series)
            .log([true; 2]),
    );
    let worst = found.iter().map(|given| given.tapped[1].most / given.bound).fold(0.0, f64::max);
    report.check(
        "with the stage no more energy is given out than its allowance and a cycle's leak",
        format!("{worst:.2} of it at worst"),
        worst <= 1.0,
    );
}

fn introduce(report: &mut Report, allowance: f64) {
    report.heading("Energy given out");
    report.say(&format!(
        "The most that the motors have given out at a time after the same tap, torque held times turn made, at the base of the tables above. The stage allows {} J; what a spring holds late leaks \
         in the cycle before it acts comes on top: 2 pi w h (1/2 + D) of what the tap put in, w = sqrt(K/J).",
        short(allowance)
    ));
    report.family("energy_given_{tenths}_tenths_{guard} | J | the most energy that the motors gave out after a tap, at so many tenths of the linear border, passivity stage on or off; `bound`: that with the stage");
}

/// The energy that the motors deliver after a tap on the sphere, without and with the passivity
/// stage, for a spring of one stiffness.
struct Given {
    /// Stiffness of the spring relative to the stability limit of the linear theory.
    times: f64,
    stiffness: f64,
    /// Largest energy that the motors may deliver if the passivity stage is on, J. It is the
    /// stage's allowance plus the energy that the spring generates in one cycle before the stage
    /// acts.
    bound: f64,
    tapped: [Tapped; 2],
}

impl Given {
    fn measure(times: f64, inertia: f64, limit: &PassivityLimit, floor: f64) -> Self {
        let stiffness = times * BASE.border();
        let put_in = 0.5 * inertia * TAP.length_squared();
        let leak = TAU * (stiffness / inertia).sqrt() * BASE.period() * (0.5 + f64::from(BASE.delay));
        let tapped = [false, true].map(|guard| tapped(&BASE, stiffness, guard, floor));
        Self { times, stiffness, bound: limit.allowance + leak * put_in, tapped }
    }
}
