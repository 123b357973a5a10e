//! `docs/api.md` against the crate.

use super::{samples, unframed};
use crate::{Encoding, ErrorCode, Fault, Mode, Op, Request, ServerMessage, Who};
use serde_json::Value;

const PAGE: &str = include_str!("../../../../docs/api.md");

/// The page from one heading to the next.
fn section(heading: &str) -> &'static str {
    let (_, rest) = PAGE.split_once(&format!("\n{heading}\n")).unwrap_or_else(|| panic!("{heading}"));
    rest.split_once("\n#").map_or(rest, |(section, _)| section)
}

/// The row of a section's table that begins with `name`.
fn row(heading: &str, name: &str) -> &'static str {
    let mut rows = section(heading).lines().filter(|line| line.starts_with(&format!("| `{name}` |")));
    let row = rows.next().unwrap_or_else(|| panic!("docs/api.md, {heading}: no row for {name}"));
    assert!(rows.next().is_none(), "docs/api.md, {heading}: two rows for {name}");
    row
}

fn object(message: &impl serde::Serialize) -> serde_json::Map<String, Value> {
    let Value::Object(map) = serde_json::to_value(message).unwrap() else { panic!("a map") };
    map
}

#[test]
fn every_op_has_its_row_with_who_and_all_fields() {
    for request in samples::requests() {
        let row = row("## Ops", request.op.name());
        let who = match request.op.who() {
            Who::First => "first",
            Who::Any => "any",
            Who::Holder => "holder",
        };
        assert!(row.contains(&format!("` | {who} |")), "{row}");
        let fields = match &request.op {
            Op::Set { .. } => vec!["effect".to_owned()],
            op => object(op).keys().filter(|key| *key != "op").cloned().collect(),
        };
        for field in fields {
            assert!(row.contains(&format!("`{field}`")), "{field} is missing: {row}");
        }
    }
}

#[test]
fn every_event_field_and_name_is_there() {
    for message in samples::events() {
        let ServerMessage::Event(event) = message else { panic!("event") };
        let map = object(&event);
        let name = map["event"].as_str().unwrap();
        for field in map.keys().filter(|key| *key != "event") {
            let place = if name == "state" { section("### state") } else { row("## Events", name) };
            assert!(place.contains(&format!("`{field}`")), "{field} of {name}");
        }
    }
    for mode in Mode::ALL {
        assert!(row("### state", "mode").contains(&format!("`{mode}`")), "{mode}");
    }
    for fault in Fault::ALL {
        assert!(row("### state", "fault").contains(&format!("`{fault}`")), "{fault}");
    }
    for code in ErrorCode::ALL {
        row("## Errors", code.as_str());
    }
}

#[test]
fn requests_on_the_page_are_legal() {
    let lines: Vec<&str> = PAGE
        .lines()
        .filter_map(|line| line.strip_prefix("    "))
        .filter(|line| line.starts_with("{\"id\"") && line.contains("\"op\""))
        .collect();
    assert!(lines.len() >= 4, "the transcript");
    for line in lines {
        Request::read(Encoding::Json, line.as_bytes()).unwrap_or_else(|refusal| panic!("{line}: {refusal}"));
    }
    let hex = PAGE.lines().find_map(|line| line.strip_prefix("    00 00 00 ")).expect("the frame");
    let frame: Vec<u8> = format!("00 00 00 {hex}")
        .split_whitespace()
        .map(|byte| u8::from_str_radix(byte, 16).unwrap())
        .collect();
    let request = Request::read(Encoding::Msgpack, &unframed(Encoding::Msgpack, &frame));
    assert_eq!(request, Ok(Request { id: Some(2.into()), op: Op::Info }));
}

#[test]
fn limits_on_the_page_are_those_of_the_crate() {
    for limit in
        ["65,536 bytes", "64 deep", "at most 128 bytes", "1-64 bytes", "1-1000000", "default 100", "1 MiB"]
    {
        assert!(PAGE.contains(limit), "{limit}");
    }
    assert_eq!((crate::MAX_REQUEST_BYTES, crate::MAX_DEPTH, crate::MAX_ID_BYTES), (65_536, 64, 128));
    assert_eq!((crate::MAX_NAME_BYTES, crate::MAX_EVERY, crate::DEFAULT_VALID_MS), (64, 1_000_000, 100));
    assert_eq!((crate::MAX_ANSWER_BYTES, crate::MAX_VALID_MS, crate::DEFAULT_PORT), (1 << 20, 1000, 4268));
}
