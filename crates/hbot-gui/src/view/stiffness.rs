//! Controls for the stiffness and damping of a spring. They are the panel's first purpose.

use eframe::egui::style::HandleShape;
use eframe::egui::{self, ComboBox, DragValue, Shape, Slider, SliderClamping, Stroke, Ui, pos2, vec2};
use hbot_config::advice::{StiffnessKey, Warning, rounded_down};
use serde_json::{Value, json};

use super::Desk;
use super::bar;
use super::number::number;
use super::parameter;
use super::state::{is_low, remedy};
use super::theme::{Palette, coloured, heading, named, weak};
use super::{round_up, three_digits};
use crate::model::{Effect, Model};
use crate::net::Intent;

/// The slider extends at least to the stiffness that reaches the rig's torque limit at this
/// deflection, rad.
const STIFFEST_AT: f64 = 0.1;
/// Ratio of the largest damping to the largest stiffness on their sliders, s. Slightly less damping
/// is critical for the prototype's sphere with the stiffest spring.
const DAMPING_SHARE: f64 = 0.02;
/// Ratio of the least value above 0 on a slider to the largest. Sliders are logarithmic.
const LEAST_SHARE: f64 = 2e-4;
/// A slider that is dragged this near to its mark stays at the mark, points.
const CATCH: f32 = 4.0;
/// Width of the field beside a slider, points.
const FIELD: f32 = 70.0;
/// Height of the flag on the mark, and half its width, points.
const FLAG: f32 = 5.0;
/// Hover texts of stiffness and damping, which also explain the units.
const STIFFNESS: &str =
    "torque for each radian of turn. N m/rad: newton metres per radian, 1 rad is 57.3\u{b0}";
const DAMPING: &str = "torque against each radian per second. N m s/rad: newton metres per radian per second";

/// Draws the controls, and below them the warnings about the scene without the first `told`, which
/// stand elsewhere.
pub(crate) fn show(ui: &mut Ui, model: &Model, (desk, told): (&mut Desk, usize), intents: &mut Vec<Intent>) {
    if is_low(ui) {
        // The sentence on what is stable stays in sight.
        ui.spacing_mut().item_spacing.y = 2.0;
    }
    heading(ui, "Stiffness and damping");
    desk.judged.take(&model.info);
    let scene = model.scene.shown();
    let ids: Vec<&str> = model.scene.springs(&model.info).map(|effect| effect.id.as_str()).collect();
    let Some(effect) = model
        .scene
        .springs(&model.info)
        .find(|effect| effect.id == desk.spring)
        .or_else(|| model.scene.springs(&model.info).next())
    else {
        let known = model.scene.is_known();
        let text =
            if known { "No effect of this scene has a stiffness." } else { "The scene is not known yet." };
        weak(ui, text);
        warnings(ui, desk.judged.warnings(&scene).get(told..).unwrap_or_default());
        return;
    };
    ui.horizontal_wrapped(|ui| {
        if ids.len() > 1 {
            let response =
                ComboBox::from_id_salt("spring").selected_text(&effect.id).width(90.0).show_ui(ui, |ui| {
                    for id in &ids {
                        ui.selectable_value(&mut desk.spring, (*id).to_owned(), *id);
                    }
                });
            named(response.response, "Spring to set");
        }
        law(ui, model, effect, intents);
        axes_apart(ui, model, effect, intents);
    });
    let stiffest = stiffest(model);
    let borders = borders(model, effect, &scene, desk);
    let names = ["Stiffness", "Stiffness n1", "Stiffness n2", "Stiffness n3"];
    impedance(ui, model, effect, "stiffness", names, stiffest, borders, intents);
    let names = ["Damping", "Damping n1", "Damping n2", "Damping n3"];
    impedance(ui, model, effect, "damping", names, stiffest * DAMPING_SHARE, [None; 3], intents);
    // The length of this text depends on the value of the sliders, so it comes below them.
    limits(ui, model, effect, &scene, (desk, borders[0]));
    warnings(ui, desk.judged.warnings(&scene).get(told..).unwrap_or_default());
}

