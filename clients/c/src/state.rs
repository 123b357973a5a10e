//! States as a plain struct.

use std::ffi::{CString, c_char};
use std::sync::LazyLock;

use hbot_api::{Fault, Mode, StateEvent};

use crate::status::{Failure, HbotStatus};

/// Largest number of joints of a rig: two for each of eight wheels.
pub const HBOT_MAX_JOINTS: usize = 16;

/// What the rig is doing.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HbotMode {
    /// The zeros of the steer joints are not known yet.
    Unreferenced = 0,
    /// Ready to be enabled, without torque.
    Idle = 1,
    /// Enabled; the torque rises.
    Enabling = 2,
    /// Renders the scene.
    Active = 3,
    /// Stopped by a fault, until a reset.
    Fault = 4,
    /// Stopped by an emergency stop, until a reset.
    Estop = 5,
}

impl From<Mode> for HbotMode {
    fn from(mode: Mode) -> Self {
        match mode {
            Mode::Unreferenced => Self::Unreferenced,
            Mode::Idle => Self::Idle,
            Mode::Enabling => Self::Enabling,
            Mode::Active => Self::Active,
            Mode::Fault => Self::Fault,
            Mode::Estop => Self::Estop,
        }
    }
}

/// The cause of a fault. docs/something-is-wrong.md explains them.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HbotFault {
    /// There is no fault.
    None = 0,
    /// No reading came from a motor controller in time.
    LinkLost = 1,
    /// Too many damaged frames on the line.
    LinkCorrupt = 2,
    /// A motor controller has reported a fault.
    ControllerFault = 3,
    /// The sphere turned too fast.
    Overspeed = 4,
    /// Too much current, or too much energy to the hand.
    Overtorque = 5,
    /// A wheel slipped too fast.
    Slip = 6,
    /// A computed value was not finite.
    NonFinite = 7,
    /// A reading was physically impossible.
    ImplausibleFeedback = 8,
    /// The loop could not keep its rate.
    Deadline = 9,
    /// The connection of the lease holder ended.
    ClientLost = 10,
    /// A motor or its controller was too hot.
    Thermal = 11,
}

impl From<Option<Fault>> for HbotFault {
    fn from(fault: Option<Fault>) -> Self {
        let Some(fault) = fault else { return Self::None };
        match fault {
            Fault::LinkLost => Self::LinkLost,
            Fault::LinkCorrupt => Self::LinkCorrupt,
            Fault::ControllerFault => Self::ControllerFault,
            Fault::Overspeed => Self::Overspeed,
            Fault::Overtorque => Self::Overtorque,
            Fault::Slip => Self::Slip,
            Fault::NonFinite => Self::NonFinite,
            Fault::ImplausibleFeedback => Self::ImplausibleFeedback,
            Fault::Deadline => Self::Deadline,
            Fault::ClientLost => Self::ClientLost,
            Fault::Thermal => Self::Thermal,
        }
    }
}

/// Returns the name of a mode, such as "idle", or "unknown" for a number that is none. The text is
/// valid for ever.
#[unsafe(no_mangle)]
pub extern "C" fn hbot_mode_name(mode: i32) -> *const c_char {
    static MODES: LazyLock<[CString; Mode::ALL.len()]> =
        LazyLock::new(|| Mode::ALL.map(|it| text(it.as_str())));
    usize::try_from(mode).ok().and_then(|k| MODES.get(k)).map_or(c"unknown", |name| name).as_ptr()
}

/// Returns the name of the cause of a fault, such as "link_lost", "none" for `HBOT_FAULT_NONE`, or
/// "unknown" for a number that is none. The text is valid for ever.
#[unsafe(no_mangle)]
pub extern "C" fn hbot_fault_name(fault: i32) -> *const c_char {
    static FAULTS: LazyLock<[CString; Fault::ALL.len()]> =
        LazyLock::new(|| Fault::ALL.map(|it| text(it.as_str())));
    match usize::try_from(fault) {
        Ok(0) => c"none",
        Ok(k) => FAULTS.get(k - 1).map_or(c"unknown", |name| name),
        Err(_) => c"unknown",
    }
    .as_ptr()
}

fn text(name: &str) -> CString {
    CString::new(name).unwrap_or_default()
}

/// One joint in one tick.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HbotJoint {
    /// Angle from the joint's zero, 0 to 2 pi rad.
    pub angle: f64,
    /// Rate, rad/s.
    pub rate: f64,
    /// Commanded torque at the joint, N m.
    pub torque: f64,
}

