//! The box that says what the rig does now, and what the user must know about it.

use std::time::Duration;

use eframe::egui::{self, Color32, FontId, RichText, ScrollArea, TextStyle, Ui, vec2};
use glam::DVec3;
use hbot_api::{Fault, FaultEvent, Mode, ShakingEvent, StateEvent};
use hbot_config::advice::Warning;

use super::meters::{self, percent};
use super::recover;
use super::stop::has_keys;
use super::theme::{Palette, STOP, bold, coloured, sized, stripes, weak, wrapped};
use crate::model::{Headline, Model, Refusal, has_torque};
use crate::net::{Intent, Lease};

/// Height of the text in the box with the mode, in a low and in a tall window, points.
const STATUS: [f32; 2] = [114.0, 180.0];
/// Height of a window above which this text has more room, up to `MORE`, points.
const USUAL: f32 = 774.0;
const MORE: f32 = 46.0;
/// Size of the word for the state, and of what it says beside the mode, points.
const HEADLINE: f32 = 28.0;
const MOOD: f32 = 16.0;
/// Size of the time without a word, and of the order of a stop that is not confirmed, points.
const SINCE: f32 = 24.0;
const ORDER: f32 = 20.0;
/// The ground of the box without torque, dark in both themes: a stop is calm.
const CALM: Color32 = Color32::from_rgb(0x34, 0x3b, 0x44);
/// What replaces the advice to cut the motors' power.
const NO_MOTORS: &str = "Simulated: nothing real moves.";
/// Size of the text in the box of a low window, points.
const SMALL: f32 = 12.0;
/// Size of what to do first, in the box, points.
const LARGE: f32 = 15.0;
/// A speed is judged by its largest value in this time, so that what is said does not flicker, s.
const RECENT_S: f64 = 0.5;
/// Speed above which the box says that the sphere still turns, rad/s.
pub(super) const TURNS: f64 = 0.1;
/// Speed above which a sphere without torque must rest before `Recover`, rad/s, as on the page.
const SPINS: f64 = 2.0;
/// What the headline of a sphere that shakes says beside the mode.
const SHAKES: &str = ": shakes";
/// What that of a scene that may shake says.
const WARNING: &str = ": warning";
/// What is said while the torque rises.
const RISES: &str = "The torque rises: the sphere will push.";
/// A part of the torque below this is not told in the box when the limits cut it.
const LEAST_CUT: f64 = 0.01;
/// Height of the bars in a low and in a tall window, points. A fault takes their place, so that its
/// explanation and remedy can be read without scrolling; in a low window, all that is wrong does.
const BARS: [f32; 2] = [70.0, 108.0];
/// A window of at least this height is tall, points.
pub(super) const TALL: f32 = 720.0;
/// What to do about torque that the limits cut.
const STRAINED: &str = "Lower the stiffness, or push less.";
/// What is said of a sphere with torque that nobody commands.
const FREE: &str = "Nobody commands. The sphere pushes on; STOP and Disable work.";
/// What to do about a sphere that shakes, if its scene has no remedy.
const LESS: &str = "Lower the stiffness or raise the damping.";

/// Draws the buttons that enable, disable and reset the rig, what the rig does now, and how near it
/// is to its limits. `warnings` are those about the running scene. Returns whether the first of
/// them stands there in full.
pub(crate) fn show(ui: &mut Ui, model: &Model, warnings: &[Warning], intents: &mut Vec<Intent>) -> bool {
    recover::orders(ui, model, intents);
    recover::show(ui, model, intents);
    let palette = Palette::of(ui);
    let size = usize::from(!is_low(ui));
    let height = STATUS[size] + (ui.ctx().content_rect().height() - USUAL).clamp(0.0, MORE);
    if is_long(ui, model) {
        return status(ui, model, warnings, height + BARS[size]);
    }
    let in_full = status(ui, model, warnings, height);
    ui.add_enabled_ui(model.is_certain(), |ui| meters::show(ui, model, palette));
    in_full
}

/// Returns whether the box takes the place of the bars.
fn is_long(ui: &Ui, model: &Model) -> bool {
    match model.headline() {
        Headline::Mode(Mode::Fault) => true,
        Headline::Mode(Mode::Estop) => is_low(ui) || model.fault_before.is_some(),
        Headline::NotStopped | Headline::NoContact => is_low(ui),
        _ => false,
    }
}

