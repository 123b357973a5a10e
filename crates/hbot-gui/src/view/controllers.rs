//! The table of a wheel's motor controllers: current, temperature and firmware of the steer and the
//! drive. Complaints stand below it, because their words are too long for a column.

use eframe::egui::{Response, RichText, Ui};
use hbot_api::{ControllerFlag, ControllerInfo};

use super::theme::{Palette, coloured, column};
use crate::model::words;

/// Names and widths of the columns. The last one takes the rest of the line.
const COLUMNS: [(&str, f32); 3] = [("", 34.0), ("current", 64.0), ("temp.", 52.0)];
/// Hover text of a value that the controller does not report.
const NOT_REPORTED: &str = "not reported by the controller";

/// Draws the table. `pair` are the controllers of the wheel's steer and drive.
pub(super) fn show(ui: &mut Ui, pair: &[ControllerInfo]) {
    if pair.is_empty() {
        return;
    }
    ui.spacing_mut().item_spacing.x = 5.0;
    ui.horizontal(|ui| {
        for (name, width) in COLUMNS {
            column(ui, width, small(name).weak());
        }
        rest(ui, small("firmware").weak());
    });
    for (controller, name) in pair.iter().zip(["steer", "drive"]) {
        ui.horizontal(|ui| row(ui, controller, name));
    }
    for (controller, name) in pair.iter().zip(["steer", "drive"]).filter(|(it, _)| complains(it)) {
        let said = format!("{name} complains of {}", controller.flags.join(", "));
        coloured(ui, Palette::of(ui).warn, said).on_hover_text(explained(&controller.flags));
    }
}

fn complains(controller: &ControllerInfo) -> bool {
    !controller.flags.is_empty()
}

fn row(ui: &mut Ui, controller: &ControllerInfo, name: &str) {
    let [(_, first), (_, current), (_, temperature)] = COLUMNS;
    let warn = Palette::of(ui).warn;
    let name = RichText::new(name);
    let name = if complains(controller) { name.color(warn) } else { name };
    column(ui, first, name).on_hover_text(place(controller));
    let ampere = controller.current_a.map(|ampere| format!("{ampere:+.3} A"));
    value(ui, current, ampere, "motor current that makes torque");
    let degrees = controller.temperature_c.map(|degrees| format!("{degrees:.1} \u{b0}C"));
    value(ui, temperature, degrees, "the highest temperature that the controller reports");
    match &controller.firmware {
        Some(firmware) => rest(ui, small(firmware)).on_hover_text(firmware.as_str()),
        None => rest(ui, small("-").weak()).on_hover_text(NOT_REPORTED),
    };
}

/// Draws a value in a column, or a dash if the controller does not report it.
fn value(ui: &mut Ui, width: f32, text: Option<String>, what: &str) {
    match text {
        Some(text) => column(ui, width, small(text).monospace()).on_hover_text(what),
        None => column(ui, width, small("-").weak()).on_hover_text(NOT_REPORTED),
    };
}

/// Draws text in the rest of the line.
fn rest(ui: &mut Ui, text: RichText) -> Response {
    let width = ui.available_width().max(20.0);
    column(ui, width, text)
}

fn small(text: impl Into<String>) -> RichText {
    RichText::new(text).size(12.0)
}

/// Returns the port, the protocol and the id of a controller in words.
fn place(controller: &ControllerInfo) -> String {
    let known = |text: &Option<String>| text.clone().unwrap_or_else(|| "not known".to_owned());
    let id = controller.id.map(|id| format!(", id {id}")).unwrap_or_default();
    format!("port {}, protocol {}{id}", known(&controller.port), known(&controller.protocol))
}

/// Returns an explanation of each complaint. A word that this panel does not know explains itself.
fn explained(flags: &[String]) -> String {
    let line = |flag: &String| match flag.parse::<ControllerFlag>() {
        Ok(known) => format!("{flag}: {}", words::controller(known)),
        Err(()) => flag.clone(),
    };
    flags.iter().map(line).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use egui_kittest::kittest::Queryable as _;

    use super::*;

    #[test]
    fn each_controller_has_its_values_and_a_dash_for_each_that_it_does_not_report() {
        let hot = ControllerInfo {
            joint: 0,
            port: Some("/dev/ttyACM0".to_owned()),
            protocol: Some("moteus".to_owned()),
            id: Some(7),
            firmware: Some("moteus 0x010f".to_owned()),
            current_a: Some(-0.25),
            temperature_c: Some(31.5),
            flags: vec!["overtemperature".to_owned(), "eclipse".to_owned()],
        };
        assert_eq!(place(&hot), "port /dev/ttyACM0, protocol moteus, id 7");
        assert_eq!(
            explained(&hot.flags),
            "overtemperature: The motor or the power stage is too hot.\neclipse"
        );
        let pair = [hot, ControllerInfo { joint: 1, ..ControllerInfo::default() }];
        let mut harness = egui_kittest::Harness::new_ui(move |ui| show(ui, &pair));
        harness.run();
        let shown = |text| harness.query_all_by_label(text).count();
        for text in [
            "current",
            "firmware",
            "-0.250 A",
            "31.5 \u{b0}C",
            "steer complains of overtemperature, eclipse",
            "moteus 0x010f",
        ] {
            assert_eq!(shown(text), 1, "{text}");
        }
        assert!(harness.query_by_label_contains("drive complains").is_none());
        assert_eq!(shown("-"), 3, "current, temperature and firmware of the drive");
    }
}
