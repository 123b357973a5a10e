//! Random scenes at the edges of what a file can contain, generated from the schemas of the kinds
//! of effect.

use crate::prelude::*;
use std::sync::LazyLock;

use hbot_config::scene::{Listed, kinds};
use serde_json::{Map, Value, json};

static KINDS: LazyLock<Vec<Listed>> = LazyLock::new(kinds);

/// Returns a scene with one to eight effects.
pub fn scene(rng: &mut Rng) -> Value {
    let effects: Vec<_> = (0..1 + rng.below(8))
        .map(|k| {
            let kind = KINDS[rng.below(KINDS.len() as u64) as usize].name;
            let mut effect = parameters(rng, kind);
            effect.insert("id".to_owned(), json!(format!("e{k}")));
            effect.insert("kind".to_owned(), json!(kind));
            Value::Object(effect)
        })
        .collect();
    json!({"name": "random", "effect": effects})
}

/// Returns some parameters of a kind, each at an edge of its range or inside.
pub fn parameters(rng: &mut Rng, kind: &str) -> Map<String, Value> {
    let listed = KINDS.iter().find(|listed| listed.name == kind);
    let Some(properties) = listed.and_then(|listed| listed.schema["properties"].as_object()) else {
        return Map::new();
    };
    let mut chosen = Map::new();
    for (key, schema) in properties {
        // Files of points, and lists whose elements depend on each other, keep their defaults.
        if matches!(key.as_str(), "file" | "points" | "positions" | "orientations" | "twist" | "path" | "set")
        {
            continue;
        }
        if rng.once_in(2) {
            chosen.insert(key.clone(), value(rng, key, schema));
        }
    }
    chosen
}

fn value(rng: &mut Rng, key: &str, schema: &Value) -> Value {
    for choice in ["anyOf", "oneOf"] {
        if let Some(options) = schema[choice].as_array() {
            // If a number and a matrix are allowed, the number is chosen.
            let option = if choice == "anyOf" { 0 } else { rng.below(options.len() as u64) as usize };
            return value(rng, key, &options[option]);
        }
    }
    if let Some(options) = schema["enum"].as_array() {
        return options[rng.below(options.len() as u64) as usize].clone();
    }
    if !schema["const"].is_null() {
        return schema["const"].clone();
    }
    match schema["type"].as_str() {
        Some("number" | "integer") => {
            let bound = |names: [&str; 2], or: f64| {
                names.iter().find_map(|name| schema[*name].as_f64()).unwrap_or(or)
            };
            let low = bound(["minimum", "exclusiveMinimum"], 0.0);
            let high = bound(["maximum", "exclusiveMaximum"], 10.0);
            let x = match rng.below(5) {
                0 => low,
                1 => high,
                2 => schema["default"].as_f64().unwrap_or(low),
                3 => rng.between(low, high),
                _ => low + (high - low) * rng.between(0.0, 1.0).powi(6),
            };
            if schema["type"] == "integer" { json!(x.round() as i64) } else { json!(x) }
        }
        Some("boolean") => json!(rng.once_in(2)),
        Some("array") if key == "reference" => match rng.below(3) {
            0 => json!([1.0, 0.0, 0.0, 0.0]),
            1 => json!([0.0, 1.0, 0.0, 0.0]),
            _ => {
                let v = rng.vector(1.0);
                json!([rng.between(0.1, 1.0), v.x, v.y, v.z])
            }
        },
        Some("array") => {
            let n = schema["minItems"].as_u64().unwrap_or(0);
            (0..n).map(|_| value(rng, "", &schema["items"])).collect()
        }
        _ => schema["default"].clone(),
    }
}
