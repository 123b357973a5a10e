//! The direction from which the sphere is seen. The projection is parallel, with n3 upwards.

use eframe::egui::{Pos2, Vec2, pos2};
use glam::DVec3;

/// Least and largest size of the sphere, relative to the one that fits into the picture.
const ZOOM: [f64; 2] = [0.5, 4.0];

/// The direction from which the viewer looks at the sphere, given by two angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Camera {
    /// Angle of the viewer's position about the vertical axis n3, counted from the axis n1, rad.
    pub(crate) azimuth: f64,
    /// Angle of the viewer's position above the horizontal plane (that of n1 and n2), rad.
    pub(crate) elevation: f64,
    /// Size of the sphere on the screen, relative to the one that fits into the picture.
    zoom: f64,
}

impl Default for Camera {
    /// Returns a view along the axis n2, slightly from the side of n1 and from above. Both wheels
    /// of the prototype are visible from there.
    fn default() -> Self {
        Self { azimuth: -1.25, elevation: 0.22, zoom: 1.0 }
    }
}

impl Camera {
    /// Turns the view when the user drags the sphere. `drag` is the pointer's motion and `radius`
    /// the sphere's radius on the screen, both in points. The surface of the sphere follows the
    /// pointer.
    pub(crate) fn orbit(&mut self, drag: Vec2, radius: f32) {
        let scale = 1.0 / f64::from(radius.max(1.0));
        self.azimuth = (self.azimuth - f64::from(drag.x) * scale).rem_euclid(std::f64::consts::TAU);
        self.elevation = (self.elevation + f64::from(drag.y) * scale).clamp(-1.5, 1.5);
    }

    /// Makes the sphere on the screen larger by a factor, within limits.
    pub(crate) fn zoom_by(&mut self, factor: f64) {
        self.zoom = (self.zoom * factor).clamp(ZOOM[0], ZOOM[1]);
    }

    /// Returns the same view of a sphere that fits into the picture.
    pub(crate) fn unzoomed(self) -> Self {
        Self { zoom: 1.0, ..self }
    }

    /// Returns the projection onto the screen. `radius` is that of a sphere which fits into the
    /// picture, points.
    pub(crate) fn onto(self, middle: Pos2, radius: f32) -> Projection {
        let (sa, ca) = self.azimuth.sin_cos();
        let (se, ce) = self.elevation.sin_cos();
        Projection {
            right: DVec3::new(-sa, ca, 0.0),
            up: DVec3::new(-se * ca, -se * sa, ce),
            eye: DVec3::new(ce * ca, ce * sa, se),
            middle,
            radius: radius * self.zoom as f32,
        }
    }
}

/// Converts positions in frame N to positions on the screen. Lengths in frame N are in units of the
/// sphere's radius.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Projection {
    right: DVec3,
    up: DVec3,
    /// Unit vector from the centre of the sphere to the viewer.
    pub(crate) eye: DVec3,
    middle: Pos2,
    /// Radius of the sphere on the screen, points.
    pub(crate) radius: f32,
}

impl Projection {
    pub(crate) fn point(&self, p: DVec3) -> Pos2 {
        let (x, y) = (p.dot(self.right) as f32, p.dot(self.up) as f32);
        pos2(self.middle.x + self.radius * x, self.middle.y - self.radius * y)
    }

    /// Returns the motion in frame N of a point on the near side of the sphere that moves by `drag`
    /// points on the screen, in units of the sphere's radius.
    pub(crate) fn motion(&self, drag: Vec2) -> DVec3 {
        let scale = 1.0 / f64::from(self.radius.max(1.0));
        (self.right * f64::from(drag.x) - self.up * f64::from(drag.y)) * scale
    }

    /// Returns the point of the unit sphere that is seen at a place on the screen. `None` beside
    /// the sphere.
    pub(crate) fn touched(&self, at: Pos2) -> Option<DVec3> {
        let across = self.motion(at - self.middle);
        let near = 1.0 - across.length_squared();
        (near >= 0.0).then(|| across + self.eye * near.sqrt())
    }

    /// Returns whether the viewer cannot see a point because the unit sphere hides it: the point is
    /// inside the sphere or behind it.
    pub(crate) fn is_hidden(&self, p: DVec3) -> bool {
        let beside = p.length_squared() - p.dot(self.eye).powi(2);
        // A small tolerance, so that points on the surface are visible.
        beside < 1.0 && p.dot(self.eye) < (1.0 - beside).sqrt() - 1e-3
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use eframe::egui::vec2;

    #[test]
    fn the_eye_sees_the_near_half_and_what_stands_out() {
        let view = Camera { azimuth: 0.0, elevation: 0.0, zoom: 1.0 }.onto(pos2(0.0, 0.0), 100.0);
        assert!(!view.is_hidden(DVec3::X), "the nearest point");
        assert!(view.is_hidden(-DVec3::X) && view.is_hidden(DVec3::ZERO));
        assert!(view.is_hidden(-2.0 * DVec3::X), "behind the sphere");
        assert!(!view.is_hidden(1.1 * DVec3::Z), "above it");
        assert_eq!(view.point(DVec3::Z), pos2(0.0, -100.0));
        assert_eq!(view.point(DVec3::Y), pos2(100.0, 0.0));
    }

    #[test]
    fn a_drag_moves_the_surface_with_the_pointer() {
        let mut camera = Camera { azimuth: 0.0, elevation: 0.0, zoom: 1.0 };
        let middle = pos2(0.0, 0.0);
        let before = camera.onto(middle, 100.0).point(DVec3::X);
        camera.orbit(vec2(5.0, 3.0), 100.0);
        let moved = camera.onto(middle, 100.0).point(DVec3::X) - before;
        // The projection is linear only to the second order of the angle, which is 0.05 rad.
        assert!((moved - vec2(5.0, 3.0)).length() < 0.05, "{moved:?}");
    }
    #[test]
    fn a_touched_point_is_seen_where_it_is_touched() {
        let mut camera = Camera::default();
        camera.zoom_by(2.0);
        let middle = pos2(30.0, 40.0);
        let view = camera.onto(middle, 100.0);
        for drag in [vec2(0.0, 0.0), vec2(60.0, -30.0), vec2(-199.0, 0.0)] {
            let touched = view.touched(middle + drag).expect("on the sphere");
            // Screen coordinates are single precision numbers below 300.
            assert!((view.point(touched) - middle - drag).length() < 1e-4, "{touched}");
            assert!((touched.length() - 1.0).abs() < 1e-6 && !view.is_hidden(touched), "{touched}");
        }
        assert_eq!(view.touched(pos2(240.0, 40.0)), None);
        camera.zoom_by(100.0);
        assert_eq!(camera.zoom, ZOOM[1]);
        assert_eq!(camera.unzoomed().zoom, 1.0);
    }
}
