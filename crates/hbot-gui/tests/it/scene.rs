//! Tests of scenes: choosing and loading them, switching effects, changing parameters, saving.

use eframe::egui::Key;
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use hbot_config::SceneFile;
use serde_json::{Map, Value, json};

use crate::bench::{AloneServer, STILL, Seat, ServerSetup, Witness, norm};
use crate::controls::seated;

#[test]
fn a_scene_is_chosen_loaded_and_shown() {
    let bench = AloneServer::start(&ServerSetup::default());
    let (mut seat, mut witness) = seated(&bench);
    seat.pick("Scene file", "uneven-spring");
    seat.click("Load");
    seat.until_text("Uneven spring");
    seat.until("the effects", |harness| harness.query_by_label("air on").is_some());
    assert_eq!(witness.info().scene["name"], "Uneven spring");
    assert!(seat.shows("ns a tick"), "what the effects cost");
    assert!(seat.shows("rad from its reference"), "the spring pulls somewhere");
    // The stiffness of this scene is a matrix, so there is a slider for each axis.
    assert_eq!(seat.harness.get_by_label("Stiffness n1").accesskit_node().numeric_value(), Some(4.0));
}

#[test]
fn a_file_with_mistakes_is_refused_with_its_line() {
    let bench = AloneServer::start(&ServerSetup::default());
    let (mut seat, _witness) = seated(&bench);
    let bad = "name = \"Bad\"\n[[effect]]\nid = \"s\"\nkind = \"spring\"\nstiffness = -1\n";
    std::fs::write(seat.out.path().join("scenes/bad.toml"), bad).expect("written");
    seat.pick("Scene file", "bad");
    seat.click("Load");
    seat.until_text("bad.toml:5");
}

#[test]
fn an_effect_is_switched_off_and_on_with_its_gain_kept() {
    let bench = AloneServer::start(&ServerSetup::default());
    let (mut seat, mut witness) = seated(&bench);
    seat.type_number("spring gain", "2");
    let gain = |witness: &mut Witness| witness.parameter("spring", "gain").as_f64();
    seat.until("a gain of 2", |_| gain(&mut witness) == Some(2.0));
    seat.click("spring on");
    seat.until("a gain of 0", |_| gain(&mut witness) == Some(0.0));
    witness.state("no torque", |state| norm(state.torque) < 1e-6);
    seat.until("the answer", |harness| {
        harness.get_by_label("spring gain").value().is_some_and(|v| v.starts_with('0'))
    });
    seat.click("spring on");
    seat.until("a gain of 2 again", |_| gain(&mut witness) == Some(2.0));
    // A gain of 2, a stiffness of 0.2 N m/rad and an angle of 0.2 rad. The hand yields a little.
    witness.state("torque", |state| (norm(state.torque) - 0.08).abs() < 0.001);
}

#[test]
fn a_scene_is_saved_as_it_runs() {
    let bench = AloneServer::start(&ServerSetup::default());
    let (mut seat, mut witness) = seated(&bench);
    seat.type_number("spring stiffness", "0.7");
    seat.until("0.7", |_| witness.parameter("spring", "stiffness") == json!(0.7));
    seat.until("the answer", |h| {
        h.get_by_label("spring stiffness").value().is_some_and(|v| v.contains("0.7"))
    });
    seat.type_text("Save scene as", "mine");
    seat.click("Save");
    seat.until_text("saved as");
    let path = seat.out.path().join("scenes/mine.toml");
    let saved = SceneFile::from_path(&path).expect("a legal scene");
    assert_eq!(saved.to_json(), witness.info().scene);
    // The button warns that a file of this name exists.
    assert!(seat.harness.query_by_label("Overwrite").is_some());
}

/// Returns a value that is legal by the schema of a parameter, for a parameter without a default.
fn some_value(schema: &Value) -> Value {
    match schema["type"].as_str() {
        Some("number" | "integer") => {
            let least = schema["minimum"].as_f64().or(schema["exclusiveMinimum"].as_f64()).unwrap_or(0.0);
            json!((least + 1.0).min(schema["maximum"].as_f64().unwrap_or(f64::INFINITY)))
        }
        Some("array") => {
            let count = schema["minItems"].as_u64().unwrap_or(1).max(1);
            (0..count).map(|_| some_value(&schema["items"])).collect()
        }
        Some("boolean") => json!(false),
        _ => schema["enum"][0].clone(),
    }
}

fn one_of_each() -> String {
    let mut text = "name = \"One of each\"\n".to_owned();
    for kind in hbot_config::scene::kinds() {
        let mut effect =
            Map::from_iter([("id".to_owned(), json!(kind.name)), ("kind".to_owned(), json!(kind.name))]);
        for key in kind.schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str) {
            effect.insert(key.to_owned(), some_value(&kind.schema["properties"][key]));
        }
        text += "[[effect]]\n";
        for (key, value) in effect {
            text += &format!("{key} = {value}\n");
        }
    }
    text + "[simulate]\nhand = { stiffness = 50, damping = 1, amplitude = 0 }\n"
}

