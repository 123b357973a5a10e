//! The reference pages agree with the checks: every key has its row in docs/files.md, or in
//! docs/effects.md for kinds of effects. The rows are generated from the schema that the checks
//! use. The figures of the rate estimates in docs/internals/velocity.md are those of the
//! computation.

use std::fmt::Write;

use hbot_config::advice::RateAdvice;
use hbot_config::scene::{Listed, kinds, phenomena};
use hbot_config::{Override, RigConfig};
use hbot_core::design::rig::RateEstimate;
use serde_json::Value;

use crate::folder;

const FILES: &str = "docs/files.md";
const EFFECTS: &str = "docs/effects.md";
const VELOCITY: &str = "docs/internals/velocity.md";

/// Generates all tables of a reference page. Returns each with its name: the page contains the
/// table between the marks `<!-- NAME -->` and `<!-- end -->`.
fn tables(page: &str) -> Vec<(String, String)> {
    let described =
        |name: String, listed: Listed| (name, format!("{}\n\n{}", listed.description, rows(&listed.schema)));
    if page == EFFECTS {
        return effects();
    }
    if page == VELOCITY {
        return vec![("estimates".to_owned(), estimates()), ("picks".to_owned(), picks())];
    }
    let rig = RigConfig::schema();
    let section = |name: &str| &rig["properties"][name];
    let mut all = vec![
        ("rig".to_owned(), rows(&rig)),
        ("sphere".to_owned(), rows(section("sphere"))),
        ("wheel".to_owned(), rows(&section("wheel")["items"])),
        ("joint".to_owned(), rows(&section("wheel")["items"]["properties"]["steer"])),
    ];
    for name in ["loop", "link", "limits", "api"] {
        all.push((name.to_owned(), rows(section(name))));
    }
    all.push(("energy".to_owned(), rows(&section("limits")["properties"]["energy"])));
    all.push(("traction".to_owned(), rows(&section("limits")["properties"]["traction"])));
    all.push(("tls".to_owned(), rows(&section("api")["properties"]["tls"])));
    let joint = &section("wheel")["items"]["properties"]["steer"]["properties"];
    all.push(("friction".to_owned(), rows(&joint["friction"])));
    all.push(("cogging".to_owned(), rows(&joint["cogging"]["items"])));
    for name in ["accuracy", "rate_estimate", "passivity", "lead", "compensation"] {
        let choices = section("loop")["properties"][name]["anyOf"].as_array().unwrap();
        let table = choices.iter().find(|choice| choice["type"] == "object").unwrap();
        all.push((name.to_owned(), rows(table)));
    }
    all.extend(phenomena().into_iter().map(|it| described(format!("simulate.{}", it.name), it)));
    all.into_iter().map(|(name, table)| (name, with_short_rows(&table))).collect()
}

/// Moves all but the first sentence of a long row's meaning below the table.
fn with_short_rows(table: &str) -> String {
    const MOST_CHARS: usize = 200;
    const MOST_COLUMNS: usize = 120;
    let mut below = String::new();
    let mut all = String::new();
    for line in table.lines() {
        let cells: Vec<&str> = line.splitn(3, " | ").collect();
        let [key, meaning, rest] = cells[..] else {
            writeln!(all, "{line}").unwrap();
            continue;
        };
        match meaning.split_once(". ").filter(|_| line.chars().count() > MOST_CHARS) {
            Some((first, more)) => {
                writeln!(all, "{key} | {first}. | {rest}").unwrap();
                let mut width = 0;
                for word in format!("- {}: {more}", key.trim_start_matches("| ")).split(' ') {
                    let length = word.chars().count() + 1;
                    let space = match width {
                        0 => "",
                        _ if width + length > MOST_COLUMNS => "\n  ",
                        _ => " ",
                    };
                    width = if space.starts_with('\n') { 1 } else { width } + length;
                    write!(below, "{space}{word}").unwrap();
                }
                below.push('\n');
            }
            None => writeln!(all, "{line}").unwrap(),
        }
    }
    if below.is_empty() { all } else { format!("{all}\n{below}") }
}

