//! A hand for the simulated sphere: the mouse or the arrow keys turn it, and the scene pushes back.
//! With Shift, beside the sphere, with two fingers, or where there is no such hand, they turn the
//! view.

use eframe::egui::{EventFilter, Key, Pos2, Response, Ui, Vec2, vec2};
use glam::{DQuat, DVec3};

use crate::model::Model;
use crate::model::sample::quaternion;
use crate::net::Intent;
use crate::view::Desk;
use crate::view::camera::Projection;

/// How fast an arrow key turns the sphere or the view, rad/s.
const KEY_RATE: f64 = 0.8;
/// Longest time for which a key acts in one frame, s. A window that was not drawn for longer must
/// not make a jump.
const LONGEST_FRAME: f32 = 0.1;
/// Angle by which the mouse wheel twists the sphere, rad for each point that it scrolls. One notch
/// of a usual wheel is about 50 points.
const TWIST: f64 = 0.003;
/// Natural logarithm of the zoom for each point that the mouse wheel scrolls.
const ZOOM: f64 = 0.004;

/// The simulated hand while it holds the sphere.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Held {
    /// Orientation to which the hand turns the sphere: from the sphere's axes to frame N.
    q: DQuat,
    /// Where the hand touches the sphere: a unit vector in the axes of the sphere.
    pub(super) grip: DVec3,
    /// The place of the pointer that holds the sphere. `None` if the arrow keys do.
    pub(super) pointer: Option<Pos2>,
}

/// The force of the scene on the hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Push {
    /// The place of the hand: a unit vector in frame N.
    pub(super) at: DVec3,
    /// Force along the sphere's surface in frame N, N. Its moment about the centre is the torque
    /// on the sphere, except for the part about the line through the hand.
    pub(super) force: DVec3,
    /// Size of the torque on the sphere, N m.
    pub(super) torque: f64,
}

impl Held {
    /// Returns the force with which a torque on a sphere of the radius `radius` pushes the hand.
    /// `q` is the orientation of the sphere, `torque` is in N m and in frame N, `radius` in m.
    pub(super) fn push(&self, q: DQuat, torque: DVec3, radius: f64) -> Push {
        let at = q * self.grip;
        let force = if radius > 0.0 { torque.cross(at) / radius } else { DVec3::ZERO };
        Push { at, force, torque: torque.length() }
    }

    fn turn(&mut self, rotation: DVec3) {
        self.q = (DQuat::from_scaled_axis(rotation) * self.q).normalize();
    }

    fn intent(&self) -> Intent {
        let q = self.q;
        Intent::Hand(Some([q.w, q.x, q.y, q.z]))
    }
}

/// What turns the sphere or the view: the picture, and what the user does there in one frame.
pub(super) struct Control<'a> {
    pub(super) ui: &'a Ui,
    /// The response of the picture.
    pub(super) response: &'a Response,
    pub(super) model: &'a Model,
    pub(super) desk: &'a mut Desk,
    pub(super) view: Projection,
    pub(super) intents: &'a mut Vec<Intent>,
}

