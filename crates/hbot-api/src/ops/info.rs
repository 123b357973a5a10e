//! The op `info`.
//!
//! A field that the server does not send is read as its default (0, an empty list, `None`). The
//! types thus also serve clients of older servers.

use super::{Op, OpRow, Who};
use crate::names::names;
use crate::{Client, ClientError, finite};
use crate::{FaultEvent, Mode, ShakingEvent, WarningParts};
use serde::{Deserialize, Serialize};
use serde_json::Value;

pub(super) const ROW: OpRow = OpRow::new(Who::Any, &[]).weighing(500);

/// The answer to the op `info`. It describes the rig and the running scene.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct InfoOk {
    /// Description of the rig.
    pub rig: RigInfo,
    /// The time of tick 0. `None` if the server does not send this field.
    pub clock: Option<ClockInfo>,
    /// Limits on the torque, speed and energy of the rig.
    pub limits: LimitsInfo,
    /// Estimates of the stiffest springs that the rig can render. `None` if the inertias of a wheel
    /// contradict each other.
    pub render: Option<RenderInfo>,
    /// Name of the preset of numerical methods: `fast`, `balanced`, `exact`, or `custom` if the rig
    /// file names each method.
    pub accuracy: String,
    /// What happens to the torque when the connection of the client that holds the lease ends.
    pub on_client_lost: ClientLostPolicy,
    /// Kinds of effects that a scene can contain.
    pub effects: Vec<KindInfo>,
    /// Phenomena, such as friction, that a scene can switch on in the simulated rig. `None` if the
    /// rig is real.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub phenomena: Option<Vec<KindInfo>>,
    /// The ready-made scenes, which the op `load_scene` accepts by their names.
    pub scenes: Vec<SceneInfo>,
    /// What each mode of the rig means, for people.
    pub modes: Vec<ModeWords>,
    /// What each fault means and what to do about it, for people.
    pub faults: Vec<FaultWords>,
    /// The running scene, in the form that the op `load_scene` accepts.
    pub scene: Value,
    /// Warnings about the running scene, as in the answer to `load_scene`.
    pub warnings: Vec<String>,
    /// The same warnings in parts.
    pub advice: Vec<WarningParts>,
    /// Largest stiffness with which the loop is expected to keep the running scene stable, for each
    /// stiffness in it, the rest of the scene unchanged. `None` until the server has computed it
    /// for the present values, or if it does not send this field.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stable: Option<Vec<StableInfo>>,
    /// Torque of the running scene about n1, n2 and n3, each as pairs of the angle about this axis
    /// from the scene's anchor, rad, and the torque about it, N m: from minus half a turn to half a
    /// turn and back. `None` as for `stable`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub curves: Option<[Vec<[f64; 2]>; 3]>,
    /// Largest torque on the sphere about each axis of frame N (n1, n2, n3) at the present steer
    /// angles, N m. `None` before the first tick.
    #[serde(serialize_with = "finite::optional_array")]
    pub capability: Option<[f64; 3]>,
    /// The client that holds the lease. `None` if the server does not send this field.
    pub lease: Option<LeaseInfo>,
    /// Mode of the rig in the newest tick. `None` before the first tick, or if the server does not
    /// send this field.
    pub mode: Option<Mode>,
    /// The event of the fault or the emergency stop in which the rig is now: its cause in words,
    /// and who stopped it. `None` in other modes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub incident: Option<FaultEvent>,
    /// The last event of a sphere that shakes by itself, while the torque is lowered for it. `None`
    /// with the full torque, or if the server does not send this field.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shaking: Option<ShakingEvent>,
}

/// The largest stiffness of an effect with which the running scene is stable.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StableInfo {
    /// Id of the effect.
    pub effect: String,
    /// Axis of the effect's reference, 1 to 3, if its stiffness is a matrix. `None`: all axes.
    pub axis: Option<u8>,
    /// The stiffness, N m/rad.
    #[serde(serialize_with = "finite::scalar")]
    pub stiffness: f64,
}

/// Description of the rig: its sphere, wheels and tick rate.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RigInfo {
    /// Name of the rig.
    pub name: String,
    /// Whether the rig is simulated.
    pub simulated: bool,
    /// Tick rate of the loop, Hz.
    pub rate_hz: u32,
    /// Sphere of the rig.
    pub sphere: SphereInfo,
    /// Wheels of the rig. State messages list the joints in the same order.
    pub wheels: Vec<WheelInfo>,
}

/// The time of tick 0 on two clocks of the server's machine. A state with time `t` belongs to the
/// moment `unix_ns + 1e9 t`. The time of the built-in simulated rig waits if the machine is busy,
/// and each wait moves this clock. In virtual time it is the moment at which the loop started, and
/// the time `t` of later ticks does not follow these clocks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct ClockInfo {
    /// Deadline of tick 0 on CLOCK_MONOTONIC, ns.
    pub monotonic_ns: u64,
    /// The same moment on CLOCK_REALTIME, measured when the loop started: ns since 1970-01-01 00:00
    /// UTC. A JSON reader that holds numbers as doubles rounds it, by at most 128 ns.
    pub unix_ns: u64,
}

