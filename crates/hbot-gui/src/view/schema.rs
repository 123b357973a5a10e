//! Interprets JSON schemas, so that parameters of any kind of effect can be drawn without code for
//! that kind.

use serde_json::Value;

/// The kind of value that a schema describes. It decides with which control the value is edited.
#[derive(Debug, PartialEq)]
pub(crate) enum Shape<'a> {
    Number {
        whole: bool,
        least: f64,
        most: f64,
    },
    Flag,
    /// One value from a list of legal values.
    Choice(Vec<&'a Value>),
    List {
        item: &'a Value,
        least: usize,
        most: usize,
    },
    /// A value that matches one of several schemas.
    Variants(&'a [Value]),
    Text,
    /// A value that the panel cannot edit.
    Unknown,
}

static NULL: Value = Value::Null;

/// Returns the kind of value that a schema describes. The schema must not contain references to
/// other schemas.
pub(crate) fn shape(schema: &Value) -> Shape<'_> {
    if let Some(values) = schema["enum"].as_array() {
        return Shape::Choice(values.iter().collect());
    }
    if let Some(value) = schema.get("const") {
        return Shape::Choice(vec![value]);
    }
    for key in ["oneOf", "anyOf"] {
        if let Some(variants) = schema[key].as_array() {
            let choice: Option<Vec<_>> = variants
                .iter()
                .map(|variant| match shape(variant) {
                    Shape::Choice(values) => Some(values),
                    _ => None,
                })
                .collect();
            return match choice {
                Some(values) => Shape::Choice(values.concat()),
                None => Shape::Variants(variants),
            };
        }
    }
    let bound = |keys: [&str; 2], otherwise: f64| {
        keys.iter().find_map(|key| schema[*key].as_f64()).unwrap_or(otherwise)
    };
    match schema["type"].as_str() {
        Some(kind @ ("number" | "integer")) => Shape::Number {
            whole: kind == "integer",
            least: bound(["minimum", "exclusiveMinimum"], f64::NEG_INFINITY),
            most: bound(["maximum", "exclusiveMaximum"], f64::INFINITY),
        },
        Some("boolean") => Shape::Flag,
        Some("string") => Shape::Text,
        Some("array") => Shape::List {
            item: schema.get("items").unwrap_or(&NULL),
            least: schema["minItems"].as_u64().unwrap_or(0) as usize,
            most: schema["maxItems"].as_u64().map_or(usize::MAX, |n| n as usize),
        },
        _ => Shape::Unknown,
    }
}

/// Returns whether a value has the type that a schema requires. Ranges are not checked, because the
/// server checks them.
pub(crate) fn fits(schema: &Value, value: &Value) -> bool {
    match shape(schema) {
        Shape::Number { .. } => value.is_number(),
        Shape::Flag => value.is_boolean(),
        Shape::Text => value.is_string(),
        Shape::Choice(values) => values.contains(&value),
        Shape::List { item, least, most } => value.as_array().is_some_and(|list| {
            (least..=most).contains(&list.len()) && list.iter().all(|value| fits(item, value))
        }),
        Shape::Variants(variants) => variants.iter().any(|variant| fits(variant, value)),
        Shape::Unknown => false,
    }
}

/// Converts `value` to the type that a schema requires. If it already has this type, returns it
/// unchanged. Otherwise returns the default if there is one, or else the nearest value of the
/// required type.
pub(crate) fn converted(schema: &Value, value: &Value) -> Value {
    if fits(schema, value) {
        return value.clone();
    }
    if let Some(default) = schema.get("default") {
        return default.clone();
    }
    match shape(schema) {
        Shape::Number { whole, least, most } => {
            let x = mean(value).unwrap_or(0.0).clamp(least, most);
            if whole { Value::from(x.round() as i64) } else { Value::from(x) }
        }
        Shape::Flag => Value::Bool(false),
        Shape::Text => Value::from(""),
        Shape::Choice(values) => values.first().map_or(Value::Null, |value| (*value).clone()),
        Shape::List { item, least, .. } => {
            // A number becomes a square matrix with this diagonal, or a list of equal numbers.
            let square =
                matches!(shape(item), Shape::List { least: n, most, .. } if n == least && most == least);
            let row = |i: usize| match value.as_f64() {
                Some(x) if square => {
                    (0..least).map(|j| if i == j { Value::from(x) } else { Value::from(0.0) }).collect()
                }
                Some(_) => converted(item, value),
                None => converted(item, &value[i]),
            };
            (0..least).map(row).collect()
        }
        Shape::Variants(variants) => {
            variants.first().map_or(Value::Null, |variant| converted(variant, value))
        }
        Shape::Unknown => Value::Null,
    }
}

