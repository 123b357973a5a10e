//! What the loop did in one tick.

use crate::finite;
use crate::names::names;
use serde::{Deserialize, Serialize};

/// A sample of the loop, sent every so many ticks to who has subscribed. All belongs to one tick: the torque is the
/// one rendered at this orientation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StateEvent {
    /// The number of the tick.
    pub tick: u64,
    /// Time of the tick since the loop began, s.
    #[serde(serialize_with = "finite::scalar")]
    pub t: f64,
    /// What the rig does.
    pub mode: Mode,
    /// Why it stopped; `None` but in [`Mode::Fault`].
    pub fault: Option<Fault>,
    /// Orientation of the sphere, `[w, x, y, z]`, unit norm; its sign never jumps from one tick to the next.
    #[serde(serialize_with = "finite::array")]
    pub q: [f64; 4],
    /// Angular velocity of the sphere in N, rad/s.
    #[serde(serialize_with = "finite::array")]
    pub omega: [f64; 3],
    /// Where the first effect of the scene that has a reference is to bring the sphere, `[w, x, y, z]`, unit norm: its
    /// reference as it stands in this tick, anchored, and moved by a client. `None` where no effect has one.
    #[serde(default, serialize_with = "finite::optional_array")]
    pub reference: Option<[f64; 4]>,
    /// Torque on the sphere in N, as applied after all limits, N m.
    #[serde(serialize_with = "finite::array")]
    pub torque: [f64; 3],
    /// Each joint: steer and drive of the first wheel, then of the next.
    pub joints: Vec<JointState>,
    /// The largest slip velocity at a contact that the encoders can see, m/s, >= 0.
    #[serde(serialize_with = "finite::scalar")]
    pub slip: f64,
    /// The share of the torque wanted that the limits left, from 0 to 1.
    #[serde(serialize_with = "finite::scalar")]
    pub scale: f64,
    /// The largest tangential force at a contact over what friction holds there, 0 to 1; 1 where this limits the torque.
    #[serde(serialize_with = "finite::scalar")]
    pub traction: f64,
    /// Energy given out to the hand since the start, by the passivity observer, J; negative where more came in.
    #[serde(serialize_with = "finite::scalar")]
    pub energy: f64,
    /// The last stream message that was taken; `None` before the first.
    pub client: Option<ClientStream>,
    /// How punctual the tick was.
    pub timing: StateTiming,
}

/// A rig of which nothing is known yet: unreferenced, at the identity, at rest, with nothing cut by a limit.
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

/// A joint in a [`StateEvent`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointState {
    /// Angle from the zero, within a turn, rad, 0 to 2 pi.
    #[serde(serialize_with = "finite::scalar")]
    pub angle: f64,
    /// Its rate, rad/s.
    #[serde(serialize_with = "finite::scalar")]
    pub rate: f64,
    /// Torque commanded, N m.
    #[serde(serialize_with = "finite::scalar")]
    pub torque: f64,
}

/// The last stream message that was taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ClientStream {
    /// The `seq` of it; `None` where the client gave none.
    pub seq: Option<u64>,
    /// Ticks since the tick that it named, or else since it was taken.
    pub age_ticks: u64,
}

/// How punctual a tick was, in microseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StateTiming {
    /// From the deadline of the tick to its start.
    #[serde(serialize_with = "finite::scalar")]
    pub lateness_us: f64,
    /// In the controller: from the feedback decoded to the torques ready.
    #[serde(serialize_with = "finite::scalar")]
    pub compute_us: f64,
    /// On the serial line: reading, decoding, encoding, writing.
    #[serde(serialize_with = "finite::scalar")]
    pub link_us: f64,
    /// From the reading of the joints (taken when the command that it answers went out) to the torque on the wire that
    /// was computed from it.
    #[serde(serialize_with = "finite::scalar")]
    pub age_us: f64,
}

names! {
    /// What the rig does, as clients read it. `Mode` of hbot-core is the loop's; this crate depends on no other
    /// crate of hbot, so clients link nothing else. `convert.rs` of hbot-server maps the loop's modes to these.
    pub enum Mode {
        /// The zero of the steering is not known; no torque.
        Unreferenced = "unreferenced",
        /// Ready; no torque.
        Idle = "idle",
        /// On the way to active: the torque rises over 0.5 s.
        Enabling = "enabling",
        /// The scene is rendered.
        Active = "active",
        /// Stopped by a fault; no torque until a reset.
        Fault = "fault",
        /// Stopped by somebody; no torque until a reset.
        Estop = "estop",
    }
}

names! {
    /// Why the rig stopped by itself.
    pub enum Fault {
        /// No feedback from a controller for the rig's `timeout_ticks`.
        LinkLost = "link_lost",
        /// Too many damaged frames on the serial line.
        LinkCorrupt = "link_corrupt",
        /// A controller reports a fault of its own.
        ControllerFault = "controller_fault",
        /// The sphere turns faster than the rig's limit.
        Overspeed = "overspeed",
        /// A controller reports more current than it may, or more energy was given out than the rig's limit.
        Overtorque = "overtorque",
        /// The wheels slip more than the rig's limit.
        Slip = "slip",
        /// A computed value is not finite.
        NonFinite = "non_finite",
        /// A reading that cannot be true.
        ImplausibleFeedback = "implausible_feedback",
        /// The loop could not hold its rate.
        Deadline = "deadline",
        /// The client that commanded is gone, and the rig file asks for a fault then.
        ClientLost = "client_lost",
        /// A motor or its controller is too hot.
        Thermal = "thermal",
    }
}
