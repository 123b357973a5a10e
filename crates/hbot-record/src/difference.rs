//! Names the field in which two outputs differ.

use hbot_core::outputs::State;
use hbot_core::{Outputs, Quat, Vec3};

/// Returns the first field in which the bits of two outputs differ, with both values. Returns
/// `None` if all fields agree.
pub(crate) fn first(recorded: &Outputs, computed: &Outputs) -> Option<(String, [String; 2])> {
    let fields = fields(recorded).into_iter().zip(fields(computed));
    let differing = fields.into_iter().find(|(a, b)| a.bits != b.bits);
    differing.map(|(a, b)| (a.name, [a.text, b.text]))
}

struct Field {
    name: String,
    bits: Vec<u64>,
    text: String,
}

/// Lists the fields of outputs, causes before effects: the state first, the command to the motors
/// last.
fn fields(outputs: &Outputs) -> Vec<Field> {
    let mut list = List(Vec::with_capacity(32));
    state(&outputs.state, &mut list);
    for (k, reply) in outputs.replies.iter().enumerate() {
        list.other(&format!("replies[{k}]"), reply);
    }
    list.other("drive.enable", &outputs.drive.enable);
    list.reals("drive.torque", &outputs.drive.torque);
    list.0
}

fn state(state: &State, list: &mut List) {
    list.other("state.tick", &state.tick);
    list.other("state.fresh", &state.fresh);
    list.quat("state.q", state.q);
    list.vector("state.omega", state.omega);
    list.other("state.joints", &state.joints);
    list.reals("state.angle", &state.angle);
    list.reals("state.rate", &state.rate);
    list.reals("state.slip", &[state.slip]);
    list.other("state.mode", &state.mode);
    list.other("state.cause", &state.cause);
    list.other("state.client", &state.client);
    list.other("state.reference", &state.reference.is_some());
    list.quat("state.reference", state.reference.unwrap_or_default());
    list.vector("state.torque", state.torque);
    list.reals("state.scale", &[state.scale]);
    list.other("state.deficient", &state.deficient);
    list.reals("state.traction", &[state.traction]);
    list.reals("state.joint_torque", &state.joint_torque);
    list.reals("state.energy", &[state.energy]);
    list.reals("state.damping", &[state.damping]);
}

struct List(Vec<Field>);

impl List {
    fn reals(&mut self, name: &str, values: &[f64]) {
        let bits = values.iter().map(|value| value.to_bits()).collect();
        self.0.push(Field { name: name.to_owned(), bits, text: format!("{values:?}") });
    }

    fn vector(&mut self, name: &str, v: Vec3) {
        self.reals(name, &v.to_array());
    }

    fn quat(&mut self, name: &str, q: Quat) {
        self.reals(name, &[q.w, q.x, q.y, q.z]);
    }

    /// Adds a field whose text tells all of its values apart. Rust writes a real with as many
    /// digits as it needs.
    fn other(&mut self, name: &str, value: &impl std::fmt::Debug) {
        let text = format!("{value:?}");
        let bits = text.bytes().map(u64::from).collect();
        self.0.push(Field { name: name.to_owned(), bits, text });
    }
}
