//! What the states before a fault show, in sentences.

use hbot_config::RigConfig;
use hbot_record::messages::foxglove::Vector3;
use hbot_record::messages::hbot::State;

/// A sentence about the time before a fault, with a word in front.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Finding {
    pub(super) label: &'static str,
    pub(super) text: String,
}

/// A fraction of a limit at which it counts as reached.
const AT_LIMIT: f64 = 0.98;
/// A swing is told if the sphere turns back this often in the last half second.
const LEAST_TURNS: usize = 6;
/// The time in which swings are counted, s.
const SWING_S: f64 = 0.5;
/// Below this rate, rad/s, a swing is noise.
const NOISE: f64 = 0.05;
/// A swing grows if at least this number of successive peaks grow.
const LEAST_PEAKS: usize = 3;
/// A peak of this many times the one before has another cause than the swing.
const MOST_GROWTH: f64 = 4.0;
/// A peak may be smaller than the one before it by this part, because it lies between two ticks.
const BETWEEN_TICKS: f64 = 0.05;
/// A swing grows or decays if it changes by this factor.
const CHANGE: f64 = 1.5;

/// Returns the findings about the states before a fault of `rig`. The last state is the first of
/// the fault.
pub(super) fn of(states: &[State], rig: &RigConfig) -> Vec<Finding> {
    let Some((last, before)) = states.split_last() else { return Vec::new() };
    let found = [
        ("speed", speed(before, last, rig.rig.limits.speed)),
        ("swings", swings(before)),
        ("torque", torque(before, last, rig.rig.limits.torque)),
        ("grip", grip(before, last, rig.rig.limits.slip)),
        ("energy", energy(before, last)),
        ("stream", stream(before, last, rig)),
        ("loop", timing(states, rig)),
    ];
    found.into_iter().filter_map(|(label, text)| Some(Finding { label, text: text? })).collect()
}

pub(super) fn components(v: Option<&Vector3>) -> [f64; 3] {
    v.map_or([0.0; 3], |v| [v.x, v.y, v.z])
}

