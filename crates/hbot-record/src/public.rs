//! The public topics: messages that viewers understand, made from the messages of the TCP API.

use hbot_api::{ClientStream, Event, Fault, JointState, Mode, StateEvent};
use hbot_core::outputs::State;
use hbot_core::safety::mode;
use prost::Message;

use crate::messages::foxglove::{self, FrameTransform, FrameTransforms, Log, Quaternion, Vector3};
use crate::messages::hbot;
use crate::topic::Topic;

/// Name of the frame fixed in space.
pub const FRAME_N: &str = "N";
/// Name of the frame of the sphere.
pub const FRAME_SPHERE: &str = "sphere";
/// Name of the frame towards which the scene pulls the sphere.
pub const FRAME_REFERENCE: &str = "reference";

const NS: u64 = 1_000_000_000;

/// Returns the mode of the core as the messages of the TCP API name it.
#[must_use]
pub fn mode(mode: mode::Mode) -> Mode {
    match mode {
        mode::Mode::Unreferenced => Mode::Unreferenced,
        mode::Mode::Idle => Mode::Idle,
        mode::Mode::Enabling => Mode::Enabling,
        mode::Mode::Active => Mode::Active,
        mode::Mode::Fault => Mode::Fault,
        mode::Mode::Estop => Mode::Estop,
    }
}

/// Returns the cause of a fault as the messages of the TCP API name it.
#[must_use]
pub fn fault(cause: mode::Cause) -> Fault {
    // Both lists have one order.
    Fault::ALL[cause as usize]
}

/// Fills `event` with the state of a tick, all but its times. `t_ns` is the nominal time of the
/// tick since the start of the loop, ns. Allocates no memory after the first call.
pub fn fill(event: &mut StateEvent, state: &State, t_ns: u64) {
    event.tick = state.tick;
    event.t = t_ns as f64 * 1.0e-9;
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
    event.orientation_sigma = state.sigma.map(|sigma| sigma.to_array());
    event.client = state.client.map(|client| ClientStream { seq: client.seq, age_ticks: client.age_ticks });
}

/// Encodes messages of the public topics in the format of protobuf. `unix_ns` is the Unix time of a
/// tick's deadline, ns.
#[derive(Debug, Default)]
pub struct Encoder {
    /// Names of the joints, in the order steer, drive of each wheel.
    joints: Vec<String>,
    buffer: Vec<u8>,
}

impl Encoder {
    /// Returns an encoder for a rig whose joints have these names, in the order steer, drive of
    /// each wheel.
    #[must_use]
    pub fn new(joints: Vec<String>) -> Self {
        Self { joints, buffer: Vec::new() }
    }

    /// Encodes the messages of a tick, one for each topic of every tick, and passes each to `put`.
    ///
    /// # Errors
    /// Fails with the first error of `put`.
    pub fn state<E>(
        &mut self,
        state: &StateEvent,
        unix_ns: u64,
        mut put: impl FnMut(Topic, &[u8]) -> Result<(), E>,
    ) -> Result<(), E> {
        put(Topic::State, self.encode(&self::state(state, unix_ns)))?;
        let joints = joints(state, &self.joints, unix_ns);
        put(Topic::Joints, self.encode(&joints))?;
        put(Topic::Transforms, self.encode(&transforms(state, unix_ns)))?;
        put(Topic::Torque, self.torque(state, unix_ns))
    }

    /// Encodes the torque of a tick.
    pub fn torque(&mut self, state: &StateEvent, unix_ns: u64) -> &[u8] {
        self.encode(&torque(state, unix_ns))
    }

    /// Encodes an event of the TCP API.
    pub fn event(&mut self, event: &Event, unix_ns: u64) -> &[u8] {
        self.encode(&self::event(event, unix_ns))
    }

    /// Encodes that the scene `name` is rendered from `tick` on. `json` is its file as JSON.
    pub fn scene(&mut self, tick: u64, name: &str, json: &str, unix_ns: u64) -> &[u8] {
        self.encode(&scene(tick, name, json, unix_ns))
    }

    fn encode(&mut self, message: &impl Message) -> &[u8] {
        self.buffer.clear();
        // This cannot fail: the buffer grows.
        let _ = message.encode(&mut self.buffer);
        &self.buffer
    }
}

fn timestamp(unix_ns: u64) -> Option<prost_types::Timestamp> {
    // A nanosecond count of 64 bits ends in the year 2554, so neither cast wraps.
    Some(prost_types::Timestamp { seconds: (unix_ns / NS) as i64, nanos: (unix_ns % NS) as i32 })
}