/// Returns the largest stiffness of `effect` about each axis with which the loop keeps `scene`
/// stable, N m/rad. If the stiffness is one number, the first is that of all axes. An older server
/// does not tell its loop: then it is the stiffness that is stable with a usual damping.
fn borders(model: &Model, effect: &Effect, scene: &Value, desk: &mut Desk) -> [Option<f64>; 3] {
    let Some(most) = model.info.render.as_ref().map(|render| render.stiffness_most) else { return [None; 3] };
    let index = index_of(model, effect);
    let is_matrix = model.scene.value(effect, "stiffness").is_some_and(Value::is_array);
    let gain = model.scene.value(effect, "gain").and_then(Value::as_f64).unwrap_or(1.0);
    if !tells_loop(model) {
        return [stable(model).filter(|_| gain > 0.0).map(|stable| stable / gain); 3];
    }
    let mut of = |axis| {
        // No stiffer spring is stable, with any damping.
        desk.judged.border(scene, StiffnessKey { effect: index?, axis }, most)
    };
    if is_matrix { [Some(0), Some(1), Some(2)].map(of) } else { [of(None), None, None] }
}

fn index_of(model: &Model, effect: &Effect) -> Option<usize> {
    model.scene.effects().iter().position(|other| other.id == effect.id)
}

/// Returns whether the server tells the loop from which stable stiffnesses follow.
fn tells_loop(model: &Model) -> bool {
    model.info.render.as_ref().is_some_and(|render| render.sampled.is_some())
}

/// Draws what the server warns of when it loads such a scene.
fn warnings(ui: &mut Ui, warnings: &[Warning]) {
    let palette = Palette::of(ui);
    for warning in warnings {
        let color = if warning.remedy.is_some() { palette.text } else { palette.warn };
        if let Some(cure) = warning.remedy_sentence() {
            remedy(ui, palette, &cure);
        }
        coloured(ui, color, warning.reason());
    }
}

/// Returns the largest stiffness with which the rig is expected to be stable with a usual damping,
/// N m/rad. Returns `None` if the server does not report it.
fn stable(model: &Model) -> Option<f64> {
    model.info.render.as_ref().map(|render| render.stiffness_stable).filter(|stable| *stable > 0.0)
}

/// Returns the largest stiffness on the slider, a round number in N m/rad.
fn stiffest(model: &Model) -> f64 {
    let limit = model.info.limits.torque;
    let by_torque = if limit > 0.0 { limit / STIFFEST_AT } else { 10.0 };
    round_up(by_torque.max(1.5 * stable(model).unwrap_or(0.0)))
}

fn law(ui: &mut Ui, model: &Model, effect: &Effect, intents: &mut Vec<Intent>) {
    let schema = model.info.kind(&effect.kind).map(|kind| &kind.schema["properties"]["law"]);
    let (Some(schema), Some(value)) = (schema.filter(|s| !s.is_null()), model.scene.value(effect, "law"))
    else {
        return;
    };
    weak(ui, "law");
    if let Some(value) = parameter::edit(ui, "Law", schema, value) {
        intents.push(Intent::Set { effect: effect.id.clone(), key: "law".to_owned(), value });
    }
}

/// Draws the switch between one stiffness for all axes and a separate one for each axis.
fn axes_apart(ui: &mut Ui, model: &Model, effect: &Effect, intents: &mut Vec<Intent>) {
    let before = model.scene.value(effect, "stiffness").is_some_and(Value::is_array);
    let mut apart = before;
    let text = "for stiffness and damping, in the axes of the spring's reference";
    ui.checkbox(&mut apart, "Each axis").on_hover_text(text);
    if apart == before {
        return;
    }
    for key in ["stiffness", "damping"] {
        let Some(value) = model.scene.value(effect, key) else { continue };
        let diagonal = diagonal(value);
        let value = if apart { matrix(value, diagonal) } else { json!(diagonal.iter().sum::<f64>() / 3.0) };
        intents.push(Intent::Set { effect: effect.id.clone(), key: key.to_owned(), value });
    }
}

