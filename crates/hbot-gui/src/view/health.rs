//! Shows how well the loop keeps its deadlines, the quality of the link, and the cost of the
//! computation.

use eframe::egui::{Align2, FontId, Grid, Rect, RichText, Role, Sense, Ui, WidgetInfo, pos2, vec2};

use super::theme::{Palette, heading, weak, wrapped};
use super::three_digits;
use crate::model::{BINS, Histogram, Model};
use hbot_api::{Distribution, StatsOk};

pub(crate) fn show(ui: &mut Ui, model: &Model) {
    let Some(stats) = &model.stats else {
        weak(ui, "No figures yet.");
        return;
    };
    heading(ui, "Lateness of ticks");
    histogram(ui, &model.lateness);
    ui.add_space(4.0);
    times(ui, stats);
    heading(ui, "Ticks and link");
    counts(ui, model, stats);
    heading(ui, "Accuracy");
    accuracy(ui, model, stats);
    heading(ui, "Faults so far");
    faults(ui, stats);
}

/// Draws the histogram of the lateness of ticks, for all states that the panel has received.
fn histogram(ui: &mut Ui, lateness: &Histogram) {
    let palette = Palette::of(ui);
    let (rect, response) = ui.allocate_exact_size(vec2(ui.available_width(), 92.0), Sense::hover());
    let total = lateness.total();
    response.widget_info(|| {
        WidgetInfo::labeled(Role::Image, true, format!("Histogram of lateness over {total} samples"))
    });
    let painter = ui.painter_at(rect);
    let plot = Rect::from_min_max(rect.min, rect.max - vec2(0.0, 16.0));
    painter.rect_filled(plot, 3.0, ui.visuals().extreme_bg_color);
    let width = plot.width() / BINS as f32;
    // Logarithmic, so that one late tick in a million is visible.
    let height = |count: u64| {
        if count == 0 { 0.0 } else { (1.0 + count as f32).log10() / (2.0 + total as f32).log10() }
    };
    for (bin, count) in lateness.counts().iter().enumerate() {
        let left = plot.left() + width * bin as f32;
        let top = plot.bottom() - (plot.height() - 4.0) * height(*count);
        let bar = Rect::from_min_max(pos2(left + 1.0, top), pos2(left + width - 1.0, plot.bottom()));
        painter.rect_filled(bar, 1.0, palette.axes[2]);
    }
    for (bin, text) in [(4, "1 us"), (8, "10"), (12, "100"), (16, "1 ms"), (20, "10"), (24, "100")] {
        let x = plot.left() + width * (bin + 1) as f32;
        painter.vline(x, plot.bottom()..=plot.bottom() + 3.0, (1.0, palette.weak));
        painter.text(
            pos2(x, rect.bottom()),
            Align2::CENTER_BOTTOM,
            text,
            FontId::proportional(11.0),
            palette.weak,
        );
    }
    response.on_hover_text(format!("{total} samples since the connection was made; heights are logarithmic"));
    debug_assert!(Histogram::edge(4) > 0.99 && Histogram::edge(4) < 1.01, "the marks stand at their bins");
}

/// Draws the table with the distributions of times, over all ticks since the server started.
fn times(ui: &mut Ui, stats: &StatsOk) {
    let rows: [(&str, &Distribution, &str); 4] = [
        ("late", &stats.lateness_us, "from a tick's deadline to its start"),
        ("compute", &stats.compute_us, "in the controller"),
        ("line", &stats.link_us, "reading, decoding, encoding, writing"),
        ("age", &stats.age_us, "from an encoder's reading to the torque made of it"),
    ];
    Grid::new("times").num_columns(5).spacing(vec2(10.0, 2.0)).striped(true).show(ui, |ui| {
        ui.label(RichText::new("us").weak()).on_hover_text("microseconds: millionths of a second");
        for head in ["median", "99 %", "99.9 %", "max"] {
            ui.label(RichText::new(head).weak());
        }
        ui.end_row();
        for (name, d, hint) in rows {
            ui.label(name).on_hover_text(hint);
            for value in [d.p50, d.p99, d.p99_9, d.max] {
                ui.label(RichText::new(three_digits(value)).monospace().size(12.0));
            }
            ui.end_row();
        }
    });
}

fn counts(ui: &mut Ui, model: &Model, stats: &StatsOk) {
    let palette = Palette::of(ui);
    let ticks = stats.ticks.max(1) as f64;
    let answered = 100.0 * (1.0 - stats.missed_ticks as f64 / ticks).max(0.0);
    let rows = [
        ("ticks", stats.ticks, "since the server began"),
        ("late", stats.late_ticks, "started more than a quarter period after their deadline"),
        ("skipped", stats.skipped_ticks, "their deadline passed before the one before had ended"),
        ("missed", stats.missed_ticks, "had no new feedback"),
        ("corrupt frames", stats.corrupt_frames, "arrived damaged"),
        ("foreign frames", stats.foreign_frames, "arrived whole and are not of this link"),
        ("failed sends", stats.send_failures, "commands that did not go out"),
        ("samples lost", stats.dropped_samples + model.dropped, "states that did not reach this window"),
    ];
    Grid::new("counts").num_columns(2).spacing(vec2(16.0, 2.0)).striped(true).show(ui, |ui| {
        ui.label("link quality").on_hover_text("ticks that had an answer of the controllers");
        // Round down, so that 100 % is shown only if no tick was missed.
        let shown = if stats.missed_ticks > 0 { answered.min(99.999) } else { answered };
        let color = if shown < 99.9 { palette.warn } else { palette.good };
        ui.colored_label(color, format!("{shown:.3} %"));
        ui.end_row();
        for (name, count, hint) in rows {
            ui.label(name).on_hover_text(hint);
            ui.label(RichText::new(count.to_string()).monospace().size(12.0));
            ui.end_row();
        }
        if let Some(state) = &model.state {
            ui.label("passivity energy").on_hover_text(
                "given out to the hand since the start; a passive rig's is never above zero for long",
            );
            ui.label(RichText::new(format!("{:.3} J", state.energy)).monospace().size(12.0));
            ui.end_row();
        }
    });
}

/// Draws the names of the numerical methods in use and their computing time per tick.
fn accuracy(ui: &mut Ui, model: &Model, stats: &StatsOk) {
    // Infinite until the server has reported its rate.
    let period_us = 1e6 / f64::from(model.info.rig.rate_hz);
    let share = |us: f64| 100.0 * us / period_us;
    let accuracy = model.info.accuracy.as_str();
    wrapped(ui, RichText::new(if accuracy.is_empty() { "not told" } else { accuracy }).strong());
    weak(
        ui,
        format!(
            "costs {} us of each tick (median; {:.2} % of the period), {} us in one of a hundred",
            three_digits(stats.compute_us.p50),
            share(stats.compute_us.p50),
            three_digits(stats.compute_us.p99),
        ),
    );
}

fn faults(ui: &mut Ui, stats: &StatsOk) {
    let mut any = false;
    for (cause, count) in stats.faults.iter().filter(|(_, count)| *count > 0) {
        any = true;
        ui.label(format!("{cause}: {count}"));
    }
    if stats.estops > 0 {
        any = true;
        ui.label(format!("stops: {}", stats.estops));
    }
    if !any {
        weak(ui, "none");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::painted::{drawn, hint};

    #[test]
    fn the_unit_of_the_times_is_explained() {
        let mut seen = drawn([800.0, 600.0], |ui| times(ui, &StatsOk::default()));
        assert_eq!(hint(&mut seen, "us"), "microseconds: millionths of a second");
    }
}
