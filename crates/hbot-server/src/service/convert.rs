//! Conversions from the core's types to those of the TCP messages.

use hbot_api::{ClientLostPolicy, ClientStream, Fault, JointState, Mode, StateEvent, StateTiming};
use hbot_core::inputs::OnClientLost;
use hbot_core::mode;
use hbot_core::{Quat, Vec3};
use hbot_host::sample::Sample;

pub(crate) fn mode(mode: mode::Mode) -> Mode {
    match mode {
        mode::Mode::Unreferenced => Mode::Unreferenced,
        mode::Mode::Idle => Mode::Idle,
        mode::Mode::Enabling => Mode::Enabling,
        mode::Mode::Active => Mode::Active,
        mode::Mode::Fault => Mode::Fault,
        mode::Mode::Estop => Mode::Estop,
    }
}

pub(crate) fn fault(cause: mode::Cause) -> Fault {
    match cause {
        mode::Cause::LinkLost => Fault::LinkLost,
        mode::Cause::LinkCorrupt => Fault::LinkCorrupt,
        mode::Cause::ControllerFault => Fault::ControllerFault,
        mode::Cause::Overspeed => Fault::Overspeed,
        mode::Cause::Overtorque => Fault::Overtorque,
        mode::Cause::Slip => Fault::Slip,
        mode::Cause::NonFinite => Fault::NonFinite,
        mode::Cause::ImplausibleFeedback => Fault::ImplausibleFeedback,
        mode::Cause::Deadline => Fault::Deadline,
        mode::Cause::ClientLost => Fault::ClientLost,
        mode::Cause::Thermal => Fault::Thermal,
    }
}

pub(super) fn client_lost_policy(policy: OnClientLost) -> ClientLostPolicy {
    match policy {
        OnClientLost::Ramp => ClientLostPolicy::Ramp,
        OnClientLost::Keep => ClientLostPolicy::Keep,
        OnClientLost::Fault => ClientLostPolicy::Fault,
    }
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
    let state = &sample.state;
    event.tick = state.tick;
    event.t = seconds(sample.t_ns);
    event.mode = mode(state.mode);
    event.fault = state.cause.map(fault);
    event.q = [state.q.w, state.q.x, state.q.y, state.q.z];
    event.omega = state.omega.to_array();
    event.reference = state.reference.map(|q| [q.w, q.x, q.y, q.z]);
    event.torque = state.torque.to_array();
    event.joints.resize(state.joints, JointState::default());
    for (i, joint) in event.joints.iter_mut().enumerate() {
        *joint = JointState { angle: state.angle[i], rate: state.rate[i], torque: state.joint_torque[i] };
    }
    event.slip = state.slip;
    event.scale = state.scale;
    event.traction = state.traction;
    event.energy = state.energy;
    event.client = state.client.map(|client| ClientStream { seq: client.seq, age_ticks: client.age_ticks });
    event.timing = StateTiming {
        lateness_us: microseconds(sample.timing.lateness_ns),
        compute_us: microseconds(sample.timing.compute_ns),
        link_us: microseconds(sample.timing.line_ns),
        // Before the first reading the age is reported as zero.
        age_us: sample.timing.age_ns.map_or(0.0, microseconds),
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_causes_of_the_core_are_the_faults_of_the_messages() {
        assert_eq!(mode::Cause::ALL.map(fault), Fault::ALL);
    }
}