/// Checks that the panel draws the parameters of every kind of effect from its schema, and that
/// each number, choice and switch reaches the server. Kinds that are added later are tested without
/// a change to this test.
#[test]
fn parameters_of_every_kind_are_drawn_from_their_schema_and_reach_the_server() {
    let scene = one_of_each();
    assert_ne!(scene, STILL);
    let bench = AloneServer::with_scene(&scene);
    let mut witness = Witness::new(&bench);
    let mut seat = Seat::at(bench.address);
    seat.until_text("you command");
    let kinds = hbot_config::scene::kinds();
    let shown = |seat: &Seat, label: &str| seat.harness.query_by_label(label).is_some();
    let mut changed = 0;
    for kind in &kinds {
        let id = kind.name;
        seat.until(id, |harness| harness.query_by_label(&format!("{id} on")).is_some());
        let properties = kind.schema["properties"].as_object().expect("properties");
        if !shown(&seat, &format!("{id} gain")) {
            seat.click(&format!("{id} parameters"));
            seat.until("parameters", |harness| harness.query_by_label(&format!("{id} gain")).is_some());
        }
        for (key, schema) in properties {
            let label = format!("{id} {key}");
            let before = witness.parameter(id, key);
            if let Some(options) = choices(schema) {
                let Some(other) = options.iter().find(|option| **option != before) else { continue };
                seat.pick(&label, other.as_str().expect("text"));
                seat.until(&label, |_| witness.parameter(id, key) == *other);
            } else if before.is_boolean() {
                seat.click(&label);
                seat.until(&label, |_| witness.parameter(id, key) != before);
            } else if let Some(x) = before.as_f64() {
                let other = another(x, schema);
                seat.type_number(&label, &other.to_string());
                seat.until(&format!("{label} = {other}"), |_| {
                    witness.parameter(id, key).as_f64() == Some(other)
                });
            } else {
                // The elements of lists and matrices have separate controls.
                let part = if before[0].is_array() { format!("{label} 1 1") } else { format!("{label} 1") };
                assert!(
                    before.as_array().is_none_or(Vec::is_empty) || shown(&seat, &part),
                    "{part} for {before}"
                );
                continue;
            }
            changed += 1;
        }
        // Close the parameters again, because the window's height is limited.
        seat.click(&format!("{id} parameters"));
    }
    println!("{changed} parameters of {} kinds changed", kinds.len());
    assert!(changed >= 3 * kinds.len(), "gain and fade_s, and most kinds have more");
}

/// Returns the legal values of a schema that lists them one by one (`enum` or `oneOf`). Returns
/// `None` for any other schema.
fn choices(schema: &Value) -> Option<Vec<Value>> {
    if let Some(values) = schema["enum"].as_array() {
        return Some(values.clone());
    }
    let variants = schema["oneOf"].as_array()?;
    variants.iter().map(|variant| variant.get("const").cloned()).collect()
}

/// Returns a number that differs from `x`, has few digits, and is in the range of a schema.
fn another(x: f64, schema: &Value) -> f64 {
    let schema = if schema["type"].is_string() { schema } else { &schema["anyOf"][0] };
    let whole = schema["type"] == "integer";
    let bound = |a: &str, b: &str| schema[a].as_f64().or(schema[b].as_f64());
    let most = bound("maximum", "exclusiveMaximum").unwrap_or(f64::INFINITY);
    let least = bound("minimum", "exclusiveMinimum").unwrap_or(f64::NEG_INFINITY);
    let step = if whole {
        1.0
    } else if x == 0.0 {
        0.125
    } else {
        x.abs() / 8.0
    };
    let step = step.min((most - least) / 4.0);
    let other = if x + step < most { x + step } else { x - step };
    // The field shows six decimals.
    (other * 1e6).round() / 1e6
}

#[test]
fn a_matrix_is_made_of_a_number_and_edited() {
    let bench = AloneServer::start(&ServerSetup::default());
    let (mut seat, mut witness) = seated(&bench);
    seat.pick("spring stiffness form", "matrix");
    seat.until("a matrix", |_| witness.parameter("spring", "stiffness")[2][2] == json!(0.2));
    seat.until("its fields", |harness| harness.query_by_label("spring stiffness 2 2").is_some());
    seat.type_number("spring stiffness 2 2", "0.5");
    seat.until("0.5", |_| witness.parameter("spring", "stiffness")[1][1] == json!(0.5));
    // Escape only stops the rig here. Values that have been set stay.
    seat.harness.key_press(Key::Escape);
    seat.frame();
    assert_eq!(witness.parameter("spring", "stiffness")[1][1], json!(0.5));
}

#[test]
fn the_shelf_says_what_a_scene_feels_like() {
    let bench = AloneServer::start(&ServerSetup::default());
    let (mut seat, _witness) = seated(&bench);
    let path = seat.out.path().join("scenes/mine.toml");
    std::fs::write(&path, "name = \"Mine\"\ndescription = \"It feels like nothing.\"\n").expect("written");
    seat.pick("Scene file", "mine");
    seat.until_text("It feels like nothing.");
    seat.pick("Scene file", "clay");
    seat.until_text("A lump of clay: it keeps every shape");
    seat.pick("Scene file", "mine");
    std::fs::write(&path, "[[effect]]\nid = \"s\"\nkind = \"spring\"\nstiffness = -1\n").expect("written");
    seat.until_text("This file has mistakes");
}

#[test]
fn the_picture_shows_the_wall_that_the_hand_meets() {
    let wall = "name = \"Wall\"\n[[effect]]\nid = \"wall\"\nkind = \"end_stop\"\ncone = 0.1\nstiffness = 2\n";
    let held = "[simulate]\nhand = { stiffness = 50, damping = 1, amplitude = 0.3, rate = 0.1 }\n";
    let scene = format!("{wall}{held}");
    let bench = AloneServer::with_scene(&scene);
    let (mut seat, _witness) = seated(&bench);
    seat.until_text("; the hand meets wall");
    seat.until("free inside", |harness| {
        harness.query_all_by_label_contains("Sphere: orientation").next().is_some()
            && harness.query_all_by_label_contains("the hand meets").next().is_none()
    });
}
