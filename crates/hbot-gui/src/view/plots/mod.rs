//! Plots of torque, angle, speed, slip and energy against time, and of torque against deflection
//! with the fitted stiffness.

mod axes;
mod deflection;
mod time;

use std::cell::Cell;

pub(super) use axes::plain;
use eframe::egui::{self, Align, ComboBox, Layout, Rect, Ui, UiBuilder, vec2};
use glam::DQuat;

use super::theme::{named, press};
use super::{Act, Desk};
use crate::model::sample::quaternion;
use crate::model::{History, Link, Model, SPAN_S};
use crate::net::Intent;

/// Plots that are narrower than this have only some of their controls beside the names of the
/// curves, points.
const NARROW: f32 = 400.0;
/// Plots of at least this width have room for words instead of short units, points.
const WIDE: f32 = 600.0;

/// The quantity that a plot shows, such as the torque.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Which {
    #[default]
    Torque,
    Angle,
    Speed,
    Slip,
    Energy,
    Stiffness,
}

impl Which {
    const ALL: [(Self, &str); 6] = [
        (Self::Torque, "Torque"),
        (Self::Angle, "Angle"),
        (Self::Speed, "Speed"),
        (Self::Slip, "Slip"),
        (Self::Energy, "Energy"),
        (Self::Stiffness, "Torque / deflection"),
    ];

    /// Returns whether the plot measures deflections, from an orientation that the user can choose.
    fn is_from_zero(self) -> bool {
        matches!(self, Self::Angle | Self::Stiffness)
    }
}

/// The settings of the plots that the user can change.
#[derive(Debug)]
pub(crate) struct PlotDesk {
    which: Which,
    /// Length of the time that the plots show, s.
    window: f64,
    /// The samples that are shown while the user has paused the plots.
    paused: Option<Box<History>>,
    /// Orientation from which the sphere's deflection is measured, if the user has chosen one.
    zero: Option<DQuat>,
    /// How far the vertical axis of each plot reaches below and above 0, and last the horizontal
    /// one of deflections.
    scale: Cell<[[f64; 2]; 7]>,
}

impl Default for PlotDesk {
    fn default() -> Self {
        Self { which: Which::Torque, window: 10.0, paused: None, zero: None, scale: Cell::default() }
    }
}

impl PlotDesk {
    pub(crate) fn go_on(&mut self) {
        self.paused = None;
    }
}

pub(crate) fn show(ui: &mut Ui, model: &Model, desk: &mut Desk, acts: &mut Vec<Act>) {
    let plots = &mut desk.plots;
    let width = ui.available_width();
    // The names of the curves leave room beside them, but the text of a fit does not.
    let (in_row, beside) = match plots.which {
        Which::Stiffness => TOOLS.split_at(TOOLS.len()),
        _ if width < NARROW => TOOLS.split_at(2),
        _ => TOOLS.split_at(0),
    };
    ui.horizontal_wrapped(|ui| {
        for (which, name) in Which::ALL {
            ui.selectable_value(&mut plots.which, which, name);
        }
        for tool in in_row {
            tool(ui, model, plots, acts);
        }
        if plots.which.is_from_zero() {
            zero_control(ui, model, plots);
        }
    });
    let row = Rect::from_min_size(ui.cursor().min, vec2(width, ui.spacing().interact_size.y));
    let right_to_left = UiBuilder::new().max_rect(row).layout(Layout::right_to_left(Align::Min));
    let mut right = ui.new_child(right_to_left);
    for tool in beside.iter().rev() {
        tool(&mut right, model, plots, acts);
    }
    super::faded_unless_live(ui, model);
    let plots = &desk.plots;
    let history = plots.paused.as_deref().unwrap_or(&model.history);
    match plots.which {
        Which::Stiffness => deflection::show(ui, model, history, plots),
        _ => drop(time::show(ui, model, history, plots, right.min_rect().size())),
    }
}
type Tool = fn(&mut Ui, &Model, &mut PlotDesk, &mut Vec<Act>);

/// The controls that all plots have, from left to right.
const TOOLS: [Tool; 4] = [time_shown, pause, export, samples_per_s];

fn time_shown(ui: &mut Ui, _: &Model, plots: &mut PlotDesk, _: &mut Vec<Act>) {
    let window = ComboBox::from_id_salt("window").selected_text(format!("{} s", plots.window)).width(52.0);
    let response = window.show_ui(ui, |ui| {
        for seconds in [2.0, 5.0, 10.0, SPAN_S] {
            ui.selectable_value(&mut plots.window, seconds, format!("{seconds} s"));
        }
    });
    named(response.response, "Time shown");
}

fn pause(ui: &mut Ui, model: &Model, plots: &mut PlotDesk, _: &mut Vec<Act>) {
    // The slider of a recording pauses its plots.
    if matches!(model.link, Link::Recording) {
        return;
    }
    let paused = plots.paused.is_some();
    if ui.button(if paused { "Go on" } else { "Pause" }).clicked() {
        plots.paused = if paused { None } else { Some(Box::new(model.history.clone())) };
    }
}

fn export(ui: &mut Ui, model: &Model, plots: &mut PlotDesk, acts: &mut Vec<Act>) {
    let hint = "writes the last 30 s to a file in the folder the panel runs in";
    if ui.button("Export CSV").on_hover_text(hint).clicked() {
        let history = plots.paused.as_deref().unwrap_or(&model.history);
        acts.push(Act::Export(history.last(SPAN_S).cloned().collect()));
    }
}

fn samples_per_s(ui: &mut Ui, model: &Model, _: &mut PlotDesk, acts: &mut Vec<Act>) {
    if matches!(model.link, Link::Recording) {
        return;
    }
    let (unit, width) = if ui.max_rect().width() < WIDE { ("/s", 64.0) } else { (" samples/s", 124.0) };
    let text = format!("{}{unit}", model.samples_per_s);
    let response = ComboBox::from_id_salt("rate").selected_text(text).width(width).show_ui(ui, |ui| {
        for n in [60, 120, 250, 1000, 10_000] {
            if ui.selectable_label(model.samples_per_s == n, format!("{n}{unit}")).clicked() {
                acts.push(Act::Ask(Intent::Samples(n)));
            }
        }
    });
    named(response.response, "Samples a second")
        .on_hover_text("states that the server sends; at most one a tick");
}

fn zero_control(ui: &mut Ui, model: &Model, plots: &mut PlotDesk) {
    let hint = "measures deflection from the orientation of this moment, wherever the scene's reference is";
    if plots.zero.is_none() {
        let newest = model.history.newest().map(|sample| quaternion(sample.q));
        if press(ui, newest.is_some(), egui::Button::new("Zero here")).on_hover_text(hint).clicked() {
            plots.zero = newest;
        }
    } else if ui
        .button("Zero at reference")
        .on_hover_text("measures from the scene's reference again")
        .clicked()
    {
        plots.zero = None;
    }
}
