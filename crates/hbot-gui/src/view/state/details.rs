//! The sentences in the box: what is wrong, why, and how to go on.

use std::time::Duration;

use eframe::egui::{self, Color32, RichText, TextStyle, Ui};
use glam::DVec3;
use hbot_api::{Fault, FaultEvent, Mode, ShakingEvent, StateEvent};
use hbot_config::advice::Warning;

use super::{LARGE, MOOD, SMALL, TURNS, is_low, strain, too_fast};
use crate::model::{Headline, Mark, Model, Refusal, has_torque};
use crate::net::Lease;
use crate::view::recover;
use crate::view::stop::has_keys;
use crate::view::theme::{Palette, bold, coloured, weak, wrapped};

/// What replaces the advice to cut the motors' power.
const NO_MOTORS: &str = "Simulated: nothing real moves.";
/// What is said while the torque rises.
const RISES: &str = "The torque rises: the sphere will push.";
/// What is said of a sphere with torque that nobody commands.
const FREE: &str = "Nobody commands. The sphere pushes on; STOP and Disable work.";
/// What to do about a sphere that shakes, if its scene has no remedy.
const LESS: &str = "Lower the stiffness or raise the damping.";
/// The box tells a fault that the rig has left for so long, s.
const LEFT_S: f64 = 10.0;
/// Size of the order of a stop that is not confirmed, points.
const ORDER: f32 = 20.0;

/// Draws what the user must know in the room of this height, and scrolls if it is more. Returns
/// whether the first warning stands there in full.
pub(super) fn details(
    ui: &mut Ui,
    model: &Model,
    (warnings, room): (&[Warning], f32),
    headline: Headline,
    palette: Palette,
) -> bool {
    match (headline, &model.state) {
        (Headline::NotStopped, _) => not_stopped(ui, model),
        (Headline::NoContact, _) => no_contact(ui, model),
        (Headline::Mode(Mode::Fault), Some(state)) => {
            let warning = warnings.first().map_or(0.0, |first| height(ui, &first.to_string()));
            fault(ui, model, state, room - warning, palette);
            return warned(ui, (warnings, room), palette, None);
        }
        (Headline::Mode(Mode::Estop), _) => {
            match model.fault.as_ref().and_then(|told| told.by.as_ref()) {
                Some(by) => stopped(ui, model, palette, &format!("Stopped by {}.", model.who(by))),
                None => stopped(ui, model, palette, Mode::Estop.sentence()),
            }
            if let Some((before, fault)) = model.fault_before.as_ref().and_then(|it| Some((it, it.fault?))) {
                coloured(ui, palette.warn, format!("Before the stop: {fault}. {}", fault.words().0));
                wrapped(ui, cure_of(fault, Some(before)));
            }
            return warned(ui, (warnings, room), palette, None);
        }
        (Headline::Mode(Mode::Idle), _)
            if let Some(text) = model
                .refusal
                .as_ref()
                .map(Refusal::in_words)
                .or_else(|| recover::refusal(model).map(|text| format!("No torque. {text}"))) =>
        {
            still_turns(ui, model);
            coloured(ui, palette.warn, text);
        }
        (Headline::Mode(mode), _) => {
            if mode == Mode::Idle {
                still_turns(ui, model);
            }
            let cured = model.shaking.as_ref().map(|shaking| {
                let cure = cure(warnings, shaking.effect.as_deref());
                remedy(ui, palette, &cure);
                coloured(ui, palette.warn, shaken(shaking));
                cure
            });
            if cured.is_none() && warnings.is_empty() && model.lease == Lease::Free && has_torque(mode) {
                remedy(ui, palette, FREE);
            } else if warnings.is_empty() && strain(model, headline).is_none() {
                match mode {
                    Mode::Enabling => drop(weak(ui, RISES)),
                    // Motors can hurt a hand.
                    Mode::Active if !model.is_simulated() => {
                        let text = strong(ui, mode.sentence());
                        wrapped(ui, text);
                    }
                    _ => drop(weak(ui, mode.sentence())),
                }
            }
            if let Some([text, why]) = left_faults(model) {
                // A line that is cut says nothing.
                let full = format!("{text}. {why}");
                let in_full = height(ui, &full) <= room - ui.min_rect().height();
                coloured(ui, palette.warn, if in_full { full } else { text }).on_hover_text(why);
            }
            return warned(ui, (warnings, room), palette, cured.as_deref());
        }
        (Headline::NoState, _) => {
            weak(ui, if model.is_online() { "Waiting for the first state." } else { "Not connected." });
        }
    }
    false
}