#[expect(clippy::too_many_arguments, reason = "a row of the panel, called twice")]
fn impedance(
    ui: &mut Ui,
    model: &Model,
    effect: &Effect,
    key: &str,
    names: [&str; 4],
    end: f64,
    borders: [Option<f64>; 3],
    intents: &mut Vec<Intent>,
) {
    let Some(value) = model.scene.value(effect, key) else { return };
    let schema = model.info.kind(&effect.kind).map_or(&Value::Null, |kind| &kind.schema["properties"][key]);
    let unit = schema["unit"].as_str().unwrap_or_default();
    let most = schema["anyOf"][0]["maximum"].as_f64().unwrap_or(f64::INFINITY);
    let mut set = |value: Value| {
        intents.push(Intent::Set { effect: effect.id.clone(), key: key.to_owned(), value });
    };
    let hint = if key == "stiffness" { STIFFNESS } else { DAMPING };
    ui.horizontal(|ui| {
        weak(ui, format!("{key}, {unit}")).on_hover_text(hint);
        // This line has room for the words, so that they move nothing.
        if key == "stiffness"
            && let Some(first) = bar::first(model)
        {
            // They are not grey like the controls that they are about.
            ui.set_opacity(1.0);
            coloured(ui, Palette::of(ui).warn, first);
        }
    });
    if let Some(x) = value.as_f64() {
        if let Some(x) = row(ui, "", names[0], x, ([end, most], unit), borders[0]) {
            set(json!(x));
        }
        return;
    }
    let before = diagonal(value);
    for k in 0..3 {
        if let Some(x) =
            row(ui, ["n1", "n2", "n3"][k], names[k + 1], before[k], ([end, most], unit), borders[k])
        {
            let mut after = before;
            after[k] = x;
            set(matrix(value, after));
        }
    }
    if has_off_diagonal(value) {
        weak(ui, "The matrix has values off its diagonal; they stay. See the scene.");
    }
}

/// Draws a slider and a text field for one number. Returns the new number if the user has changed
/// it.
fn row(
    ui: &mut Ui,
    label: &str,
    name: &str,
    before: f64,
    ([end, most], unit): ([f64; 2], &str),
    stable: Option<f64>,
) -> Option<f64> {
    let mut x = before;
    let end = end.min(most).max(before);
    ui.horizontal(|ui| {
        if !label.is_empty() {
            ui.label(label);
        }
        ui.spacing_mut().slider_width =
            (ui.available_width() - FIELD - ui.spacing().item_spacing.x).max(60.0);
        let slider = Slider::new(&mut x, 0.0..=end)
            .show_value(false)
            .clamping(SliderClamping::Edits)
            .logarithmic(true)
            .smallest_positive(LEAST_SHARE * end)
            .trailing_fill(true);
        let response = named(ui.add(slider), name);
        if let Some(stable) = stable.filter(|stable| *stable < end) {
            let room = room(ui, response.rect);
            let place = |x: f64| {
                let share = 1.0 - (x / end).ln() / LEAST_SHARE.ln();
                room.min + room.span() * share.max(0.0) as f32
            };
            let is_near = (place(x) - place(stable)).abs() < CATCH;
            if response.interact_pointer_pos().is_some() && is_near {
                // The number of the sentence below the sliders, on the stable side of the mark.
                x = rounded_down(stable).parse().unwrap_or(x);
            }
            mark(ui, response.rect, room.max, place(stable));
        }
        let draw = |ui: &mut Ui, field: DragValue<'_>| {
            let field = field.speed((0.01 * before).max(0.001)).max_decimals(4);
            ui.add_sized([FIELD, ui.spacing().interact_size.y], field)
        };
        number(ui, &format!("{name} value"), &mut x, (0.0..=most, unit), draw);
    });
    (x != before).then_some(x)
}

/// Returns where the middle of a slider's handle can be. By egui's own geometry, the handle stays
/// half its width away from the ends.
fn room(ui: &Ui, slider: egui::Rect) -> egui::Rangef {
    let narrower = match ui.visuals().handle_shape {
        HandleShape::Rect { aspect_ratio } => aspect_ratio,
        HandleShape::Circle => 1.0,
    };
    slider.x_range().shrink(narrower * slider.height() / 2.5)
}

