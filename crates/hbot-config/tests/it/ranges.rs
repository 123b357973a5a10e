//! Every number of rig and scene files is refused outside its range, on each side.

use hbot_config::scene::{kinds, phenomena};
use hbot_config::{RigConfig, SceneFile};
use serde_json::Value;

fn outside(schema: &Value) -> Vec<String> {
    let bound = |key: &str| schema[key].as_f64();
    let step = if schema["type"] == "integer" { 1.0 } else { 1.0e-9 };
    let low = bound("minimum").map(|b| b - step).or(bound("exclusiveMinimum"));
    let high = bound("maximum").map(|b| b + step * b.max(1.0)).or(bound("exclusiveMaximum"));
    let (low, high) = (low.expect("a least value"), high.expect("a largest value"));
    let beyond = [low, low - 1.0, low - 1.0e12, high, high + 1.0, high + 1.0e12];
    if schema["type"] == "integer" {
        let whole = beyond.iter().map(|x| x.to_string());
        return whole.chain(["nan", "inf", "0.5", "1e300"].map(String::from)).collect();
    }
    let real = beyond.iter().map(|x| format!("{x:?}"));
    real.chain(["nan", "inf", "-inf", "1e300", "-1e300"].map(String::from)).collect()
}

/// Collects the schema and path of every number in a schema. Of an array, only the first element is
/// collected.
fn numbers(schema: &Value, path: &str, found: &mut Vec<(String, Value)>) {
    match schema["type"].as_str() {
        Some("number" | "integer") if schema["enum"].is_null() => {
            found.push((path.to_owned(), schema.clone()))
        }
        Some("object") => {
            for (key, property) in schema["properties"].as_object().unwrap() {
                let at = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                numbers(property, &at, found);
            }
        }
        Some("array") => numbers(&schema["items"], &format!("{path}[0]"), found),
        _ => {
            for branch in schema["anyOf"].as_array().into_iter().flatten() {
                numbers(branch, path, found);
            }
        }
    }
}

/// Returns the text of a TOML file in which the value at `path` is replaced by `value`, given in
/// TOML syntax.
fn with(mut file: toml::Value, path: &str, value: &str) -> String {
    const MARK: &str = "here";
    let mut place = &mut file;
    let keys: Vec<&str> = path.split(['.', '[']).collect();
    for (k, key) in keys.iter().enumerate() {
        place = match key.strip_suffix(']') {
            Some(index) => {
                if !place.is_array() {
                    // The file lacks the list, or has a number where a matrix is legal, too.
                    *place = match keys.get(k + 1) {
                        Some(next) if next.ends_with(']') => toml::Value::from(vec![
                            vec![1.0, 0.0, 0.0],
                            vec![0.0, 1.0, 0.0],
                            vec![0.0, 0.0, 1.0],
                        ]),
                        // A harmonic of `cogging`, whose other numbers are legal.
                        Some(_) => toml::from_str("a = [{ per_turn = 1, amplitude = 0.1 }]")
                            .map(|list: toml::Table| list["a"].clone())
                            .unwrap(),
                        None => toml::Value::from(vec![0.0; 3]),
                    };
                }
                &mut place.as_array_mut().unwrap()[index.parse::<usize>().unwrap()]
            }
            None => {
                if !place.is_table() {
                    // The file lacks the table.
                    *place = toml::Value::Table(toml::Table::new());
                }
                place.as_table_mut().unwrap().entry(*key).or_insert(toml::Value::Boolean(false))
            }
        };
    }
    *place = toml::Value::String(MARK.to_owned());
    toml::to_string(&file).unwrap().replace(&format!("{MARK:?}"), value)
}

fn all_are_refused(
    numbers: &[(String, Value)],
    file: &toml::Value,
    said: impl Fn(&str) -> Result<(), String>,
) {
    for (path, schema) in numbers {
        for value in outside(schema) {
            let text = with(file.clone(), path, &value);
            let said = said(&text).expect_err(&format!("{path} = {value}"));
            let place = format!(": {path}: ");
            assert!(
                said.starts_with("x.toml:") && said.contains(&place) && said.contains("; legal: "),
                "{said}"
            );
            assert_eq!(said.lines().count(), 1, "{said}");
            let kind =
                ["is out of range", "is not a finite number", "found "].iter().any(|k| said.contains(k));
            assert!(kind, "{said}");
        }
    }
}