/// The state of the rig in one tick. docs/api.md explains the fields.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HbotState {
    /// Number of the tick.
    pub tick: u64,
    /// Time of the tick since the loop began, s.
    pub t: f64,
    /// What the rig is doing.
    pub mode: HbotMode,
    /// Cause of the fault, if the mode is fault.
    pub fault: HbotFault,
    /// Orientation of the sphere: the unit quaternion {w, x, y, z} that turns sphere axes into
    /// frame N.
    pub q: [f64; 4],
    /// Angular velocity of the sphere in frame N, rad/s.
    pub omega: [f64; 3],
    /// Torque on the sphere in frame N after all limits, N m.
    pub torque: [f64; 3],
    /// Whether the scene pulls towards `reference`.
    pub has_reference: bool,
    /// Orientation to which the scene pulls, {w, x, y, z}; zeros without one.
    pub reference: [f64; 4],
    /// Number of valid elements of `joints`.
    pub joint_count: u32,
    /// Steer and drive of the first wheel, then of the next.
    pub joints: [HbotJoint; HBOT_MAX_JOINTS],
    /// Largest slip that the encoders can show, m/s.
    pub slip: f64,
    /// Fraction of the wanted torque that is left after all limits, 0 to 1.
    pub scale: f64,
    /// Largest part of the friction limit that a contact uses, 0 to 1.
    pub traction: f64,
    /// Energy given to the hand since the start, J.
    pub energy: f64,
    /// Whether a stream message has been accepted, and `client_age_ticks` counts from it.
    pub has_client: bool,
    /// Whether that message had a number, `client_seq`.
    pub has_client_seq: bool,
    /// Number of the last accepted stream message.
    pub client_seq: u64,
    /// Age of the last accepted stream message, ticks.
    pub client_age_ticks: u64,
    /// From the deadline to the start of the tick, us.
    pub lateness_us: f64,
    /// Computing time of the tick, us.
    pub compute_us: f64,
    /// Time spent on the line, us.
    pub link_us: f64,
    /// From the measurement of the joints until the torque computed from it was sent, us.
    pub age_us: f64,
    /// By how much the scene was rendered ahead of its reading, us. 0 without a lead.
    pub lead_us: f64,
    /// Whether a measurement with a sigma has been taken, and `orientation_sigma` is known.
    pub has_orientation_sigma: bool,
    /// Standard deviations of the error of `q` about the axes of frame N, rad.
    pub orientation_sigma: [f64; 3],
}

impl HbotState {
    /// Converts a state. Fails if it has more joints than a legal rig.
    pub(crate) fn of(state: &StateEvent) -> Result<Self, Failure> {
        let mut joints = [HbotJoint::default(); HBOT_MAX_JOINTS];
        let count = state.joints.len();
        let room = joints.get_mut(..count).ok_or_else(|| {
            let text = format!("a state has {count} joints; this library has room for {HBOT_MAX_JOINTS}");
            Failure::new(HbotStatus::Protocol, text)
        })?;
        for (to, from) in room.iter_mut().zip(&state.joints) {
            *to = HbotJoint { angle: from.angle, rate: from.rate, torque: from.torque };
        }
        Ok(Self {
            tick: state.tick,
            t: state.t,
            mode: state.mode.into(),
            fault: state.fault.into(),
            q: state.q,
            omega: state.omega,
            torque: state.torque,
            has_reference: state.reference.is_some(),
            reference: state.reference.unwrap_or_default(),
            joint_count: count as u32,
            joints,
            slip: state.slip,
            scale: state.scale,
            traction: state.traction,
            energy: state.energy,
            has_client: state.client.is_some(),
            has_client_seq: state.client.is_some_and(|client| client.seq.is_some()),
            client_seq: state.client.and_then(|client| client.seq).unwrap_or_default(),
            client_age_ticks: state.client.map_or(0, |client| client.age_ticks),
            lateness_us: state.timing.lateness_us,
            compute_us: state.timing.compute_us,
            link_us: state.timing.link_us,
            age_us: state.timing.age_us,
            lead_us: state.timing.lead_us,
            has_orientation_sigma: state.orientation_sigma.is_some(),
            orientation_sigma: state.orientation_sigma.unwrap_or_default(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modes_and_faults_have_the_numbers_of_their_names() {
        for (number, mode) in Mode::ALL.into_iter().enumerate() {
            assert_eq!(HbotMode::from(mode) as usize, number, "{mode}");
        }
        for (number, fault) in Fault::ALL.into_iter().enumerate() {
            assert_eq!(HbotFault::from(Some(fault)) as usize, number + 1, "{fault}");
        }
    }
}
