//! Checks a tree of values against a JSON schema and reports every mistake, not only the first.
//!
//! It supports the part of JSON schema that the types of this crate use: object, array, number,
//! integer, string, boolean, enum, const, and alternatives of different types.

use serde_json::{Map, Value};

use crate::document::{Report, join};
use crate::legal::{branches, did_you_mean, found, guess, legal, list, mistyped, names, range};

/// Checks a value against a JSON schema, and adds a mistake to the report for everything that the
/// schema does not allow. `path` is the place of the value in the file. Takes unknown keys out of
/// `value`, so that they do not hinder later checks. A misspelt key gets its right name.
pub(crate) fn validate(schema: &Value, value: &mut Value, path: &str, report: &mut Report) {
    if report.knows(path) {
        // The tree cannot hold this value (nan, a date), and the mistake is already reported. Only
        // the legal values are added to it.
        return report.suggest(path, legal(schema));
    }
    let names = names(schema);
    if !names.is_empty() {
        return validate_name(&names, value, path, report);
    }
    if let Some(branches) = branches(schema) {
        return match branches.iter().find(|b| is_of_type(b, value)) {
            Some(branch) => validate(branch, value, path, report),
            None => report.push(path, mistyped(schema, value), legal(schema)),
        };
    }
    if !is_of_type(schema, value) {
        return report.push(path, mistyped(schema, value), legal(schema));
    }
    match value {
        Value::Object(table) => validate_table(schema, table, path, report),
        Value::Array(array) => {
            let count = array.len() as u64;
            let enough = schema["minItems"].as_u64().is_none_or(|min| count >= min);
            let most = schema["maxItems"].as_u64();
            if !enough || most.is_some_and(|max| count > max) {
                report.push(path, format!("found {}", found(value)), legal(schema));
                // Numbers in place of the rows of a matrix are not rows that are wrong.
                if schema["items"]["type"] == "array" {
                    return;
                }
            }
            // Surplus elements are not checked.
            let looked_at = most.and_then(|max| usize::try_from(max).ok()).unwrap_or(usize::MAX);
            let elements = value.as_array_mut().into_iter().flatten();
            for (i, element) in elements.take(looked_at).enumerate() {
                validate(&schema["items"], element, &format!("{path}[{i}]"), report);
            }
        }
        Value::Number(number) => {
            if !number.as_f64().is_some_and(|x| is_in_range(schema, x)) {
                report.push(path, format!("{number} is out of range"), range(schema));
            }
        }
        Value::String(text) => {
            let count = text.chars().count() as u64;
            let (min, max) = (schema["minLength"].as_u64(), schema["maxLength"].as_u64());
            let words = || match (min, max) {
                (Some(min), Some(max)) => format!("{min} to {max} characters"),
                (None, Some(max)) => format!("at most {max} characters"),
                _ => "a string that is not empty".to_owned(),
            };
            if max.is_some_and(|max| count > max) {
                report.push(path, format!("{} has {count} characters", found(value)), words());
            } else if min.is_some_and(|min| count < min) {
                report.push(path, format!("found {}", found(value)), words());
            }
        }
        Value::Null | Value::Bool(_) => {}
    }
}

fn validate_table(schema: &Value, table: &mut Map<String, Value>, path: &str, report: &mut Report) {
    let empty = Map::new();
    let properties = schema["properties"].as_object().unwrap_or(&empty);
    let unknown: Vec<String> = table.keys().filter(|key| !properties.contains_key(*key)).cloned().collect();
    for (key, value) in table.iter_mut() {
        if let Some(property) = properties.get(key) {
            validate(property, value, &join(path, key), report);
        }
    }
    if schema["additionalProperties"] == Value::Bool(false) {
        for key in &unknown {
            if report.is_full() {
                return report.more();
            }
            take_unknown(key, properties, table, path, report);
        }
    }
    for key in schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str) {
        if !table.contains_key(key) {
            let guess = did_you_mean(key, unknown.iter().map(String::as_str));
            let guess = guess.map(|k| format!(" (is it `{k}`?)")).unwrap_or_default();
            report.push(&join(path, key), format!("missing{guess}"), legal(&properties[key]));
        }
    }
}

/// Adds a mistake to the report for the key `key` of `table`, which is not in `properties`. If it
/// is a misspelt one with a legal value, gives it its right name, and otherwise removes it.
fn take_unknown(
    key: &str,
    properties: &Map<String, Value>,
    table: &mut Map<String, Value>,
    path: &str,
    report: &mut Report,
) {
    let keys: Vec<&str> = properties.keys().map(String::as_str).collect();
    let meant = did_you_mean(key, keys.iter().copied());
    let at = join(path, key);
    report.push_key(&at, format!("unknown key{}", guess(meant)), keys.join(", "));
    let Some(mut value) = table.remove(key) else { return };
    let Some(meant) = meant.filter(|meant| !table.contains_key(*meant)) else { return report.settle(&at) };
    let mut of_value = Report::default();
    validate(&properties[meant], &mut value, "", &mut of_value);
    // Without the value that is meant, a later check could complain about its default.
    if of_value.clean_under("") {
        report.settle(&at);
        report.rename(&at, &join(path, meant));
        table.insert(meant.to_owned(), value);
    }
}

fn validate_name(names: &[&Value], value: &Value, path: &str, report: &mut Report) {
    if names.contains(&value) {
        return;
    }
    let message = match value {
        Value::String(word) => {
            let meant = did_you_mean(word, names.iter().filter_map(|n| n.as_str()));
            let guess = meant.map(|name| format!(" (did you mean {name:?}?)")).unwrap_or_default();
            format!("{} is not known here{guess}", found(value).trim_start_matches("the string "))
        }
        _ => format!("found {}", found(value)),
    };
    report.push(path, message, list(names));
}

/// Returns whether a value has the type that a schema requires, and so have all its elements if it
/// is an array. Ranges, lengths and names are not checked.
pub(crate) fn is_typed(schema: &Value, value: &Value) -> bool {
    if let Some(branches) = branches(schema).filter(|_| names(schema).is_empty()) {
        return branches.iter().any(|branch| is_typed(branch, value));
    }
    is_of_type(schema, value)
        && value.as_array().is_none_or(|elements| elements.iter().all(|e| is_typed(&schema["items"], e)))
}

/// Returns whether a number is in the range that a schema allows.
pub(crate) fn is_in_range(schema: &Value, x: f64) -> bool {
    let bound = |key: &str| schema[key].as_f64();
    bound("minimum").is_none_or(|b| x >= b)
        && bound("maximum").is_none_or(|b| x <= b)
        && bound("exclusiveMinimum").is_none_or(|b| x > b)
        && bound("exclusiveMaximum").is_none_or(|b| x < b)
}

/// Returns whether a value has the type that a schema requires. Ranges are not checked.
fn is_of_type(schema: &Value, value: &Value) -> bool {
    let listed = names(schema);
    if !listed.is_empty() {
        return listed.iter().any(|n| std::mem::discriminant(*n) == std::mem::discriminant(value));
    }
    match schema["type"].as_str() {
        Some("number") => value.is_number(),
        Some("integer") => value.is_i64() || value.is_u64(),
        Some("string") => value.is_string(),
        Some("boolean") => value.is_boolean(),
        Some("array") => value.is_array(),
        Some("object") => value.is_object(),
        _ => true,
    }
}
