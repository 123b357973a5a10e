//! A recording in the middle of the window: which moment is shown, and the slider that chooses it.

use std::sync::Arc;

use eframe::egui::{self, Button, Rect, RichText, Role, Sense, Slider, Stroke, Ui, WidgetInfo, pos2, vec2};
use glam::DVec3;
use hbot_api::StateEvent;

use super::theme::{Palette, coloured, named, weak};
use crate::model::{Film, What, thinned};

/// Height of the curve of the torque over the whole recording, points.
const STRIP: f32 = 44.0;

/// Draws the name of the recording, its moment, and the slider. Returns whether the user closes it.
pub(crate) fn show(ui: &mut Ui, film: &mut Film) -> bool {
    let palette = Palette::of(ui);
    ui.add_space(2.0);
    let closed = ui
        .horizontal(|ui| {
            let text = if film.playing { "Hold" } else { "Play" };
            let [from, to] = film.span();
            if named(ui.add(Button::new(text).min_size(vec2(54.0, 0.0))), "Play the recording").clicked() {
                film.playing = !film.playing;
                if film.playing && film.t() >= to {
                    film.seek(from);
                }
            }
            let close = named(ui.button("Close"), "Close the recording").clicked();
            ui.add(egui::Label::new(RichText::new(film.name()).strong()).truncate());
            close
        })
        .inner;
    if film.playing {
        play(ui, film);
    }
    if let Some(state) = film.model.state.clone() {
        ui.horizontal_wrapped(|ui| moment(ui, &state, palette));
    }
    timeline(ui, film, palette);
    if let Some(text) = flaws(film) {
        weak(ui, text);
    }
    weak(ui, "The column at the left shows the rig as it is now.");
    closed
}

/// Goes on by the time since the last frame.
fn play(ui: &Ui, film: &mut Film) {
    let [_, to] = film.span();
    // A window that was not drawn for a while goes on where it was.
    let step = ui.input(|input| f64::from(input.stable_dt.min(0.1)));
    let wanted = film.t() + step;
    let before = film.t();
    film.seek(wanted);
    if film.t() == before {
        // The next state is further away than one frame.
        film.step();
    }
    film.playing = film.t() < to;
    ui.ctx().request_repaint();
}

fn moment(ui: &mut Ui, state: &StateEvent, palette: Palette) {
    let [t1, t2, t3] = state.torque;
    ui.label(RichText::new(format!("{:.3} s", state.t)).strong().monospace());
    ui.label(RichText::new(state.mode.as_str().to_uppercase()).strong().color(palette.mode(state.mode)));
    if let Some(fault) = state.fault {
        coloured(ui, palette.warn, fault.words().0);
    }
    let length = DVec3::from(state.torque).length();
    let text = format!("torque {length:.3} N m ({t1:.3}, {t2:.3}, {t3:.3}), tick {}", state.tick);
    ui.label(RichText::new(text).weak());
}

/// Draws the torque over the whole recording with its faults and scenes, and below it the slider.
fn timeline(ui: &mut Ui, film: &mut Film, palette: Palette) {
    let width = ui.available_width();
    let (strip, response) = ui.allocate_exact_size(vec2(width, STRIP), Sense::click_and_drag());
    // The handle of the slider stays its radius away from the ends, by egui's own geometry.
    let inset = ui.spacing().interact_size.y / 2.5;
    let room = strip.x_range().shrink(inset);
    let [from, to] = film.span();
    let span = (to - from).max(1e-9);
    if let Some(at) = response.interact_pointer_pos() {
        film.playing = false;
        film.seek(from + span * f64::from((at.x - room.min) / room.span()));
    }
    let points = curve(film, strip, room.span() as usize);
    let x = |t: f64| room.min + room.span() * ((t - from) / span) as f32;
    let painter = ui.painter();
    painter.rect_filled(strip, 3.0, ui.visuals().extreme_bg_color);
    for mark in &film.recorded.marks {
        let color = if mark.what == What::Fault { palette.warn } else { palette.ghost };
        painter.vline(x(mark.t), strip.y_range(), Stroke::new(1.0, color));
    }
    let line = points.into_iter().map(|[t, y]| pos2(x(t), y as f32)).collect();
    painter.add(egui::Shape::line(line, Stroke::new(1.2, palette.torque)));
    painter.vline(x(film.t()), strip.y_range(), Stroke::new(2.0, ui.visuals().strong_text_color()));
    response.widget_info(|| WidgetInfo::labeled(Role::Image, true, "Torque over the recording"));
    let mut t = film.t();
    ui.spacing_mut().slider_width = width;
    let slider = named(ui.add(Slider::new(&mut t, from..=to).show_value(false)), "Time in the recording");
    if slider.changed() {
        film.playing = false;
        film.seek(t);
    }
}

/// Returns the curve of the torque's length: times, s, and places on the screen.
fn curve(film: &Film, strip: Rect, columns: usize) -> Vec<[f64; 2]> {
    let states = &film.recorded.states;
    let length = |state: &Arc<StateEvent>| DVec3::from(state.torque).length();
    let limit = film.recorded.info.limits.torque;
    let most = states.iter().map(length).fold(0.1 * limit, f64::max).max(1e-6);
    let height = f64::from(strip.height()) - 4.0;
    let base = f64::from(strip.bottom()) - 2.0;
    let points = states.iter().map(|state| [state.t, base - height * length(state) / most]);
    thinned(points, columns)
}

/// Says what of the recording is not shown, if anything.
fn flaws(film: &Film) -> Option<String> {
    let every = film.recorded.every;
    let thin = (every > 1).then(|| format!("It is long: one of {every} states is shown."));
    let text = "A part of the file is damaged or missing.";
    let damaged = film.recorded.damaged.then(|| text.to_owned());
    let all: Vec<_> = thin.into_iter().chain(damaged).collect();
    (!all.is_empty()).then(|| all.join(" "))
}
