//! The field of a number. It refuses what is typed outside the legal range, because the end of the
//! range can be far from what was meant.

use std::cell::Cell;
use std::ops::RangeInclusive;

use eframe::egui::{DragValue, Id, Response, Ui};

use super::theme::named;

/// Key of the message about a refused number in the memory of the window.
const REFUSED: &str = "refused number";

/// Draws the field of the number `x` as `draw` does, with this name for screen readers. `x` stays
/// if the user types a number outside `legal`; then [`refused`] returns why. A drag stops at the
/// end of `legal`.
pub(super) fn number(
    ui: &mut Ui,
    name: &str,
    x: &mut f64,
    (legal, unit): (RangeInclusive<f64>, &str),
    draw: impl FnOnce(&mut Ui, DragValue<'_>) -> Response,
) -> Response {
    let before = *x;
    let is_legal = |x: f64| x.is_finite() && legal.contains(&x);
    let refused = Cell::new(None);
    let parse = |text: &str| {
        // As egui reads it: without blanks, and with the sign for minus.
        let plain: String = text.split_whitespace().collect();
        let typed: f64 = plain.replace('\u{2212}', "-").parse().ok()?;
        if !is_legal(typed) {
            refused.set(Some(plain));
        }
        is_legal(typed).then_some(typed)
    };
    let field = DragValue::new(x)
        .range(legal.clone())
        .clamp_existing_to_range(false)
        .custom_parser(parse)
        // A rig must not get the 1 while the user types 15.
        .update_while_editing(false);
    let response = named(draw(ui, field), name);
    // Arrow keys and screen readers change the number without the parser.
    if *x != before && !is_legal(*x) {
        refused.set(Some(x.to_string()));
        *x = before;
    }
    if let Some(typed) = refused.take() {
        let legal = match (*legal.start(), *legal.end()) {
            (f64::NEG_INFINITY, f64::INFINITY) => "every finite number".to_owned(),
            (least, f64::INFINITY) => format!("{least} or more"),
            (f64::NEG_INFINITY, most) => format!("{most} or less"),
            (least, most) => format!("{least} to {most}"),
        };
        let name = name.trim_end_matches(" value");
        let text = format!("{name}: {typed}; legal: {legal} {unit}").trim_end().to_owned();
        let (key, now) = (response.id.with(REFUSED), ui.ctx().cumulative_frame_nr());
        ui.data_mut(|data| {
            // Egui reads what was typed again in the frame after Enter.
            if data.get_temp::<u64>(key).is_none_or(|last| now > last + 1) {
                data.insert_temp(Id::unique(REFUSED), text);
            }
            data.insert_temp(key, now);
        });
    }
    response
}

/// Returns once why the last number that the user has typed was refused, if it was.
pub(super) fn refused(ui: &Ui) -> Option<String> {
    ui.data_mut(|data| data.remove_temp(Id::unique(REFUSED)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use eframe::egui::{Key, vec2};
    use egui_kittest::Harness;
    use egui_kittest::kittest::Queryable as _;

    type Seen = Harness<'static, (f64, Option<String>)>;

    /// Draws the field of 2 J with this range, lets the user act, and returns the number and what
    /// is said.
    fn after(legal: RangeInclusive<f64>, act: impl FnOnce(&mut Seen)) -> (f64, String) {
        let draw = move |ui: &mut Ui, (x, said): &mut (f64, Option<String>)| {
            number(ui, "E value", x, (legal.clone(), "J"), |ui, field| ui.add(field));
            let refused = refused(ui);
            assert!(said.is_none() || refused.is_none(), "said once");
            *said = said.take().or(refused);
        };
        let mut seen = Harness::new_ui_state(draw, (2.0, None));
        act(&mut seen);
        seen.run_steps(4);
        let (x, said) = seen.into_state();
        (x, said.unwrap_or_default())
    }

    fn edited(seen: &mut Seen) {
        seen.get_by_label("E value").focus();
        seen.run_steps(2);
    }

    #[test]
    fn what_is_typed_outside_the_range_is_refused() {
        let (least, most) = (f64::NEG_INFINITY, f64::INFINITY);
        for (legal, typed, x, said) in [
            (0.0..=10.0, "10", 10.0, ""),
            (0.0..=10.0, "10.5", 2.0, "E: 10.5; legal: 0 to 10 J"),
            (0.0..=10.0, "\u{2212} 5", 2.0, "E: \u{2212}5; legal: 0 to 10 J"),
            (0.0..=most, "-5", 2.0, "E: -5; legal: 0 or more J"),
            (least..=10.0, "11", 2.0, "E: 11; legal: 10 or less J"),
            (least..=most, "-1e9", -1e9, ""),
            (least..=most, "inf", 2.0, "E: inf; legal: every finite number J"),
            (0.0..=10.0, "NaN", 2.0, "E: NaN; legal: 0 to 10 J"),
            (0.0..=10.0, "ten", 2.0, ""),
        ] {
            for key in [Key::Enter, Key::Tab] {
                let told = after(legal.clone(), |seen| {
                    edited(seen);
                    seen.get_by_label("E value").type_text(typed);
                    seen.run_steps(2);
                    seen.key_press(key);
                });
                assert_eq!(told, (x, said.to_owned()), "{typed}, {key:?}");
            }
        }
    }

    #[test]
    fn a_step_or_a_screen_reader_does_not_leave_the_range_and_a_drag_stops_at_its_end() {
        let stepped = after(1.5..=10.0, |seen| {
            edited(seen);
            seen.key_press(Key::ArrowDown);
        });
        assert_eq!(stepped, (2.0, "E: 1; legal: 1.5 to 10 J".to_owned()));
        let set = after(0.0..=10.0, |seen| seen.get_by_label("E value").set_value_accesskit(5000.0));
        assert_eq!(set, (2.0, "E: 5000; legal: 0 to 10 J".to_owned()));
        let dragged = after(0.0..=10.0, |seen| {
            let place = seen.get_by_label("E value").rect().center();
            seen.drag_at(place);
            seen.run_steps(2);
            seen.hover_at(place + vec2(300.0, 0.0));
        });
        assert_eq!(dragged, (10.0, String::new()));
    }
}