/// Marks the part of a slider in which the rig is not expected to be stable, from `x` to `end`.
fn mark(ui: &Ui, slider: egui::Rect, end: f32, x: f32) {
    let palette = Palette::of(ui);
    let painter = ui.painter();
    let beyond = egui::Rect::from_x_y_ranges(x..=end, slider.bottom() - 3.0..=slider.bottom() - 1.0);
    painter.rect_filled(beyond, 0.0, palette.warn);
    painter.vline(x, slider.y_range(), Stroke::new(2.0, palette.warn));
    // Above the handle, which else hides the mark where it matters.
    let tip = pos2(x, slider.top() + 1.0);
    let flag = vec![tip, tip + vec2(-FLAG, -FLAG), tip + vec2(FLAG, -FLAG)];
    painter.add(Shape::convex_polygon(flag, palette.warn, Stroke::NONE));
}

/// Draws an explanation of the largest stiffness: where the effect reaches the rig's torque limit,
/// and up to which stiffness the rig is expected to be stable with the present damping.
fn limits(
    ui: &mut Ui,
    model: &Model,
    effect: &Effect,
    scene: &Value,
    (desk, stable): (&mut Desk, Option<f64>),
) {
    let Some(value) = model.scene.value(effect, "stiffness") else { return };
    let gain = model.scene.value(effect, "gain").and_then(Value::as_f64).unwrap_or(1.0);
    let stiffest = diagonal(value).into_iter().fold(0.0, f64::max) * gain;
    let limit = model.info.limits.torque;
    if let Some(stable) = stable
        && value.is_number()
    {
        let text = if tells_loop(model) {
            // In the digits of the warnings.
            format!("with this damping expected to be stable up to {} N m/rad (mark)", rounded_down(stable))
        } else {
            // An older server tells one stiffness, whatever the damping.
            format!("expected to be stable up to {} N m/rad (mark)", three_digits(stable))
        };
        if stiffest > gain * stable {
            coloured(ui, Palette::of(ui).warn, text);
        } else {
            weak(ui, text);
        }
    }
    if limit > 0.0
        && let Some(index) = index_of(model, effect)
        && let Some(reach) = desk.judged.reach(scene, index, limit)
    {
        weak(ui, reach.in_words(limit));
    }
}

fn diagonal(value: &Value) -> [f64; 3] {
    let number = value.as_f64();
    std::array::from_fn(|k| number.or_else(|| value[k][k].as_f64()).unwrap_or_default())
}

/// Returns the matrix `value` with `diagonal` as its new diagonal. The other elements stay
/// unchanged.
fn matrix(value: &Value, diagonal: [f64; 3]) -> Value {
    let element = |i: usize, j: usize| {
        if i == j { diagonal[i] } else { value[i][j].as_f64().unwrap_or_default() }
    };
    json!(std::array::from_fn::<_, 3, _>(|i| std::array::from_fn::<_, 3, _>(|j| element(i, j))))
}

