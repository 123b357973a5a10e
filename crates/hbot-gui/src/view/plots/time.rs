//! Plots of quantities against time, with marks at changes of the scene and at faults.

use std::ops::Range;
use std::sync::Arc;

use eframe::egui::{Align2, Color32, FontId, RichText, Role, Ui, Vec2, WidgetInfo, vec2};
use egui_plot::{HLine, Line, LineStyle, PlotBounds, PlotPoint, PlotUi, Text, VLine};
use glam::DVec3;
use hbot_api::StateEvent;

use super::axes::{full_scale, held, plot};
use super::{PlotDesk, Which};
use crate::model::sample::{deflection, zero};
use crate::model::{History, Link, Mark, Model, What, thinned};
use crate::view::pointer::{self, Reading};
use crate::view::theme::{Palette, weak};

/// Stands at a mark whose text has no room.
const ELLIPSIS: &str = "\u{2026}";
/// Largest number of rows of texts at marks.
const MOST_ROWS: usize = 4;
/// Size of these texts, points.
const TEXT: f32 = 11.0;
struct Curve {
    name: &'static str,
    color: Color32,
    of: Box<dyn Fn(&StateEvent) -> f64>,
}

/// What a plot against time shows: up to four curves of one unit.
struct Quantity {
    /// Name and unit, next to the vertical axis.
    axis: &'static str,
    curves: Vec<Curve>,
    /// The axis extends at least this far from zero, so that smaller noise does not fill the plot.
    least: f64,
    /// Upper limit of the last curve, if the rig has one. A limit of a vector bounds its length, so
    /// the last curve is the length.
    limit: Option<f64>,
}

impl Quantity {
    /// Returns what the plot `which` shows. Returns `None` for the plot against deflection.
    fn of(which: Which, model: &Model, plots: &PlotDesk, palette: Palette) -> Option<Self> {
        let limits = &model.info.limits;
        let color = palette.torque;
        let length = |name, vector: fn(&StateEvent) -> [f64; 3]| {
            let mut curves = components(palette, vector);
            curves.push(Curve { name, color, of: Box::new(move |s| DVec3::from(vector(s)).length()) });
            curves
        };
        let alone = |name, of: fn(&StateEvent) -> f64| vec![Curve { name, color, of: Box::new(of) }];
        let chosen = plots.zero;
        let from = match &model.state {
            _ if chosen.is_some() => Some("turn from Zero here, rad"),
            Some(state) if state.reference.is_some() => Some("turn from reference, rad"),
            _ => None,
        };
        let (axis, curves, least, limit) = match which {
            Which::Torque => {
                let least = (0.1 * limits.torque).max(0.002);
                ("torque, N m", length("length", |sample| sample.torque), least, limits.torque)
            }
            Which::Speed => {
                ("angular velocity, rad/s", length("speed", |sample| sample.omega), 0.1, limits.speed)
            }
            Which::Angle => {
                let angle = move |s: &StateEvent| deflection(s, zero(s, chosen)).to_array();
                (from.unwrap_or("turn from N, rad"), components(palette, angle), 0.02, 0.0)
            }
            Which::Slip => ("slip, m/s", alone("largest slip", |sample| sample.slip), 0.002, limits.slip),
            Which::Energy => {
                ("energy to the hand, J", alone("since the start", |sample| sample.energy), 0.01, 0.0)
            }
            Which::Stiffness => return None,
        };
        Some(Self { axis, curves, least, limit: (limit > 0.0).then_some(limit) })
    }
}

/// Returns the curves of the three components of a vector in frame N.
fn components(palette: Palette, vector: impl Fn(&StateEvent) -> [f64; 3] + Copy + 'static) -> Vec<Curve> {
    let names = ["n1", "n2", "n3"];
    (0..3)
        .map(|k| Curve {
            name: names[k],
            color: palette.axes[k],
            of: Box::new(move |sample| vector(sample)[k]),
        })
        .collect()
}

