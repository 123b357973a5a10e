//! A message that is written is read again unchanged, and no bytes make the reader panic.

use super::{encoded, samples, unframed};
use crate::*;
use proptest::collection::{btree_map, vec};
use proptest::prelude::*;
use serde_json::{Map, Number, Value};

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![4 => -MAX_MAGNITUDE..=MAX_MAGNITUDE, 1 => prop::num::f64::SUBNORMAL, 1 => Just(-0.0)]
}

fn quaternion() -> impl Strategy<Value = [f64; 4]> {
    prop::array::uniform4(-1.0..1.0_f64).prop_filter_map("norm", |q| {
        let norm = q.iter().map(|x| x * x).sum::<f64>().sqrt();
        (norm > 0.1).then(|| q.map(|x| x / norm))
    })
}

fn json() -> impl Strategy<Value = Value> {
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

fn impedance() -> impl Strategy<Value = Impedance> {
    let size = || 0.0..=MAX_MAGNITUDE;
    prop_oneof![
        size().prop_map(Impedance::All),
        prop::array::uniform3(size()).prop_map(Impedance::Axes),
        (prop::array::uniform3(size()), prop::array::uniform3(number()))
            .prop_map(|([a, b, c], [d, e, f])| Impedance::Matrix([[a, d, e], [d, b, f], [e, f, c]])),
    ]
}

fn model() -> impl Strategy<Value = ModelCommand> {
    let normal = prop::sample::select(vec![[1.0, 0.0, 0.0], [0.0, -0.6, 0.8], [0.0, 0.0, -1.0]]);
    let size = || 0.0..=MAX_MAGNITUDE;
    let plane = (normal, -MAX_OFFSET..=MAX_OFFSET, size(), size())
        .prop_map(|(normal, offset, stiffness, damping)| PlaneCommand { normal, offset, stiffness, damping });
    let extras = (prop::option::of(0..=MAX_BLEND_MS), any::<bool>(), any::<Option<u64>>(), 1..=MAX_VALID_MS);
    let law = (prop::array::uniform3(number()), impedance(), impedance(), prop::option::of(quaternion()));
    (law, vec(plane, 0..=MAX_PLANES), extras).prop_map(
        |((torque, stiffness, damping, pose), planes, (blend_ms, soften, tick, valid_ms))| ModelCommand {
            torque,
            stiffness,
            damping,
            pose,
            planes,
            valid_ms,
            blend_ms,
            soften,
            tick,
            seq: tick,
        },
    )
}

fn op() -> impl Strategy<Value = Op> {
    let name = "[a-z][a-z0-9 _äß]{0,20}";
    let object =
        || btree_map("[a-z]{1,9}_", json(), 1..4).prop_map(|map| map.into_iter().collect::<Map<_, _>>());
    let stamps = || (1..=MAX_VALID_MS, any::<Option<u64>>(), any::<Option<u64>>());
    prop_oneof![
        (name, any::<Option<String>>(), prop::sample::select(&Encoding::ALL[..])).prop_map(
            |(name, token, encoding)| Op::Hello(Hello {
                version: 1,
                name,
                token: token.map(Token::from),
                encoding
            })
        ),
        (1..=MAX_EVERY).prop_map(|every| Op::Subscribe { every }),
        (1..=MAX_EVERY).prop_map(|ticks| Op::Advance { ticks }),
        any::<bool>().prop_map(|steal| Op::Acquire { steal }),
        object().prop_map(|scene| Op::LoadScene { scene: scene.into() }),
        (name, object()).prop_map(|(effect, parameters)| Op::Set { effect, parameters }),
        (prop::array::uniform3(number()), stamps()).prop_map(|(torque, (valid_ms, tick, seq))| Op::Torque(
            TorqueCommand { torque, valid_ms, tick, seq }
        )),
        (name, quaternion(), prop::option::of(prop::array::uniform3(number())), stamps()).prop_map(
            |(effect, q, omega, (valid_ms, tick, seq))| {
                Op::Reference(ReferenceCommand { effect, q, omega, valid_ms, tick, seq })
            }
        ),
        model().prop_map(|model| Op::Model(Box::new(model))),
        (quaternion(), 0.0..=1.0_f64, prop::option::of(0.0..1e9_f64))
            .prop_map(|(q, weight, t)| Op::Align(Align { q, weight, sigma: None, t })),
        (quaternion(), prop::array::uniform3(1e-5..3.0_f64), prop::option::of(0.0..1e9_f64))
            .prop_map(|(q, sigma, t)| Op::Align(Align { q, weight: 1.0, sigma: Some(sigma), t })),
        (1e-5..3.0_f64, prop::option::of(0.0..1e9_f64)).prop_map(|(sigma, t)| {
            let (body, world) = ([0.0, 0.6, 0.8], [0.0, 0.0, -1.0]);
            Op::AlignDirection(AlignDirection { body, world, sigma, t })
        }),
        json().prop_map(|data| Op::Ping { data }),
        prop::sample::select(vec![
            Op::Info,
            Op::Unsubscribe,
            Op::Stats,
            Op::Controllers,
            Op::Release,
            Op::Enable,
            Op::Disable,
            Op::Reset,
            Op::Estop
        ]),
    ]
}

/// Passes bytes to every reader of this crate. They must not panic or use too much memory.
fn read_all(bytes: &[u8]) {
    for encoding in Encoding::ALL {
        let _ = Request::read(encoding, bytes);
        let _ = ServerMessage::read(encoding, bytes);
        let mut splitter = Splitter::with_limit(encoding, 64);
        for piece in bytes.chunks(7) {
            splitter.push(piece);
            while let Some(message) = splitter.next_message() {
                assert!(message.is_err() || message.is_ok_and(|message| message.len() <= 64));
            }
            assert!(splitter.pending() <= 64 + encoding::LENGTH_BYTES, "memory is bounded");
        }
    }
}

proptest! {
    #[test]
    fn requests_come_back(id in id(), op in op()) {
        let request = Request { id, op };
        for encoding in Encoding::ALL {
            let bytes = unframed(encoding, &encoded(encoding, &request));
            let back = Request::read(encoding, &bytes);
            prop_assert_eq!(back.as_ref(), Ok(&request), "{}", encoding);
        }
    }

    #[test]
    fn answers_come_back(id in id(), body in btree_map(".*", json(), 0..4)) {
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

    #[test]
    fn random_bytes_never_panic(bytes in vec(any::<u8>(), 0..300)) {
        read_all(&bytes);
    }

    /// Checks that reading a damaged message never panics. Such a message is nearly legal, so more
    /// of it is read than of random bytes.
    #[test]
    fn damaged_messages_never_panic(
        which in any::<prop::sample::Index>(), at in any::<prop::sample::Index>(),
        byte in any::<u8>(), cut in any::<prop::sample::Index>(),
    ) {
        let requests = samples::requests();
        for encoding in Encoding::ALL {
            let mut bytes = unframed(encoding, &encoded(encoding, which.get(&requests)));
            let at = at.index(bytes.len());
            bytes[at] = byte;
            read_all(&bytes);
            read_all(&bytes[..cut.index(bytes.len())]);
        }
    }
}
