//! The table of a wheel's motor controllers: current, temperature and firmware of the steer and the
//! drive. Complaints stand below it, because their words are too long for a column.

use eframe::egui::{Align, Label, Layout, Response, RichText, Ui};
use hbot_api::{ControllerFlag, ControllerInfo};

use super::theme::{Palette, cell, coloured, column};

/// Names and widths of the columns. The last one takes the rest of the line.
const COLUMNS: [(&str, f32); 3] = [("", 34.0), ("current", 66.0), ("temp.", 60.0)];
/// What is shown in the place of all tables if the server does not know the motor controllers.
pub(super) const OLDER_SERVER: &str =
    "Motor controllers: not reported, because this server is older than the panel.";
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
        let said = format!("{name}: {}", controller.flags.join(", "));
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
    value(ui, current, controller.current_a.map(amperes), "motor current that makes torque");
    let degrees = controller.temperature_c.map(|degrees| format!("{degrees:.1} \u{b0}C"));
    value(ui, temperature, degrees, "the highest temperature that the controller reports");
    match &controller.firmware {
        Some(firmware) => rest(ui, small(firmware)),
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

/// Formats a current with at most two or three decimals, so that it fits its column.
fn amperes(current: f64) -> String {
    let decimals = if current.abs() < 10.0 { 3 } else { 2 };
    format!("{current:+.decimals$} A")
}

/// Draws text in the rest of the line. A long text takes several lines.
fn rest(ui: &mut Ui, text: RichText) -> Response {
    let width = ui.available_width().max(20.0);
    cell(ui, width, Layout::left_to_right(Align::Center), Label::new(text).wrap())
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
        Ok(known) => format!("{flag}: {}", known.sentence()),
        Err(()) => flag.clone(),
    };
    flags.iter().map(line).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use eframe::egui::pos2;
    use egui_kittest::Harness;
    use egui_kittest::kittest::Queryable as _;

    use super::*;
    use crate::view::painted::{drawn, hint, lines, texts};

    /// Returns the steer's controller, which reports everything, and the drive's, which reports
    /// nothing.
    fn pair() -> [ControllerInfo; 2] {
        let steer = ControllerInfo {
            joint: 0,
            port: Some("/dev/ttyACM0".to_owned()),
            protocol: Some("moteus".to_owned()),
            id: Some(7),
            firmware: Some("moteus 0x010f".to_owned()),
            current_a: Some(0.25),
            temperature_c: Some(31.5),
            flags: vec!["overtemperature".to_owned(), "eclipse".to_owned()],
        };
        [steer, ControllerInfo { joint: 1, ..ControllerInfo::default() }]
    }

    /// Draws the table of these controllers in a window of this width.
    fn table(width: f32, pair: Vec<ControllerInfo>) -> Harness<'static> {
        drawn([width, 400.0], move |ui| show(ui, &pair))
    }

    #[test]
    fn each_controller_has_its_values_and_a_dash_for_each_that_it_does_not_report() {
        let [steer, drive] = pair();
        let both = table(400.0, vec![steer.clone(), drive.clone()]);
        let first = ["current | temp. | firmware", "steer | +0.250 A | 31.5 \u{b0}C | moteus 0x010f"];
        let rest = ["drive | - | - | -", "steer: overtemperature, eclipse"];
        assert_eq!(lines(&both), [first, rest].concat());
        // With the two exchanged, each line has the other's values.
        let drive = ControllerInfo { current_a: Some(-12.3456), ..drive };
        let both = table(400.0, vec![drive, steer]);
        let first = ["current | temp. | firmware", "steer | -12.35 A | - | -"];
        let rest = ["drive | +0.250 A | 31.5 \u{b0}C | moteus 0x010f", "drive: overtemperature, eclipse"];
        assert_eq!(lines(&both), [first, rest].concat());
    }

    #[test]
    fn nothing_is_drawn_of_controllers_that_the_server_does_not_report() {
        assert_eq!(lines(&table(400.0, Vec::new())), [""; 0]);
    }

    #[test]
    fn only_a_controller_that_complains_has_the_colour_of_a_warning() {
        let harness = table(400.0, pair().into());
        let texts = texts(&harness);
        let color_of = |text: &str| texts.iter().find(|it| it.text == text).expect(text).color;
        let warn = color_of("steer: overtemperature, eclipse");
        assert_eq!(color_of("steer"), warn);
        assert_ne!(color_of("drive"), warn);
    }

    #[test]
    fn hints_say_where_a_controller_is_and_what_its_complaints_mean() {
        let mut harness = table(400.0, pair().into());
        for (text, said) in [
            ("steer", "port /dev/ttyACM0, protocol moteus, id 7"),
            ("drive", "port not known, protocol not known"),
            ("+0.250 A", "motor current that makes torque"),
            ("31.5 \u{b0}C", "the highest temperature that the controller reports"),
            ("-", "not reported by the controller"),
            (
                "steer: overtemperature, eclipse",
                "overtemperature: The motor or the power stage is too hot.\neclipse",
            ),
        ] {
            assert_eq!(hint(&mut harness, text), said, "{text}");
        }
    }

    #[test]
    fn each_dash_says_that_the_value_is_not_reported() {
        let mut harness = table(400.0, pair().into());
        let dashes: Vec<_> = harness.query_all_by_label("-").map(|label| label.rect().center()).collect();
        assert_eq!(dashes.len(), 3, "current, temperature and firmware of the drive");
        for (k, dash) in dashes.into_iter().enumerate() {
            // The empty part of the window, then the dash.
            for (place, said) in [(pos2(390.0, 390.0), false), (dash, true)] {
                harness.hover_at(place);
                harness.run_steps(8);
                let says = texts(&harness).iter().any(|it| it.text == NOT_REPORTED);
                assert_eq!(says, said, "dash {k}, the pointer at {place:?}");
            }
        }
    }

    /// The table is 270 points wide in a narrow window, and 314 in a wide one.
    #[test]
    fn the_longest_values_fit_the_table() {
        let long = |current, temperature| ControllerInfo {
            firmware: Some("moteus 0x010f, register map 5".to_owned()),
            current_a: Some(current),
            temperature_c: Some(temperature),
            flags: ControllerFlag::ALL.map(|flag| flag.to_string()).to_vec(),
            ..ControllerInfo::default()
        };
        for width in [270.0, 314.0] {
            for pair in
                [[long(-123.456, 123.45), long(9.9994, -12.3)], [long(-9.9999, 99.99), pair()[0].clone()]]
            {
                let harness = table(width, pair.into());
                for text in texts(&harness) {
                    assert!(text.is_whole(), "{width} points: {text:?}");
                }
            }
        }
    }
}