/// Draws the plot that the user has chosen, unless it is the one against deflection. Something of
/// the size `beside` already stands at the right of the names of the curves. Returns the range of
/// the axes.
pub(super) fn show(
    ui: &mut Ui,
    model: &Model,
    history: &History,
    plots: &PlotDesk,
    beside: Vec2,
) -> Option<PlotBounds> {
    let palette = Palette::of(ui);
    let quantity = Quantity::of(plots.which, model, plots, palette)?;
    let Some(newest) = history.newest() else {
        weak(ui, "No samples yet.");
        return None;
    };
    let now = newest.t;
    let columns = ui.available_width() as usize;
    let lines: Vec<Vec<[f64; 2]>> = quantity
        .curves
        .iter()
        .map(|curve| {
            let points = history.last(plots.window).map(|sample| [sample.t - now, (curve.of)(sample)]);
            thinned(points, columns)
        })
        .collect();
    let ends = lines.iter().flatten().fold([-quantity.least, quantity.least], |[low, high], point| {
        [low.min(point[1]), high.max(point[1])]
    });
    let [low, high] = held(plots, plots.which as usize, ends, quantity.limit);
    // The limit is shown where the axis reaches it. Otherwise it would flatten the curves.
    let limit = quantity.limit.filter(|limit| high >= *limit);
    // Above the plot, where the names cover no curve.
    let room = vec2((ui.available_width() - beside.x).max(0.0), beside.y);
    ui.allocate_ui(room, |ui| {
        ui.spacing_mut().interact_size.y = beside.y;
        ui.horizontal_wrapped(|ui| {
            for curve in &quantity.curves {
                ui.colored_label(curve.color, curve.name);
            }
            if limit.is_some() {
                ui.colored_label(palette.warn, "limit");
            }
        });
    });
    let marks: Vec<&Mark> = model.marks.between(now - plots.window, now).collect();
    let shown = plot(ui, quantity.axis, plots, quantity.axis)
        .include_x(-plots.window)
        .include_x(0.0)
        .include_y(low)
        .include_y(high)
        // The curves end where the plot does. A curve at the limit does not lie on the frame.
        .set_margin_fraction(vec2(0.0, 0.1))
        .x_axis_label(before(model, plots))
        .show(ui, |plot| {
            for (curve, points) in quantity.curves.iter().zip(lines) {
                plot.line(Line::new(curve.name, points).color(curve.color).width(1.6));
            }
            if let Some(limit) = limit {
                let name = quantity.curves.last().map_or("", |curve| curve.name);
                let line = HLine::new(format!("limit of {name}"), limit);
                plot.hline(line.color(palette.warn).style(LineStyle::dashed_loose()));
            }
            draw(plot, &marks, now, palette, low..high);
        });
    pointer::show(ui, &shown.response, &shown.transform, |x| {
        let away = |sample: &&Arc<StateEvent>| (sample.t - now - x).abs();
        let sample = history.last(plots.window).min_by(|a, b| away(a).total_cmp(&away(b)))?;
        let of = |curve: &Curve| (curve.color, curve.name.to_owned(), (curve.of)(sample));
        let values = quantity.curves.iter().map(of).collect();
        Some(Reading { x: sample.t - now, place: format!("{:.2} s", sample.t - now), values })
    });
    let text = in_words(quantity.axis, history.last(plots.window).len(), limit, &marks, now);
    shown.response.widget_info(|| WidgetInfo::labeled(Role::Image, true, &text));
    let unit = quantity.axis.rsplit(", ").next().unwrap_or_default();
    full_scale(ui, *shown.transform.frame(), plots, [low, high], unit);
    Some(*shown.transform.bounds())
}

/// Returns the name of the axis of time, which says from when the time counts.
fn before(model: &Model, plots: &PlotDesk) -> &'static str {
    match model.link {
        Link::Recording => "time before this moment, s",
        _ if plots.paused.is_some() => "time before the pause, s",
        // Nothing is known of the time since then.
        Link::Offline { .. } => "time before the last state, s",
        _ if model.silent_for().is_some() => "time before the last state, s",
        _ => "time before now, s",
    }
}

