//! Controls for a value, drawn from its JSON schema.

use eframe::egui::{self, ComboBox, DragValue, Response, Ui};
use glam::DQuat;
use hbot_core::rotation::shortest;
use serde_json::Value;

use super::number::number;
use super::schema::{Shape, converted, explain, fits, shape};
use super::theme::{named, press, weak};

/// Draws a control with which the user can change `value`. Returns the new value if the user has
/// changed it. `name` is the name of the control for screen readers.
pub(crate) fn edit(ui: &mut Ui, name: &str, schema: &Value, value: &Value) -> Option<Value> {
    match shape(schema) {
        Shape::Number { whole, least, most } => numeric(ui, name, schema, value, whole, [least, most]),
        Shape::Flag => {
            let mut on = value.as_bool().unwrap_or_default();
            let response = named(ui.checkbox(&mut on, ""), name).on_hover_text(explain(schema));
            response.changed().then_some(Value::Bool(on))
        }
        Shape::Choice(values) => choice(ui, name, schema, value, &values),
        Shape::List { item, least, most } => list(ui, name, item, value, [least, most]),
        Shape::Variants(variants) => variant(ui, name, schema, value, variants),
        Shape::Text => text(ui, name, schema, value),
        Shape::Unknown => {
            weak(ui, value.to_string());
            None
        }
    }
}

fn numeric(
    ui: &mut Ui,
    name: &str,
    schema: &Value,
    value: &Value,
    whole: bool,
    [least, most]: [f64; 2],
) -> Option<Value> {
    let before = value.as_f64().unwrap_or_default();
    let mut x = before;
    let unit = schema["unit"].as_str();
    let draw = |ui: &mut Ui, drag: DragValue<'_>| {
        let mut drag = drag
            .speed(if whole { 0.1 } else { (0.01 * before.abs()).max(0.001) })
            .max_decimals(if whole { 0 } else { 6 });
        if whole {
            drag = drag.fixed_decimals(0);
        }
        // Beside the field, because a unit in it would vanish while a value is typed.
        let Some(unit) = unit else { return field(ui, drag) };
        let both = |ui: &mut Ui| {
            ui.spacing_mut().item_spacing.x = 4.0;
            (field(ui, drag), ui.weak(unit)).0
        };
        ui.horizontal(both).inner
    };
    let response = number(ui, name, &mut x, (least..=most, unit.unwrap_or_default()), draw)
        .on_hover_text(explained(schema, before));
    let changed = response.changed() && x != before;
    changed.then(|| if whole { Value::from(x.round() as i64) } else { Value::from(x) })
}

/// Draws the field of a number. It keeps its width while a value is typed, so that nothing moves.
fn field(ui: &mut Ui, drag: DragValue<'_>) -> Response {
    let (id, least) = (ui.next_auto_id(), ui.spacing().interact_size.x);
    let key = id.with("width");
    if ui.memory(|memory| memory.has_focus(id)) {
        ui.spacing_mut().interact_size.x = ui.data(|data| data.get_temp(key)).unwrap_or(least);
    }
    let response = ui.add(drag);
    ui.spacing_mut().interact_size.x = least;
    if !response.has_focus() {
        ui.data_mut(|data| data.insert_temp(key, response.rect.width()));
    }
    response
}

/// Explains a number: what it is, and an angle also in degrees.
fn explained(schema: &Value, x: f64) -> String {
    let text = explain(schema);
    if schema["unit"] == "rad" { format!("{text}\n{x:.4} rad is {:.2}\u{b0}", x.to_degrees()) } else { text }
}

