//! The picture of the sphere in three dimensions: its orientation, the reference, the wheels, and
//! the torque.

use eframe::egui::{
    self, Align2, Color32, FontId, Key, Mesh, Painter, Pos2, Role, Sense, Shape, Stroke, Ui, Vec2,
    WidgetInfo, pos2, vec2,
};
use glam::{DQuat, DVec3};
use hbot_api::StateEvent;

use super::Desk;
use super::camera::Projection;
use super::theme::Palette;
use super::wheels::Contact;
use crate::model::Model;
use crate::model::sample::quaternion;

/// Everything in the picture is drawn within this distance from the sphere's centre, in units of
/// the sphere's radius.
const REACH: f64 = 1.5;
/// Height of the text below the picture of the sphere, points.
const READOUTS: f32 = 50.0;
/// Length of the arrow that shows the torque, in units of the sphere's radius. The first number is
/// the least length, so that the direction is always visible. The second is added to it at the
/// rig's torque limit.
const TORQUE_LENGTH: [f64; 2] = [0.2, 0.32];
/// Number of straight pieces with which a circle is drawn.
const CIRCLE: usize = 48;

/// Draws the picture of the sphere into the room that is left in the window.
pub(crate) fn show(ui: &mut Ui, model: &Model, desk: &mut Desk) {
    let (response, painter) = ui.allocate_painter(ui.available_size(), Sense::click_and_drag());
    let rect = response.rect;
    let room = rect.with_max_y(rect.bottom() - READOUTS);
    let middle = room.center();
    let radius = (room.width().min(room.height()) / 2.0 / REACH as f32).max(10.0);
    if response.dragged() {
        desk.camera.orbit(response.drag_delta(), radius);
    }
    if response.double_clicked() {
        desk.camera = Default::default();
    }
    if response.has_focus() {
        desk.camera.orbit(arrow_keys(ui) * 12.0, radius);
    }
    let state = model.state.as_ref();
    let q = state.map_or(DQuat::IDENTITY, |state| quaternion(state.q));
    response.widget_info(|| WidgetInfo::labeled(Role::Canvas, true, describe(state)));

    let palette = Palette::of(ui);
    let draw = Drawing { painter, view: desk.camera.onto(middle, radius), palette };
    draw.sphere(q);
    if let Some(reference) = state.and_then(|state| state.reference) {
        draw.ghost(quaternion(reference));
    }
    draw.axes(q);
    if let Some(state) = state {
        for (k, wheel) in model.info.rig.wheels.iter().enumerate() {
            let angle = |joint: usize| state.joints.get(joint).map_or(0.0, |joint| joint.angle);
            if let Some(contact) = Contact::of(&model.info.rig, wheel, angle(2 * k)) {
                draw.wheel(&contact, angle(2 * k + 1), wheel.name.as_deref().unwrap_or("?"));
            }
        }
        draw.torque(state.torque.into(), model.info.limits.torque);
    }
    draw.corner(rect, desk);
    readouts(&draw.painter, rect, state, palette);
    if rect.width() > 500.0 {
        let at = rect.right_bottom() - vec2(8.0, 6.0);
        let hint = "drag to turn the view, double click to turn it back";
        draw.painter.text(at, Align2::RIGHT_BOTTOM, hint, FontId::proportional(12.0), palette.weak);
    }
}

fn arrow_keys(ui: &Ui) -> Vec2 {
    ui.input(|input| {
        let key = |key| f32::from(u8::from(input.key_down(key)));
        vec2(key(Key::ArrowRight) - key(Key::ArrowLeft), key(Key::ArrowDown) - key(Key::ArrowUp))
    })
}

/// Describes the picture of the sphere in words, for screen readers.
fn describe(state: Option<&StateEvent>) -> String {
    let Some(state) = state else { return "Sphere: no state yet".to_owned() };
    let [w, x, y, z] = state.q;
    let torque = DVec3::from(state.torque).length();
    let away = state.reference.map_or(String::new(), |reference| {
        format!(", {:.3} rad from its reference", quaternion(reference).angle_between(quaternion(state.q)))
    });
    format!("Sphere: orientation {w:.3} {x:.3} {y:.3} {z:.3}, torque {torque:.3} N m{away}")
}

