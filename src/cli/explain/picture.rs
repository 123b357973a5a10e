//! The picture of the time before a fault.

use hbot_config::RigConfig;
use hbot_plot::{Curve, PlotPanel, sheet};
use hbot_record::messages::hbot::State;

use super::findings::{components, length};

/// Draws rate, torque, grip and lateness against the time before the fault. Returns the picture as
/// SVG.
pub(super) fn draw(states: &[State], rig: &RigConfig, fault: &str) -> String {
    let limits = &rig.rig.limits;
    let late = |state: &State| state.timing.as_ref().map_or(0.0, |timing| 1.0e-3 * timing.lateness_us);
    let vector = |of: fn(&State) -> [f64; 3], name: &str, k: usize| {
        curve(states, &format!("{name} n{}", k + 1), Some(k), move |state| of(state)[k])
    };
    let omega: fn(&State) -> [f64; 3] = |state| components(state.omega.as_ref());
    let torque: fn(&State) -> [f64; 3] = |state| components(state.torque.as_ref());
    let mut rates = vec![curve(states, "rate", None, |state| length(state.omega.as_ref()))];
    rates.extend((0..3).map(|k| vector(omega, "rate", k)));
    let mut torques = vec![curve(states, "torque", None, |state| length(state.torque.as_ref()))];
    torques.extend((0..3).map(|k| vector(torque, "torque", k)));
    let shares = vec![
        curve(states, "part applied", Some(0), |state| state.scale),
        curve(states, "part of the grip", Some(1), |state| state.traction),
    ];
    let panels = [
        panel(states, "rate of the sphere, rad/s", Some(limits.speed), rates),
        panel(states, "torque on it, N m", Some(limits.torque), torques),
        panel(states, "fraction", None, shares),
        panel(states, "lateness, ms", None, vec![curve(states, "lateness", None, late)]),
    ];
    sheet(&format!("Before {fault}"), &panels, None)
}

fn curve(states: &[State], name: &str, colour: Option<usize>, of: impl Fn(&State) -> f64) -> Curve {
    let end = states.last().map_or(0.0, |state| state.t);
    let points = states.iter().map(|state| (state.t - end, of(state))).collect();
    Curve { name: Some(name.to_owned()), points, colour, dashed: false }
}

fn panel(states: &[State], y: &str, limit: Option<f64>, curves: Vec<Curve>) -> PlotPanel {
    let values = || curves.iter().flat_map(|curve| &curve.points).map(|point| point.1);
    let most = 1.1 * values().map(f64::abs).fold(1.0e-3, f64::max);
    let least = if values().all(|value| value >= 0.0) { 0.0 } else { -most };
    let begin = states.first().zip(states.last()).map_or(-1.0, |(first, last)| first.t - last.t);
    PlotPanel {
        x: "time before the fault, s".to_owned(),
        y: y.to_owned(),
        x_range: (begin.min(-1.0e-3)..0.0, 11),
        y_range: least..most,
        limit: limit.filter(|limit| *limit < most),
        curves,
    }
}