/// Size and mass of the sphere.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct SphereInfo {
    /// Radius of the sphere, m.
    #[serde(serialize_with = "finite::scalar")]
    pub radius: f64,
    /// Mass of the sphere, kg.
    #[serde(serialize_with = "finite::scalar")]
    pub mass: f64,
}

/// Position and size of one wheel, as described in the rig file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct WheelInfo {
    /// Name of the wheel. `None` if it has no name.
    pub name: Option<String>,
    /// Steering axis of the wheel, a unit vector in frame N.
    #[serde(serialize_with = "finite::array")]
    pub axis: [f64; 3],
    /// Cone angle between the steering axis and the contact normal, rad.
    #[serde(serialize_with = "finite::scalar")]
    pub cone: f64,
    /// Toe angle: the wheel's rolling direction is turned by this angle about the contact normal,
    /// rad.
    #[serde(serialize_with = "finite::scalar")]
    pub toe: f64,
    /// Radius of the wheel, m.
    #[serde(serialize_with = "finite::scalar")]
    pub radius: f64,
    /// Joint that steers the wheel.
    pub steer: JointInfo,
    /// Joint that drives the wheel.
    pub drive: JointInfo,
}

/// The torque limits of a joint's motor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct JointInfo {
    /// Largest joint torque that the motor can give for a short time, N m.
    #[serde(serialize_with = "finite::scalar")]
    pub peak: f64,
    /// Joint torque that the motor can hold without time limit, N m.
    #[serde(serialize_with = "finite::scalar")]
    pub continuous: f64,
}

/// The limits that the rig keeps while it renders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct LimitsInfo {
    /// Largest torque on the sphere, N m.
    #[serde(serialize_with = "finite::scalar")]
    pub torque: f64,
    /// Largest rate of change of the torque on the sphere, N m/s.
    #[serde(serialize_with = "finite::scalar")]
    pub torque_rate: f64,
    /// Largest angular speed of the sphere while the motors are on, rad/s.
    #[serde(serialize_with = "finite::scalar")]
    pub speed: f64,
    /// Largest slip between a wheel and the sphere while the motors are on, m/s.
    #[serde(serialize_with = "finite::scalar")]
    pub slip: f64,
    /// Limit on the energy delivered to the hand. `None` if only torque and speed are limited.
    pub energy: Option<EnergyInfo>,
    /// Friction between wheels and sphere, which limits the torque. `None` if the rig file does not
    /// give it.
    pub traction: Option<TractionInfo>,
    /// The energy limit that the passivity controller keeps. `None` if the rig file switches the
    /// passivity controller off, or if the server does not send this field.
    pub passivity: Option<PassivityInfo>,
    /// Largest angle between the sphere and the rest orientation of an effect at which rendering
    /// can begin, rad.
    #[serde(serialize_with = "finite::scalar")]
    pub enable_max_angle: f64,
    /// How fast the op `align` corrects the sphere's orientation, rad/s.
    #[serde(serialize_with = "finite::scalar")]
    pub align_rate: f64,
    /// How fast a reference moves to a new orientation that a client sends, at most, rad/s.
    #[serde(serialize_with = "finite::scalar")]
    pub reference_rate: f64,
    /// Largest age of a client's stream message, in ticks since the tick that it names.
    pub max_age_ticks: u32,
}

/// Limit on the energy delivered to the hand: `power` for any time, and `burst` in addition.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct EnergyInfo {
    /// Energy that can be delivered to the hand at once in excess of `power`, J.
    #[serde(serialize_with = "finite::scalar")]
    pub burst: f64,
    /// Power that can be delivered to the hand without time limit, W.
    #[serde(serialize_with = "finite::scalar")]
    pub power: f64,
}

/// The energy limit that the passivity controller keeps, and how strongly it acts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct PassivityInfo {
    /// Energy that can be delivered to the hand in excess of the energy absorbed from it, J.
    #[serde(serialize_with = "finite::scalar")]
    pub allowance: f64,
    /// Largest amount of absorbed energy that can be delivered again later, J.
    #[serde(serialize_with = "finite::scalar")]
    pub store: f64,
    /// Largest damping that the passivity controller adds, N m s/rad.
    #[serde(serialize_with = "finite::scalar")]
    pub damping: f64,
}

/// Friction between wheels and sphere, which limits the torque.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct TractionInfo {
    /// Friction coefficient between wheel and sphere.
    #[serde(serialize_with = "finite::scalar")]
    pub mu: f64,
    /// Normal force of each wheel on the sphere, N.
    #[serde(serialize_with = "finite::scalar")]
    pub normal_force: f64,
}

