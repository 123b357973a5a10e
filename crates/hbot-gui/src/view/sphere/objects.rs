//! The objects of the picture: the sphere with its axes, the reference, wheels and torque.

use eframe::egui::{Mesh, Pos2, Shape, Stroke, Vec2, vec2};
use glam::{DQuat, DVec3};
use hbot_api::{JointState, RigInfo, WheelInfo};
use hbot_core::design::kinematics::ContactFrame;
use hbot_core::{Device, WheelSpec};

use super::drawing::{CIRCLE, Drawing, circle, segment};
use super::hand::{Held, Push};
use super::{PUSH_LENGTH, TORQUE_LENGTH};

impl Drawing {
    pub(super) fn sphere(&self, q: DQuat) {
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
    pub(super) fn ball(&self) {
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

    pub(super) fn axes(&self, q: DQuat) {
        for (k, axis) in DVec3::AXES.into_iter().enumerate() {
            let color = self.palette.axes[k];
            let axis = q * axis;
            self.arrow(DVec3::ZERO, axis * 1.3, Stroke::new(2.5, color));
            self.text(axis * 1.3, &format!("s{}", k + 1), color, 14.0);
            [1.15, 1.3].into_iter().for_each(|far| self.keep_free(axis * far, 9.0));
            // A mark where the axis leaves the sphere. It turns with the surface.
            if !self.view.is_hidden(axis) {
                self.painter.circle_filled(self.view.point(axis), 3.5, color);
                self.keep_free(axis, 9.0);
            }
        }
    }

    pub(super) fn ghost(&self, q: DQuat) {
        let color = self.palette.ghost;
        for normal in DVec3::AXES {
            let circle: Vec<DVec3> = circle(normal).map(|p| q * p).collect();
            self.dashes(&circle, Stroke::new(1.2, color.gamma_multiply(0.8)));
        }
        for axis in DVec3::AXES.map(|axis| q * axis) {
            // These end before the labels at the ends of the sphere's own axes.
            self.dashes(&segment(axis, axis * 1.16), Stroke::new(1.5, color));
            self.painter.circle_stroke(self.view.point(axis * 1.16), 4.0, Stroke::new(1.2, color));
            // With the edge of a name and a gap.
            self.keep_free(axis * 1.16, 13.0);
        }
    }

    /// Draws the wheels where the law of the loop has them, if the rig's geometry is known.
    pub(super) fn wheels(&self, rig: &RigInfo, joints: &[JointState]) {
        let spec = |wheel: &WheelInfo| WheelSpec {
            axis: wheel.axis.into(),
            cone: wheel.cone,
            toe: wheel.toe,
            radius: wheel.radius / rig.sphere.radius,
            ..WheelSpec::default()
        };
        let specs: Vec<_> = rig.wheels.iter().map(spec).collect();
        // In units of the sphere's radius. The mass makes no difference.
        let Ok(device) = Device::new(1.0, 1.0, &specs) else { return };
        let angle = |joint: usize| joints.get(joint).map_or(0.0, |joint| joint.angle);
        for (k, (wheel, info)) in device.wheels().iter().zip(&rig.wheels).enumerate() {
            let contact = ContactFrame::at(wheel, angle(2 * k));
            self.wheel(wheel.spec(), &contact, angle(2 * k + 1), info.name.as_deref().unwrap_or("?"));
        }
    }

    fn wheel(&self, spec: &WheelSpec, contact: &ContactFrame, drive: f64, name: &str) {
        let (axis, rolling, normal) = (spec.axis.normalize(), contact.c2, contact.c3);
        let centre = normal * (1.0 + spec.radius);
        let hidden = self.view.is_hidden(centre);
        let color = if hidden { self.palette.wheel.gamma_multiply(0.35) } else { self.palette.wheel };
        let rim = |angle: f64| {
            let (s, c) = angle.sin_cos();
            centre + spec.radius * (rolling * c + normal * s)
        };
        let points: Vec<Pos2> = (0..CIRCLE)
            .map(|k| self.view.point(rim(k as f64 / CIRCLE as f64 * std::f64::consts::TAU)))
            .collect();
        self.dashes(&segment(axis, axis * 1.5), Stroke::new(1.0, color.gamma_multiply(0.7)));
        self.painter.add(Shape::convex_polygon(points, color.gamma_multiply(0.35), Stroke::new(2.5, color)));
        let spoke = [self.view.point(centre), self.view.point(rim(-drive))];
        self.painter.line_segment(spoke, Stroke::new(2.0, color));
        // The rolling direction at the contact.
        let (from, to) = (centre - rolling * 0.3, centre + rolling * 0.3);
        self.arrow(from, to, Stroke::new(1.5, color));
        self.text(axis * 1.5, name, self.palette.wheel, 9.0);
    }

    pub(super) fn torque(&self, torque: DVec3, limit: f64) {
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

    /// Draws where the simulated hand holds the sphere, and the force with which the scene pushes
    /// it. `limit` is the rig's torque limit, N m, and `radius` the sphere's radius, m.
    pub(super) fn hand(&self, held: &Held, push: &Push, limit: f64, radius: f64) {
        let color = self.palette.hand;
        let at = self.view.point(push.at);
        if let Some(pointer) = held.pointer {
            let line = Shape::dashed_line(&[at, pointer], Stroke::new(1.5, color), 2.0, 3.0);
            self.painter.extend(line);
        }
        self.painter.circle_filled(at, 6.0, color);
        let most = if limit > 0.0 { limit / radius } else { 1.0 };
        let share = push.force.length() / most;
        let Some(direction) = push.force.try_normalize() else { return };
        // Below one hundredth of the limit the direction is not meaningful.
        if share < 0.01 {
            return;
        }
        let [least, more] = PUSH_LENGTH;
        let to = self.view.point(push.at + direction * (least + more * share.min(1.0)));
        // The hand is in front of the sphere, so nothing of its arrow is hidden.
        self.painter.line_segment([at, to], Stroke::new(5.0, color));
        self.head(at, to, 16.0, color);
    }

    /// Draws the directions of the axes of frame N, in the corner of the picture that `view` shows.
    pub(super) fn corner(&self) {
        for (k, axis) in DVec3::AXES.into_iter().enumerate() {
            let color = self.palette.axes[k];
            let ends = [DVec3::ZERO, axis].map(|p| self.view.point(p));
            self.painter.line_segment(ends, Stroke::new(2.0, color));
            self.text(axis, &format!("n{}", k + 1), color, 11.0);
            // An axis along the line of sight is a point, beside which its name stands.
            [0.3, 0.7].into_iter().for_each(|share| self.keep_free(axis * share, 9.0));
        }
        self.write_names();
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