/// Draws a vertical line with a text at each mark. The texts stay within `span`, the range of the
/// curves: the axis grows with what is drawn, so a text placed by the range of the axis would make
/// it grow in every frame.
fn draw(plot: &mut PlotUi<'_>, marks: &[&Mark], now: f64, palette: Palette, span: Range<f64>) {
    let font = FontId::proportional(TEXT);
    let ground = plot.ctx().style_of(plot.ctx().theme()).visuals.extreme_bg_color.gamma_multiply(0.8);
    let size = |text: &str| {
        let text = text.to_owned();
        plot.ctx().fonts_mut(|fonts| fonts.layout_no_wrap(text, font.clone(), Color32::WHITE).size())
    };
    let to_screen = plot.transform();
    let middle = to_screen.frame().center().x;
    let row_height = f64::from(size(ELLIPSIS).y) / to_screen.dpos_dvalue_y().abs();
    let mut rows = Rows::new(((span.end - span.start) / row_height) as usize);
    // Those that the user must know take their places first.
    let mut order: Vec<&&Mark> = marks.iter().rev().collect();
    order.sort_by_key(|mark| mark.what != What::Fault);
    let mut labels = Vec::new();
    for mark in order {
        let color = match mark.what {
            What::Scene => palette.ghost,
            What::Set => palette.weak,
            What::Fault => palette.warn,
        };
        let x = mark.t - now;
        let at = to_screen.position_from_point_x(x);
        // The text is on the side of its mark that has room.
        let right = at > middle;
        let placed = [mark.text.as_str(), ELLIPSIS].into_iter().find_map(|text| {
            let text = if right { format!("{text} ") } else { format!(" {text}") };
            let width = size(&text).x;
            let row = rows.take(if right { at - width..at } else { at..at + width })?;
            Some((row, text))
        });
        labels.push((x, color, right, placed));
    }
    for (x, color, ..) in &labels {
        plot.vline(VLine::new("", *x).color(*color).width(1.0).style(LineStyle::dashed_dense()));
    }
    // No line of another mark crosses a text, and no curve.
    for (x, color, right, placed) in labels {
        if let Some((row, text)) = placed {
            let side = if right { Align2::RIGHT_BOTTOM } else { Align2::LEFT_BOTTOM };
            let place = PlotPoint::new(x, span.start + row as f64 * row_height);
            let text = RichText::new(text).size(TEXT).color(color).background_color(ground);
            plot.text(Text::new("", place, text).color(color).anchor(side));
        }
    }
}

/// The rows of texts at the lower end of a plot, from below.
struct Rows(Vec<Vec<Range<f32>>>);

impl Rows {
    /// Makes one row or more: as many as fit into the lower half, up to [`MOST_ROWS`]. More would
    /// hide the curves.
    fn new(fit: usize) -> Self {
        Self(vec![Vec::new(); (fit / 2).clamp(1, MOST_ROWS)])
    }

    /// Takes the place `wanted` in the lowest row that has room there. Returns the row, or `None`
    /// if no row has room.
    fn take(&mut self, wanted: Range<f32>) -> Option<usize> {
        let is_free =
            |taken: &Vec<Range<f32>>| taken.iter().all(|it| wanted.end <= it.start || it.end <= wanted.start);
        let row = self.0.iter().position(is_free)?;
        self.0[row].push(wanted);
        Some(row)
    }
}