impl Control<'_> {
    /// Turns the sphere or the view as the user asks with pointer and keys.
    pub(super) fn act(mut self) {
        let before = self.desk.hand.map(|held| held.q);
        self.fingers();
        self.pointer();
        self.wheel();
        self.keys();
        if let Some(held) = &self.desk.hand
            && Some(held.q) != before
        {
            self.intents.push(held.intent());
        }
        if self.response.double_clicked() {
            self.desk.camera = Default::default();
        }
    }

    fn let_go(&mut self) {
        if self.desk.hand.take().is_some() {
            self.intents.push(Intent::Hand(None));
        }
    }

    /// Takes hold of the sphere at the point `touched`, a unit vector in frame N, if there is a
    /// hand.
    fn take(&mut self, touched: DVec3, pointer: Option<Pos2>) -> Option<Held> {
        let state = self.model.state.as_ref().filter(|_| self.model.has_hand())?;
        let q = quaternion(state.q);
        let held = Held { q, grip: q.conjugate() * touched, pointer };
        self.desk.hand = Some(held);
        Some(held)
    }

    /// Lets two fingers turn and zoom the view.
    fn fingers(&mut self) {
        let Some(touch) = self.ui.input(|input| input.multi_touch()) else { return };
        self.let_go();
        self.desk.camera.orbit(touch.translation_delta, self.view.radius);
        self.desk.camera.zoom_by(f64::from(touch.zoom_delta));
    }

    fn pointer(&mut self) {
        let (at, pressed, shift, fingers) = self.ui.input(|input| {
            let fingers = input.multi_touch().is_some();
            let pressed = input.pointer.primary_pressed();
            (input.pointer.interact_pos(), pressed, input.modifiers.shift, fingers)
        });
        let down = self.response.is_pointer_button_down_on() && !fingers;
        match (&mut self.desk.hand, at.filter(|_| down)) {
            (Some(held), Some(at)) => {
                if let Some(last) = held.pointer.replace(at) {
                    let motion = self.view.motion(at - last);
                    held.turn(self.view.eye.cross(motion));
                }
            }
            (Some(Held { pointer: Some(_), .. }), None) => self.let_go(),
            (None, Some(at)) if pressed && !shift => {
                if let Some(touched) = self.view.touched(at)
                    && let Some(held) = self.take(touched, Some(at))
                {
                    self.intents.push(held.intent());
                }
            }
            _ => {}
        }
        if self.response.dragged() && self.desk.hand.is_none() && !fingers {
            self.desk.camera.orbit(self.response.drag_delta(), self.view.radius);
        }
    }

    /// Lets the mouse wheel twist the sphere about the line of sight while the hand holds it, and
    /// zoom otherwise.
    fn wheel(&mut self) {
        let scrolled = f64::from(self.ui.input(|input| input.smooth_scroll_delta.y));
        if let Some(held) = &mut self.desk.hand {
            held.turn(self.view.eye * (TWIST * scrolled));
        } else if self.response.hovered() {
            self.desk.camera.zoom_by((ZOOM * scrolled).exp());
        }
    }

    fn keys(&mut self) {
        let has_focus = self.response.has_focus();
        let arrows = if has_focus {
            // The arrow keys would otherwise move the focus.
            let filter =
                EventFilter { horizontal_arrows: true, vertical_arrows: true, ..EventFilter::default() };
            self.ui.memory_mut(|memory| memory.set_focus_lock_filter(self.response.id, filter));
            arrow_keys(self.ui)
        } else {
            Vec2::ZERO
        };
        let by_keys = self.desk.hand.is_some_and(|held| held.pointer.is_none());
        let (shift, seconds, near, far) = self.ui.input(|input| {
            let near = has_focus && (input.key_pressed(Key::Plus) || input.key_pressed(Key::Equals));
            let far = has_focus && input.key_pressed(Key::Minus);
            (input.modifiers.shift, input.stable_dt.min(LONGEST_FRAME), near, far)
        });
        self.desk.camera.zoom_by(1.1_f64.powi(i32::from(near) - i32::from(far)));
        if arrows == Vec2::ZERO {
            if by_keys {
                self.let_go();
            }
            return;
        }
        // A key that is held down moves the sphere in each frame.
        self.ui.ctx().request_repaint();
        let angle = arrows * (KEY_RATE as f32) * seconds;
        if self.desk.hand.is_none() && !shift {
            self.take(self.view.eye, None);
        }
        match &mut self.desk.hand {
            Some(held) if held.pointer.is_none() => {
                held.turn(self.view.eye.cross(self.view.motion(angle * self.view.radius)));
            }
            Some(_) => {}
            None => self.desk.camera.orbit(angle, 1.0),
        }
    }
}

fn arrow_keys(ui: &Ui) -> Vec2 {
    ui.input(|input| {
        let key = |key| f32::from(u8::from(input.key_down(key)));
        vec2(key(Key::ArrowRight) - key(Key::ArrowLeft), key(Key::ArrowDown) - key(Key::ArrowUp))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_force_on_the_hand_has_the_torque_of_the_scene() {
        // A hand at s1, on a sphere whose s1 points along n2. The torque is about n3.
        let q = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let held = Held { q, grip: DVec3::X, pointer: None };
        let push = held.push(q, DVec3::new(0.0, 0.0, 0.2), 0.1);
        // The tolerance is the rounding of a few products of numbers below 10.
        assert!((push.at - DVec3::Y).length() < 1e-15);
        assert!((push.force - DVec3::new(-2.0, 0.0, 0.0)).length() < 1e-14, "{push:?}");
        assert!((0.1 * push.at.cross(push.force) - DVec3::new(0.0, 0.0, 0.2)).length() < 1e-15);
        // A torque about the line through the hand pushes it nowhere.
        let twist = held.push(q, DVec3::new(0.0, 0.3, 0.0), 0.1);
        assert!(twist.force.length() < 1e-15 && (twist.torque - 0.3).abs() < 1e-15);
    }
}