pub(super) fn length(v: Option<&Vector3>) -> f64 {
    components(v).iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Returns a time before the fault in words.
fn ago(last: &State, t: f64) -> String {
    let s = last.t - t;
    if s < 1.0 { format!("{:.0} ms before", 1000.0 * s) } else { format!("{s:.1} s before") }
}

fn speed(before: &[State], last: &State, limit: f64) -> Option<String> {
    let fastest = before
        .iter()
        .chain([last])
        .max_by(|a, b| length(a.omega.as_ref()).total_cmp(&length(b.omega.as_ref())))?;
    let most = length(fastest.omega.as_ref());
    let beyond = before.iter().find(|state| length(state.omega.as_ref()) > AT_LIMIT * limit);
    let since =
        beyond.map_or_else(String::new, |state| format!("; at the limit from {} on", ago(last, state.t)));
    Some(format!("up to {most:.2} rad/s, {} (limit {limit} rad/s){since}", ago(last, fastest.t)))
}

/// Says that the sphere swung about the axis of its largest rate, how fast, and whether it grew.
fn swings(before: &[State]) -> Option<String> {
    let end = before.last()?.t;
    let late: Vec<[f64; 4]> = before
        .iter()
        .filter(|state| state.t > end - SWING_S)
        .map(|state| {
            let [x, y, z] = components(state.omega.as_ref());
            [state.t, x, y, z]
        })
        .collect();
    let most = |axis: usize| late.iter().map(|s| s[axis].abs()).fold(0.0, f64::max);
    let axis = (1..4).max_by(|a, b| most(*a).total_cmp(&most(*b)))?;
    // The time and the largest rate of each half swing.
    let peaks: Vec<(f64, f64)> = late
        .chunk_by(|a, b| a[axis] * b[axis] >= 0.0)
        .filter_map(|half| half.iter().map(|s| (s[0], s[axis].abs())).max_by(|a, b| a.1.total_cmp(&b.1)))
        .filter(|(_, rate)| *rate >= NOISE)
        .collect();
    let ((begin, first), (until, last)) = (*peaks.first()?, *peaks.last()?);
    if peaks.len() <= LEAST_TURNS {
        return None;
    }
    let rates: Vec<f64> = peaks.iter().map(|(_, rate)| *rate).collect();
    let now = rates.iter().copied().fold(0.0, f64::max);
    let how = if let Some(from) = grown(rates.iter().copied()).filter(|_| last > first) {
        format!(", growing from {from:.2} to {now:.2} rad/s: the loop shook itself")
    } else if grown(rates.iter().rev().copied()).is_some() {
        format!(", decaying from {now:.2} to {last:.2} rad/s")
    } else {
        format!(", with {now:.2} rad/s")
    };
    Some(format!(
        "about n{axis} at {:.0} Hz in the last {:.1} s{how}",
        (peaks.len() - 1) as f64 / (2.0 * (until - begin)),
        late.last()?[0] - late.first()?[0]
    ))
}

/// Returns the first of the successive peaks that grow, if there are enough of them, and they grow
/// enough.
fn grown(peaks: impl Iterator<Item = f64>) -> Option<f64> {
    let peaks: Vec<f64> = peaks.collect();
    let grows = |a: &f64, b: &f64| (1.0 - BETWEEN_TICKS..MOST_GROWTH).contains(&(b / a));
    let runs = peaks.chunk_by(grows).filter(|run| run.len() >= LEAST_PEAKS);
    runs.map(|run| (run[0], run[run.len() - 1])).find(|(from, to)| *to > CHANGE * from).map(|(from, _)| from)
}

fn torque(before: &[State], last: &State, limit: f64) -> Option<String> {
    let most = before.iter().map(|state| length(state.torque.as_ref())).fold(0.0, f64::max);
    // How long the limits have cut the torque off, without a break, until the fault.
    let cut = before.iter().rev().take_while(|state| state.scale < AT_LIMIT).last();
    let cut = cut.map_or_else(String::new, |first| {
        let least = before.iter().filter(|s| s.t >= first.t).map(|s| s.scale).fold(1.0, f64::min);
        format!(
            "; limits have cut it off from {} on, to {:.0} % of what was wanted",
            ago(last, first.t),
            100.0 * least
        )
    });
    Some(format!("up to {most:.3} N m (limit {limit} N m){cut}"))
}

fn grip(before: &[State], last: &State, limit: f64) -> Option<String> {
    let grip = before.iter().map(|state| state.traction).fold(0.0, f64::max);
    let slip = before.iter().chain([last]).map(|state| state.slip).fold(0.0, f64::max);
    (grip > 0.5 || slip > 0.5 * limit).then(|| {
        format!(
            "up to {:.0} % of what friction holds; slip up to {slip:.3} m/s (limit {limit} m/s)",
            100.0 * grip
        )
    })
}

fn energy(before: &[State], last: &State) -> Option<String> {
    let given = last.energy - before.first()?.energy;
    let way = if given < 0.0 { "taken from" } else { "given to" };
    (given.abs() > 1.0e-3)
        .then(|| format!("{:.1} mJ {way} the hand in {:.1} s", 1.0e3 * given.abs(), last.t - before[0].t))
}

fn stream(before: &[State], last: &State, rig: &RigConfig) -> Option<String> {
    let newest = before.last()?.client.as_ref()?;
    let period_ms = 1.0e-6 * rig.rig.timing.period_ns as f64;
    let oldest =
        before.iter().filter_map(|state| state.client.as_ref()).map(|client| client.age_ticks).max()?;
    let ms = |ticks: u64| ticks as f64 * period_ms;
    Some(format!(
        "a client's newest message was {:.0} ms old at the fault, {:.0} ms at most in {:.1} s",
        ms(newest.age_ticks),
        ms(oldest),
        last.t - before[0].t
    ))
}

fn timing(states: &[State], rig: &RigConfig) -> Option<String> {
    let late = |state: &State| state.timing.as_ref().map_or(0.0, |timing| timing.lateness_us);
    let latest = states.iter().max_by(|a, b| late(a).total_cmp(&late(b)))?;
    let period_us = 1.0e-3 * rig.rig.timing.period_ns as f64;
    (late(latest) > 0.25 * period_us).then(|| {
        format!(
            "a tick began {:.1} ms late, {} (period {:.1} ms)",
            1.0e-3 * late(latest),
            ago(states.last().unwrap_or(latest), latest.t),
            1.0e-3 * period_us
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns one second of states at 1 kHz before an overspeed, whose rate about n2 is `rate` of
    /// the time, and whose torque is cut off in the last 0.3 s.
    fn states(rate: impl Fn(f64) -> f64) -> Vec<State> {
        let state = |k: u64| {
            let t = k as f64 * 1.0e-3;
            let fault = if k == 1000 { "overspeed" } else { "" };
            State {
                tick: k,
                t,
                mode: if k == 1000 { "fault" } else { "active" }.to_owned(),
                fault: fault.to_owned(),
                omega: Some(Vector3 { x: 0.0, y: rate(t), z: 0.0 }),
                torque: Some(Vector3 { x: 0.0, y: 0.4, z: 0.3 }),
                scale: if t > 0.7 { 0.5 } else { 1.0 },
                ..State::default()
            }
        };
        (0..=1000).map(state).collect()
    }

    fn said(states: &[State], label: &str) -> Option<String> {
        let all = of(states, &RigConfig::prototype());
        all.into_iter().find(|finding| finding.label == label).map(|finding| finding.text)
    }

    #[test]
    fn the_speed_before_an_overspeed_and_the_torque_at_its_limit_are_told() {
        let limit = RigConfig::prototype().rig.limits.speed;
        let fast = states(|t| if (t - 0.988).abs() < 4.0e-4 { 40.0 } else { 0.1 });
        let told = said(&fast, "speed").unwrap();
        assert!(
            told.starts_with(&format!("up to 40.00 rad/s, 12 ms before (limit {limit} rad/s)")),
            "{told}"
        );
        let torque = said(&fast, "torque").unwrap();
        assert!(torque.starts_with("up to 0.500 N m"), "{torque}");
        assert!(torque.contains("cut it off from 300 ms before on, to 50 % of what was wanted"), "{torque}");
        assert_eq!(said(&fast, "swings"), None);
        assert_eq!(said(&fast, "loop"), None);
    }

    #[test]
    fn a_swing_that_grows_is_told_with_its_frequency_and_axis() {
        let swing = states(|t| (5.0 * t).exp() * 0.01 * (std::f64::consts::TAU * 40.0 * t).sin());
        let told = said(&swing, "swings").unwrap();
        assert!(told.starts_with("about n2 at 40 Hz in the last 0.5 s, growing from"), "{told}");
        let even = states(|t| 0.2 * (std::f64::consts::TAU * 40.0 * t).sin());
        assert_eq!(said(&even, "swings").unwrap(), "about n2 at 40 Hz in the last 0.5 s, with 0.20 rad/s");
    }

    /// A hand that lets go of a spring leaves a ring, which is no swing of the loop.
    #[test]
    fn a_ring_that_decays_does_not_grow() {
        let ring = |decay: f64, hz: f64| {
            states(move |t| {
                let after = t - 0.85;
                let noise = 0.04 * (std::f64::consts::TAU * 15.0 * t).sin();
                let ring = 4.0 * (-decay * after).exp() * (std::f64::consts::TAU * hz * after).sin();
                if after < 0.0 { noise } else { ring }
            })
        };
        assert_eq!(said(&ring(12.0, 5.0), "swings"), None, "two peaks");
        let told = said(&ring(12.0, 30.0), "swings").unwrap();
        assert!(told.starts_with("about n2 at 30 Hz") && told.contains(", decaying from 3.6"), "{told}");
    }
}
