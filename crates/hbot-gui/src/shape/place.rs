//! Where the references of a scene's effects are.

use glam::DQuat;
use hbot_config::scene::SceneEffect;
use hbot_core::render::effects::Anchor;

/// What the panel knows about the places of references.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Placing {
    /// Orientation of the sphere: the rotation from its axes to frame N.
    pub(crate) q: DQuat,
    /// The reference of the first effect that has one, as the server reports it in this state.
    pub(crate) reference: Option<DQuat>,
    /// Orientation of the sphere when rendering began, if the panel was there.
    pub(crate) began: Option<DQuat>,
    /// Whether the scene is rendered. Before that, effects with the anchor `here` would begin at
    /// the present orientation.
    pub(crate) rendering: bool,
}

impl Placing {
    /// Returns the orientation at which the scene is anchored, as a rotation to frame N: the
    /// identity if its first reference is absolute, or if no effect has one.
    pub(crate) fn anchor(&self, laws: &[SceneEffect]) -> DQuat {
        let first = laws.iter().find_map(|effect| effect.kind().reference());
        match (first, self.reference) {
            (Some((_, Anchor::Here)), _) if !self.rendering => self.q,
            (Some((own, Anchor::Here)), Some(now)) => own.conjugate() * now,
            _ => DQuat::IDENTITY,
        }
    }

    /// Returns the reference of each effect, as a rotation to frame N: the identity for effects
    /// without one, and `None` if the panel does not know where it is.
    ///
    /// The server reports the reference of the first effect that has one. If that effect is
    /// anchored `here`, its reference also says where the sphere was at enable.
    pub(crate) fn references(&self, laws: &[SceneEffect]) -> Vec<Option<DQuat>> {
        let all: Vec<_> = laws.iter().map(|effect| effect.kind().reference()).collect();
        let first = all.iter().position(Option::is_some);
        let anchor = match (self.rendering, first.and_then(|first| all[first]), self.reference) {
            (false, ..) => Some(self.q),
            (true, Some((own, Anchor::Here)), Some(now)) => Some(own.conjugate() * now),
            _ => self.began,
        };
        let place = |(k, reference): (usize, &Option<(DQuat, Anchor)>)| match reference {
            None => Some(DQuat::IDENTITY),
            // A client can have moved it.
            Some((_, kind)) if Some(k) == first && (self.rendering || *kind == Anchor::Absolute) => {
                self.reference
            }
            Some((own, Anchor::Absolute)) => Some(*own),
            Some((own, Anchor::Here)) => anchor.map(|anchor| *own * anchor),
        };
        all.iter().enumerate().map(place).collect()
    }
}
