//! How much the paper's GCI depends on the posture at which its turns begin.

use hbot_core::Quat;
use hbot_plot::{Map, maps};

use super::indices::IndexedDevice;
use super::so3;
use super::torus::{self, THREE, mean};
use crate::context::Context;
use crate::report::Report;

/// Reports how the mean conditioning index (GCI) depends on the steer angles at which the turns of
/// the sphere begin. `start` are the steer angles that the other sections use, and `ours` is the
/// GCI for them. Returns the smallest and the largest GCI over all steer angles.
pub(super) fn study(
    context: &Context,
    report: &mut Report,
    rig: &IndexedDevice,
    (start, ours): ([f64; 2], f64),
) -> [f64; 2] {
    context.part("GCI against the start");
    report.family("gci_three_motors_spectral_so3_over_starts_{statistic} | 1 | the same over starts spread evenly over the torus: least, mean, largest");
    let (cells, level) = if context.quick { (10, 1) } else { (24, 2) };
    let samples: Vec<Quat> = so3::uniform(level).collect();
    let values = torus::over(cells, |th| rig.gci(&samples, th, &THREE));
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let most = values.iter().copied().fold(0.0, f64::max);
    let average = mean(values.iter().copied());
    for (statistic, value) in [("least", least), ("mean", average), ("largest", most)] {
        report.figure(format!("gci_three_motors_spectral_so3_over_starts_{statistic}"), value);
    }
    report.say(&format!(
        "The paper's GCI from other starts than steering angles of {:.0} and {:.0} deg, where it is {ours:.3}: {least:.3} to {most:.3}, {average:.3} in the mean. Turns of up to half a turn do not \
         forget where they began.",
        start[0].to_degrees(),
        start[1].to_degrees()
    ));
    let map = Map {
        title: "GCI the paper's way, by the posture it starts from".to_owned(),
        x: "steering angle 1 at the start, deg".to_owned(),
        y: "steering angle 2 at the start, deg".to_owned(),
        span: 0.0..360.0,
        values,
        range: least..most,
        lines: Vec::new(),
    };
    report.plot(
        "gci_start",
        "GCI of the three motors (spectral) over SO(3), by the steering angles that all turns begin at",
        maps(&[map]),
    );
    [least, most]
}
