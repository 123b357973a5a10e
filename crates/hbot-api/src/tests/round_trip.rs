//! A message that is written is read again unchanged, and no bytes make the reader panic.

use super::{encoded, samples, unframed};
use crate::*;
use proptest::collection::{btree_map, vec};
use proptest::prelude::*;
use proptest::sample::Index;
use serde_json::{Map, Number, Value, json};

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![4 => -MAX_MAGNITUDE..=MAX_MAGNITUDE, 1 => prop::num::f64::SUBNORMAL, 1 => Just(-0.0)]
}

fn quaternion() -> impl Strategy<Value = [f64; 4]> {
    prop::array::uniform4(-1.0..1.0_f64).prop_filter_map("norm", |q| {
        let norm = q.iter().map(|x| x * x).sum::<f64>().sqrt();
        (norm > 0.1).then(|| q.map(|x| x / norm))
    })
}

fn any_json() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::Bool),
        any::<i64>().prop_map(|n| Value::Number(n.into())),
        any::<u64>().prop_map(|n| Value::Number(n.into())),
        prop::num::f64::NORMAL.prop_map(|x| Value::Number(Number::from_f64(x).unwrap())),
        ".*".prop_map(Value::String),
    ];
    leaf.prop_recursive(4, 32, 4, |inner| {
        prop_oneof![
            vec(inner.clone(), 0..4).prop_map(Value::Array),
            btree_map(".*", inner, 0..4).prop_map(|map| Value::Object(map.into_iter().collect())),
        ]
    })
}

fn id() -> impl Strategy<Value = Option<Id>> {
    prop_oneof![
        Just(None),
        any::<i64>().prop_map(|n| Some(n.into())),
        ".{0,30}".prop_map(|s| Some(Id::Text(s)))
    ]
}

/// What replaces the values of one field.
#[derive(Clone, Debug)]
struct Change {
    factor: f64,
    integer: u64,
    text: String,
    flag: bool,
    quaternion: [f64; 4],
    json: Value,
}

fn change() -> impl Strategy<Value = Change> {
    let factor = prop_oneof![4 => 0.0..2.0_f64, 1 => number()];
    let integer = prop_oneof![3 => 1..=MAX_VALID_MS, 1 => any::<u64>()];
    let text = prop_oneof!["[a-z][a-z0-9 _äß]{0,20}", ".*"];
    (factor, integer, text, any::<bool>(), quaternion(), any_json()).prop_map(
        |(factor, integer, text, flag, quaternion, json)| Change {
            factor,
            integer,
            text,
            flag,
            quaternion,
            json,
        },
    )
}

impl Change {
    /// Replaces integers, text and flags, and multiplies real numbers, which keeps matrices
    /// symmetric.
    fn apply(&self, value: &mut Value) {
        match value {
            Value::Null => {}
            Value::Bool(flag) => *flag = self.flag,
            Value::String(text) => text.clone_from(&self.text),
            Value::Number(number) if number.is_f64() => {
                *value = (number.as_f64().unwrap() * self.factor).into()
            }
            Value::Number(number) => *number = self.integer.into(),
            Value::Array(list) => list.iter_mut().for_each(|value| self.apply(value)),
            Value::Object(map) => map.values_mut().for_each(|value| self.apply(value)),
        }
    }
}

/// Whether a value says the same as none: 0, false, null, and lists of them.
fn is_nothing(value: &Value) -> bool {
    match value {
        Value::Array(list) => list.iter().all(is_nothing),
        value => matches!(value, Value::Null | Value::Bool(false)) || value.as_f64() == Some(0.0),
    }
}

