//! The buttons that enable, disable and reset the rig, and the button `Recover`: reset and enable
//! in one step, after a look at how far the sphere is from where the scene would pull it.

use eframe::egui::text::LayoutJob;
use eframe::egui::{Button, RichText, TextStyle, Ui, Vec2, vec2};
use hbot_api::Mode;
use hbot_core::render::effects::Anchor;

use super::state::{is_low, spins, too_fast, turns};
use super::theme::{Palette, coloured, leading, press, weak};
use crate::model::sample::quaternion;
use crate::model::{Model, has_torque};
use crate::net::{Intent, Lease};

/// Height of the buttons that enable, disable and reset, in a low and in a tall window, points.
const ORDER: [f32; 2] = [30.0, 38.0];

/// How far the sphere is from where the scene would pull it after `enable`.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Distance {
    /// The angle to where the first effect with a reference is at rest, rad, is at most what the
    /// rig allows.
    Near(f64),
    /// This angle, rad, is more than the rig allows.
    Far(f64),
    /// The rig does not limit the angle to the scene's reference, rad, or the panel does not know
    /// the law of the effect.
    Free(f64),
    /// The scene is placed where the sphere is then.
    Here,
    /// No effect of the scene has a reference.
    None,
    /// There is no state.
    Unknown,
}

impl Distance {
    fn of(model: &Model) -> Self {
        let Some(state) = &model.state else { return Self::Unknown };
        let Some(reference) = state.reference.map(quaternion) else { return Self::None };
        let q = quaternion(state.q);
        let first = model.scene.first_reference();
        if matches!(first, Some((_, Anchor::Here))) {
            // While the scene is rendered, it has begun elsewhere.
            return if has_torque(state.mode) { Self::Free(reference.angle_between(q)) } else { Self::Here };
        }
        // The server reports the reference of the first effect only. It refuses by this angle,
        // unless the reference has been changed since the torque ended.
        match first.and_then(|(effect, _)| effect.kind().excess(reference, q, effect.numbers())) {
            Some(angle) if angle <= model.info.limits.enable_max_angle => Self::Near(angle),
            Some(angle) => Self::Far(angle),
            None => Self::Free(reference.angle_between(q)),
        }
    }

    fn in_words(self, allowed: f64) -> String {
        match self {
            Self::Near(angle) | Self::Far(angle) => {
                format!("{angle:.2} rad from reference; Enable works to {allowed:.2}")
            }
            Self::Free(angle) => format!("{angle:.2} rad from reference"),
            Self::Here => "The scene begins where the sphere is.".to_owned(),
            Self::None => "No reference: Enable works at any orientation.".to_owned(),
            Self::Unknown => String::new(),
        }
    }
}

/// Returns the button that gives command, if the user must press it before a change.
pub(super) fn must_press(model: &Model) -> Option<&'static str> {
    match model.lease {
        Lease::Other(_) => Some("Take over"),
        Lease::Free | Lease::Unknown if model.observes => Some("Take command"),
        _ => None,
    }
}

/// Says why the button is off. In mode idle, `Enable` does its work, and the distance tells more.
fn why_off(model: &Model, distance: Distance) -> Option<String> {
    let why = match model.mode() {
        _ if !model.is_online() => "no connection".to_owned(),
        _ if model.silent_for().is_some() => "no contact".to_owned(),
        None => "no state yet".to_owned(),
        _ if !model.may_command() => "you observe".to_owned(),
        Some(Mode::Idle) => return None,
        Some(Mode::Fault | Mode::Estop) => match (model.other_stopper(), distance) {
            (Some(who), _) => format!("stopped by {who}"),
            _ if too_fast(model).is_some() => "the sphere is too fast".to_owned(),
            _ if spins(model) => "the sphere still turns".to_owned(),
            (_, Distance::Far(angle)) if !model.is_simulated() => format!("{angle:.2} rad from reference"),
            _ => return None,
        },
        Some(_) => model.headline().text(),
    };
    Some(format!("Recover is off: {why}"))
}