/// Writes the computed figures of the rate estimates on the prototype with a lead, as a Markdown
/// table.
fn estimates() -> String {
    let kalman =
        |acceleration| (format!("`kalman`, {acceleration} rad/s²"), RateEstimate::Kalman { acceleration });
    let low_pass = |cutoff_hz| (format!("`low_pass`, {cutoff_hz} Hz"), RateEstimate::LowPass { cutoff_hz });
    let window = RateEstimate::AdaptiveWindow { tolerance_counts: 1, longest_ticks: 16 };
    let methods = [
        ("`controller`, exact rates".to_owned(), RateEstimate::Controller),
        ("`difference`".to_owned(), RateEstimate::Difference),
        low_pass(100.0),
        ("`adaptive_window`, 16 ticks".to_owned(), window),
        kalman(10.0),
        kalman(30.0),
        kalman(100.0),
        kalman(300.0),
    ];
    let mut table = "| counts | method | ripple at 100 N m/rad, mN m | lag, ms | stable, N m/rad | not felt, N m/rad | most \
                     damping, N m s/rad |\n|---|---|---|---|---|---|---|\n"
        .to_owned();
    for counts in [16384, 2048] {
        let lead = Override { path: "loop.lead", value: true.into(), from: "the table" };
        let text = std::fs::read_to_string(folder("rigs/prototype.toml")).unwrap();
        let text = text.replace("= 16384", &format!("= {counts}"));
        let config = RigConfig::from_toml_with(&text, "prototype.toml", &[lead]).unwrap();
        let advice = RateAdvice::of(&config).unwrap();
        for (name, estimate) in &methods {
            let quality = advice.quality(*estimate);
            writeln!(
                table,
                "| {} x 4 | {name} | {:.1} | {:.1} | {:.0} | {:.0} | {:.2} |",
                counts / 4,
                1e5 * quality.ripple,
                // No minus before a zero.
                (1e4 * quality.lag).round() / 10.0 + 0.0,
                quality.stable,
                quality.smooth,
                quality.most_damping
            )
            .unwrap();
        }
    }
    table
}

/// Writes what `rate_estimate = "auto"` picks for the ready-made rigs with a lead, as a Markdown
/// table.
fn picks() -> String {
    let mut table = "| rig | passivity stage | `\"auto\"` picks | stable and not felt up to, N m/rad | with the controllers' \
                     rates, N m/rad |\n|---|---|---|---|---|\n"
        .to_owned();
    for (rig, counts) in [
        ("prototype", "16384"),
        ("prototype", "2048"),
        ("three_wheels", "16384"),
        ("four_wheels", "16384"),
        ("prototype-moteus", ""),
        ("prototype-odrive", ""),
    ] {
        let text = std::fs::read_to_string(folder(&format!("rigs/{rig}.toml"))).unwrap();
        let text = text.replace("= 16384", &format!("= {counts}"));
        let lines = counts.parse::<u32>().map_or(String::new(), |counts| format!(", {} x 4", counts / 4));
        for (stage, on) in [("on", true), ("off", false)] {
            let with = [
                ("loop.lead", true.into()),
                ("loop.passivity", on.into()),
                ("loop.rate_estimate", "auto".into()),
            ];
            let with = with.map(|(path, value)| Override { path, value, from: "the table" });
            let pick = RigConfig::from_toml_with(&text, rig, &with).unwrap().rate_pick.unwrap();
            let name = match pick.picked.estimate {
                RateEstimate::Kalman { acceleration } => format!("`kalman`, {acceleration} rad/s²"),
                RateEstimate::LowPass { cutoff_hz } => format!("`low_pass`, {cutoff_hz} Hz"),
                other => format!("{other:?}"),
            };
            let own =
                pick.controllers.map_or("not compared".to_owned(), |own| format!("{:.0}", own.usable()));
            writeln!(table, "| {rig}{lines} | {stage} | {name} | {:.0} | {own} |", pick.picked.usable())
                .unwrap();
        }
    }
    table
}

/// Generates the tables of docs/effects.md: one of the keys that are alike in at least three kinds
/// of effects, and one for each kind with its other keys.
fn effects() -> Vec<(String, String)> {
    let tables: Vec<String> = kinds().iter().map(|kind| rows(&kind.schema)).collect();
    let holders = |line: &str| tables.iter().filter(|table| table.lines().any(|other| other == line)).count();
    let shared = |line: &str| line.starts_with("| `") && holders(line) >= 3;
    let mut alike: Vec<&str> = tables[0].lines().take(2).collect();
    for line in tables.iter().flat_map(|table| table.lines()).filter(|line| shared(line)) {
        if !alike.contains(&line) {
            alike.push(line);
        }
    }
    let own = |(kind, table): (Listed, &String)| {
        let rows: String =
            table.lines().filter(|line| !shared(line)).map(|line| format!("{line}\n")).collect();
        let copy = format!("\n```toml\n{}```\n", kind.snippet());
        (kind.name.to_owned(), format!("{}\n\n{rows}{copy}", kind.description))
    };
    let mut all = vec![("several kinds".to_owned(), format!("{}\n", alike.join("\n")))];
    all.extend(kinds().into_iter().zip(&tables).map(own));
    all
}

/// Writes the properties of a JSON schema as a Markdown table.
fn rows(schema: &Value) -> String {
    let mut table = "| key | meaning | unit | range | default |\n|---|---|---|---|---|\n".to_owned();
    let required = schema["required"].as_array().cloned().unwrap_or_default();
    for (key, property) in schema["properties"].as_object().unwrap() {
        let unit = property["unit"].as_str().unwrap_or("");
        // The unit has a column of its own, and the pages say once which lengths are legal.
        let meaning = property["description"].as_str().unwrap().replacen(&format!(", {unit}."), ".", 1);
        let meaning = meaning.replace(" Any length except zero.", "");
        let default = match &property["default"] {
            Value::Null if required.contains(&Value::from(key.as_str())) => "required".to_owned(),
            Value::Null => "absent".to_owned(),
            Value::Object(_) => "its defaults".to_owned(),
            Value::Array(a) if a.is_empty() => "none".to_owned(),
            value => format!("`{}`", whole(value)),
        };
        writeln!(table, "| `{key}` | {meaning} | {unit} | {} | {default} |", range(property)).unwrap();
    }
    table
}