/// Whether a request that was read, and is `written` again, says what was `given`. A direction is
/// scaled when it is read, and a quaternion here has unit norm.
fn same(written: &Value, given: &Value) -> bool {
    match (written, given) {
        (Value::Object(written), Value::Object(given)) => {
            written.iter().all(|(name, value)| {
                let scaled = ["normal", "body", "world"].contains(&name.as_str());
                scaled || given.get(name).is_none_or(|given| same(value, given))
            }) && given.iter().all(|(name, value)| written.contains_key(name) || is_nothing(value))
        }
        (Value::Array(written), Value::Array(given)) => {
            written.len() == given.len() && written.iter().zip(given).all(|(a, b)| same(a, b))
        }
        (Value::Number(a), Value::Number(b)) if a.is_f64() => a.as_f64() == b.as_f64(),
        _ => written == given,
    }
}

/// A request of `messages.golden` with changes that leave it legal: what is written, and what is
/// read from it. So every op takes part.
fn request() -> impl Strategy<Value = (Value, Request)> {
    let changes = vec(prop::option::of(change()), 12);
    (any::<Index>(), id(), changes).prop_filter_map("legal", |(which, id, changes)| {
        let mut given = serde_json::to_value(&which.get(samples::requests()).op).unwrap();
        let fields = given.as_object_mut().unwrap().iter_mut().filter(|(name, _)| *name != "op");
        for ((name, value), change) in fields.zip(changes) {
            let Some(change) = change else { continue };
            match name.as_str() {
                "q" | "pose" => *value = change.quaternion.into_iter().collect(),
                "data" => *value = change.json,
                "scene" => *value = json!({ "inner": change.json }),
                _ => change.apply(value),
            }
        }
        let read = Request::read(Encoding::Json, given.to_string().as_bytes()).ok()?;
        Some((given, Request { id, ..read }))
    })
}

proptest! {
    #[test]
    fn requests_come_back((given, request) in request()) {
        prop_assert!(same(&serde_json::to_value(&request.op).unwrap(), &given), "{:?}", request);
        for encoding in Encoding::ALL {
            let bytes = unframed(encoding, &encoded(encoding, &request));
            let back = Request::read(encoding, &bytes);
            prop_assert_eq!(back.as_ref(), Ok(&request), "{}", encoding);
        }
    }

    #[test]
    fn answers_come_back(id in id(), body in btree_map(".*", any_json(), 0..4)) {
        let body: Map<String, Value> = body.into_iter().collect();
        let response = Response::ok(id, Value::Object(body));
        for encoding in Encoding::ALL {
            let bytes = unframed(encoding, &encoded(encoding, &response));
            let back = ServerMessage::read(encoding, &bytes);
            prop_assert_eq!(back, Ok(ServerMessage::Response(response.clone())), "{}", encoding);
        }
    }

    #[test]
    fn states_come_back(
        numbers in vec(number(), 12), joints in vec(prop::array::uniform3(number()), 0..9),
        tick in any::<u64>(), mode in prop::sample::select(&Mode::ALL[..]),
        fault in prop::option::of(prop::sample::select(&Fault::ALL[..])), q in quaternion(),
        reference in prop::option::of(quaternion()), client in any::<Option<(Option<u64>, u64)>>(),
        hand in prop::option::of(prop::array::uniform3(number())),
        orientation_sigma in prop::option::of(prop::array::uniform3(number())),
    ) {
        let n = |i: usize| numbers[i];
        let event = Event::State(StateEvent {
            tick, t: n(0), mode, fault, q, reference, omega: [n(1), n(2), n(3)], torque: [n(4), n(5), n(6)],
            joints: joints.iter().map(|&[angle, rate, torque]| JointState { angle, rate, torque }).collect(),
            slip: n(7), scale: n(8), traction: n(9), energy: n(10),
            client: client.map(|(seq, age_ticks)| ClientStream { seq, age_ticks }),
            timing: StateTiming { lateness_us: n(11), ..samples::state().timing },
            hand, orientation_sigma,
        });
        for encoding in Encoding::ALL {
            let bytes = unframed(encoding, &encoded(encoding, &event));
            let back = ServerMessage::read(encoding, &bytes);
            prop_assert_eq!(back, Ok(ServerMessage::Event(event.clone())), "{}", encoding);
        }
    }
}
