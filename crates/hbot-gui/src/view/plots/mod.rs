//! Plots of torque, angle, speed, slip and energy against time, and of torque against deflection
//! with the fitted stiffness.

mod axes;
mod deflection;
mod time;

use eframe::egui::{self, ComboBox, Ui};
use glam::DQuat;

use super::theme::named;
use super::{Act, Desk};
use crate::model::{History, Link, Model, SPAN_S};
use crate::net::Intent;

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
}

impl Default for PlotDesk {
    fn default() -> Self {
        Self { which: Which::Torque, window: 10.0, paused: None, zero: None }
    }
}

impl PlotDesk {
    /// Ends a pause.
    pub(crate) fn go_on(&mut self) {
        self.paused = None;
    }
}

pub(crate) fn show(ui: &mut Ui, model: &Model, desk: &mut Desk, acts: &mut Vec<Act>) {
    controls(ui, model, &mut desk.plots, acts);
    super::faded_unless_live(ui, model);
    let plots = &desk.plots;
    let history = plots.paused.as_deref().unwrap_or(&model.history);
    match plots.which {
        Which::Stiffness => deflection::show(ui, model, history, plots),
        _ => drop(time::show(ui, model, history, plots)),
    }
}

fn controls(ui: &mut Ui, model: &Model, plots: &mut PlotDesk, acts: &mut Vec<Act>) {
    ui.horizontal_wrapped(|ui| {
        for (which, name) in Which::ALL {
            ui.selectable_value(&mut plots.which, which, name);
        }
        ui.add_space(8.0);
        let window =
            ComboBox::from_id_salt("window").selected_text(format!("{} s", plots.window)).width(52.0);
        let response = window.show_ui(ui, |ui| {
            for seconds in [2.0, 5.0, 10.0, SPAN_S] {
                ui.selectable_value(&mut plots.window, seconds, format!("{seconds} s"));
            }
        });
        named(response.response, "Time shown");
        let is_recorded = matches!(model.link, Link::Recording);
        let paused = plots.paused.is_some();
        // The slider of a recording pauses its plots.
        if !is_recorded && ui.button(if paused { "Go on" } else { "Pause" }).clicked() {
            plots.paused = if paused { None } else { Some(Box::new(model.history.clone())) };
        }
        let export = ui
            .button("Export CSV")
            .on_hover_text("writes the last 30 s to a file in the folder the panel runs in");
        if export.clicked() {
            let history = plots.paused.as_deref().unwrap_or(&model.history);
            acts.push(Act::Export(history.last(SPAN_S).copied().collect()));
        }
        if is_recorded {
            return zero_of(ui, model, plots);
        }
        let rates =
            ComboBox::from_id_salt("rate").selected_text(format!("{}/s", model.samples_per_s)).width(64.0);
        let response = rates.show_ui(ui, |ui| {
            for n in [60, 120, 250, 1000, 10_000] {
                if ui.selectable_label(model.samples_per_s == n, format!("{n}/s")).clicked() {
                    acts.push(Act::Ask(Intent::Samples(n)));
                }
            }
        });
        named(response.response, "Samples a second")
            .on_hover_text("states that the server sends; at most one a tick");
        zero_of(ui, model, plots);
    });
}

fn zero_of(ui: &mut Ui, model: &Model, plots: &mut PlotDesk) {
    if plots.which.is_from_zero() {
        zero_control(ui, model, plots);
    }
}

fn zero_control(ui: &mut Ui, model: &Model, plots: &mut PlotDesk) {
    let hint = "measures deflection from the orientation of this moment, wherever the scene's reference is";
    if plots.zero.is_none() {
        let newest = model.history.newest().map(|sample| sample.q);
        if ui.add_enabled(newest.is_some(), egui::Button::new("Zero here")).on_hover_text(hint).clicked() {
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
