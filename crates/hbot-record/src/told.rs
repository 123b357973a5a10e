//! Reads the public messages of a recording back.

use hbot_api::{ClientStream, Encoding, Event, JointState, Mode, ServerMessage, StateEvent, StateTiming};
use prost::Message as _;

use crate::messages::foxglove::{Log, Quaternion, Vector3};
use crate::messages::hbot::{Scene, State};
use crate::topic::Topic;

/// A public message of a recording.
#[derive(Debug, Clone, PartialEq)]
pub enum Told {
    /// The state of a tick.
    State(Box<State>),
    /// An event of the TCP API.
    Event(Box<Event>),
    /// A scene that is rendered from its tick on.
    Scene(Box<Scene>),
}

/// Reads a message of the topic `topic`. Returns `None` for any other topic, and for a message that
/// cannot be read.
#[must_use]
pub fn told(topic: &str, data: &[u8]) -> Option<Told> {
    if topic == Topic::State.name() {
        return State::decode(data).ok().map(|state| Told::State(Box::new(state)));
    }
    if topic == Topic::Scene.name() {
        return Scene::decode(data).ok().map(|scene| Told::Scene(Box::new(scene)));
    }
    if topic == Topic::Event.name() {
        let log = Log::decode(data).ok()?;
        return match ServerMessage::read(Encoding::Json, log.message.as_bytes()) {
            Ok(ServerMessage::Event(event)) => Some(Told::Event(Box::new(event))),
            _ => None,
        };
    }
    None
}

/// Returns the state of a tick as clients receive it. A field that the recording lacks has its
/// default: recordings have no torque of the simulated hand, and no uncertainty.
#[must_use]
pub fn event(state: &State) -> StateEvent {
    let joint = |j: usize| {
        let of = |values: &[f64]| values.get(j).copied().unwrap_or_default();
        JointState {
            angle: of(&state.joint_angle),
            rate: of(&state.joint_rate),
            torque: of(&state.joint_torque),
        }
    };
    let timing = state.timing.unwrap_or_default();
    let client = state.client.as_ref();
    StateEvent {
        tick: state.tick,
        t: state.t,
        mode: state.mode.parse().unwrap_or(Mode::Unreferenced),
        fault: state.fault.parse().ok(),
        q: state.q.as_ref().map_or([1.0, 0.0, 0.0, 0.0], quaternion),
        omega: state.omega.as_ref().map_or([0.0; 3], vector),
        reference: state.reference.as_ref().map(quaternion),
        torque: state.torque.as_ref().map_or([0.0; 3], vector),
        joints: (0..state.joint_angle.len()).map(joint).collect(),
        slip: state.slip,
        scale: state.scale,
        traction: state.traction,
        energy: state.energy,
        client: client.map(|client| ClientStream { seq: client.seq, age_ticks: client.age_ticks }),
        timing: StateTiming {
            lateness_us: timing.lateness_us,
            compute_us: timing.compute_us,
            link_us: timing.link_us,
            age_us: timing.age_us,
            lead_us: timing.lead_us,
        },
        ..StateEvent::default()
    }
}

fn quaternion(q: &Quaternion) -> [f64; 4] {
    [q.w, q.x, q.y, q.z]
}

fn vector(v: &Vector3) -> [f64; 3] {
    [v.x, v.y, v.z]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::public::Encoder;
    use hbot_api::Fault;

    #[test]
    fn a_state_is_read_as_it_was_written() {
        let state = StateEvent {
            tick: 7,
            t: 0.007,
            mode: Mode::Fault,
            fault: Some(Fault::Overspeed),
            q: [0.5, -0.5, 0.5, -0.5],
            omega: [1.0, 2.0, 3.0],
            reference: Some([1.0, 0.0, 0.0, 0.0]),
            torque: [0.1, 0.2, -0.3],
            joints: vec![JointState { angle: 1.0, rate: -2.0, torque: 0.25 }; 4],
            slip: 0.01,
            scale: 0.5,
            traction: 0.25,
            energy: -1.5,
            client: Some(ClientStream { seq: Some(9), age_ticks: 2 }),
            timing: StateTiming {
                lateness_us: 1.0,
                compute_us: 2.0,
                link_us: 3.0,
                age_us: 4.0,
                lead_us: 5.0,
            },
            ..StateEvent::default()
        };
        for state in [state, StateEvent { tick: 8, ..StateEvent::default() }] {
            let mut read = None;
            let put = |topic: Topic, data: &[u8]| {
                if let Some(Told::State(state)) = told(topic.name(), data) {
                    read = Some(event(&state));
                }
                Ok::<_, ()>(())
            };
            Encoder::new(Vec::new()).state(&state, 1, put).expect("nothing fails");
            assert_eq!(read, Some(state));
        }
    }
}