fn whole(value: &Value) -> String {
    match value {
        Value::Array(a) => format!("[{}]", a.iter().map(whole).collect::<Vec<_>>().join(", ")),
        _ => value.as_f64().map_or_else(|| value.to_string(), |x| x.to_string()),
    }
}

fn range(property: &Value) -> String {
    let bound = |key: &str| property.get(key).filter(|v| v.is_number()).map(angle);
    if let Some(words) = property["legal"].as_str() {
        return words.to_owned();
    }
    if let Some(names) = property["enum"].as_array() {
        return names.iter().map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", ");
    }
    let branches = property["oneOf"].as_array().or_else(|| property["anyOf"].as_array());
    if let Some(branches) = branches {
        let name = |b: &Value| match &b["const"] {
            Value::Null if b["type"] == "object" => "a table".to_owned(),
            Value::Null => range(b),
            name => format!("`{name}`"),
        };
        return branches.iter().map(name).collect::<Vec<_>>().join(", ");
    }
    let both = bound("minimum").zip(bound("maximum")).map(|(a, b)| format!("{a} to {b}"));
    let parts = [
        bound("minimum").map(|b| format!(">= {b}")),
        bound("exclusiveMinimum").map(|b| format!("> {b}")),
        bound("maximum").map(|b| format!("<= {b}")),
        bound("exclusiveMaximum").map(|b| format!("< {b}")),
    ];
    let parts = both.unwrap_or_else(|| parts.into_iter().flatten().collect::<Vec<_>>().join(", "));
    let count = |least: &str, most: &str| match (property[least].as_u64(), property[most].as_u64()) {
        (Some(a), Some(b)) if a == b => format!("{a} "),
        (Some(a), Some(b)) => format!("{a} to {b} "),
        (Some(a), None) => format!("{a} or more "),
        (None, Some(b)) => format!("up to {b} "),
        (None, None) => String::new(),
    };
    match property["type"].as_str() {
        Some("array") if property["items"]["type"] == "object" => count("minItems", "maxItems") + "tables",
        Some("array") => {
            format!("{}numbers, each {}", count("minItems", "maxItems"), range(&property["items"]))
        }
        Some("object") => "table".to_owned(),
        Some("boolean") => "`true`, `false`".to_owned(),
        Some("string") => match count("minLength", "maxLength") {
            any if any.is_empty() => "string".to_owned(),
            count => count + "characters",
        },
        Some("integer") => format!("whole, {parts}"),
        _ => parts,
    }
}

fn angle(bound: &Value) -> String {
    let x = bound.as_f64().unwrap();
    match x / std::f64::consts::PI {
        1.0 => "pi".to_owned(),
        0.5 => "pi/2".to_owned(),
        -0.5 => "-pi/2".to_owned(),
        _ => x.to_string(),
    }
}

/// Checks that the tables in the reference pages are those generated from the schemas. If the
/// environment variable `HBOT_BLESS` is set, writes the tables into the pages instead.
#[test]
fn every_key_stands_in_the_reference_as_the_checks_have_it() {
    for page in [FILES, EFFECTS, VELOCITY] {
        let path = folder(page);
        let old = std::fs::read_to_string(&path).unwrap();
        let mut new = old.clone();
        for (name, table) in tables(page) {
            let open = format!("<!-- {name} -->\n");
            let start = new.find(&open).unwrap_or_else(|| panic!("{page}: no mark for {name}")) + open.len();
            let end = start + new[start..].find("<!-- end -->").unwrap_or_else(|| panic!("no end of {name}"));
            new.replace_range(start..end, &table);
        }
        if std::env::var_os("HBOT_BLESS").is_some() {
            std::fs::write(&path, &new).unwrap();
        } else if let Some((have, want)) = old.lines().zip(new.lines()).find(|(a, b)| a != b) {
            panic!("{page} says\n{have}\nand the checks say\n{want}\n(HBOT_BLESS=1 writes the tables anew)");
        } else {
            assert_eq!(old, new);
        }
    }
}

/// Checks that every TOML example in the reference pages is a legal rig file or scene file.
#[test]
fn examples_load() {
    let text = [FILES, EFFECTS].map(|page| std::fs::read_to_string(folder(page)).unwrap()).concat();
    let examples: Vec<&str> =
        text.split("```toml\n").skip(1).map(|rest| rest.split("```").next().unwrap()).collect();
    assert!(examples.len() >= 2);
    for example in examples {
        if example.contains("[[wheel]]") {
            RigConfig::from_toml(example, "docs").map(drop).unwrap_or_else(|e| panic!("{e}"));
        } else {
            let scene = hbot_config::SceneFile::from_toml(example, "docs");
            scene.map(drop).unwrap_or_else(|e| panic!("{e}"));
        }
    }
}
