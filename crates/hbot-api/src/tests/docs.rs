//! `docs/api.md` agrees with this crate.

use super::{samples, unframed};
use crate::*;
use serde_json::Value;
use std::collections::BTreeSet;

const PAGE: &str = include_str!("../../../../docs/api.md");

fn section(heading: &str) -> &'static str {
    let (_, rest) = PAGE.split_once(&format!("\n{heading}\n")).unwrap_or_else(|| panic!("{heading}"));
    rest.split_once("\n#").map_or(rest, |(section, _)| section)
}

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

/// Returns the table rows in the section of `docs/api.md` under this heading: the name in the first
/// cell of each, and its other cells.
fn rows(heading: &str) -> Vec<(&'static str, Vec<&'static str>)> {
    let cells = |line: &'static str| line.trim_matches('|').split('|').map(str::trim).collect::<Vec<_>>();
    let rows = section(heading).lines().filter(|line| line.starts_with("| `")).map(cells);
    rows.map(|cells| (cells[0].trim_matches('`'), cells[1..].to_vec())).collect()
}

/// Returns the parts of a text that are in backticks.
fn named(text: &str) -> Vec<&str> {
    text.split('`').skip(1).step_by(2).collect()
}

fn fields_of(heading: &str) -> BTreeSet<&'static str> {
    section(heading).lines().filter(|line| line.starts_with("| ")).flat_map(named).collect()
}

/// Collects the keys of all maps in a message, at any depth.
fn keys(value: &Value, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(map) => map.iter().for_each(|(name, value)| {
            found.insert(name.clone());
            keys(value, found);
        }),
        Value::Array(values) => values.iter().for_each(|value| keys(value, found)),
        _ => {}
    }
}

#[test]
fn the_table_of_ops_is_that_of_the_page() {
    let rows = rows("## Ops");
    assert_eq!(rows.iter().map(|(op, _)| *op).collect::<Vec<_>>(), OpName::ALL.map(OpName::as_str));
    for (op, (_, cells)) in OpName::ALL.into_iter().zip(&rows) {
        let row = op.row();
        let who = match row.who {
            Who::First => "first",
            Who::Any => "any",
            Who::Holder => "holder",
        };
        assert_eq!(cells[0], who, "{op}");
        let fields = row
            .fields
            .iter()
            .map(|field| format!("`{}`{}", field.name, if field.optional { "?" } else { "" }));
        let fields: Vec<String> = fields.collect();
        for field in &fields {
            assert!(cells[1].contains(field), "docs/api.md, {op}: {field} is missing in {}", cells[1]);
        }
        let marked = |text: &str| text.matches("`?").count();
        assert_eq!(
            marked(cells[1]),
            marked(&fields.concat()),
            "docs/api.md, {op}: fields that may be left out"
        );
        let names: Vec<&str> = named(cells[1]).into_iter().filter(|name| !name.starts_with('"')).collect();
        assert_eq!(names, row.fields.iter().map(|field| field.name).collect::<Vec<_>>(), "{op}");
        assert_eq!(cells[1].contains("At least one parameter"), row.parameters, "{op}");
        assert_eq!(row.stop, op.as_str().parse().ok(), "{op}");
    }
}

/// Weights and limits are a contract: clients pace their requests by them.
#[test]
fn weights_and_limits_are_those_of_the_contract() {
    for op in OpName::ALL {
        let weight = match op {
            OpName::Info => 500,
            OpName::LoadScene => 250,
            OpName::Stats | OpName::Controllers | OpName::Acquire | OpName::Release | OpName::Set => 100,
            _ => 1,
        };
        assert_eq!(op.row().weight, weight, "{op}");
    }
    assert_eq!((crate::MAX_REQUEST_BYTES, crate::MAX_DEPTH, crate::MAX_ID_BYTES), (65_536, 64, 128));
    assert_eq!((crate::MAX_NAME_BYTES, crate::MAX_EVERY, crate::DEFAULT_VALID_MS), (64, 1_000_000, 100));
    assert_eq!((crate::MAX_ANSWER_BYTES, crate::MAX_VALID_MS, crate::DEFAULT_PORT), (1 << 20, 1000, 4268));
}

#[test]
fn the_rows_hold_the_fields_that_are_sent() {
    for request in samples::requests() {
        let row = request.op.name().row();
        for field in object(&request.op).keys().filter(|key| *key != "op") {
            let known = row.fields.iter().any(|known| known.name == field);
            assert!(known || row.parameters, "{field} of {}", request.op.name());
        }
    }
}

#[test]
fn every_field_of_info_and_stats_is_there() {
    let mut told = BTreeSet::new();
    keys(&serde_json::to_value(samples::info()).unwrap(), &mut told);
    let page = &fields_of("### info") | &fields_of("#### render");
    for field in &told {
        assert!(page.contains(field.as_str()), "docs/api.md, info: {field} is missing");
    }
    for policy in ClientLostPolicy::ALL {
        assert!(page.contains(policy.as_str()), "docs/api.md, info: {policy} is missing");
    }
    let mut told = BTreeSet::new();
    let Value::Object(mut stats) = serde_json::to_value(StatsOk::default()).unwrap() else { panic!("a map") };
    stats["faults"] = Value::Null;
    stats["refused"] = Value::Null;
    keys(&Value::Object(stats), &mut told);
    let page: BTreeSet<String> = fields_of("### stats").into_iter().map(str::to_owned).collect();
    assert_eq!(page, told, "docs/api.md, stats");
}

#[test]
fn every_field_and_flag_of_controllers_is_there() {
    let mut told = BTreeSet::new();
    keys(&serde_json::to_value(samples::controllers().controllers).unwrap(), &mut told);
    let rows: BTreeSet<String> =
        rows("### controllers").into_iter().map(|(name, _)| name.to_owned()).collect();
    assert_eq!(rows, told, "docs/api.md, controllers");
    assert!(section("### controllers").contains("`ok` holds `controllers`"));
    let listed = section("### controllers").lines().filter_map(|line| line.strip_prefix("- `"));
    let flags: Vec<&str> = listed.filter_map(|line| line.split('`').next()).collect();
    assert_eq!(flags, ControllerFlag::ALL.map(ControllerFlag::as_str));
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
    let first = |heading| rows(heading).into_iter().map(|(name, _)| name).collect::<Vec<_>>();
    assert_eq!(first("## Errors"), ErrorCode::ALL.map(ErrorCode::as_str));
    assert_eq!(first("## Events"), EventName::ALL.map(EventName::as_str));
    for cause in LeaseCause::ALL {
        assert!(row("## Events", "lease").contains(&format!("`{cause}`")), "{cause}");
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
fn each_fault_has_its_row_on_the_page_of_what_is_wrong() {
    let page = include_str!("../../../../docs/something-is-wrong.md");
    for fault in Fault::ALL {
        assert!(
            page.contains(&format!("\n| `{fault}` | ")),
            "docs/something-is-wrong.md: no row for {fault}"
        );
    }
}