/// Says in words what four numbers are if they are an orientation, and what the rows of a matrix
/// are.
fn meaning(value: &Value) -> Option<String> {
    let parts = value.as_array()?;
    if parts.len() == 3 && parts.iter().all(|row| row.as_array().is_some_and(|row| row.len() == 3)) {
        let text = "Row k is the torque about axis k for each radian or rad/s about axes 1, 2 and 3 of the reference.";
        return Some(text.to_owned());
    }
    let numbers: Vec<f64> = parts.iter().filter_map(Value::as_f64).collect();
    let [w, x, y, z] = *numbers.as_slice() else { return None };
    let q = DQuat::from_xyzw(x, y, z, w);
    // The server takes no quaternion without a length.
    let q = (q.length() > 1e-9).then(|| q.normalize())?;
    let turn = shortest(q).to_scaled_axis();
    Some(match turn.try_normalize().filter(|_| turn.length() > 5e-4) {
        Some(axis) => {
            let [a, b, c] = axis.to_array();
            format!("w x y z: turned {:.1}\u{b0} about ({a:.2}, {b:.2}, {c:.2})", turn.length().to_degrees())
        }
        None => "w x y z: not turned".to_owned(),
    })
}

fn choice(ui: &mut Ui, name: &str, schema: &Value, value: &Value, values: &[&Value]) -> Option<Value> {
    let mut picked = None;
    let combo = ComboBox::from_id_salt(name).selected_text(plain(value)).width(110.0);
    let response = combo.show_ui(ui, |ui| {
        for option in values {
            let described = described(schema, option);
            let mut response = ui.selectable_label(*option == value, plain(option));
            if !described.is_empty() {
                response = response.on_hover_text(described);
            }
            if response.clicked() && *option != value {
                picked = Some((*option).clone());
            }
        }
    });
    named(response.response, name).on_hover_text(explain(schema));
    picked
}

/// Returns the description that a schema contains for one of its legal values.
fn described<'a>(schema: &'a Value, option: &Value) -> &'a str {
    let variants = schema["oneOf"].as_array().or_else(|| schema["anyOf"].as_array());
    let told = variants.into_iter().flatten().find(|variant| {
        variant.get("const") == Some(option) || variant["enum"].as_array().is_some_and(|e| e.contains(option))
    });
    told.and_then(|variant| variant["description"].as_str()).unwrap_or_default()
}

