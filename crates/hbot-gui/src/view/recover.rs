//! The button `Recover`: reset and enable in one step, after a look at how far the sphere is from
//! where the scene would pull it.

use eframe::egui::{Button, Ui, vec2};
use hbot_api::Mode;

use super::theme::{Palette, coloured, weak};
use crate::model::Model;
use crate::model::sample::quaternion;
use crate::net::{Intent, Lease};

/// How far the sphere is from where the scene would pull it after `enable`.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Distance {
    /// The angle to the scene's reference, rad, is at most what the rig allows.
    Near(f64),
    /// The angle to the scene's reference, rad, is more than the rig allows.
    Far(f64),
    /// The scene is placed where the sphere is then.
    Here,
    /// No effect of the scene has a reference.
    None,
    /// There is no connection, so nothing is known.
    NoConnection,
    /// No state has arrived over the present connection yet.
    NoState,
}

impl Distance {
    fn of(model: &Model) -> Self {
        let Some(state) = &model.state else {
            return if model.is_online() { Self::NoState } else { Self::NoConnection };
        };
        let Some(reference) = state.reference else { return Self::None };
        if model.scene.is_placed_here() {
            return Self::Here;
        }
        let angle = quaternion(reference).angle_between(quaternion(state.q));
        if angle <= model.info.limits.enable_max_angle { Self::Near(angle) } else { Self::Far(angle) }
    }

    fn in_words(self, allowed: f64, stopped: bool) -> String {
        match self {
            Self::Far(angle) if stopped => {
                format!("{angle:.2} rad from reference: turn to within {allowed:.2}")
            }
            Self::Near(angle) | Self::Far(angle) => {
                format!("{angle:.2} rad from reference (enable: up to {allowed:.2})")
            }
            Self::Here => "The scene begins where the sphere is.".to_owned(),
            Self::None => "No reference: nothing pulls at once.".to_owned(),
            Self::NoConnection => "Distance: not known without a connection.".to_owned(),
            Self::NoState => "Distance: not known yet.".to_owned(),
        }
    }
}

/// Returns how to go on after a stop, with the labels of the buttons.
pub(crate) fn way_on(model: &Model) -> &'static str {
    match (&model.lease, Distance::of(model)) {
        (Lease::Other(_), _) => "No torque. To go on, press Take over, then Recover.",
        (_, Distance::Far(_)) => "No torque. To go on, turn the sphere to its reference, then press Recover.",
        _ => "No torque. To go on, press Recover.",
    }
}

/// Draws the button and the distance, in all modes at the same place. The distance is grey if it
/// may be old.
pub(crate) fn show(ui: &mut Ui, model: &Model, intents: &mut Vec<Intent>) {
    let distance = Distance::of(model);
    let stopped = matches!(model.mode(), Some(Mode::Fault | Mode::Estop));
    let enabled = model.may_command() && stopped && !matches!(distance, Distance::Far(_));
    let hint = "Reset and Enable in one step, with a soft start of half a second. The sphere must be near the reference";
    ui.horizontal(|ui| {
        let button = Button::new("Recover").min_size(vec2(76.0, 34.0));
        let response = ui.add_enabled(enabled, button).on_hover_text(hint);
        if response.on_disabled_hover_text(hint).clicked() {
            intents.push(Intent::Recover);
        }
        let text = distance.in_words(model.info.limits.enable_max_angle, stopped);
        // The text has two lines of room beside the button, whatever it says.
        ui.allocate_ui(vec2(ui.available_width(), 34.0), |ui| {
            if !model.is_live() {
                ui.disable();
            }
            match distance {
                Distance::Far(_) if stopped => coloured(ui, Palette::of(ui).warn, text),
                _ => weak(ui, text),
            }
        });
    });
}

#[cfg(test)]
mod tests {
    use super::*;
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
        // The arc cosine has the square root of the rounding of its argument.
        assert!((near - 0.3).abs() < 1e-7, "{near}");
        assert!(matches!(Distance::of(&model(0.6, "absolute")), Distance::Far(_)));
        assert_eq!(Distance::of(&model(0.6, "here")), Distance::Here);
        let mut free = model(0.6, "absolute");
        free.state.as_mut().expect("a state").reference = None;
        assert_eq!(Distance::of(&free), Distance::None);
        free.state = None;
        assert_eq!(Distance::of(&free), Distance::NoConnection);
    }

    #[test]
    fn the_way_on_after_a_stop_names_the_buttons() {
        let near = model(0.3, "absolute");
        assert_eq!(way_on(&near), "No torque. To go on, press Recover.");
        let far = way_on(&model(0.6, "absolute"));
        assert_eq!(far, "No torque. To go on, turn the sphere to its reference, then press Recover.");
        for angle in [0.3, 0.6] {
            let mut observer = model(angle, "absolute");
            observer.lease = Lease::Other("panel ben@lab3".to_owned());
            assert_eq!(way_on(&observer), "No torque. To go on, press Take over, then Recover.");
        }
    }
}