/// Says what to do about a rig that may push although the user has stopped it, and why.
fn not_stopped(ui: &mut Ui, model: &Model) {
    let Some(stop) = model.unconfirmed_stop() else { return };
    let order = |ui: &mut Ui, text: &str| {
        let text = RichText::new(text).font(bold(ui, ORDER)).color(Color32::WHITE);
        wrapped(ui, text);
    };
    let back = model.mode().filter(|_| model.pushes_again(stop));
    if let Some(mode) = back {
        let mode = Headline::Mode(mode).text();
        order(ui, &format!("Connected again: the rig is {mode} and pushes. Press STOP."));
    }
    let cut = ["Cut the motors' power.", "If it pushes on, cut the motors' power."];
    order(ui, if model.is_of_simulated(stop) { NO_MOTORS } else { cut[usize::from(back.is_some())] });
    let way_out = stop.way_out(&model.server, has_keys(ui));
    wrapped(ui, format!("{} s since STOP. {way_out}", stop.since().as_secs()));
    // The bar names the address of this panel's own server.
    let here = stop.server == model.server;
    let whose = if here { "Why".to_owned() } else { format!("At {}", stop.server) };
    wrapped(ui, format!("{whose}: {}.", stop.why()));
    if !here && let Some(mode) = model.mode().filter(|_| model.is_live()) {
        wrapped(ui, format!("The mode of the rig at {} is {mode}.", model.server));
    }
    if model.silent_for().is_some() {
        last(ui, model);
    }
}

/// Draws the first warning about the scene: the list below the sliders can be out of sight when the
/// user enables or recovers. Without room for all of it, only what it warns of, and nothing if the
/// box says what to do already (`cured`). Returns whether it stands there in full.
fn warned(ui: &mut Ui, (warnings, room): (&[Warning], f32), palette: Palette, cured: Option<&str>) -> bool {
    let Some(first) = warnings.first() else { return false };
    let cure = first.remedy_sentence();
    let color = if cure.is_some() { palette.text } else { palette.warn };
    if let Some(cure) = cure.as_deref().filter(|_| cured.is_none()) {
        remedy(ui, palette, cure);
    }
    let words = |text: String| match warnings.len() {
        1 => format!("Warning: {text}"),
        many => format!("The first of {many} warnings: {text}"),
    };
    let full = words(first.reason());
    let in_full = height(ui, &full) <= room - ui.min_rect().height();
    if in_full || cured.is_none() {
        let text = if in_full { full } else { words(first.brief()) };
        coloured(ui, color, text).on_hover_text(first.to_string());
    }
    in_full && (cured.is_none() || cured == cure.as_deref())
}

/// Returns what to do about a shaking of `effect`: what the warning of it says, or another one of
/// the scene, so that there is one instruction.
fn cure(warnings: &[Warning], effect: Option<&str>) -> String {
    let shaky = || warnings.iter().filter(|warning| warning.shakes);
    let mut first = shaky().filter(|warning| warning.effect.as_deref() == effect).chain(shaky());
    first.find_map(Warning::remedy_sentence).unwrap_or_else(|| LESS.to_owned())
}

/// Draws what to do about a warning. It stands before the warning.
pub(in crate::view) fn remedy(ui: &mut Ui, palette: Palette, text: &str) {
    let text = strong(ui, text).color(palette.warn);
    wrapped(ui, text);
}

/// Returns the text of what to do, in the size for this window.
pub(super) fn strong(ui: &Ui, text: &str) -> RichText {
    RichText::new(text).font(bold(ui, if is_low(ui) { SMALL } else { LARGE }))
}

/// Says which effect shook the sphere.
fn shaken(shaking: &ShakingEvent) -> String {
    let who = shaking.effect.as_deref().unwrap_or("the scene");
    format!("Torque lowered: {who} shook the sphere at {:.0} Hz.", shaking.frequency)
}

/// Draws who has stopped the rig, and which button goes on.
fn stopped(ui: &mut Ui, model: &Model, palette: Palette, who: &str) {
    still_turns(ui, model);
    let powered = if model.is_simulated() { "" } else { " The motors still have power." };
    wrapped(ui, format!("{who}{powered}"));
    refused(ui, model, palette);
    wrapped(ui, recover::way_on(model));
}

/// Says that the user's last request to enable or reset was refused, and why, if it was.
fn refused(ui: &mut Ui, model: &Model, palette: Palette) {
    if let Some(refusal) = &model.refusal {
        coloured(ui, palette.warn, refusal.in_words());
    }
}

/// Says that the sphere turns without torque, if it does.
fn still_turns(ui: &mut Ui, model: &Model) {
    let speed = model.state.as_ref().map_or(0.0, |state| DVec3::from(state.omega).length());
    if speed > TURNS {
        let text = strong(ui, &format!("The sphere still turns: {speed:.2} rad/s"));
        wrapped(ui, text);
    }
}