/// Returns how to go on after a stop, with the labels of the buttons.
pub(crate) fn way_on(model: &Model) -> String {
    let take = must_press(model).map(|take| format!("press {take}, then"));
    if model.other_stopper().is_some() {
        // Who has stopped the rig may have a hand in it.
        let press = take.as_deref().unwrap_or("press");
        return format!(
            "No torque. To go on, make sure that nobody touches the sphere, {press} Reset, then Enable."
        );
    }
    let rest = match (spins(model), model.is_simulated()) {
        (false, _) => "",
        // It may spin for ever.
        (true, true) => "hold the sphere, then ",
        (true, false) => "wait until the sphere rests, then ",
    };
    let first = match (take.as_deref(), Distance::of(model)) {
        (Some(take), _) => take,
        (_, Distance::Far(_)) if model.is_simulated() => "press \"set its anchor to here\", then",
        (_, Distance::Far(_)) => "turn the sphere to its reference, then press",
        _ => "press",
    };
    let takes = if model.lease == Lease::Free && take.is_none() { ", which takes command" } else { "" };
    format!("No torque. To go on, {rest}{first} Recover{takes}.")
}

/// Returns the name of the button that is the next step of this user, if one of these is. In a
/// fault it is the one that the remedy names.
pub(crate) fn next_step(model: &Model) -> Option<&'static str> {
    let far = matches!(Distance::of(model), Distance::Far(_));
    // While the sphere turns, `Reset` works, but waiting is better.
    match model.mode()? {
        _ if !model.may_command() || spins(model) => None,
        Mode::Fault => (!turns(model)).then_some("Reset"),
        Mode::Estop if model.other_stopper().is_some() => (!turns(model)).then_some("Reset"),
        Mode::Estop => (!far).then_some("Recover"),
        Mode::Idle => (!far).then_some("Enable"),
        _ => None,
    }
}

/// Returns why the server would refuse to enable now because of the distance, and what to do about
/// it. Returns `None` if the panel knows no such reason.
pub(crate) fn refusal(model: &Model) -> Option<String> {
    let Distance::Far(angle) = Distance::of(model) else { return None };
    let (effect, _) = model.scene.first_reference()?;
    let (id, allowed) = (effect.id(), model.info.limits.enable_max_angle);
    // Quicker than to turn the simulated sphere back by the mouse.
    let remedy = if model.is_simulated() {
        format!("press \"set its anchor to here\" above, or type `hbot set {id} anchor=here`")
    } else {
        "turn the sphere nearer to the reference".to_owned()
    };
    Some(format!(
        "The sphere is {angle:.3} rad from the reference of {id}. The rig enables it within {allowed} rad: {remedy}."
    ))
}

/// Draws the buttons that enable, disable and reset the rig.
pub(super) fn orders(ui: &mut Ui, model: &Model, intents: &mut Vec<Intent>) {
    let mode = model.mode();
    let may = model.may_command();
    let width = (ui.available_width() - 2.0 * ui.spacing().item_spacing.x) / 3.0;
    let height = ORDER[usize::from(!is_low(ui))];
    let refusal = refusal(model).filter(|_| mode == Some(Mode::Idle));
    let too_fast = too_fast(model);
    let orders = [
        (
            "Enable",
            Intent::Enable,
            may && matches!(mode, Some(Mode::Idle)),
            refusal.as_deref().unwrap_or("begin to render, with a soft start of half a second"),
        ),
        (
            "Disable",
            Intent::Disable,
            model.is_online() && matches!(mode, Some(Mode::Active | Mode::Enabling)),
            "stop rendering, with a ramp of 50 ms",
        ),
        (
            "Reset",
            Intent::Reset,
            may && matches!(mode, Some(Mode::Fault | Mode::Estop)) && too_fast.is_none(),
            too_fast.as_deref().unwrap_or("leave a fault or a stop, once its cause is gone"),
        ),
    ];
    ui.horizontal(|ui| {
        for (name, intent, enabled, hint) in orders {
            if order(ui, model, name, vec2(width, height), (enabled, hint)) {
                intents.push(intent);
            }
        }
    });
}