fn readouts(painter: &Painter, rect: egui::Rect, state: Option<&StateEvent>, palette: Palette) {
    let Some(state) = state else { return };
    let q = quaternion(state.q);
    let turn = (if q.w < 0.0 { -q } else { q }).to_scaled_axis();
    let torque = DVec3::from(state.torque);
    let lines = [
        format!("q        {:7.4} {:7.4} {:7.4} {:7.4}", q.w, q.x, q.y, q.z),
        format!("rotation {:7.4} {:7.4} {:7.4} rad", turn.x, turn.y, turn.z),
        format!("angle    {:7.4} rad, {:.1}\u{b0}", turn.length(), turn.length().to_degrees()),
    ];
    let font = FontId::monospace(12.0);
    for (k, line) in lines.iter().rev().enumerate() {
        let at = pos2(rect.left() + 8.0, rect.bottom() - 6.0 - 15.0 * k as f32);
        painter.text(at, Align2::LEFT_BOTTOM, line, font.clone(), palette.weak);
    }
    let mut legend = vec![(palette.torque, format!("torque {:.3} N m", torque.length()))];
    legend.push(match state.reference {
        Some(_) => (palette.ghost, "reference, dashed".to_owned()),
        None => (palette.weak, "no reference".to_owned()),
    });
    for (k, (color, text)) in legend.into_iter().enumerate() {
        let at = pos2(rect.left() + 8.0, rect.top() + 6.0 + 16.0 * k as f32);
        painter.text(at, Align2::LEFT_TOP, text, FontId::proportional(13.0), color);
    }
}

/// Draws objects in three dimensions. Lines that the sphere hides are dimmed.
struct Drawing {
    painter: Painter,
    view: Projection,
    palette: Palette,
}

impl Drawing {
    fn sphere(&self, q: DQuat) {
        let grid: Vec<Vec<DVec3>> = grid().map(|line| line.into_iter().map(|p| q * p).collect()).collect();
        let thin = |color| Stroke::new(1.0, color);
        for line in &grid {
            self.runs(line, true, thin(self.palette.grid.gamma_multiply(0.16)));
        }
        self.ball();
        for (k, line) in grid.iter().enumerate() {
            // The equator and the meridians through the axes are stronger, so that a rotation is
            // easy to see.
            let strong = k == 0 || (k > 4 && (k - 5) % 3 == 0);
            let alpha = if strong { 0.75 } else { 0.32 };
            self.runs(line, false, thin(self.palette.grid.gamma_multiply(alpha)));
        }
    }

    /// Draws the sphere as a shaded disc. It is slightly transparent, so that lines behind it are
    /// faintly visible.
    fn ball(&self) {
        let [light, dark] = self.palette.sphere;
        let mut mesh = Mesh::default();
        let middle = self.view.point(DVec3::ZERO);
        let radius = self.view.radius;
        mesh.colored_vertex(middle + vec2(-0.3, -0.35) * radius, light.gamma_multiply(0.78));
        for k in 0..=CIRCLE {
            let a = k as f32 / CIRCLE as f32 * std::f32::consts::TAU;
            mesh.colored_vertex(middle + Vec2::angled(a) * radius, dark.gamma_multiply(0.86));
            if k > 0 {
                mesh.add_triangle(0, k as u32, k as u32 + 1);
            }
        }
        self.painter.add(Shape::mesh(mesh));
        self.painter.circle_stroke(middle, radius, Stroke::new(1.5, self.palette.grid.gamma_multiply(0.7)));
    }

    fn axes(&self, q: DQuat) {
        for (k, axis) in DVec3::AXES.into_iter().enumerate() {
            let color = self.palette.axes[k];
            let axis = q * axis;
            self.arrow(DVec3::ZERO, axis * 1.3, Stroke::new(2.5, color));
            self.text(axis * 1.42, &format!("s{}", k + 1), color);
            // A mark where the axis leaves the sphere. It turns with the surface.
            if !self.view.is_hidden(axis) {
                self.painter.circle_filled(self.view.point(axis), 3.5, color);
            }
        }
    }