fn has_off_diagonal(value: &Value) -> bool {
    (0..3).any(|i| (0..3).any(|j| i != j && value[i][j].as_f64().is_some_and(|x| x != 0.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::painted::{filled, hint, polygons, vertical_lines};
    use egui_kittest::Harness;
    use egui_kittest::kittest::Queryable as _;
    use hbot_config::advice::{Abilities, StiffnessBound, USUAL_DAMPING};
    use hbot_config::{RigConfig, SceneFile};

    /// The prototype without a lead, whose border has a simple formula.
    fn unled() -> RigConfig {
        let mut config = RigConfig::prototype();
        config.rig = config.rig.with(|parts| parts.lead = None).expect("legal");
        config
    }

    /// A panel of this rig, whose torque limit is 0.9 N m, with a spring.
    fn panel(stiffness: f64, damping: f64, tells_loop: bool) -> Model {
        let rig = unled();
        let bound = StiffnessBound::of(&rig).expect("legal inertias");
        let told = hbot_api::LoopInfo::from(bound.sampled());
        let render = json!({"stiffness_stable": bound.stable(USUAL_DAMPING),
            "stiffness_most": bound.most()[0], "loop": tells_loop.then_some(told)});
        let limits = &rig.rig.limits;
        let scene = json!({"name": "S", "effect": [{"id": "s", "kind": "spring", "gain": 1.0,
            "anchor": "here", "stiffness": stiffness, "damping": damping}]});
        let info = json!({"rig": {"rate_hz": rig.rate_hz, "simulated": true},
            "limits": {"torque": 0.9, "torque_rate": limits.torque_rate, "speed": limits.speed},
            "effects": hbot_config::scene::kinds(), "scene": scene, "render": render});
        let mut model = Model::new("", "panel me@here", 1);
        model.info = serde_json::from_value(info).expect("an answer to info");
        model.scene.take(&scene);
        model
    }

    fn drawn(model: Model) -> Harness<'static> {
        let mut desk = Desk::default();
        let mut harness = Harness::new_ui(move |ui| show(ui, &model, (&mut desk, 0), &mut Vec::new()));
        harness.run();
        harness
    }

    fn said(model: Model) -> String {
        format!("{:?}", drawn(model).root())
    }

    /// Returns the stiffness that the sentence below the sliders names as stable, N m/rad.
    fn border(said: &str) -> f64 {
        let (_, after) = said.split_once("expected to be stable up to ").expect("a border");
        let (number, _) = after.split_once(" N m/rad (mark)").expect("a unit");
        number.parse().expect("a number")
    }

    #[test]
    fn stiffness_and_damping_say_what_their_units_are() {
        let mut seen = drawn(panel(2.0, 0.02, false));
        for (label, said) in [("stiffness, N m/rad", STIFFNESS), ("damping, N m s/rad", DAMPING)] {
            assert_eq!(hint(&mut seen, label), said);
        }
    }

    #[test]
    fn the_border_follows_the_damping_as_it_moves() {
        let bound = StiffnessBound::of(&unled()).expect("legal inertias");
        for damping in [0.01, 0.02, 0.2] {
            // The slider moves; the server has not answered yet.
            let mut model = panel(5.0, 0.02, true);
            model.scene.ask("s", "damping", &json!(damping));
            // The judge keeps a margin of 10 %, and lets a swing grow by 0.05 1/s, as a damping of
            // -2 J 0.05 1/s makes it. The search ends within 4.5 % below the border.
            let want = bound.stable(damping + 0.1 * bound.inertia()) / 1.1;
            let told = border(&said(model));
            assert!(told <= 1.01 * want && told >= 0.95 * want, "{damping}: {told}, not {want}");
        }
        assert_eq!(border(&said(panel(5.0, 0.0, true))), 0.0, "nothing is stable without damping");
    }

    #[test]
    fn the_mark_moves_with_the_damping() {
        let mark = |damping| {
            let mut model = panel(5.0, 0.02, true);
            model.scene.ask("s", "damping", &json!(damping));
            vertical_lines(&drawn(model))
        };
        let (none, little, more) = (mark(0.0), mark(0.01), mark(0.02));
        assert_eq!([none.len(), little.len(), more.len()], [1; 3]);
        assert!(none[0] < little[0] - 5.0 && little[0] < more[0] - 5.0, "{none:?} {little:?} {more:?}");
    }

    /// Returns where the handle of the slider for the stiffness is.
    fn handle(seen: &Harness<'_>) -> f32 {
        let filled = filled(seen);
        // Nothing else is higher than wide.
        let (handle, _) = filled.iter().find(|(rect, _)| rect.height() > rect.width()).expect("a handle");
        handle.center().x
    }

    #[test]
    fn the_mark_is_where_the_handle_is_with_that_stiffness() {
        let border = border(&said(panel(5.0, 0.02, true)));
        let seen = drawn(panel(border, 0.02, true));
        let (mark, whole) = (vertical_lines(&seen)[0], handle(&seen));
        assert!((mark - whole).abs() < 1.0, "{mark}, {whole}");
        let tenth = handle(&drawn(panel(0.1 * border, 0.02, true)));
        let hundredth = handle(&drawn(panel(0.01 * border, 0.02, true)));
        assert!(
            (whole - tenth - (tenth - hundredth)).abs() < 1.0 && whole > tenth + 5.0,
            "logarithmic: {whole}, {tenth}, {hundredth}"
        );
    }

    #[test]
    fn the_handle_does_not_hide_the_mark() {
        let border = border(&said(panel(5.0, 0.02, true)));
        let seen = drawn(panel(border, 0.02, true));
        let handle =
            filled(&seen).into_iter().find(|(rect, _)| rect.height() > rect.width()).expect("a handle");
        let flags = polygons(&seen, Palette::of_theme(true, eframe::egui::Color32::GRAY).warn);
        let flag = flags.first().expect("a flag");
        assert!(flag.bottom() <= handle.0.top() && (flag.center().x - handle.0.center().x).abs() < 1.0);
    }

    #[test]
    fn a_slider_that_is_dragged_stays_at_the_mark_and_a_key_moves_it_past() {
        let border = border(&said(panel(5.0, 0.02, true)));
        let asked = |stiffness, act: &dyn Fn(&mut Harness<'_, Vec<Intent>>, f32)| {
            let (model, mut desk) = (panel(stiffness, 0.02, true), Desk::default());
            let draw =
                move |ui: &mut Ui, intents: &mut Vec<Intent>| show(ui, &model, (&mut desk, 0), intents);
            let mut seen = Harness::new_ui_state(draw, Vec::new());
            seen.run_steps(2);
            let mark = vertical_lines(&seen)[0];
            act(&mut seen, mark);
            match seen.state().last().expect("a change") {
                Intent::Set { value, .. } => value.as_f64().expect("a number"),
                other => panic!("{other:?}"),
            }
        };
        let dragged_by = |by: f32| {
            asked(2.0, &|seen, mark| {
                let y = seen.get_by_label("Stiffness").rect().center().y;
                seen.drag_at(pos2(mark - 30.0, y));
                seen.run_steps(2);
                seen.hover_at(pos2(mark + by, y));
                seen.run_steps(2);
            })
        };
        for by in [-3.0, 0.0, 3.0] {
            assert_eq!(dragged_by(by), border, "{by}");
        }
        assert!(dragged_by(-8.0) < border && dragged_by(8.0) > border);
        let by_key = asked(border, &|seen, _| {
            seen.get_by_label("Stiffness").focus();
            seen.run_steps(2);
            seen.key_press(eframe::egui::Key::ArrowRight);
            seen.run_steps(2);
        });
        assert!(by_key > border, "{by_key}");
    }

    #[test]
    fn the_sentence_is_the_warning_of_the_server() {
        let model = panel(40.0, 0.01, true);
        let scene = SceneFile::from_json(model.scene.to_json()).expect("legal");
        let warnings = Abilities::of(&unled()).warnings(&scene);
        assert_eq!(warnings.len(), 1);
        let said_of = said(model);
        // What to do comes first.
        let (what, cure) = (warnings[0].reason(), warnings[0].remedy_sentence().expect("a remedy"));
        let [cure, what] = [cure, what].map(|text| said_of.find(&text).expect("told in full"));
        assert!(cure < what, "{said_of}");
        // The sentence about the mark has the number of the warning.
        let border = border(&said_of);
        assert!(
            warnings[0].to_string().contains(&format!("at most {border:?} N m/rad is stable")),
            "{border}, {warnings:?}"
        );
        assert!(!said(panel(5.0, 0.02, true)).contains("shake"));
    }

    #[test]
    fn the_mark_of_an_older_server_is_what_it_tells_with_any_damping() {
        let stable = StiffnessBound::of(&unled()).expect("legal").stable(USUAL_DAMPING);
        for damping in [0.0, 0.2] {
            let said = said(panel(40.0, damping, false));
            assert!((border(&said) - stable).abs() < 0.006, "{said}");
            assert!(!said.contains("with this damping") && !said.contains("shake"), "{said}");
        }
        let mut silent = panel(7.0, 0.0, false);
        silent.info.render = None;
        let said = said(silent);
        assert!(said.contains("reaches the rig's 0.9 N m at 0.13 rad") && !said.contains("stable"), "{said}");
    }

    #[test]
    fn a_diagonal_is_set_and_the_rest_stays() {
        let value = json!([[1, 0.5, 0], [0.5, 2, 0], [0, 0, 3]]);
        assert_eq!(diagonal(&value), [1.0, 2.0, 3.0]);
        assert_eq!(
            matrix(&value, [4.0, 5.0, 6.0]),
            json!([[4.0, 0.5, 0.0], [0.5, 5.0, 0.0], [0.0, 0.0, 6.0]])
        );
        assert!(has_off_diagonal(&value) && !has_off_diagonal(&json!(2.0)));
        assert_eq!(diagonal(&json!(2.0)), [2.0; 3]);
    }
}