/// Draws what the rig does now, and what the user must know about it, in a box whose text is
/// `height` points high. So the sliders below it stay in their place; a longer text scrolls.
/// Returns whether the first warning stands there in full. What differs in meaning differs in sign,
/// fill and edge too, not in colour alone.
fn status(ui: &mut Ui, model: &Model, warnings: &[Warning], height: f32) -> bool {
    let headline = model.headline();
    let palette = Palette::of(ui);
    // What is old stands in grey.
    let old = model.quiet_for().filter(|_| matches!(headline, Headline::Mode(_)));
    let mood = mood(model, headline, warnings, palette).filter(|_| old.is_none());
    let is_fault = headline == Headline::Mode(Mode::Fault);
    let (fill, edge) = match headline {
        _ if old.is_some() => (Color32::TRANSPARENT, palette.weak),
        Headline::Mode(mode) if is_fault || has_torque(mode) => {
            let color = mood.map_or(palette.headline(headline), |(_, color)| color);
            let is_loud = is_fault || mood.is_some_and(|(text, _)| text == SHAKES);
            (if is_loud { color.gamma_multiply(0.12) } else { Color32::TRANSPARENT }, color)
        }
        Headline::Mode(_) => (CALM, CALM),
        // Drawn below.
        Headline::NotStopped | Headline::NoContact | Headline::NoState => {
            (Color32::TRANSPARENT, Color32::TRANSPARENT)
        }
    };
    // Torque that is not all there has a dashed edge, and so has what is not known.
    let (edge, dashes) = match headline {
        Headline::Mode(Mode::Enabling) => (Color32::TRANSPARENT, edge),
        _ => (edge, palette.text),
    };
    let dark = headline == Headline::NotStopped || fill == CALM;
    // The edge is as wide in all states, so that nothing below the box moves.
    let frame = egui::Frame::group(ui.style()).inner_margin(egui::Margin::symmetric(10, 4));
    let ground = ui.painter().add(egui::Shape::Noop);
    let drawn = frame.fill(fill).stroke((2.0, edge)).show(ui, |ui| {
        if dark {
            *ui.visuals_mut() = ui.ctx().style_of(egui::Theme::Dark).visuals.clone();
        }
        let palette = Palette::of(ui);
        ui.set_width(ui.available_width());
        ui.set_height(height - 2.0);
        ui.spacing_mut().item_spacing.y = 3.0;
        let color = mood.map_or(palette.headline(headline), |(_, color)| color);
        let color = if old.is_some() { palette.weak } else { color };
        head(ui, headline, mood.map_or("", |(text, _)| text), color);
        let is_long = matches!(headline, Headline::Mode(_)) && is_long(ui, model);
        let is_certain = model.is_certain() || !matches!(headline, Headline::Mode(_));
        ui.add_enabled_ui(is_certain, |ui| figures(ui, model, headline, is_long));
        if is_low(ui) {
            ui.style_mut().override_font_id = Some(FontId::proportional(SMALL));
        }
        if let Some(text) = strain(model, headline) {
            // What shakes, or may, has a remedy of its own.
            if warnings.is_empty() && model.shaking.is_none() {
                let remedy = strong(ui, STRAINED).color(palette.torque);
                wrapped(ui, remedy);
            }
            coloured(ui, palette.torque, text);
        }
        let area = ScrollArea::vertical().id_salt("status").auto_shrink(false).min_scrolled_height(0.0);
        let room = ui.available_height();
        let area = area.max_height(room).show(ui, |ui| {
            if let Some(quiet) = old {
                coloured(ui, palette.warn, format!("last heard {:.1} s ago", tenths(quiet)));
                ui.disable();
            }
            details(ui, model, (warnings, room), headline, palette)
        });
        area.inner
    });
    let rect = drawn.response.rect;
    let painter = ui.painter().with_clip_rect(rect.intersect(ui.clip_rect()));
    match headline {
        Headline::NoContact => {
            let stroke = (3.0, Palette::of(ui).warn);
            painter.rect_stroke(rect.shrink(1.0), 2.0, stroke, egui::StrokeKind::Inside);
        }
        // Red is for the button STOP: this box cannot be pressed.
        Headline::NotStopped => {
            let simulated = model.unconfirmed_stop().is_some_and(|stop| model.is_of_simulated(stop));
            let color = if simulated { palette.weak } else { STOP };
            let mut shapes = stripes(rect, color, 6.0, Color32::WHITE);
            shapes.push(egui::Shape::rect_filled(rect.shrink(6.0), 0.0, Color32::BLACK));
            painter.set(ground, shapes);
        }
        Headline::NoState | Headline::Mode(Mode::Enabling) => {
            let rect = rect.shrink(1.0);
            let [a, b] = [rect.right_top(), rect.left_bottom()];
            let closed = [rect.min, a, rect.max, b, rect.min];
            painter.extend(egui::Shape::dashed_line(&closed, (2.0, dashes), 8.0, 6.0));
        }
        Headline::Mode(_) => {}
    }
    drawn.inner
}