    fn ghost(&self, q: DQuat) {
        let color = self.palette.ghost;
        for normal in DVec3::AXES {
            let circle: Vec<DVec3> = circle(normal).map(|p| q * p).collect();
            self.dashes(&circle, Stroke::new(1.2, color.gamma_multiply(0.8)));
        }
        for axis in DVec3::AXES.map(|axis| q * axis) {
            // These end before the labels at the ends of the sphere's own axes.
            self.dashes(&segment(axis, axis * 1.16), Stroke::new(1.5, color));
            self.painter.circle_stroke(self.view.point(axis * 1.16), 4.0, Stroke::new(1.2, color));
        }
    }

    fn wheel(&self, contact: &Contact, drive: f64, name: &str) {
        let centre = contact.centre();
        let hidden = self.view.is_hidden(centre);
        let color = if hidden { self.palette.wheel.gamma_multiply(0.35) } else { self.palette.wheel };
        let rim = |angle: f64| {
            let (s, c) = angle.sin_cos();
            centre + contact.radius * (contact.rolling * c + contact.normal * s)
        };
        let points: Vec<Pos2> = (0..CIRCLE)
            .map(|k| self.view.point(rim(k as f64 / CIRCLE as f64 * std::f64::consts::TAU)))
            .collect();
        self.dashes(&segment(contact.axis, contact.axis * 1.5), Stroke::new(1.0, color.gamma_multiply(0.7)));
        self.painter.add(Shape::convex_polygon(points, color.gamma_multiply(0.35), Stroke::new(2.5, color)));
        let spoke = [self.view.point(centre), self.view.point(rim(-drive))];
        self.painter.line_segment(spoke, Stroke::new(2.0, color));
        // The rolling direction at the contact.
        let (from, to) = (centre - contact.rolling * 0.3, centre + contact.rolling * 0.3);
        self.arrow(from, to, Stroke::new(1.5, color));
        self.text(contact.axis * 1.56, name, color);
    }

    fn torque(&self, torque: DVec3, limit: f64) {
        let Some(direction) = torque.try_normalize() else { return };
        let share = if limit > 0.0 { torque.length() / limit } else { 1.0 };
        // Below one hundredth of the limit the direction is not meaningful.
        if share < 0.01 {
            return;
        }
        let color = self.palette.torque;
        let tip = direction * (1.0 + TORQUE_LENGTH[0] + TORQUE_LENGTH[1] * share.min(1.0));
        self.arrow(direction, tip, Stroke::new(5.0, color));
        // An arc about the arrow shows the sense of rotation, by the right-hand rule.
        let across = direction.any_orthonormal_vector();
        let along = direction.cross(across);
        let arc: Vec<DVec3> = (0..=20)
            .map(|k| {
                let (s, c) = (f64::from(k) / 20.0 * 4.6).sin_cos();
                direction * 1.08 + (across * c + along * s) * 0.17
            })
            .collect();
        let stroke = Stroke::new(2.0, color);
        self.runs(&arc, true, Stroke::new(2.0, color.gamma_multiply(0.3)));
        self.runs(&arc, false, stroke);
        if !self.view.is_hidden(arc[20]) {
            self.head(self.view.point(arc[18]), self.view.point(arc[20]), 7.0, color);
        }
    }

    /// Draws the directions of the axes of frame N in a corner of the picture.
    fn corner(&self, rect: egui::Rect, desk: &Desk) {
        let view = desk.camera.onto(rect.right_top() + vec2(-46.0, 48.0), 26.0);
        for (k, axis) in DVec3::AXES.into_iter().enumerate() {
            let color = self.palette.axes[k];
            let tip = view.point(axis);
            self.painter.line_segment([view.point(DVec3::ZERO), tip], Stroke::new(2.0, color));
            let font = FontId::proportional(12.0);
            self.painter.text(
                view.point(axis * 1.4),
                Align2::CENTER_CENTER,
                format!("n{}", k + 1),
                font,
                color,
            );
        }
    }