#[test]
fn of_the_rig_file() {
    let mut all = Vec::new();
    numbers(&RigConfig::schema(), "", &mut all);
    assert_eq!(all.len(), 75, "{all:?}");
    let mut file = toml::Value::Table(include_str!("../../../../rigs/prototype.toml").parse().unwrap());
    // Keys that accept a table have one here, so that its numbers are tested.
    file["loop"]["rate_estimate"] = toml::Value::Table("method = 'kalman'".parse().unwrap());
    for key in ["passivity", "lead", "compensation"] {
        file["loop"].as_table_mut().unwrap().insert(key.to_owned(), toml::Table::new().into());
    }
    let energy = "burst = 0.5\npower = 1".parse::<toml::Table>().unwrap();
    file["limits"].as_table_mut().unwrap().insert("energy".to_owned(), energy.into());
    all_are_refused(&all, &file, |text| {
        RigConfig::from_toml(text, "x.toml").map(drop).map_err(|error| error.to_string())
    });
}

/// Fed friction is smoothed over three times the noise that counts make in the joint rates.
#[test]
fn friction_is_smoothed_beyond_the_noise_of_the_rates() {
    let altered = |rate: &str, alter: fn(&str) -> String| {
        let text = include_str!("../../../../rigs/prototype.toml")
            .replace("rate_estimate = \"controller\"", &format!("rate_estimate = {rate}"))
            .replace("mass = 0.467", "friction = { coulomb = 1e-3 }\nmass = 0.467");
        let config = RigConfig::from_toml(&alter(&text), "x.toml").unwrap_or_else(|error| panic!("{error}"));
        config.rig.compensation.expect("friction").smoothing
    };
    let smoothing = |rate: &str| altered(rate, str::to_owned);
    assert_eq!(smoothing("'controller'"), 0.005, "the controllers' rates count as without noise");
    // A difference of two angles, each rounded by a count of the steer joint: u sqrt(2/12)/h.
    let noise = std::f64::consts::TAU / 16384.0 * f64::sqrt(1.0 / 6.0) / 1.0e-3;
    let noisy = smoothing("'difference'");
    assert!((noisy / (3.0 * noise) - 1.0).abs() < 1.0e-9, "{noisy}");
    let own = "'difference'\ncompensation = { smoothing = 0.03 }";
    assert_eq!(smoothing(own), 0.03);
    // The noise of 64 lines is beyond what is legal.
    let coarse: fn(&str) -> String = |text| text.replace("counts_per_turn = 16384", "counts_per_turn = 256");
    assert_eq!(altered("'difference'", coarse), 10.0);
}

fn defaults(schema: &Value) -> toml::Table {
    let properties = schema["properties"].as_object().unwrap();
    properties.iter().map(|(name, p)| (name.clone(), toml::Value::try_from(&p["default"]).unwrap())).collect()
}

#[test]
fn of_scenes() {
    let said = |text: &str| SceneFile::from_toml(text, "x.toml").map(drop).map_err(|error| error.to_string());
    for kind in kinds() {
        let mut all = Vec::new();
        numbers(&kind.schema, "effect[0]", &mut all);
        assert!(all.len() >= 3, "{all:?}");
        let mut effect = toml::Table::new();
        for (name, parameter) in kind.schema["properties"].as_object().unwrap() {
            let mut value = toml::Value::try_from(&parameter["default"]).unwrap();
            if let Some(list) = value.as_array_mut().filter(|list| list.is_empty()) {
                // A list that is empty by default gets an element, whose range can then be tested.
                list.push(match parameter["items"]["minItems"].as_u64() {
                    Some(numbers) => toml::Value::from(vec![0.0; numbers as usize]),
                    None => 0.0.into(),
                });
            }
            effect.insert(name.clone(), value);
        }
        effect.insert("id".to_owned(), "e".into());
        effect.insert("kind".to_owned(), kind.name.into());
        let file = toml::Table::from_iter([("effect".to_owned(), toml::Value::from(vec![effect]))]);
        all_are_refused(&all, &toml::Value::Table(file), said);
    }
    for phenomenon in phenomena() {
        let mut all = Vec::new();
        numbers(&phenomenon.schema, &format!("simulate.{}", phenomenon.name), &mut all);
        assert!(!all.is_empty());
        let within =
            |name: &str, table: toml::Table| toml::Table::from_iter([(name.to_owned(), table.into())]);
        let file = within("simulate", within(phenomenon.name, defaults(&phenomenon.schema)));
        all_are_refused(&all, &toml::Value::Table(file), said);
    }
}