fn no_contact(ui: &mut Ui, model: &Model) {
    last(ui, model);
    let simulated = model.is_online() && model.is_simulated();
    if !simulated {
        let advice = RichText::new("If in doubt, cut the motors' power.");
        wrapped(ui, advice.font(bold(ui, MOOD)));
    }
    if !model.is_online() {
        ui.label("Not connected.");
    }
    let rig = if simulated { NO_MOTORS } else { "" };
    wrapped(ui, format!("What the rig does now is not known. {rig}").trim_end());
}

/// Returns a time in seconds, not rounded up: what is said is not older than what is meant.
pub(super) fn tenths(time: Duration) -> f64 {
    (10.0 * time.as_secs_f64()).floor() / 10.0
}

/// Says what the rig did when it was heard last.
fn last(ui: &mut Ui, model: &Model) {
    if let Some(last) = model.history.newest() {
        let mode = Headline::Mode(last.mode).text();
        let ago = model.heard_before().map_or(String::new(), |heard| format!(" {} s ago", heard.as_secs()));
        ui.label(format!("Last heard{ago}: {mode}, {:.2} N m", DVec3::from(last.torque).length()));
    }
}

fn fault(ui: &mut Ui, model: &Model, state: &StateEvent, room: f32, palette: Palette) {
    let Some(fault) = state.fault else { return };
    let (what, _) = fault.words();
    let told = model.fault.as_ref();
    let by = told
        .and_then(|told| told.by.as_ref())
        .map(|by| format!(" It was {}.", model.who(by)))
        .unwrap_or_default();
    coloured(ui, palette.warn, format!("No torque. {what}{by}"));
    match too_fast(model) {
        Some(text) => drop(coloured(ui, palette.warn, text)),
        None => refused(ui, model, palette),
    }
    let take = recover::must_press(model).map(|take| format!("{take}, ")).unwrap_or_default();
    let go_on = format!("To go on: {take}Reset, then Enable.");
    let cure = cure_of(fault, told);
    // Of a simulated rig, nothing has to be mended before, but it must rest. Advice stands apart.
    let is_ready = model.is_simulated() && too_fast(model).is_none();
    let (first, advice) = if is_ready { ("", cure.as_str()) } else { first_sentence(&cure) };
    let way = wrapped(ui, format!("{first} {go_on}").trim_start());
    // A line that is cut says nothing. The list of messages has what was found too.
    let fits = |ui: &Ui, text: &str| height(ui, text) <= room - ui.min_rect().height();
    if !advice.is_empty() && fits(ui, advice) {
        weak(ui, advice);
    } else if !advice.is_empty() {
        way.on_hover_text(advice);
    }
    // What was found comes last, because it can be long.
    let found = told.and_then(|told| Some(format!("{fault}: {}", told.found.as_deref()?).replace('`', "")));
    let text = found.as_deref().unwrap_or(fault.as_str());
    if fits(ui, text) {
        weak(ui, text);
    }
}

/// Returns the first sentence of a text, and the rest.
fn first_sentence(text: &str) -> (&str, &str) {
    text.find(". ").map_or((text, ""), |end| (&text[..=end], &text[end + 2..]))
}

/// Tells the faults of the last moments that the rig has left, which the plots mark too, and what
/// the last one was.
pub(super) fn left_faults(model: &Model) -> Option<[String; 2]> {
    let now = model.state.as_ref()?.t;
    let known = |mark: &Mark| Some((mark.t, Fault::ALL.into_iter().find(|it| it.as_str() == mark.text)?));
    let faults: Vec<_> = model.marks.between(now - LEFT_S, now).filter_map(known).collect();
    let (t, fault) = faults.last()?;
    let many = match faults.len() {
        1 => "Fault".to_owned(),
        many => format!("{many} faults in {LEFT_S} s, the last"),
    };
    Some([format!("{many} {:.0} s ago: {fault}", (now - t).floor()), fault.words().0.to_owned()])
}

/// Returns the height of a text that takes several lines.
fn height(ui: &Ui, text: &str) -> f32 {
    let wrap = Some(egui::TextWrapMode::Wrap);
    egui::WidgetText::from(text).into_galley(ui, wrap, ui.available_width(), TextStyle::Body).size().y
        + ui.spacing().item_spacing.y
}

/// Returns what to do about a fault. The server knows more of this rig than the usual words.
fn cure_of(fault: Fault, told: Option<&FaultEvent>) -> String {
    let (_, usual) = fault.words();
    told.and_then(|told| told.remedy.as_deref()).unwrap_or(usual).replace('`', "")
}
