//! Bars that show how near the rig is to each of its limits.

use eframe::egui::{self, Color32, FontId, RichText, Role, Ui, WidgetInfo, vec2};
use glam::DVec3;

use super::state::is_low;
use super::theme::{Palette, bold, column, sized};
use crate::model::Model;

/// Names of the bars and their hover texts, which also explain the units.
const METERS: [(&str, &str); 4] = [
    ("Speed", "how fast the sphere turns / the rig's limit. rad/s: radians per second, 1 rad is 57.3\u{b0}"),
    ("Traction", "part of the friction between wheel and sphere that is in use, at the wheel that uses most"),
    ("Slip", "how fast a wheel slides on the sphere / the rig's limit. mm/s: millimetres per second"),
    ("Saturation", "part of the scene's torque that the rig's limits cut off"),
];
/// Width of the longest figures beside a bar, such as `12.34 / 30 rad/s`, points.
const FIGURES: f32 = 104.0;
const TORQUE: &str =
    "of the sphere / the rig's limit. N m: newton metre, the torque of 1 N on a lever of 1 m";
/// The figures of the torque have the digits that its largest value in this time needs, s.
const RECENT_S: f64 = 10.0;
/// Hover text of the line that tells the lead.
const LEAD: &str = "the scene is rendered where the sphere will be when the torque acts, so that the delay takes no damping away";

/// Draws bars that show how near the rig is to each of its limits.
pub(super) fn show(ui: &mut Ui, model: &Model, palette: Palette) {
    // A low window needs the room for what stands below.
    (ui.spacing_mut().item_spacing.y, ui.spacing_mut().interact_size.y) =
        if is_low(ui) { (0.0, 16.0) } else { (2.0, ui.spacing().interact_size.y) };
    let limits = &model.info.limits;
    let load = |share, figures| load(palette, share, figures);
    // Without a state that is true now, the bars keep their places.
    let state = model.state.as_ref().filter(|_| model.is_certain());
    let values = state.map_or_else(
        || METERS.map(|_| load(0.0, "-".to_owned())),
        |state| {
            let lost = 1.0 - state.scale;
            let slip = format!("{:.1} / {:.0} mm/s", 1e3 * state.slip, 1e3 * limits.slip);
            // Whatever the limits cut, the scene does not feel as it is meant.
            let (lost, cut) = if lost > 0.0005 {
                (lost, format!("{} cut", percent(lost).replace("over ", "> ")))
            } else {
                (0.0, "none".to_owned())
            };
            [
                speed(DVec3::from(state.omega).length(), model, palette),
                load(state.traction, format!("{:.0} %", 100.0 * state.traction)),
                load(share(state.slip, limits.slip), slip),
                (lost, palette.torque, cut),
            ]
        },
    );
    for (name, value) in METERS.into_iter().zip(values) {
        meter(ui, palette, name, value);
    }
    // How far ahead the scene is rendered. The line keeps its place; a low window has none.
    if !is_low(ui) {
        let lead = state.map(|state| state.timing.lead_us).filter(|lead| *lead > 0.0);
        let text = lead.map_or(" ".to_owned(), |lead| format!("rendered {:.2} ms ahead", 1.0e-3 * lead));
        let line = ui.label(RichText::new(text).size(13.0).color(palette.weak));
        if lead.is_some() {
            line.on_hover_text(LEAD);
        }
    }
}

/// Returns a part of a limit, with its colour and its text.
fn load(palette: Palette, share: f64, figures: String) -> (f64, Color32, String) {
    let color = match share {
        s if s > 0.7 => palette.warn,
        _ => palette.good,
    };
    (share, color, figures)
}

/// Returns the part of the torque's limit. Small torques have one more digit.
fn torque(model: &Model, palette: Palette) -> (f64, Color32, String) {
    let torque = model.state.as_ref().map_or(0.0, |state| DVec3::from(state.torque).length());
    let limit = model.info.limits.torque;
    let most = model.history.strongest(RECENT_S).max(torque);
    let figures = if most > 0.0 && share(most, limit) < 0.09 {
        format!("{torque:.3} / {limit} N m")
    } else {
        format!("{torque:.2} / {limit:.2} N m")
    };
    let (share, color, figures) = load(palette, share(torque, limit), figures);
    // What is cut has one colour.
    (share, if model.is_at_limit() { palette.torque } else { color }, figures)
}

fn speed(speed: f64, model: &Model, palette: Palette) -> (f64, Color32, String) {
    let limit = model.info.limits.speed;
    load(palette, share(speed, limit), format!("{speed:.2} / {limit} rad/s"))
}