    /// Draws either the hidden or the visible parts of a line.
    fn runs(&self, line: &[DVec3], hidden: bool, stroke: Stroke) {
        for run in line.chunk_by(|a, b| self.view.is_hidden(*a) == self.view.is_hidden(*b)) {
            if self.view.is_hidden(run[0]) == hidden {
                self.painter.add(Shape::line(run.iter().map(|p| self.view.point(*p)).collect(), stroke));
            }
        }
    }

    fn dashes(&self, line: &[DVec3], stroke: Stroke) {
        for run in line.chunk_by(|a, b| self.view.is_hidden(*a) == self.view.is_hidden(*b)) {
            let points: Vec<Pos2> = run.iter().map(|p| self.view.point(*p)).collect();
            let dim = if self.view.is_hidden(run[0]) { 0.3 } else { 1.0 };
            let stroke = Stroke::new(stroke.width, stroke.color.gamma_multiply(dim));
            self.painter.extend(Shape::dashed_line(&points, stroke, 5.0, 4.0));
        }
    }

    fn arrow(&self, from: DVec3, to: DVec3, stroke: Stroke) {
        let line = segment(from, to);
        self.runs(&line, true, Stroke::new(stroke.width, stroke.color.gamma_multiply(0.3)));
        self.runs(&line, false, stroke);
        let dim = if self.view.is_hidden(to) { 0.35 } else { 1.0 };
        let size = 5.0 + 2.0 * stroke.width;
        self.head(self.view.point(from), self.view.point(to), size, stroke.color.gamma_multiply(dim));
    }

    fn head(&self, from: Pos2, to: Pos2, size: f32, color: Color32) {
        let along = (to - from).normalized();
        // An arrow seen along its direction is drawn as a dot.
        if !along.is_finite() || (to - from).length() < 1.0 {
            self.painter.circle_filled(to, size / 2.0, color);
            return;
        }
        let base = to - along * size;
        let points =
            vec![to + along * 2.0, base + along.rot90() * size * 0.45, base - along.rot90() * size * 0.45];
        self.painter.add(Shape::convex_polygon(points, color, Stroke::NONE));
    }

    fn text(&self, at: DVec3, text: &str, color: Color32) {
        let dim = if self.view.is_hidden(at) { 0.5 } else { 1.0 };
        let font = FontId::proportional(13.0);
        self.painter.text(self.view.point(at), Align2::CENTER_CENTER, text, font, color.gamma_multiply(dim));
    }
}

/// Returns the lines of a grid on the unit sphere: the equator, four parallels, and twelve
/// meridians between the outermost parallels.
fn grid() -> impl Iterator<Item = Vec<DVec3>> {
    let parallel = |latitude: f64| {
        let (s, c) = latitude.to_radians().sin_cos();
        circle(DVec3::Z).map(|p| p * c + DVec3::Z * s).collect()
    };
    let meridian = |k: usize| {
        let turn = DQuat::from_rotation_z((30 * k) as f64 * std::f64::consts::PI / 180.0);
        let half = move |j: usize| {
            let (s, c) = (-60.0 + 120.0 * j as f64 / 20.0_f64).to_radians().sin_cos();
            turn * DVec3::new(c, 0.0, s)
        };
        (0..=20).map(half).collect()
    };
    [0.0, -60.0, -30.0, 30.0, 60.0].into_iter().map(parallel).chain((0..12).map(meridian))
}

/// Returns the points of a closed circle on the unit sphere. Its plane passes through the centre
/// and is perpendicular to `normal`.
fn circle(normal: DVec3) -> impl Iterator<Item = DVec3> {
    let across = normal.any_orthonormal_vector();
    let along = normal.cross(across);
    (0..=CIRCLE).map(move |k| {
        let (s, c) = (k as f64 / CIRCLE as f64 * std::f64::consts::TAU).sin_cos();
        across * c + along * s
    })
}

/// Returns the points that divide a straight line into short pieces, so that each piece can be
/// hidden or visible.
fn segment(from: DVec3, to: DVec3) -> Vec<DVec3> {
    (0..=16).map(|k| from.lerp(to, f64::from(k) / 16.0)).collect()
}
