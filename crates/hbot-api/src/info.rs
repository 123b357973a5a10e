//! What `info` answers.
//!
//! What a server does not say is read as its default (0, an empty list, `None`), so the types serve clients of older servers too.

use crate::finite;
use crate::names::names;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// The answer to `info`: what the rig is and can do, and what runs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct InfoOk {
    /// The rig.
    pub rig: RigInfo,
    /// Its limits.
    pub limits: LimitsInfo,
    /// What it can be expected to render; `None` if the inertias of a wheel contradict each other.
    pub render: Option<RenderInfo>,
    /// The methods in use: `fast`, `balanced`, `exact`, or `custom` if the rig file names each.
    pub accuracy: String,
    /// What happens to torque when the connection of the lease's holder ends.
    pub on_client_lost: ClientLostPolicy,
    /// The kinds of effects.
    pub effects: Vec<KindInfo>,
    /// The phenomena that a scene can ask of a simulated rig; `None` with a real one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub phenomena: Option<Vec<KindInfo>>,
    /// The scene that runs, as `load_scene` takes it.
    pub scene: Value,
    /// The largest torque about n1, n2 and n3 at this posture, N m; `None` before the first tick.
    #[serde(serialize_with = "finite::optional_array")]
    pub capability: Option<[f64; 3]>,
    /// Who may command; `None` from a server that does not say.
    pub lease: Option<LeaseInfo>,
}

/// The rig in an [`InfoOk`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RigInfo {
    /// Its name.
    pub name: String,
    /// Whether it is the simulated one.
    pub simulated: bool,
    /// Ticks a second, Hz.
    pub rate_hz: u32,
    /// Its sphere.
    pub sphere: SphereInfo,
    /// Its wheels, in the order of the joints of a state.
    pub wheels: Vec<WheelInfo>,
}

/// The sphere of a rig.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct SphereInfo {
    /// m
    #[serde(serialize_with = "finite::scalar")]
    pub radius: f64,
    /// kg
    #[serde(serialize_with = "finite::scalar")]
    pub mass: f64,
}

/// A wheel of a rig, as the rig file states it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct WheelInfo {
    /// What the rig file calls it; `None` if it has no name.
    pub name: Option<String>,
    /// Steering axis in N, unit length.
    #[serde(serialize_with = "finite::array")]
    pub axis: [f64; 3],
    /// Angle between the steering axis and the contact normal, rad.
    #[serde(serialize_with = "finite::scalar")]
    pub cone: f64,
    /// Angle of the rolling direction about the contact normal, rad.
    #[serde(serialize_with = "finite::scalar")]
    pub toe: f64,
    /// m
    #[serde(serialize_with = "finite::scalar")]
    pub radius: f64,
    /// The joint that steers it.
    pub steer: JointInfo,
    /// The joint that drives it.
    pub drive: JointInfo,
}

/// The torque of a joint's motor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct JointInfo {
    /// The most that it may have for a moment, N m.
    #[serde(serialize_with = "finite::scalar")]
    pub peak: f64,
    /// The most that it may have for ever, N m.
    #[serde(serialize_with = "finite::scalar")]
    pub continuous: f64,
}

/// The limits of a rig.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct LimitsInfo {
    /// Largest torque on the sphere, N m.
    #[serde(serialize_with = "finite::scalar")]
    pub torque: f64,
    /// Largest change of that torque, N m/s.
    #[serde(serialize_with = "finite::scalar")]
    pub torque_rate: f64,
    /// Largest angular speed of the powered sphere, rad/s.
    #[serde(serialize_with = "finite::scalar")]
    pub speed: f64,
    /// Largest slip velocity of the powered sphere at a contact, m/s.
    #[serde(serialize_with = "finite::scalar")]
    pub slip: f64,
    /// How much energy may go into the hand; `None` for as much as torque and speed allow.
    pub energy: Option<EnergyInfo>,
    /// What the contacts hold; `None` if the rig file does not say.
    pub traction: Option<TractionInfo>,
    /// How far an effect may be from where it rests when rendering begins, rad.
    #[serde(serialize_with = "finite::scalar")]
    pub enable_max_angle: f64,
    /// How fast an `align` corrects the orientation, rad/s.
    #[serde(serialize_with = "finite::scalar")]
    pub align_rate: f64,
    /// How fast a `reference` moves, rad/s.
    #[serde(serialize_with = "finite::scalar")]
    pub reference_rate: f64,
    /// How old the `tick` of a stream message may be, ticks.
    pub max_age_ticks: u32,
}

/// The limit on the energy given out to the hand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct EnergyInfo {
    /// Energy beyond what `power` allows, J.
    #[serde(serialize_with = "finite::scalar")]
    pub burst: f64,
    /// What may be given out for ever, W.
    #[serde(serialize_with = "finite::scalar")]
    pub power: f64,
}

/// The friction limit of the contacts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct TractionInfo {
    /// Coefficient of friction.
    #[serde(serialize_with = "finite::scalar")]
    pub mu: f64,
    /// Normal force of each wheel, N.
    #[serde(serialize_with = "finite::scalar")]
    pub normal_force: f64,
}

/// What a spring can be expected to do on a rig, without help from friction or hand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RenderInfo {
    /// The least apparent inertia of the sphere about any axis, kg m².
    #[serde(serialize_with = "finite::scalar")]
    pub inertia: f64,
    /// The damping that `stiffness_stable` is for, N m s/rad.
    #[serde(serialize_with = "finite::scalar")]
    pub damping: f64,
    /// Up to which stiffness a spring with this damping stays stable in this loop, N m/rad.
    #[serde(serialize_with = "finite::scalar")]
    pub stiffness_stable: f64,
    /// The stiffness beyond which no spring is stable, N m/rad.
    #[serde(serialize_with = "finite::scalar")]
    pub stiffness_most: f64,
}

/// A kind of effect, or a phenomenon of the simulated rig.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct KindInfo {
    /// What scenes call it.
    pub name: String,
    /// What it is, for people.
    pub description: String,
    /// JSON schema of its parameters, with the `unit` of each.
    pub schema: Value,
}

/// Who holds the lease.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct LeaseInfo {
    /// The name of its holder; `None` if it is free.
    pub holder: Option<String>,
    /// The session of its holder, as in its [`HelloOk`](crate::HelloOk); `None` if it is free.
    pub session: Option<u64>,
}

names! {
    /// What happens to torque when the connection of the lease's holder ends.
    #[derive(Default)]
    pub enum ClientLostPolicy {
        /// The stream ramps out, the scene stays.
        #[default]
        Ramp = "ramp",
        /// Stream and scene stay as they are.
        Keep = "keep",
        /// The rig goes into a fault.
        Fault = "fault",
    }
}

impl InfoOk {
    /// The kind of effect of this name.
    #[must_use]
    pub fn kind(&self, name: &str) -> Option<&KindInfo> {
        self.effects.iter().find(|kind| kind.name == name)
    }
}