/// Draws the torque in large figures, and beside it its bar, or this speed of a stopped rig.
pub(super) fn show_torque(ui: &mut Ui, model: &Model, palette: Palette, speed: Option<f64>) {
    let value = torque(model, palette);
    let (large, limit) = value.2.split_once(' ').unwrap_or_default();
    let rest = if speed.is_some() { "N m" } else { limit };
    let (size, ink) = (if is_low(ui) { 22.0 } else { 32.0 }, palette.text);
    ui.horizontal(|ui| {
        let rest = (&*format!(" {rest}"), FontId::proportional(13.0), ink);
        ui.label(sized(&[(large, bold(ui, size), ink), rest])).on_hover_text(TORQUE);
        let Some(speed) = speed else {
            return bar(ui, palette, "Torque", ui.available_width(), &value);
        };
        let (share, _, figures) = self::speed(speed, model, palette);
        let name = format!("Speed: {figures}");
        let color = if share > 0.7 { palette.warn } else { ink };
        let speed = ui
            .label(RichText::new(format!("speed {figures}")).size(12.0).color(color))
            .on_hover_text(METERS[0].1);
        speed.widget_info(|| WidgetInfo::labeled(Role::Label, true, &name));
    });
}

/// Says a part in per cent. All of it is never cut.
pub(super) fn percent(part: f64) -> String {
    if part > 0.99 { "over 99 %".to_owned() } else { format!("{:.0} %", 100.0 * part) }
}

fn share(value: f64, limit: f64) -> f64 {
    if limit > 0.0 { value / limit } else { 0.0 }
}

/// Draws a bar with its name, whose hover text is `hint`, and the text `figures` next to it.
/// `share` is the length of the bar: 1 means that a limit is reached.
fn meter(ui: &mut Ui, palette: Palette, (name, hint): (&str, &str), value: (f64, Color32, String)) {
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 6.0;
        column(ui, 66.0, name).on_hover_text(hint);
        bar(ui, palette, name, (ui.available_width() - FIGURES).max(24.0), &value);
        // A long text does not widen the column, because the sliders would move.
        ui.add(egui::Label::new(RichText::new(value.2).size(12.0)).truncate());
    });
}

fn bar(
    ui: &mut Ui,
    palette: Palette,
    name: &str,
    width: f32,
    (share, color, figures): &(f64, Color32, String),
) {
    let (rect, response) = ui.allocate_exact_size(vec2(width, 10.0), egui::Sense::hover());
    response.widget_info(|| WidgetInfo::labeled(Role::ProgressIndicator, true, format!("{name}: {figures}")));
    let painter = ui.painter();
    painter.rect_filled(rect, 3.0, ui.visuals().extreme_bg_color);
    let full = rect.with_max_x(rect.left() + rect.width() * share.clamp(0.0, 1.0) as f32);
    painter.rect_filled(full, 3.0, *color);
    painter.rect_stroke(rect, 3.0, (1.0, palette.weak.gamma_multiply(0.5)), egui::StrokeKind::Inside);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::tests::commanding;
    use crate::view::painted::{drawn, hint, texts};
    use crate::view::state::TALL;
    use egui_kittest::kittest::Queryable as _;
    use hbot_api::StateEvent;

    /// The line is there only while the scene is rendered ahead.
    #[test]
    fn the_lead_is_told() {
        for (lead_us, told) in [(0.0, false), (2200.0, true)] {
            let mut model = commanding(true);
            model.state.as_mut().expect("a state").timing.lead_us = lead_us;
            let seen = drawn([600.0, TALL], move |ui| show(ui, &model, Palette::of(ui)));
            assert_eq!(seen.query_by_label("rendered 2.20 ms ahead").is_some(), told);
        }
    }

    #[test]
    fn a_small_torque_has_one_more_digit() {
        for (torque, figures) in
            [(0.36, "0.36 / 0.90 N m"), (0.036, "0.036 / 0.9 N m"), (0.0, "0.00 / 0.90 N m")]
        {
            let mut model = Model::new("", "panel me@here", 1);
            model.info.limits.torque = 0.9;
            model.state = Some(StateEvent { torque: [0.0, torque, 0.0], ..StateEvent::default() });
            let draw = move |ui: &mut Ui| show_torque(ui, &model, Palette::of(ui), None);
            // As narrow as the column of a small window.
            let seen = drawn([262.0, TALL], draw);
            assert!(texts(&seen).into_iter().any(|it| it.text == figures && it.is_whole()), "{figures}");
        }
    }

    #[test]
    fn each_bar_says_what_it_shows_and_what_its_unit_is() {
        let model = Model::new("", "panel me@here", 1);
        let mut seen = drawn([600.0, 400.0], move |ui| show(ui, &model, Palette::of(ui)));
        for (name, said) in METERS {
            assert_eq!(hint(&mut seen, name), said);
        }
    }
}
