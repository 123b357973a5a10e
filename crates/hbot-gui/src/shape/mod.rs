//! The geometry of what the hand meets: walls, notches, guides, places that attract. All functions
//! are pure: from the laws of a scene and the orientation of the sphere to lines and points in
//! frame N, in units of the sphere's radius. `view/sphere` draws them.
//!
//! | module | what it makes |
//! |---|---|
//! | [`place`] | where the references of the effects are |
//! | [`round`] | circles and arcs on the sphere |
//! | [`dial`] | rings about an axis: notches, stops of the twist |
//! | [`parts`] | the shape of each part of an effect's outline |

mod dial;
mod parts;
mod place;
mod round;

use glam::{DQuat, DVec3};
use hbot_config::scene::SceneEffect;

pub(crate) use place::Placing;

/// What a piece of a shape stands for. It decides the colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// A wall that pushes back.
    Wall,
    /// A notch, a click or a place that attracts the sphere.
    Place,
    /// Directions in which the sphere turns freely.
    Guide,
    /// A part of the sphere that walls, notches and guides act on. It turns with the sphere.
    Pointer,
}

/// The form of a piece of a shape. Positions are in frame N, in units of the sphere's radius.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Form {
    Line(Vec<DVec3>),
    Dot(DVec3),
    Label(DVec3, String),
}

/// A piece of a shape.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Piece {
    pub(crate) role: Role,
    pub(crate) form: Form,
    /// How strongly the piece acts on the sphere now: 0 if not at all, 1 at the rig's torque limit
    /// or beyond.
    pub(crate) glow: f64,
}

/// The shapes of a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Shapes {
    pub(crate) pieces: Vec<Piece>,
    /// Ids of the effects with a wall, notch or guide that acts on the sphere now.
    pub(crate) met: Vec<String>,
    /// Number of effects whose shape is not in `pieces`, because the panel does not know where they
    /// are anchored.
    pub(crate) unplaced: usize,
}

/// Returns the shapes of the effects `laws`. `limit` is the rig's torque limit, N m.
pub(crate) fn shapes(laws: &[SceneEffect], placing: &Placing, limit: f64) -> Shapes {
    let mut shapes = Shapes::default();
    for (effect, place) in laws.iter().zip(placing.references(laws)) {
        if effect.gain() == 0.0 {
            continue;
        }
        let Some(reference) = place else {
            shapes.unplaced += 1;
            continue;
        };
        let first = shapes.pieces.len();
        let pull = effect.kind().at_rest(reference, placing.q, effect.numbers()).length();
        let share = pull * effect.gain() / limit;
        let mut pen = Pen { reference, q: placing.q, share, pieces: &mut shapes.pieces };
        parts::draw(&mut pen, effect);
        if shapes.pieces[first..].iter().any(|piece| piece.glow > 0.0) {
            shapes.met.push(effect.id().to_owned());
        }
    }
    shapes
}

/// Collects the pieces of one effect.
struct Pen<'a> {
    /// Reference of the effect: the rotation from its axes to frame N.
    reference: DQuat,
    /// Orientation of the sphere: the rotation from its axes to frame N.
    q: DQuat,
    /// Torque of the effect, relative to the rig's torque limit.
    share: f64,
    pieces: &'a mut Vec<Piece>,
}

impl Pen<'_> {
    fn line(&mut self, role: Role, points: Vec<DVec3>, glow: f64) {
        self.pieces.push(Piece { role, form: Form::Line(points), glow });
    }

    fn dot(&mut self, role: Role, at: DVec3, glow: f64) {
        self.pieces.push(Piece { role, form: Form::Dot(at), glow });
    }

    fn label(&mut self, role: Role, at: DVec3, text: &str) {
        self.pieces.push(Piece { role, form: Form::Label(at, text.to_owned()), glow: 0.0 });
    }

    /// Returns the orientation of the sphere relative to the effect's reference, with a scalar part
    /// that is not negative.
    fn relative(&self) -> DQuat {
        hbot_core::rotation::shortest(self.reference.conjugate() * self.q)
    }

    /// Returns how bright a piece glows that the effect acts through. Also a light touch is
    /// visible.
    fn glow(&self) -> f64 {
        const LEAST: f64 = 0.3;
        if self.share > 0.0 { (LEAST + (1.0 - LEAST) * self.share).min(1.0) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests;