/// Draws a button for the rig, filled if it is the next step, and returns whether it was pressed.
fn order(ui: &mut Ui, model: &Model, name: &str, size: Vec2, (enabled, hint): (bool, &str)) -> bool {
    let button = if next_step(model) == Some(name) { leading(ui, name) } else { Button::new(name) };
    let response = press(ui, enabled, button.min_size(size)).on_hover_text(hint);
    response.on_disabled_hover_text(hint).clicked()
}

/// Draws the button, and beside it the distance or why it is off, in all modes at the same place.
/// The distance is grey if it may be old.
pub(crate) fn show(ui: &mut Ui, model: &Model, intents: &mut Vec<Intent>) {
    let distance = Distance::of(model);
    let stopped = matches!(model.mode(), Some(Mode::Fault | Mode::Estop));
    let stopper = model.other_stopper().map(|who| format!("Stopped by {who}: press Reset, then Enable"));
    let refusal = too_fast(model).or_else(|| refusal(model)).filter(|_| stopped);
    let refusal = stopper.or(refusal);
    let enabled = model.may_command() && stopped && refusal.is_none() && !spins(model);
    let hint = refusal.as_deref().unwrap_or(
        "Reset and Enable in one step, with a soft start of half a second. The sphere must be near the reference",
    );
    ui.horizontal(|ui| {
        if order(ui, model, "Recover", vec2(76.0, 34.0), (enabled, hint)) {
            intents.push(Intent::Recover);
        }
        let allowed = model.info.limits.enable_max_angle;
        // The box below says what to do about it.
        let off = why_off(model, distance);
        // The text has two lines of room beside the button, whatever it says.
        ui.allocate_ui(vec2(ui.available_width(), 34.0), |ui| {
            if off.is_none() && !model.is_fresh() {
                ui.disable();
            }
            match distance {
                _ if let Some(off) = off => {
                    let (font, ink) = (TextStyle::Body.resolve(ui.style()), Palette::of(ui).weak);
                    let laid = |text: String| {
                        let mut job = LayoutJob::simple(text, font.clone(), ink, ui.available_width());
                        job.wrap.max_rows = 2;
                        ui.painter().layout_job(job)
                    };
                    // The box below has room for a long name.
                    let names = [off, "Recover is off: stopped by another client".to_owned()];
                    let fits = names.into_iter().map(laid).find(|text| !text.elided);
                    fits.map(|text| ui.label(text));
                }
                // The control itself can be below the lower end of its tab.
                Distance::Far(angle)
                    if model.is_simulated()
                        && let Some((effect, _)) = model.scene.first_reference() =>
                {
                    let text = format!("{angle:.2} rad from reference: set its anchor to here");
                    let text = RichText::new(text).color(Palette::of(ui).warn).size(12.0);
                    // Two lines, as high as the button beside it, so that nothing below moves.
                    ui.spacing_mut().button_padding.y = 1.0;
                    let button = Button::new(text).wrap().min_size(vec2(0.0, 34.0));
                    if press(ui, model.may_command(), button).clicked() {
                        let (effect, key) = (effect.id().to_owned(), "anchor".to_owned());
                        intents.push(Intent::Set { effect, key, value: "here".into() });
                    }
                }
                Distance::Far(_) => drop(coloured(ui, Palette::of(ui).warn, distance.in_words(allowed))),
                _ => drop(weak(ui, distance.in_words(allowed))),
            }
        });
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::tests::{held_by, stopped_by};
    use hbot_api::StateEvent;
    use serde_json::json;

    fn model(angle: f64, anchor: &str) -> Model {
        let mut model = Model::new("", "panel me@here", 1);
        model.info.limits.enable_max_angle = 0.5;
        model.scene.take(&json!({"name": "S", "effect": [
            {"id": "air", "kind": "damper"}, {"id": "s", "kind": "spring", "anchor": anchor}]}));
        let q = [(0.5 * angle).cos(), (0.5 * angle).sin(), 0.0, 0.0];
        // The opposite quaternion is the same orientation.
        let reference = Some([-1.0, 0.0, 0.0, 0.0]);
        model.state = Some(StateEvent { q, reference, mode: Mode::Fault, ..StateEvent::default() });
        model
    }

    #[test]
    fn the_distance_is_that_which_enable_allows() {
        let Distance::Near(near) = Distance::of(&model(0.3, "absolute")) else { panic!("not near") };
        // The tolerance is for rounding.
        assert!((near - 0.3).abs() < 1e-12, "{near}");
        assert!(matches!(Distance::of(&model(0.6, "absolute")), Distance::Far(_)));
        let mut here = model(0.6, "here");
        assert_eq!(Distance::of(&here), Distance::Here);
        // The scene has begun, and a hand has turned the sphere.
        here.state.as_mut().expect("a state").mode = Mode::Active;
        assert!(matches!(Distance::of(&here), Distance::Free(angle) if (angle - 0.6).abs() < 1e-7));
        let mut free = model(0.6, "absolute");
        free.state.as_mut().expect("a state").reference = None;
        assert_eq!(Distance::of(&free), Distance::None);
        // Such a scene can have torque at once, such as a constant one.
        let said = Distance::None.in_words(0.5);
        assert_eq!(said, "No reference: Enable works at any orientation.");
        free.state = None;
        assert_eq!(Distance::of(&free), Distance::Unknown);
    }

    #[test]
    fn the_distance_is_that_by_which_the_server_refuses() {
        let of = |effect: serde_json::Value| {
            let mut model = model(0.8, "absolute");
            model.scene.take(&json!({"name": "S", "effect": [effect]}));
            (Distance::of(&model), refusal(&model))
        };
        // The sphere has turned about the first axis, which this guide leaves free.
        let (free, refused) = of(json!({"id": "g", "kind": "guide", "axis": [1, 0, 0]}));
        assert!(matches!(free, Distance::Near(angle) if angle < 1e-7), "{free:?}");
        assert_eq!(refused, None);
        let (held, refused) = of(json!({"id": "g", "kind": "guide", "axis": [0, 0, 1]}));
        assert!(matches!(held, Distance::Far(_)), "{held:?}");
        assert!(refused.expect("refused").contains("0.800 rad from the reference of g"));
        // A magnet pulls little from far away, so no distance is refused.
        let (magnet, refused) = of(json!({"id": "m", "kind": "magnet"}));
        assert!(matches!(magnet, Distance::Free(angle) if (angle - 0.8).abs() < 1e-7), "{magnet:?}");
        assert_eq!((refused, magnet.in_words(0.5).as_str()), (None, "0.80 rad from reference"));
        // A kind that the panel does not know.
        assert!(matches!(of(json!({"id": "n", "kind": "new"})), (Distance::Free(_), None)));
    }

    #[test]
    fn the_way_on_after_a_stop_names_the_buttons() {
        let near = model(0.3, "absolute");
        assert_eq!(way_on(&near), "No torque. To go on, press Recover.");
        let mut free = model(0.3, "absolute");
        free.lease = Lease::Free;
        assert_eq!(way_on(&free), "No torque. To go on, press Recover, which takes command.");
        let far = way_on(&model(0.6, "absolute"));
        assert_eq!(far, "No torque. To go on, turn the sphere to its reference, then press Recover.");
        for angle in [0.3, 0.6] {
            let mut observer = model(angle, "absolute");
            observer.lease = held_by("panel ben@lab3", 9);
            assert_eq!(way_on(&observer), "No torque. To go on, press Take over, then Recover.");
            observer.state.as_mut().expect("a state").mode = Mode::Estop;
            observer.fault = Some(stopped_by("panel ben@lab3", Some(9)));
            let way = "No torque. To go on, make sure that nobody touches the sphere, press Take over, then Reset, \
                       then Enable.";
            assert_eq!(way_on(&observer), way);
        }
    }
}