/// Estimates of the stiffest springs that a rig can render, if neither friction nor a hand damps
/// the sphere.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RenderInfo {
    /// Smallest apparent inertia of the sphere about any axis, kg m².
    #[serde(serialize_with = "finite::scalar")]
    pub inertia: f64,
    /// Damping of the spring to which `stiffness_stable` applies, N m s/rad.
    #[serde(serialize_with = "finite::scalar")]
    pub damping: f64,
    /// Largest stiffness at which a spring is stable if its damping is `damping`, N m/rad.
    #[serde(serialize_with = "finite::scalar")]
    pub stiffness_stable: f64,
    /// Stiffness above which no spring is stable, with any damping, N m/rad.
    #[serde(serialize_with = "finite::scalar")]
    pub stiffness_most: f64,
    /// Damping above which the damping alone is unstable, N m s/rad. 0 if an older server does not
    /// send it.
    #[serde(serialize_with = "finite::scalar")]
    pub damping_most: f64,
    /// The border of stability of one spring alone: pairs of its damping, N m s/rad, and the
    /// largest stiffness that is stable with it, N m/rad, in the order of the damping. Between two
    /// pairs the border is nearly straight. Empty if an older server does not send it.
    pub border: Vec<[f64; 2]>,
    /// Which estimate of the joint rates the rig has picked by itself and why, as one sentence.
    /// `None` if the rig file names the estimate.
    pub rate_pick: Option<String>,
    /// The loop from which these numbers follow, and by which the server warns of scenes. `None`
    /// if an older server does not send it.
    #[serde(rename = "loop")]
    pub sampled: Option<LoopInfo>,
}

/// The loop from a reading of the sphere's motion to the torque that acts on it. With the tick rate
/// and the limits it decides what the rig keeps stable.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct LoopInfo {
    /// Whole ticks from a reading to the torque that is computed from it.
    pub delay_ticks: u32,
    /// Time constant with which the motors' torque follows its command, s.
    #[serde(serialize_with = "finite::scalar")]
    pub lag_s: f64,
    /// Time by which the scene is rendered ahead of its reading, s.
    #[serde(serialize_with = "finite::scalar")]
    pub lead_s: f64,
    /// Time constant of the filter of the motor controllers' encoders, s. 0 for none.
    #[serde(serialize_with = "finite::scalar")]
    pub rate_lag_s: f64,
    /// Weights of the last angles in a rate that is estimated from them, 1/s, the newest angle
    /// first. Empty if the rates are those of the motor controllers.
    pub rate_weights: Vec<f64>,
    /// Inertia of the sphere about each of `axes`, kg m².
    #[serde(serialize_with = "finite::array")]
    pub inertia: [f64; 3],
    /// The principal axes of the inertia, unit vectors in frame N.
    pub axes: [[f64; 3]; 3],
}

/// Description of a kind of effect, or of a phenomenon of the simulated rig.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct KindInfo {
    /// Name of the kind or phenomenon in scene files.
    pub name: String,
    /// A description, for people, of what the kind or phenomenon does.
    pub description: String,
    /// JSON schema of the parameters, with the `unit` of each.
    pub schema: Value,
}

/// A ready-made scene, which is a part of the server's program.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct SceneInfo {
    /// Name of the scene's file without `.toml`, which the op `load_scene` accepts.
    pub file: String,
    /// Name of the scene.
    pub name: String,
    /// One sentence on what the scene feels like.
    pub description: String,
}

/// What a mode of the rig means, for the person who uses it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct ModeWords {
    /// Name of the mode in messages.
    pub name: String,
    /// What the mode means.
    pub sentence: String,
}

/// What a fault means, for the person who uses the rig.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct FaultWords {
    /// Name of the fault in messages.
    pub name: String,
    /// What happened.
    pub sentence: String,
    /// What to do about it.
    pub remedy: String,
}

/// The client that holds the lease, which is the right to command.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct LeaseInfo {
    /// Name of the client that holds the lease. `None` if no client holds it.
    pub holder: Option<String>,
    /// Number of the connection of the client that holds the lease, as in its
    /// [`HelloOk`](crate::HelloOk). `None` if the lease is free.
    pub session: Option<u64>,
}

names! {
    /// What happens to the torque when the connection of the client that holds the lease ends.
    #[derive(Default)]
    pub enum ClientLostPolicy {
        /// The torque that the client streamed falls to zero gradually. The scene stays.
        #[default]
        Ramp = "ramp",
        /// The torque that the client streamed and the scene stay as they are.
        Keep = "keep",
        /// The rig stops with the fault `client_lost`.
        Fault = "fault",
    }
}

impl InfoOk {
    /// Returns the kind of effect with this name, or `None` if there is no such kind.
    #[must_use]
    pub fn kind(&self, name: &str) -> Option<&KindInfo> {
        self.effects.iter().find(|kind| kind.name == name)
    }
}

impl Client {
    /// Asks for the description of the rig, the kinds of effects with their parameters, and the
    /// running scene.
    pub fn info(&mut self) -> Result<InfoOk, ClientError> {
        self.ask(Op::Info)
    }
}