/// Describes a plot in words, for screen readers.
fn in_words(axis: &str, points: usize, limit: Option<f64>, marks: &[&Mark], now: f64) -> String {
    let mut text = format!("Plot of {axis} over {points} samples");
    if let Some(limit) = limit {
        text += &format!(", near its limit of {limit}");
    }
    for Mark { t, text: what, .. } in marks {
        text += &format!("; {what}, {:.1} s ago", now - t);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui_kittest::Harness;
    use egui_kittest::kittest::Queryable as _;

    use crate::view::painted::{drawn, texts};

    /// Returns the model of a rig without torque, with states of these times.
    fn still(times: [f64; 2]) -> Model {
        let mut model = Model::new("", "panel me@here", 1);
        for t in times {
            model.history.push(Arc::new(StateEvent { t, ..StateEvent::default() }));
        }
        model
    }

    /// Draws the plot of the torque in a window of this height.
    fn plot_of(model: Model, height: f32) -> Harness<'static> {
        let mut seen = drawn([560.0, height], move |ui| {
            show(ui, &model, &model.history, &PlotDesk::default(), Vec2::ZERO);
        });
        seen.run_steps(4);
        seen
    }

    #[test]
    fn the_text_of_a_mark_does_not_stretch_the_axis() {
        let mut model = still([0.0, 1.0]);
        model.marks.add(Mark { t: 0.5, what: What::Fault, text: "overspeed".to_owned() }, 0.0);
        let draw = |ui: &mut Ui, (model, range): &mut (Model, Option<PlotBounds>)| {
            *range = show(ui, model, &model.history, &PlotDesk::default(), Vec2::ZERO);
        };
        let mut seen = Harness::new_ui_state(draw, (model, None));
        seen.run_steps(200);
        let range = seen.state().1.expect("drawn");
        // The curves are at 0. The plot leaves a margin around the least range of 0.002 N m.
        assert!(range.height() < 0.006, "{range:?}");
    }

    /// The axis begins with the limit. After a click it fits what is shown, grows in round steps up
    /// to the limit, and goes back only on a click.
    #[test]
    fn the_scale_of_an_axis_holds() {
        let mut model = Model::new("", "panel me@here", 1);
        model.info.limits.torque = 0.9;
        let draw = |ui: &mut Ui, (model, range, plots): &mut (Model, f64, PlotDesk)| {
            *range = show(ui, model, &model.history, plots, Vec2::ZERO).expect("drawn").max()[1];
        };
        model.history.push(Arc::default());
        let mut seen = Harness::new_ui_state(draw, (model, 0.0, PlotDesk::default()));
        let fit = |seen: &mut Harness<'_, _>| {
            seen.get_by_label_contains("full scale").click();
            seen.run_steps(4);
        };
        seen.run_steps(4);
        seen.get_by_label("full scale -0.9 to 0.9 N m");
        fit(&mut seen);
        let torques = [(0.13, 0.2), (0.01, 0.2), (0.6, 0.9), (0.01, 0.9), (1.1, 2.0), (0.01, 2.0)];
        for (k, (torque, full)) in (0..).zip(torques) {
            let t = 20.0 * f64::from(k);
            for t in [t, t + 19.0] {
                let state = StateEvent { t, torque: [0.0, torque, 0.0], ..StateEvent::default() };
                seen.state_mut().0.history.push(Arc::new(state));
            }
            seen.run_steps(4);
            // The plot leaves a margin of a tenth of its range.
            let range = seen.state().1;
            assert!((1.1 * full..1.25 * full).contains(&range), "{torque} N m: {range}, not {full}");
            seen.get_by_label_contains(&format!("to {full} N m"));
        }
        fit(&mut seen);
        seen.get_by_label("full scale -0.1 to 0.1 N m");
    }

    #[test]
    fn the_texts_of_marks_cover_each_other_nowhere() {
        let times = |count: u32| (0..count).map(move |k| 9.0 * f64::from(k) / f64::from(count));
        for (count, all) in [(4, true), (40, false)] {
            let mut model = still([0.0, 10.0]);
            let text = |k| format!("spring {k}: stiffness = 1.234567");
            for (k, t) in times(count).enumerate() {
                let what = if k == 3 { What::Fault } else { What::Set };
                model.marks.add(Mark { what, t, text: text(k) }, 0.0);
            }
            let seen = plot_of(model, 260.0);
            let is_text = |text: &str| text.contains("stiffness") || text.trim() == ELLIPSIS;
            let texts: Vec<_> = texts(&seen).into_iter().filter(|it| is_text(&it.text)).collect();
            for (k, one) in texts.iter().enumerate() {
                assert!(one.is_whole(), "{count} marks: {one:?}");
                for other in &texts[..k] {
                    assert!(!one.overlaps(other), "{count} marks: {one:?} and {other:?}");
                }
            }
            let shown = |k: u32| texts.iter().any(|it| it.text.trim() == text(k as usize));
            assert!(shown(count - 1) && shown(3), "{count} marks: the newest and the fault");
            assert_eq!((0..count).all(shown), all, "{count} marks");
            assert_eq!(texts.iter().any(|it| it.text.trim() == ELLIPSIS), !all, "{count} marks");
        }
    }

    #[test]
    fn the_texts_of_marks_leave_the_upper_half_of_a_low_plot_to_the_curves() {
        let mut model = still([0.0, 10.0]);
        for k in 0..6 {
            let text = format!("spring {k}: stiffness = 1.234567");
            model.marks.add(Mark { what: What::Scene, t: 9.0 + 0.1 * f64::from(k), text }, 0.0);
        }
        let seen = plot_of(model, 160.0);
        let plot = seen.get_by_label_contains("Plot of").rect();
        let marks = texts(&seen).into_iter().filter(|it| it.text.contains("stiffness"));
        let ghost = Palette::of_theme(true, Color32::GRAY).ghost;
        let mut count = 0;
        for mark in marks {
            assert!(mark.place.top() > plot.center().y - 2.0 && mark.color == ghost, "{mark:?} in {plot:?}");
            count += 1;
        }
        assert!(count > 0, "the newest is told");
    }

    /// A table that is drawn for the first time makes egui draw the frame twice. In the first of
    /// these drawings, the plot cannot measure the texts of its axes.
    #[test]
    fn the_name_of_an_axis_keeps_clear_of_the_numbers_in_a_frame_that_is_drawn_twice() {
        let model = still([0.0, 10.0]);
        let draw = |ui: &mut Ui, (model, twice): &mut (Model, bool)| {
            if *twice {
                ui.ctx().request_discard("a table is drawn for the first time");
            }
            show(ui, model, &model.history, &PlotDesk::default(), Vec2::ZERO);
        };
        let mut seen = Harness::new_ui_state(draw, (model, false));
        seen.run_steps(4);
        for twice in [false, true] {
            seen.state_mut().1 = twice;
            seen.step();
            let texts = texts(&seen);
            let name = texts.iter().find(|it| it.text == "time before now, s").expect("the name");
            let numbers: Vec<_> = texts.iter().filter(|it| it.text.parse::<f64>().is_ok()).collect();
            assert!(numbers.iter().any(|it| it.text == "-10"), "{numbers:?}");
            for number in numbers {
                assert!(!name.overlaps(number), "{name:?} and {number:?}, drawn twice: {twice}");
            }
        }
    }

    /// The rig limits the length of the torque, so a component alone never shows whether a limit is
    /// reached: at 45 degrees between two axes both are at 0.71 of it.
    #[test]
    fn the_limit_is_that_of_the_length_of_the_vector() {
        let mut model = Model::new("", "panel me@here", 1);
        model.info.limits.torque = 0.9;
        model.info.limits.speed = 30.0;
        let palette = Palette::of_theme(true, Color32::GRAY);
        let component = 0.9 / 2.0_f64.sqrt();
        let state = StateEvent {
            torque: [component, component, 0.0],
            omega: [18.0, 0.0, 24.0],
            ..StateEvent::default()
        };
        for which in [Which::Torque, Which::Speed] {
            let quantity = Quantity::of(which, &model, &PlotDesk::default(), palette).expect("against time");
            let (last, limit) = (quantity.curves.last().expect("a curve"), quantity.limit.expect("limited"));
            // The tolerance is the rounding of one square root.
            assert!(((last.of)(&state) - limit).abs() < 1e-14 * limit, "{}", last.name);
            let components = &quantity.curves[..3];
            assert!(components.iter().all(|curve| (curve.of)(&state) < 0.9 * limit));
        }
    }
}
