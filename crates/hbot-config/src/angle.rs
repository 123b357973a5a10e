//! Angles with a unit, such as `"35 deg"`, and numbers that are plainly degrees.
//!
//! All angles of rig files, scene files and the op `set` are radians. A text with a unit is
//! converted before the value is checked.

use serde_json::Value;

use crate::document::{Report, join};
use crate::legal::{branches, range};
use crate::validate::is_in_range;

/// Smallest and largest whole number that is taken for degrees if it is a multiple of 5. In
/// radians, these would be 5 to 115 turns.
const LIKE_DEGREES: std::ops::RangeInclusive<f64> = 30.0..=720.0;

/// Converts the angles in `value` that are texts with a unit into radians. `schema` is the JSON
/// schema of `value`; an angle is a value whose unit there is `rad`. Adds a mistake to the report
/// for each bare number that is plainly degrees, or is out of range and would be in range as
/// degrees. A text that is not an angle stays as it is, so the later check of types reports it.
pub(crate) fn to_radians(schema: &Value, value: &mut Value, path: &str, report: &mut Report) {
    if schema["unit"] == "rad" {
        return convert(schema, value, path, report);
    }
    for branch in branches(schema).into_iter().flatten() {
        to_radians(branch, value, path, report);
    }
    match value {
        Value::Object(table) => {
            for (key, value) in table {
                if let Some(property) = schema["properties"].get(key) {
                    to_radians(property, value, &join(path, key), report);
                }
            }
        }
        Value::Array(elements) if schema.get("items").is_some() => {
            for (i, element) in elements.iter_mut().enumerate() {
                to_radians(&schema["items"], element, &format!("{path}[{i}]"), report);
            }
        }
        _ => {}
    }
}

fn convert(schema: &Value, value: &mut Value, path: &str, report: &mut Report) {
    match value {
        Value::String(text) => {
            if let Some(radians) = radians(text) {
                // Who writes degrees must not have to look for another number.
                if !is_in_range(schema, radians) && !text.trim_end().ends_with("rad") {
                    report.push(path, format!("{text:?} is {radians:.4} rad, out of range"), range(schema));
                }
                *value = radians.into();
            }
        }
        Value::Array(elements) => {
            for (i, element) in elements.iter_mut().enumerate() {
                convert(&schema["items"], element, &format!("{path}[{i}]"), report);
            }
        }
        Value::Number(number) => {
            let Some(x) = number.as_f64() else { return };
            let for_degrees = format!("\"{x} deg\" for degrees");
            if LIKE_DEGREES.contains(&x.abs()) && x % 5.0 == 0.0 {
                let turns = x.abs() / std::f64::consts::TAU;
                let message = format!("{x} rad is about {turns:.0} turns");
                let radians = format!(", \"{x} rad\" if radians are meant");
                let radians = if is_in_range(schema, x) { radians } else { String::new() };
                report.push(path, message, for_degrees + &radians);
            } else if !is_in_range(schema, x) && is_in_range(schema, x.to_radians()) {
                let legal = range(schema).map(|range| format!("{range}, or {for_degrees}"));
                report.push(path, format!("{number} is out of range"), legal);
            }
        }
        _ => {}
    }
}

/// Returns the angle that `text` names, rad. Returns `None` if it is not a finite number followed
/// by `deg`, `degrees`, `°` or `rad`.
fn radians(text: &str) -> Option<f64> {
    let text = text.trim();
    let degrees = ["degrees", "degree", "deg", "°"].iter().find_map(|unit| text.strip_suffix(unit));
    let (number, unit) = if let Some(number) = degrees {
        (number, std::f64::consts::PI / 180.0)
    } else {
        (text.strip_suffix("rad")?, 1.0)
    };
    number.trim().parse().ok().filter(|x: &f64| x.is_finite()).map(|x| x * unit)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn converted(mut value: Value) -> (Value, Vec<String>) {
        let schema = json!({"properties": {
            "cone": {"type": "number", "unit": "rad", "exclusiveMinimum": 0.0, "maximum": 3.0},
            "twist": {
                "type": "array",
                "items": {"type": "number", "minimum": -1000.0, "maximum": 1000.0},
                "unit": "rad",
            },
            "stiffness": {"type": "number", "unit": "N m/rad"},
        }});
        let mut report = Report::default();
        to_radians(&schema, &mut value, "", &mut report);
        let mistakes = report.finish(Some(())).err().map(|mistakes| mistakes.to_string());
        (value, mistakes.into_iter().collect())
    }

    #[test]
    fn a_text_with_a_unit_is_an_angle_and_nothing_else_is() {
        let half = std::f64::consts::FRAC_PI_2;
        let (value, mistakes) = converted(json!({"cone": "90 degrees", "twist": ["-90°", " 3.5rad "]}));
        assert_eq!(value, json!({"cone": half, "twist": [-half, 3.5]}));
        assert_eq!(mistakes, Vec::<String>::new());
        for text in ["90", "deg", "nan deg", "1 turn", "1 gradian"] {
            assert_eq!(converted(json!({"cone": text})).0, json!({"cone": text}));
        }
        // Only angles have these units.
        assert_eq!(converted(json!({"stiffness": "90 deg"})).0, json!({"stiffness": "90 deg"}));
    }

    #[test]
    fn bare_degrees_are_a_mistake() {
        let (_, mistakes) = converted(json!({"twist": [-90, 90.0]}));
        assert!(mistakes[0].contains("-90 rad is about 14 turns"), "{mistakes:?}");
        assert!(mistakes[0].contains("\"90 deg\" for degrees"), "{mistakes:?}");
        for legal in [json!({"twist": [-31, 1000]}), json!({"cone": 1.5}), json!({"stiffness": 90})] {
            assert_eq!(converted(legal.clone()), (legal, vec![]));
        }
        assert_eq!(converted(json!({"twist": ["-90 rad", "90 rad"]})).1, Vec::<String>::new());
    }

    #[test]
    fn an_angle_out_of_range_that_is_legal_as_degrees_is_told_how_degrees_are_written() {
        let told = |value| converted(value).1.concat();
        let cone = "cone: 10 is out of range; legal: > 0 and <= 3 rad, or \"10 deg\" for degrees";
        assert_eq!(told(json!({"cone": 10})), cone);
        let twist = "twist[1]: 1080 is out of range; legal: -1000 to 1000, or \"1080 deg\" for degrees";
        assert_eq!(told(json!({"twist": [0, 1080]})), twist);
        // The check of ranges reports what is wrong as degrees too, and what is plainly radians.
        for other in [json!({"cone": -1}), json!({"cone": 1e9}), json!({"cone": "10 rad"})] {
            assert_eq!(told(other.clone()), "", "{other}");
        }
    }
}
