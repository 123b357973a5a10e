//! Tests of finding stops in bytes, in pieces of any size and inside other content.

use crate::{Encoding, Id, Op, Request, Stop, StopFinder, asks_estop, may_be_long};
use proptest::prelude::*;

/// Returns all stops in `bytes`, each with the index of its end. The bytes arrive in pieces that
/// end at `cuts`.
fn found(bytes: &[u8], cuts: &[usize]) -> Vec<(Stop, usize)> {
    let mut finder = StopFinder::default();
    let (mut all, mut from) = (Vec::new(), 0);
    for to in cuts.iter().copied().chain([bytes.len()]) {
        finder.push(&bytes[from..to], |stop, end| all.push((stop, from + end)));
        from = to;
    }
    all
}

/// Messages that request an emergency stop. Each is damaged or unusual in a different way.
const SHAPES: &[&[u8]] = &[
    br#"{"op":"estop"}"#,
    b"{\"op\"\t : \r\"estop\"}",
    br#"{"id":1.0,"op":"estop"}"#,
    br#"{"id":true,"op":"estop"}"#,
    br#"{"id":[1],"op":"estop"}"#,
    br#"{"id":9223372036854775808,"op":"estop"}"#,
    br#"{"op":"ping","op":"estop"}"#,
    br#"{"op":"estop","op":"ping"}"#,
    br#"{"op":"estop","x":NaN}"#,
    br#"{"op":"estop","x":1e999}"#,
    br#"{"op":"estop",}"#,
    b"{\"op\":\"estop\",\"x\":\"\xff\"}",
    br#"{"op":"estop","x":"\ud800"}"#,
    br#"{"op":"ESTOP"}"#,
    br#"[{"op":"estop"}]"#,
    br#"{"op":"estop"}{"op":"estop"}"#,
    b"\xef\xbb\xbf{\"op\":\"estop\"}",
    b"\x81\xa2op\xa5estop\xc0",
    b"\x82\xa2op\xa5estop\xa1x\xd4\x01a",
    b"\x82\xa2op\xa5estop\xa1x\xc4\x01a",
    b"\x82\xa2op\xa5estop\xa1x",
    b"\x82\xa2op\xa5estop\x01\x02",
    b"\x81\xa2op\xc4\x05estop",
    b"\x81\xd9\x02op\xda\x00\x05estop",
    b"\x81\xc4\x02op\xdb\x00\x00\x00\x05Estop",
];

#[test]
fn an_estop_in_any_shape_is_one() {
    for shape in SHAPES {
        assert!(asks_estop(shape), "{}", shape.escape_ascii());
        for encoding in Encoding::ALL {
            assert!(matches!(Request::read(encoding, shape), Ok(Request { op: Op::Estop, .. })));
        }
        let whole = found(shape, &[]);
        assert!(whole.iter().all(|(stop, _)| *stop == Stop::Estop) && !whole.is_empty());
        for cut in 0..=shape.len() {
            assert_eq!(found(shape, &[cut]), whole, "{} cut at {cut}", shape.escape_ascii());
        }
        let every_byte: Vec<usize> = (0..shape.len()).collect();
        assert_eq!(found(shape, &every_byte), whole, "{} byte by byte", shape.escape_ascii());
    }
    // Found only by parsing.
    let escaped = Request::read(Encoding::Json, br#"{"\u006fp":"\u0065stop","id":1.5}"#);
    assert_eq!(escaped, Ok(Request { id: None, op: Op::Estop }));
}

#[test]
fn its_id_is_repeated_where_it_can_be_read() {
    let id = |line: &str| Request::read(Encoding::Json, line.as_bytes()).unwrap().id;
    assert_eq!(id(r#"{"id":7,"op":"estop","x":1}"#), Some(7.into()));
    assert_eq!(id(r#"{"op":"estop","id":"a"}"#), Some(Id::from("a")));
    assert_eq!(id(r#"{"id":1.0,"op":"estop"}"#), None);
    assert_eq!(id(r#"{"id":7,"op":"estop",}"#), None);
    assert_eq!(id(&format!(r#"{{"id":7,"op":"estop","x":"{}"}}"#, "x".repeat(3000))), None);
}

#[test]
fn other_messages_are_none() {
    for other in [
        &br#"{"op":"ping","data":"estop"}"#[..],
        br#"{"op":"estops"}"#,
        br#"{"op":"xestop"}"#,
        br#"{"top":"estop"}"#,
        br#"{"op ":"estop"}"#,
        br#"{"op","estop"}"#,
        br#"{"op":["estop"]}"#,
        br#"{"data":"\"op\":\"estop\""}"#,
        b"op",
        b"\"op\":\"estop",
        b"\xa2op\xa6estops",
        b"\xa3top\xa5estop",
        b"\xa2op\xd9\x06estop",
    ] {
        assert!(!asks_estop(other), "{}", other.escape_ascii());
        assert_eq!(found(other, &[]), []);
    }
    assert!(may_be_long(br#"{"op": "load_scene"}"#) && may_be_long(b"\x81\xa2op\xa3set"));
    assert!(!may_be_long(br#"{"op": "ping", "data": "set"}"#));
    // Stops are not searched for before the hello. The first message is read like any other, and
    // its receiver refuses it.
    assert!(matches!(Request::read_first(br#"{"op":"estop"}"#), Ok(Request { op: Op::Estop, .. })));
}

proptest! {
    #[test]
    fn each_stop_is_found_once_where_it_ends(
        parts in prop::collection::vec((0..4_usize, "[opest\":, ]{0,40}"), 1..12),
        cuts in prop::collection::vec(0.0..1.0_f64, 0..6),
    ) {
        let mut bytes = Vec::new();
        let mut ends = Vec::new();
        for (kind, filling) in parts {
            bytes.extend_from_slice(filling.as_bytes());
            // The separator prevents that filling bytes and their neighbours form a stop.
            bytes.push(b'#');
            let (stop, text): (_, &[u8]) = match kind {
                0 => (Stop::Estop, br#""op" :"estop""#),
                1 => (Stop::Disable, br#""op":"disable""#),
                2 => (Stop::Disable, b"\xa2op\xa7disable"),
                _ => (Stop::Estop, b"\xa2op\xd9\x05estop"),
            };
            bytes.extend_from_slice(text);
            ends.push((stop, bytes.len()));
        }
        let mut cuts: Vec<usize> = cuts.iter().map(|cut| (cut * bytes.len() as f64) as usize).collect();
        cuts.sort_unstable();
        let filled = found(&bytes, &[]);
        prop_assert!(ends.iter().all(|end| filled.contains(end)), "{:?}", bytes.escape_ascii().to_string());
        prop_assert_eq!(found(&bytes, &cuts), filled);
    }
}
