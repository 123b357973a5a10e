//! The state message: what the loop did in one tick.

use crate::finite;
use crate::names::names;
use serde::{Deserialize, Serialize};

/// The state of the rig in one tick, sent to clients that have subscribed. All fields belong to the
/// same tick: `torque` is the torque rendered at the orientation `q`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StateEvent {
    /// Number of the tick.
    pub tick: u64,
    /// Time of the tick since the loop began, s.
    #[serde(serialize_with = "finite::scalar")]
    pub t: f64,
    /// Mode of the rig.
    pub mode: Mode,
    /// Cause of the fault. `None` unless the mode is [`Mode::Fault`].
    pub fault: Option<Fault>,
    /// Orientation of the sphere, `[w, x, y, z]`, unit norm. Its sign never jumps from one tick to
    /// the next.
    #[serde(serialize_with = "finite::array")]
    pub q: [f64; 4],
    /// Angular velocity of the sphere in frame N, rad/s.
    #[serde(serialize_with = "finite::array")]
    pub omega: [f64; 3],
    /// Orientation that the first effect with a reference pulls towards in this tick, `[w, x, y,
    /// z]`, unit norm. It includes the effect's anchor and changes by clients. `None` if no effect
    /// has a reference.
    #[serde(default, serialize_with = "finite::optional_array")]
    pub reference: Option<[f64; 4]>,
    /// Torque on the sphere in frame N after all limits, N m.
    #[serde(serialize_with = "finite::array")]
    pub torque: [f64; 3],
    /// All joints: steer and drive of the first wheel, then of the next.
    pub joints: Vec<JointState>,
    /// Largest slip at a contact that the encoders can detect, m/s, at least 0.
    #[serde(serialize_with = "finite::scalar")]
    pub slip: f64,
    /// Fraction of the requested torque that remains after the limits, 0 to 1.
    #[serde(serialize_with = "finite::scalar")]
    pub scale: f64,
    /// Largest ratio of the tangential force at a contact to its friction limit, 0 to 1. It is 1
    /// while friction limits the torque.
    #[serde(serialize_with = "finite::scalar")]
    pub traction: f64,
    /// Energy delivered to the hand since the start, from the passivity observer, J. Negative if
    /// more energy was absorbed from the hand.
    #[serde(serialize_with = "finite::scalar")]
    pub energy: f64,
    /// The last stream message that was accepted. `None` before the first.
    pub client: Option<ClientStream>,
    /// Timing of the tick.
    pub timing: StateTiming,
}

/// The state of an unknown rig: unreferenced, at the identity, at rest, and with no limit acting.
impl Default for StateEvent {
    fn default() -> Self {
        Self {
            tick: 0,
            t: 0.0,
            mode: Mode::Unreferenced,
            fault: None,
            q: [1.0, 0.0, 0.0, 0.0],
            omega: [0.0; 3],
            reference: None,
            torque: [0.0; 3],
            joints: Vec::new(),
            slip: 0.0,
            scale: 1.0,
            traction: 0.0,
            energy: 0.0,
            client: None,
            timing: StateTiming::default(),
        }
    }
}

/// The state of one joint in a [`StateEvent`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointState {
    /// Angle of the joint from its zero within one turn, 0 to 2 pi rad.
    #[serde(serialize_with = "finite::scalar")]
    pub angle: f64,
    /// Rate of the joint, rad/s.
    #[serde(serialize_with = "finite::scalar")]
    pub rate: f64,
    /// Commanded joint torque, N m.
    #[serde(serialize_with = "finite::scalar")]
    pub torque: f64,
}

/// The last stream message that the loop has accepted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ClientStream {
    /// Field `seq` of the message. `None` if it had none.
    pub seq: Option<u64>,
    /// Ticks since the tick that the message named, or since it was accepted if it named none.
    pub age_ticks: u64,
}

/// Timing of one tick, in microseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StateTiming {
    /// Time from the tick's deadline to its start, us.
    #[serde(serialize_with = "finite::scalar")]
    pub lateness_us: f64,
    /// Computing time of the control law, from decoded readings to joint torques, us.
    #[serde(serialize_with = "finite::scalar")]
    pub compute_us: f64,
    /// Time spent on the line: reading, decoding, encoding and writing, us.
    #[serde(serialize_with = "finite::scalar")]
    pub link_us: f64,
    /// Time from the measurement of the joints to the sending of the torque computed from it, us.
    /// The joints are measured when the command that the reading answers goes out.
    #[serde(serialize_with = "finite::scalar")]
    pub age_us: f64,
}

names! {
    /// The mode of the rig: what the control law is doing.
    pub enum Mode {
        /// The zeros of the steer joints are not known. No torque.
        Unreferenced = "unreferenced",
        /// The rig is ready. No torque.
        Idle = "idle",
        /// The rig is becoming active. The torque rises over 0.5 s.
        Enabling = "enabling",
        /// The scene is being rendered.
        Active = "active",
        /// The rig was stopped by a fault. No torque until a reset.
        Fault = "fault",
        /// The rig was stopped by an emergency stop. No torque until a reset.
        Estop = "estop",
    }
}

names! {
    /// The cause of a fault, which made the rig stop by itself.
    pub enum Fault {
        /// No new reading from a motor controller for `timeout_ticks` ticks (a key of the rig
        /// file).
        LinkLost = "link_lost",
        /// Too many damaged frames on the serial line.
        LinkCorrupt = "link_corrupt",
        /// A motor controller reports a fault.
        ControllerFault = "controller_fault",
        /// The sphere turns faster than the rig's limit.
        Overspeed = "overspeed",
        /// A motor controller reports too much current, or the energy delivered to the hand exceeds
        /// the rig's limit.
        Overtorque = "overtorque",
        /// The slip at a contact exceeds the rig's limit.
        Slip = "slip",
        /// A computed value is not finite.
        NonFinite = "non_finite",
        /// A reading has physically impossible values.
        ImplausibleFeedback = "implausible_feedback",
        /// The loop could not keep its rate.
        Deadline = "deadline",
        /// The connection of the lease holder ended, and the rig file asks for a fault in this
        /// case.
        ClientLost = "client_lost",
        /// A motor or its motor controller is too hot.
        Thermal = "thermal",
    }
}
