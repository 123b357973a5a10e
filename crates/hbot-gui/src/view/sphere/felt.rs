//! Draws what the hand meets: walls, notches, guides, places that attract.

use eframe::egui::{Color32, Stroke, lerp};

use super::drawing::Drawing;
use crate::shape::{Form, Piece, Role};

/// Opacity of a piece that does not act on the sphere, and of its part that the sphere hides.
const AT_REST: [f32; 2] = [0.75, 0.25];

impl Drawing {
    /// Draws the pieces of the scene's shapes. Those that act on the sphere are brighter and
    /// thicker, and come last.
    pub(super) fn felt(&self, pieces: &[Piece]) {
        let (glowing, still): (Vec<_>, Vec<_>) = pieces.iter().partition(|piece| piece.glow > 0.0);
        for piece in still.into_iter().chain(glowing) {
            self.piece(piece);
        }
    }

    fn piece(&self, piece: &Piece) {
        let (color, glow) = (self.color(piece.role), piece.glow as f32);
        let seen = color.gamma_multiply(lerp(AT_REST[0]..=1.0, glow));
        let hidden = color.gamma_multiply(lerp(AT_REST[1]..=0.5, glow));
        match &piece.form {
            Form::Line(points) => {
                if glow > 0.0 {
                    self.runs(points, false, Stroke::new(5.0 + 5.0 * glow, color.gamma_multiply(0.3)));
                }
                let width = lerp(1.4..=3.0, glow);
                self.runs(points, true, Stroke::new(width, hidden));
                self.runs(points, false, Stroke::new(width, seen));
            }
            Form::Dot(at) => {
                let point = self.view.point(*at);
                let is_hidden = self.view.is_hidden(*at);
                let color = if is_hidden { hidden } else { seen };
                if glow > 0.0 && !is_hidden {
                    self.painter.circle_filled(point, 6.0 + 5.0 * glow, color.gamma_multiply(0.35));
                }
                self.painter.circle_filled(point, lerp(2.5..=4.5, glow), color);
            }
            Form::Label(at, text) => self.text(*at, text, seen, 0.0),
        }
    }

    fn color(&self, role: Role) -> Color32 {
        match role {
            // What attracts the sphere has the colour of a reference, which attracts it too.
            Role::Place => self.palette.ghost,
            Role::Wall | Role::Guide => self.palette.felt,
            Role::Pointer => self.palette.grid,
        }
    }
}
