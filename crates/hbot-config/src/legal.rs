//! Describes JSON schemas and values in words for messages: what is legal at a place, and what was
//! found there.

use serde_json::Value;

/// Describes in words which values a schema allows, such as `a number, 0 to 1000 N m/rad`.
pub(crate) fn legal(schema: &Value) -> String {
    if let Some(words) = schema["legal"].as_str() {
        return words.to_owned();
    }
    let names = names(schema);
    if !names.is_empty() {
        return list(&names);
    }
    if let Some(branches) = branches(schema) {
        return branches.iter().map(legal).collect::<Vec<_>>().join(", or ");
    }
    let with_range = |what: &str| match range(schema) {
        Some(range) => format!("{what}, {range}"),
        None => what.to_owned(),
    };
    match schema["type"].as_str() {
        Some("number") => with_range("a number"),
        Some("integer") => with_range("a whole number"),
        Some("string") => "a string".to_owned(),
        Some("boolean") => "true or false".to_owned(),
        Some("array") => {
            let elements = match schema["items"]["type"].as_str() {
                Some("number") => "numbers",
                Some("object") => "tables",
                _ => "elements",
            };
            lengths(schema).map_or_else(|| "an array".to_owned(), |n| format!("an array of {n} {elements}"))
        }
        Some("object") => "a table".to_owned(),
        _ => "anything".to_owned(),
    }
}

/// Describes in words which values a schema allows, like [`legal`]. For an array, adds the range of
/// its elements.
pub(crate) fn legal_with_elements(schema: &Value) -> String {
    let elements = range(&schema["items"]).filter(|_| schema.get("legal").is_none());
    let unit = schema["unit"].as_str().map(|unit| format!(" {unit}")).unwrap_or_default();
    elements.map_or_else(|| legal(schema), |range| format!("{}, each {range}{unit}", legal(schema)))
}

/// Returns the range that a schema allows for a number, with its unit, such as `> 0 and <= 10 m` or
/// `0 to 1000`. Returns `None` if the schema has no bounds.
pub(crate) fn range(schema: &Value) -> Option<String> {
    let bound = |key: &str| schema.get(key).filter(|v| v.is_number());
    let unit = schema["unit"].as_str().map(|unit| format!(" {unit}")).unwrap_or_default();
    if let (Some(min), Some(max)) = (bound("minimum"), bound("maximum")) {
        return Some(format!("{} to {}{unit}", number(min), number(max)));
    }
    let parts: Vec<String> =
        [("exclusiveMinimum", ">"), ("minimum", ">="), ("exclusiveMaximum", "<"), ("maximum", "<=")]
            .into_iter()
            .filter_map(|(key, sign)| bound(key).map(|b| format!("{sign} {}", number(b))))
            .collect();
    (!parts.is_empty()).then(|| format!("{}{unit}", parts.join(" and ")))
}

/// Returns the number of elements that a schema allows for an array, such as `3` or `2 to 8`.
/// Returns `None` if the schema does not limit it.
fn lengths(schema: &Value) -> Option<String> {
    match (schema["minItems"].as_u64(), schema["maxItems"].as_u64()) {
        (Some(min), Some(max)) if min == max => Some(min.to_string()),
        (Some(min), Some(max)) => Some(format!("{min} to {max}")),
        (None, Some(max)) => Some(format!("at most {max}")),
        (Some(min), None) => Some(format!("at least {min}")),
        (None, None) => None,
    }
}

/// Returns the legal values of a schema that lists them one by one. Returns an empty list for any
/// other schema.
pub(crate) fn names(schema: &Value) -> Vec<&Value> {
    if let Some(all) = schema["enum"].as_array() {
        return all.iter().collect();
    }
    match branches(schema) {
        Some(branches) if branches.iter().all(|b| b.get("const").is_some() || b.get("enum").is_some()) => {
            branches.iter().flat_map(|b| b.get("const").map_or_else(|| names(b), |only| vec![only])).collect()
        }
        _ => Vec::new(),
    }
}

/// Returns the alternatives that a schema offers (`oneOf` or `anyOf`), if it has any.
pub(crate) fn branches(schema: &Value) -> Option<&Vec<Value>> {
    schema["oneOf"].as_array().or_else(|| schema["anyOf"].as_array())
}

/// Writes values as a list with commas, such as `"a", "b", 3`. Strings are in quotes.
pub(crate) fn list(values: &[&Value]) -> String {
    values.iter().map(|v| v.to_string()).collect::<Vec<_>>().join(", ")
}

/// Describes a wrong value for an error message, such as `the string "0.1"`. A long string is cut.
pub(crate) fn found(value: &Value) -> String {
    const MOST_CHARS: usize = 40;
    match value {
        Value::Null => "null".to_owned(),
        Value::Bool(b) => b.to_string(),
        Value::Number(n) => n.to_string(),
        Value::String(text) if text.chars().count() > MOST_CHARS => {
            format!("the string {:?}...", text.chars().take(MOST_CHARS).collect::<String>())
        }
        Value::String(text) => format!("the string {text:?}"),
        Value::Array(a) if a.len() == 1 => "an array of 1 element".to_owned(),
        Value::Array(a) => format!("an array of {} elements", a.len()),
        Value::Object(_) => "a table".to_owned(),
    }
}

/// Says how to write a number that has a unit.
pub(crate) const NUMBER_ALONE: &str = " (write the number alone: its unit is that of the key)";