fn vector([x, y, z]: [f64; 3]) -> Vector3 {
    Vector3 { x, y, z }
}

fn quaternion([w, x, y, z]: [f64; 4]) -> Quaternion {
    Quaternion { x, y, z, w }
}

fn state(state: &StateEvent, unix_ns: u64) -> hbot::State {
    let joints = |value: fn(&JointState) -> f64| state.joints.iter().map(value).collect();
    let timing = &state.timing;
    hbot::State {
        timestamp: timestamp(unix_ns),
        tick: state.tick,
        t: state.t,
        mode: state.mode.as_str().to_owned(),
        fault: state.fault.map_or_else(String::new, |fault| fault.as_str().to_owned()),
        q: Some(quaternion(state.q)),
        omega: Some(vector(state.omega)),
        reference: state.reference.map(quaternion),
        torque: Some(vector(state.torque)),
        joint_angle: joints(|joint| joint.angle),
        joint_rate: joints(|joint| joint.rate),
        joint_torque: joints(|joint| joint.torque),
        slip: state.slip,
        scale: state.scale,
        traction: state.traction,
        energy: state.energy,
        client: state
            .client
            .map(|client| hbot::ClientStream { seq: client.seq, age_ticks: client.age_ticks }),
        timing: Some(hbot::Timing {
            lateness_us: timing.lateness_us,
            compute_us: timing.compute_us,
            link_us: timing.link_us,
            age_us: timing.age_us,
            lead_us: timing.lead_us,
        }),
    }
}

fn joints(state: &StateEvent, names: &[String], unix_ns: u64) -> foxglove::JointState {
    let joints = |value: fn(&JointState) -> f64| state.joints.iter().map(value).collect();
    foxglove::JointState {
        timestamp: timestamp(unix_ns),
        name: names.to_vec(),
        position: joints(|joint| joint.angle),
        velocity: joints(|joint| joint.rate),
        effort: joints(|joint| joint.torque),
    }
}

/// Returns the orientations of the sphere and of its reference in frame N. Both frames have their
/// origin at the centre of the sphere.
fn transforms(state: &StateEvent, unix_ns: u64) -> FrameTransforms {
    let transform = |child: &str, q| FrameTransform {
        timestamp: timestamp(unix_ns),
        parent_frame_id: FRAME_N.to_owned(),
        child_frame_id: child.to_owned(),
        translation: Some(Vector3::default()),
        rotation: Some(quaternion(q)),
    };
    let reference = state.reference.map(|q| transform(FRAME_REFERENCE, q));
    let transforms = std::iter::once(transform(FRAME_SPHERE, state.q)).chain(reference).collect();
    FrameTransforms { transforms }
}

fn torque(state: &StateEvent, unix_ns: u64) -> hbot::Torque {
    hbot::Torque {
        timestamp: timestamp(unix_ns),
        sphere: Some(vector(state.torque)),
        joints: state.joints.iter().map(|joint| joint.torque).collect(),
    }
}

fn scene(tick: u64, name: &str, json: &str, unix_ns: u64) -> hbot::Scene {
    hbot::Scene { timestamp: timestamp(unix_ns), tick, name: name.to_owned(), json: json.to_owned() }
}

/// Returns an event of the TCP API as a message for people. Its text is the event as JSON, as
/// clients receive it.
fn event(event: &Event, unix_ns: u64) -> Log {
    let level = match event {
        Event::Fault(fault) if matches!(fault.mode, Mode::Fault | Mode::Estop) => foxglove::log::Level::Error,
        Event::Dropped(_) | Event::Refused(_) | Event::Shaking(_) => foxglove::log::Level::Warning,
        _ => foxglove::log::Level::Info,
    };
    Log {
        timestamp: timestamp(unix_ns),
        level: level.into(),
        message: serde_json::to_string(event).unwrap_or_else(|error| error.to_string()),
        name: event.name().map_or_else(String::new, |name| name.as_str().to_owned()),
        file: String::new(),
        line: 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_causes_of_the_core_are_the_faults_of_the_messages() {
        let names = |all: &[&dyn std::fmt::Debug]| all.iter().map(|it| format!("{it:?}")).collect::<Vec<_>>();
        let causes = mode::Cause::ALL.each_ref().map(|it| it as &dyn std::fmt::Debug);
        let faults = Fault::ALL.each_ref().map(|it| it as &dyn std::fmt::Debug);
        assert_eq!(names(&causes), names(&faults));
        assert_eq!(mode::Cause::ALL.map(fault), Fault::ALL);
    }
}
