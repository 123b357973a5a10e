//! Conversions from the core's types to those of the TCP messages.

use hbot_api::{ClientLostPolicy, StateEvent, StateTiming};
use hbot_config::advice::Warning;
use hbot_core::inputs::OnClientLost;
use hbot_core::outputs::State;
use hbot_core::{Quat, Vec3};
use hbot_host::run_loop::sample::{Sample, TickTiming};
pub(crate) use hbot_record::public::{fault, mode};

pub(super) fn client_lost_policy(policy: OnClientLost) -> ClientLostPolicy {
    match policy {
        OnClientLost::Ramp => ClientLostPolicy::Ramp,
        OnClientLost::Keep => ClientLostPolicy::Keep,
        OnClientLost::Fault => ClientLostPolicy::Fault,
    }
}

pub(super) fn sentences(warnings: &[Warning]) -> Vec<String> {
    warnings.iter().map(ToString::to_string).collect()
}

pub(super) fn vector([x, y, z]: [f64; 3]) -> Vec3 {
    Vec3::new(x, y, z)
}

pub(super) fn quaternion([w, x, y, z]: [f64; 4]) -> Quat {
    Quat::from_xyzw(x, y, z, w)
}

pub(super) fn seconds(ns: u64) -> f64 {
    ns as f64 * 1.0e-9
}

pub(super) fn microseconds(ns: u64) -> f64 {
    ns as f64 * 1.0e-3
}

/// Fills `event` with the state of a sample. Allocates no memory after the first call.
pub(super) fn fill(event: &mut StateEvent, sample: &Sample) {
    fill_state(event, &sample.state, sample.t_ns, &sample.timing);
}

/// Fills `event` with the state of a tick. `t_ns` is the nominal time of the tick since the start
/// of the loop, ns. Allocates no memory after the first call.
pub(crate) fn fill_state(event: &mut StateEvent, state: &State, t_ns: u64, timing: &TickTiming) {
    hbot_record::public::fill(event, state, t_ns);
    event.timing = StateTiming {
        lateness_us: microseconds(timing.lateness_ns),
        compute_us: microseconds(timing.compute_ns),
        link_us: microseconds(timing.line_ns),
        // Before the first reading the age is reported as zero.
        age_us: timing.age_ns.map_or(0.0, microseconds),
        lead_us: state.lead_us,
    };
}