/// Formats a value for display. Text is shown without quotation marks.
fn plain(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

fn list(ui: &mut Ui, name: &str, item: &Value, value: &Value, [least, most]: [usize; 2]) -> Option<Value> {
    let mut parts = value.as_array().cloned().unwrap_or_default();
    let mut changed = false;
    let nested = matches!(shape(item), Shape::List { .. });
    let row = |ui: &mut Ui, add: &mut dyn FnMut(&mut Ui)| {
        if nested { ui.vertical(|ui| add(ui)) } else { ui.horizontal_wrapped(|ui| add(ui)) }
    };
    row(ui, &mut |ui| {
        // With this spacing the four numbers of a quaternion fit into one row.
        ui.spacing_mut().item_spacing.x = 4.0;
        ui.spacing_mut().button_padding.x = 3.0;
        for (k, part) in parts.iter_mut().enumerate() {
            let name = format!("{name} {}", k + 1);
            let item = if nested { item.clone() } else { without_unit(item) };
            if let Some(new) = edit(ui, &name, &item, part) {
                *part = new;
                changed = true;
            }
        }
        if least != most {
            let more = press(ui, parts.len() < most, egui::Button::new("+").small());
            if named(more, &format!("{name}: one more")).clicked() {
                let new = parts.last().cloned().unwrap_or_else(|| converted(item, &Value::Null));
                parts.push(new);
                changed = true;
            }
            let fewer = press(ui, parts.len() > least, egui::Button::new("\u{2212}").small());
            if named(fewer, &format!("{name}: one fewer")).clicked() {
                parts.pop();
                changed = true;
            }
        }
    });
    let edited = Value::Array(parts);
    if let Some(text) = meaning(&edited) {
        weak(ui, text);
    }
    changed.then_some(edited)
}

/// Returns a copy of the schema without its unit. A row of numbers has no room for a unit after
/// each.
fn without_unit(schema: &Value) -> Value {
    let mut schema = schema.clone();
    if let Some(table) = schema.as_object_mut() {
        table.remove("unit");
    }
    schema
}

fn variant(ui: &mut Ui, name: &str, schema: &Value, value: &Value, variants: &[Value]) -> Option<Value> {
    let current = variants.iter().position(|variant| fits(variant, value));
    let mut picked = None;
    let mut edited = None;
    ui.vertical(|ui| {
        let title = |k: usize| match shape(&variants[k]) {
            Shape::Number { .. } => "number",
            Shape::List { item, .. } if matches!(shape(item), Shape::List { .. }) => "matrix",
            Shape::List { .. } => "list",
            Shape::Choice(_) => "choice",
            _ => "other",
        };
        let control = |ui: &mut Ui| current.and_then(|k| edit(ui, name, &variants[k], value));
        let mut kinds = |ui: &mut Ui| {
            let response = ComboBox::from_id_salt((name, "form"))
                .selected_text(current.map_or("other", title))
                .width(64.0)
                .show_ui(ui, |ui| {
                    for (k, variant) in variants.iter().enumerate() {
                        if ui.selectable_label(current == Some(k), title(k)).clicked() && current != Some(k) {
                            picked = Some(converted(variant, value));
                        }
                    }
                });
            named(response.response, &format!("{name} form")).on_hover_text(explain(schema));
        };
        if current.is_some_and(|k| matches!(shape(&variants[k]), Shape::List { .. })) {
            kinds(ui);
            edited = control(ui);
        } else {
            ui.horizontal_wrapped(|ui| {
                edited = control(ui);
                kinds(ui);
            });
        }
    });
    picked.or(edited)
}

fn text(ui: &mut Ui, name: &str, schema: &Value, value: &Value) -> Option<Value> {
    // Keep the text that is being typed until the user has finished.
    let id = ui.make_persistent_id((name, "text"));
    let before = value.as_str().unwrap_or_default();
    let mut typed = ui.data(|data| data.get_temp(id)).unwrap_or_else(|| before.to_owned());
    let response = named(ui.add(egui::TextEdit::singleline(&mut typed).desired_width(130.0)), name)
        .on_hover_text(explain(schema));
    if response.lost_focus() {
        ui.data_mut(|data| data.remove_temp::<String>(id));
        return (typed != before).then_some(Value::from(typed));
    }
    if response.changed() {
        ui.data_mut(|data| data.insert_temp(id, typed));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui_kittest::Harness;
    use egui_kittest::kittest::Queryable as _;
    use serde_json::json;

    /// Draws a control for `value`, presses the buttons with these names one after the other, and
    /// returns the new value.
    fn pressed(schema: Value, value: Value, names: &[&str]) -> Value {
        let mut harness = Harness::new_ui_state(
            move |ui, value: &mut Value| {
                if let Some(new) = edit(ui, "p", &schema, value) {
                    *value = new;
                }
            },
            value,
        );
        for name in names {
            harness.get_by_label(name).click_accesskit();
            harness.run_steps(2);
        }
        harness.check_accessibility();
        harness.into_state()
    }

    #[test]
    fn orientations_and_matrices_are_explained() {
        let half = 0.5_f64.sqrt();
        for (value, text) in [
            (json!([half, 0, 0, half]), Some("w x y z: turned 90.0\u{b0} about (0.00, 0.00, 1.00)")),
            (json!([-2.0, 0, 0, 0]), Some("w x y z: not turned")),
            (json!([0, 0, 0, 0]), None),
            (json!([1, 2, 3]), None),
        ] {
            assert_eq!(meaning(&value).as_deref(), text, "{value}");
        }
        assert!(meaning(&json!([[1, 0, 0], [0, 1, 0], [0, 0, 1]])).is_some());
        assert!(explained(&json!({"unit": "rad"}), 0.5).ends_with("0.5000 rad is 28.65\u{b0}"));
    }

    #[test]
    fn flags_and_lists_of_any_length_are_edited() {
        assert_eq!(pressed(json!({"type": "boolean"}), json!(false), &["p"]), json!(true));
        let points = json!({"type": "array", "items": {"type": "array", "minItems": 2, "maxItems": 2,
            "items": {"type": "number"}}});
        assert_eq!(pressed(points.clone(), json!([]), &["p: one more"]), json!([[0.0, 0.0]]));
        assert_eq!(
            pressed(points, json!([[1, 2]]), &["p: one more", "p: one more", "p: one fewer"]),
            json!([[1, 2], [1, 2]])
        );
    }
}