/// Returns what the headline says beside the mode, and its colour, as the page does.
fn mood(
    model: &Model,
    headline: Headline,
    warnings: &[Warning],
    palette: Palette,
) -> Option<(&'static str, Color32)> {
    match headline {
        Headline::Mode(mode) if !has_torque(mode) => None,
        Headline::Mode(_) if model.shaking.is_some() => Some((SHAKES, palette.warn)),
        Headline::Mode(_) if warnings.iter().any(|it| it.shakes) => Some((WARNING, palette.warn)),
        // These are no warnings: nothing has to be done about them.
        Headline::Mode(_) if model.is_at_limit() => Some((": at limit", palette.torque)),
        Headline::Mode(_) if cut(model, headline).is_some() => Some((": reduced", palette.torque)),
        _ => None,
    }
}

/// Draws the sign and the words of the headline. Those of a fault, and of a sphere that shakes,
/// stand on a band.
fn head(ui: &mut Ui, headline: Headline, mood: &str, color: Color32) {
    let is_loud = headline == Headline::Mode(Mode::Fault) || mood == SHAKES;
    let band = is_loud.then(|| ui.painter().add(egui::Shape::Noop));
    let sign = match mood {
        SHAKES => "\u{2248}",
        WARNING => "\u{25c6}",
        _ => headline.sign(),
    };
    let ink = if band.is_some() { ui.visuals().panel_fill } else { color };
    let row = ui.horizontal(|ui| {
        // The cross is bold, as the word beside it.
        let is_cross = headline == Headline::NotStopped;
        let font = if is_cross { bold(ui, HEADLINE) } else { FontId::monospace(HEADLINE) };
        ui.label(RichText::new(sign).font(font).color(ink));
        // A long word is smaller, because the sliders would move.
        let words = |k: f32| {
            sized(&[(&headline.text(), bold(ui, k * HEADLINE), ink), (mood, bold(ui, k * MOOD), ink)])
        };
        let width = ui.painter().layout_job(words(1.0)).size().x;
        ui.label(words((ui.available_width() / width).min(1.0)));
    });
    if let Some(band) = band {
        let right = ui.max_rect().right();
        let rect = row.response.rect.with_max_x(right).expand2(vec2(10.0, 3.0));
        ui.painter().set(band, egui::Shape::rect_filled(rect, 4.0, color));
    }
}

/// Draws the one number of the state in large figures: the torque, or the time without a word.
/// Where the box takes the place of the bars, the speed stands beside the torque: it tells when a
/// reset is possible.
fn figures(ui: &mut Ui, model: &Model, headline: Headline, is_long: bool) {
    let palette = Palette::of(ui);
    // The word is as large as its number, which stands in the place of the torque.
    let since = |ui: &mut Ui, text: String| {
        let size = if is_low(ui) { LARGE } else { SINCE };
        ui.label(RichText::new(text).size(size).color(palette.text));
    };
    match (headline, &model.state) {
        (Headline::Mode(_), Some(state)) => {
            // The speed of the sentence below.
            let speed = DVec3::from(state.omega).length().max(model.history.fastest(RECENT_S));
            meters::show_torque(ui, model, palette, is_long.then_some(speed));
        }
        (Headline::NoContact, _) if let Some(heard) = model.heard_before() => {
            since(ui, format!("silent {:.1} s", tenths(heard)));
        }
        _ => {}
    }
}