/// Returns the mean of a value: for a number the number itself, for a square matrix the mean of its
/// diagonal, for any other list the mean of its elements.
fn mean(value: &Value) -> Option<f64> {
    let Some(list) = value.as_array() else { return value.as_f64() };
    let parts = list.iter().enumerate().map(|(i, part)| part.as_f64().or_else(|| part[i].as_f64()));
    let parts: Option<Vec<f64>> = parts.collect();
    parts.filter(|parts| !parts.is_empty()).map(|parts| parts.iter().sum::<f64>() / parts.len() as f64)
}

/// Returns the name of a parameter in words, without the unit, which stands in the field.
pub(crate) fn words(key: &str, schema: &Value) -> String {
    let unit = schema["unit"].as_str().unwrap_or_default();
    key.strip_suffix(unit).and_then(|name| name.strip_suffix('_')).unwrap_or(key).replace('_', " ")
}

/// Returns the help text for a parameter: description, unit, range and default.
pub(crate) fn explain(schema: &Value) -> String {
    let mut text = schema["description"].as_str().unwrap_or_default().to_owned();
    let mut add = |part: String| {
        if !text.is_empty() {
            text.push('\n');
        }
        text.push_str(&part);
    };
    if let Some(unit) = schema["unit"].as_str() {
        add(format!("unit: {unit}"));
    }
    if let Shape::Number { least, most, .. } = shape(schema)
        && (least.is_finite() || most.is_finite())
    {
        add(format!("range: {least} to {most}"));
    }
    if let Some(legal) = schema["legal"].as_str() {
        add(format!("legal: {legal}"));
    }
    if let Some(default) = schema.get("default") {
        add(format!("default: {default}"));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn impedance() -> Value {
        let kinds = hbot_config::scene::kinds();
        let spring = kinds.iter().find(|kind| kind.name == "spring").expect("a kind");
        spring.schema["properties"]["stiffness"].clone()
    }

    #[test]
    fn the_name_of_a_parameter_is_words_without_its_unit() {
        let name = |key: &str, unit: &str| words(key, &json!({"unit": unit}));
        assert_eq!(name("fade_out_s", "s"), "fade out");
        assert_eq!(name("mass", "s"), "mass");
        assert_eq!(words("reference", &json!({})), "reference");
    }

    #[test]
    fn every_parameter_of_every_kind_can_be_drawn() {
        fn check(path: &str, schema: &Value) {
            match shape(schema) {
                Shape::Unknown => panic!("{path}: {schema}"),
                Shape::List { item, .. } => check(path, item),
                Shape::Variants(variants) => variants.iter().for_each(|variant| check(path, variant)),
                _ => {}
            }
        }
        for kind in hbot_config::scene::kinds() {
            for (key, schema) in kind.schema["properties"].as_object().expect("properties") {
                check(&format!("{}.{key}", kind.name), schema);
            }
        }
    }

    #[test]
    fn a_stiffness_goes_from_a_number_to_a_matrix_and_back() {
        let schema = impedance();
        let Shape::Variants([number, matrix]) = shape(&schema) else { panic!("{schema}") };
        let rows = converted(matrix, &json!(2.0));
        assert_eq!(rows, json!([[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]]));
        assert!(fits(matrix, &rows) && !fits(number, &rows));
        assert_eq!(converted(number, &json!([[1, 0, 0], [0, 2, 0], [0, 0, 3]])), json!(2.0));
    }

    #[test]
    fn choices_of_either_notation_are_choices() {
        let plain = json!({"type": "string", "enum": ["a", "b"]});
        let told = json!({"oneOf": [{"const": "a", "description": "A"}, {"const": "b"}]});
        for schema in [plain, told] {
            let Shape::Choice(values) = shape(&schema) else { panic!("{schema}") };
            assert_eq!(values, [&json!("a"), &json!("b")]);
        }
    }
}