/// Returns whether a text is a number with a unit, such as `2 N m/rad`.
pub(crate) fn has_unit(text: &str) -> bool {
    const UNITS: [&str; 14] =
        ["N", "Nm", "m", "mm", "cm", "rad", "deg", "s", "ms", "us", "kg", "g", "Hz", "%"];
    let unit = text.split(|c: char| !c.is_alphabetic() && c != '%').find(|word| !word.is_empty());
    let first = text.split(|c: char| c.is_alphabetic() || c == '%' || c == ' ').next().unwrap_or_default();
    first.parse::<f64>().is_ok() && unit.is_some_and(|unit| UNITS.contains(&unit))
}

/// Describes a value that is not of the type of `schema`. If it is a number with a unit in quotes
/// and the number is wanted alone, says so. An angle may have its unit, as the legal values say.
pub(crate) fn mistyped(schema: &Value, value: &Value) -> String {
    let is_number = |schema: &Value| ["number", "integer"].iter().any(|kind| schema["type"] == *kind);
    let wanted = is_number(schema) || branches(schema).is_some_and(|all| all.iter().any(is_number));
    let is_told = wanted && schema["unit"] != "rad" && value.as_str().is_some_and(has_unit);
    let is_angle = wanted && schema["unit"] == "rad" && value.is_string();
    let hint = match (is_told, is_angle) {
        (true, _) => NUMBER_ALONE,
        (_, true) => " (write degrees as \"35 deg\")",
        _ => "",
    };
    format!("found {}{hint}", found(value))
}

/// Words that people use for a kind of effect or for the key `kind`, and the word that hbot knows.
const OTHER_WORDS: [(&[&str], &str); 7] = [
    (&["kind"], "type"),
    (&["wall", "walls", "stop", "limit"], "end_stop"),
    (&["notch", "notches", "click", "clicks"], "detents"),
    (&["hinge", "rail"], "guide"),
    (&["mass", "weight"], "inertia"),
    (&["gravity"], "pendulum"),
    (&["damping", "viscous"], "damper"),
];

/// Returns the word in `known` that is meant by the unknown word `word`, for the hint "did you
/// mean": another word for the same, or the most similar word. Returns `None` if no word is similar
/// enough.
#[must_use]
pub fn did_you_mean<'a>(word: &str, known: impl Iterator<Item = &'a str> + Clone) -> Option<&'a str> {
    // No known word is this long, and the comparison takes time proportional to both lengths.
    if word.len() > 100 {
        return None;
    }
    let lower = word.to_lowercase();
    let word = lower.as_str();
    // One wrong letter in three. This accepts `stiffnes` and `dampping`, but no unrelated word.
    let most = (word.chars().count() / 3).max(1);
    let similar = known
        .clone()
        .map(|k| (strsim::osa_distance(word, k), k))
        .filter(|&(d, k)| d <= most && d < k.chars().count())
        .min_by_key(|&(d, _)| d);
    let other = OTHER_WORDS.iter().find(|(words, _)| words.contains(&word));
    let other = other.and_then(|(_, kind)| known.clone().find(|k| k == kind));
    // One wrong letter is nearer than another word.
    match similar {
        Some((0 | 1, k)) => Some(k),
        _ => other.or(similar.map(|(_, k)| k)),
    }
}

/// Returns the hint that an error message about an unknown word ends with. Empty without a word
/// that is meant.
#[must_use]
pub fn guess(meant: Option<&str>) -> String {
    meant.map(|meant| format!(" (did you mean `{meant}`?)")).unwrap_or_default()
}

/// Writes a value in a short form that people prefer: `[1, 0, 0]` instead of `[1.0,0.0,0.0]`.
pub(crate) fn short(value: &Value) -> String {
    match value {
        Value::Array(all) => format!("[{}]", all.iter().map(short).collect::<Vec<_>>().join(", ")),
        Value::Number(_) => number(value),
        _ => value.to_string(),
    }
}

/// Writes a number in a short form that people prefer: `10` instead of `10.0`, and `1e-5` for a
/// small number.
pub(crate) fn number(value: &Value) -> String {
    match value.as_f64() {
        Some(x) if x.abs() < 1.0e-3 && x != 0.0 => format!("{x:e}"),
        Some(x) => x.to_string(),
        None => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn ranges_read_well() {
        let range = |schema| range(&schema);
        assert_eq!(range(json!({"exclusiveMinimum": 0.0})).as_deref(), Some("> 0"));
        assert_eq!(
            range(json!({"minimum": 0, "maximum": 1000.0, "unit": "N m"})).as_deref(),
            Some("0 to 1000 N m")
        );
        assert_eq!(
            range(json!({"exclusiveMinimum": 0, "maximum": 10, "unit": "m"})).as_deref(),
            Some("> 0 and <= 10 m")
        );
        assert_eq!(range(json!({"minimum": 1e-5})).as_deref(), Some(">= 1e-5"));
        assert_eq!(range(json!({})), None);
    }

    #[test]
    fn near_words_are_guessed_and_far_ones_are_not() {
        let known = || ["stiffness", "damping", "law"].into_iter();
        assert_eq!(did_you_mean("stifness", known()), Some("stiffness"));
        assert_eq!(did_you_mean("lwa", known()), Some("law"));
        assert_eq!(did_you_mean("colour", known()), None);
        assert_eq!(did_you_mean("wall", ["damper", "end_stop"].into_iter()), Some("end_stop"));
        assert_eq!(did_you_mean("wall", known()), None, "where no kinds are asked for");
        assert_eq!(did_you_mean("walls", ["end_stop", "wall"].into_iter()), Some("wall"));
        assert_eq!(did_you_mean("", known()), None);
    }
}