/// Returns the part of the torque that the limits cut, if it is worth telling.
fn cut(model: &Model, headline: Headline) -> Option<f64> {
    let state = model.state.as_ref().filter(|_| headline == Headline::Mode(Mode::Active))?;
    Some(1.0 - state.scale).filter(|cut| *cut >= LEAST_CUT)
}

/// Says which limit keeps the scene from being felt as it is meant, if one does.
fn strain(model: &Model, headline: Headline) -> Option<String> {
    match (cut(model, headline), &model.state) {
        (Some(cut), Some(state)) => Some(format!("{} {} of the torque", model.limit_of(state), percent(cut))),
        _ if model.is_at_limit() && matches!(headline, Headline::Mode(mode) if has_torque(mode)) => {
            Some("The torque is at the rig's limit".to_owned())
        }
        _ => None,
    }
}

/// Returns whether the sphere turns so fast without torque that torque must wait.
pub(super) fn spins(model: &Model) -> bool {
    let off = model.mode().is_some_and(|mode| !has_torque(mode));
    off && model.is_certain() && model.history.fastest(RECENT_S) > SPINS
}

/// Draws what the user must know in the room of this height, and scrolls if it is more. Returns
/// whether the first warning stands there in full.
fn details(
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
            fault(ui, model, state, room, palette);
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
            turns(ui, model);
            coloured(ui, palette.warn, text);
        }
        (Headline::Mode(mode), _) => {
            if mode == Mode::Idle {
                turns(ui, model);
            }
            let cured = model.shaking.as_ref().map(|shaking| {
                let cure = cure(warnings, shaking.effect.as_deref());
                remedy(ui, palette, &cure);
                coloured(ui, palette.warn, shaken(shaking));
                cure
            });
            if model.lease == Lease::Free && has_torque(mode) {
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
pub(super) fn remedy(ui: &mut Ui, palette: Palette, text: &str) {
    let text = strong(ui, text).color(palette.warn);
    wrapped(ui, text);
}

/// Returns the text of what to do, in the size for this window.
fn strong(ui: &Ui, text: &str) -> RichText {
    RichText::new(text).font(bold(ui, if is_low(ui) { SMALL } else { LARGE }))
}

/// Says which effect shook the sphere.
fn shaken(shaking: &ShakingEvent) -> String {
    let who = shaking.effect.as_deref().unwrap_or("the scene");
    format!("Torque lowered: {who} shook the sphere at {:.0} Hz.", shaking.frequency)
}

/// Draws who has stopped the rig, and which button goes on.
fn stopped(ui: &mut Ui, model: &Model, palette: Palette, who: &str) {
    turns(ui, model);
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
fn turns(ui: &mut Ui, model: &Model) {
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
fn tenths(time: Duration) -> f64 {
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
    // Of a simulated rig, nothing has to be mended before, but it must rest.
    let is_ready = model.is_simulated() && too_fast(model).is_none();
    wrapped(ui, if is_ready { format!("{go_on} {cure}") } else { format!("{cure} {go_on}") });
    // What was found comes last, because it can be long.
    let found = told.and_then(|told| Some(format!("{fault}: {}", told.found.as_deref()?).replace('`', "")));
    // A line that is cut says nothing. The list of messages has it too.
    let text = found.as_deref().unwrap_or(fault.as_str());
    if height(ui, text) <= room - ui.min_rect().height() {
        weak(ui, text);
    }
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

/// Says that the sphere must slow down before a reset, if it is or just was as fast as in the fault
/// `overspeed`.
pub(super) fn too_fast(model: &Model) -> Option<String> {
    let (speed, limit) = (model.history.fastest(RECENT_S), model.info.limits.speed);
    let fault = model.state.as_ref().and_then(|state| state.fault);
    let fast = fault == Some(Fault::Overspeed) && limit > 0.0 && speed > limit;
    fast.then(|| format!("Too fast for Reset: {speed:.2} rad/s."))
}

/// Returns whether the window is so low that the text in it is smaller.
pub(super) fn is_low(ui: &Ui) -> bool {
    ui.ctx().content_rect().height() < TALL
}
