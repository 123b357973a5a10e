//! The state message: what the loop did in one tick.

use crate::{Fault, Mode, finite};
use serde::{Deserialize, Serialize};

/// The state of the rig in one tick, sent to clients that have subscribed. All fields belong to
/// this tick: `torque` is the torque rendered at the orientation `q`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StateEvent {
    /// Number of the tick.
    pub tick: u64,
    /// Time of the tick, in seconds since the control loop began.
    #[serde(serialize_with = "finite::scalar")]
    pub t: f64,
    /// Mode of the rig, such as active or stopped by a fault.
    pub mode: Mode,
    /// Cause of the fault. `None` unless the mode is [`Mode::Fault`].
    pub fault: Option<Fault>,
    /// Orientation of the sphere as a unit quaternion `[w, x, y, z]`. The quaternion never changes
    /// its sign from one tick to the next.
    #[serde(serialize_with = "finite::array")]
    pub q: [f64; 4],
    /// Angular velocity of the sphere in frame N (fixed in space), rad/s.
    #[serde(serialize_with = "finite::array")]
    pub omega: [f64; 3],
    /// Orientation towards which the scene pulls the sphere in this tick, as a unit quaternion `[w,
    /// x, y, z]`: that of the first effect with a reference. It includes the effect's anchor and
    /// changes by clients. `None` if no effect has a reference.
    #[serde(default, serialize_with = "finite::optional_array")]
    pub reference: Option<[f64; 4]>,
    /// Torque on the sphere after all limits, in frame N (fixed in space), N m.
    #[serde(serialize_with = "finite::array")]
    pub torque: [f64; 3],
    /// All joints of the rig: steer and drive of the first wheel, then of the next.
    pub joints: Vec<JointState>,
    /// Largest slip between a wheel and the sphere, as far as the encoders can detect it, m/s, at
    /// least 0.
    #[serde(serialize_with = "finite::scalar")]
    pub slip: f64,
    /// Fraction of the requested torque that remains after the limits, 0 to 1.
    #[serde(serialize_with = "finite::scalar")]
    pub scale: f64,
    /// Largest ratio, over all wheels, of the tangential force on the sphere to the friction limit,
    /// 0 to 1. It is 1 while friction limits the torque.
    #[serde(serialize_with = "finite::scalar")]
    pub traction: f64,
    /// Energy delivered to the hand since the start, as measured by the passivity observer, J.
    /// Negative if the hand has delivered more energy than it received.
    #[serde(serialize_with = "finite::scalar")]
    pub energy: f64,
    /// Sequence number and age of the last stream message that the control loop has accepted.
    /// `None` before the first.
    pub client: Option<ClientStream>,
    /// Torque of the simulated hand on the sphere in frame N, N m, at most two ticks older or newer
    /// than the tick. `None` with a real rig, and while no hand holds the sphere.
    #[serde(default, skip_serializing_if = "Option::is_none", serialize_with = "finite::optional_array")]
    pub hand: Option<[f64; 3]>,
    /// Lateness, computing time and other times of the tick.
    pub timing: StateTiming,
    /// Standard deviations of the error of `q` about the axes of frame N (fixed in space), rad, as
    /// the server estimates them. `None` until a measurement with a sigma has been taken (op
    /// `align` or `align_direction`).
    #[serde(default, skip_serializing_if = "Option::is_none", serialize_with = "finite::optional_array")]
    pub orientation_sigma: Option<[f64; 3]>,
}

/// Creates the state of a rig about which nothing is known: unreferenced, at the identity
/// orientation, at rest, and with no limit acting.
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
            hand: None,
            timing: StateTiming::default(),
            orientation_sigma: None,
        }
    }
}

/// Angle, rate and torque of one joint in one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointState {
    /// Angle of the joint from its zero, 0 to 2 pi rad. Full turns are not counted.
    #[serde(serialize_with = "finite::scalar")]
    pub angle: f64,
    /// Angular rate of the joint, rad/s.
    #[serde(serialize_with = "finite::scalar")]
    pub rate: f64,
    /// Torque that the motor was commanded to give at the joint, N m.
    #[serde(serialize_with = "finite::scalar")]
    pub torque: f64,
}

/// Sequence number and age of the last stream message that the control loop has accepted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ClientStream {
    /// Sequence number of the message (its field `seq`). `None` if it had none.
    pub seq: Option<u64>,
    /// Age of the message in ticks: since the tick that it named, or since it was accepted if it
    /// named none.
    pub age_ticks: u64,
}

/// Lateness, computing time and other times of one tick, in microseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StateTiming {
    /// Time from the tick's deadline to its start, us.
    #[serde(serialize_with = "finite::scalar")]
    pub lateness_us: f64,
    /// Time in which the control law computed the joint torques from the decoded readings, us.
    #[serde(serialize_with = "finite::scalar")]
    pub compute_us: f64,
    /// Time spent on the serial line: reading, decoding, encoding and writing, us.
    #[serde(serialize_with = "finite::scalar")]
    pub link_us: f64,
    /// Time from the measurement of the joints to the sending of the torque computed from it, us.
    /// Motor controllers measure when a command goes out to them, and report the result as the
    /// reading.
    #[serde(serialize_with = "finite::scalar")]
    pub age_us: f64,
    /// Time by which the scene is rendered ahead of its reading, us. 0 without a lead, and while
    /// there is no torque.
    #[serde(default, serialize_with = "finite::scalar")]
    pub lead_us: f64,
}
