//! The box that says what the rig does now, and what the user must know about it.

mod details;

use eframe::egui::{self, Color32, FontId, RichText, ScrollArea, Ui, vec2};
use glam::DVec3;
use hbot_api::{Fault, Mode};
use hbot_config::advice::Warning;

use super::meters::{self, percent};
use super::recover;
use super::theme::{Palette, STOP, bold, coloured, sized, stripes, wrapped};
use crate::model::{Headline, Model, has_torque};
use crate::net::{Intent, Lease};
pub(super) use details::remedy;
use details::{details, left_faults, strong, tenths};

/// Height of the text in the box with the mode, in a low and in a tall window, points.
const STATUS: [f32; 2] = [114.0, 180.0];
/// Height of a window above which this text has more room, up to `MORE`, points.
const USUAL: f32 = 774.0;
const MORE: f32 = 46.0;
/// Size of the word for the state, and of what it says beside the mode, points.
const HEADLINE: f32 = 28.0;
const MOOD: f32 = 16.0;
/// Size of the time without a word, points.
const SINCE: f32 = 24.0;
/// The ground of the box without torque, dark in both themes: a stop is calm.
const CALM: Color32 = Color32::from_rgb(0x34, 0x3b, 0x44);
/// Size of the text in the box of a low window, points.
const SMALL: f32 = 13.0;
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
/// What that of a rig that has just left a fault says.
const LEFT: &str = ": after a fault";
/// What that of a scene that may shake says.
const WARNING: &str = ": warning";
/// A part of the torque below this is not told in the box when the limits cut it.
const LEAST_CUT: f64 = 0.01;
/// Height of the bars in a low and in a tall window, points. A fault takes their place, so that its
/// explanation and remedy can be read without scrolling; in a low window, all that is wrong does.
const BARS: [f32; 2] = [70.0, 109.0];
/// A window of at least this height is tall, points.
pub(super) const TALL: f32 = 720.0;
/// What to do about torque that the limits cut.
const STRAINED: &str = "Lower the stiffness, or push less.";

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
            // A shaking has its own remedy, and that nobody commands is said first.
            if warnings.is_empty() && model.shaking.is_none() && model.lease != Lease::Free {
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

/// Returns what the headline says beside the mode, and its colour.
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
        Headline::Mode(_) if left_faults(model).is_some() => Some((LEFT, palette.warn)),
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

/// Returns whether the sphere turns, or just did.
pub(super) fn turns(model: &Model) -> bool {
    model.history.fastest(RECENT_S) > TURNS
}

/// Returns whether the sphere turns so fast without torque that torque must wait.
pub(super) fn spins(model: &Model) -> bool {
    let off = model.mode().is_some_and(|mode| !has_torque(mode));
    off && model.is_certain() && model.history.fastest(RECENT_S) > SPINS
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
