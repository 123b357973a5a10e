//! The effects that scenes are made of: one file a kind, and one list at the end of this one.
//!
//! An effect is a small immutable description; what it remembers from tick to tick stands in its slot of the renderer.
//! Adding a kind means a file here, with what it is, its `Law` and its memory, and a line in the list. Equations and
//! sources are in docs/effects.md.
//!
//! New kinds are plain structs: hbot-config fills them after checking every range, and the core takes them as they are.

mod constant;
mod damper;
mod detents;
mod end_stop;
mod friction;
pub(crate) mod geometry;
mod guide;
mod inertia;
mod magnet;
mod now;
mod pendulum;
mod pulse;
mod snaps;
mod spring;
mod target;
mod texture;
mod track;
mod vibration;

pub use constant::{Constant, Frame};
pub use damper::Damper;
pub use detents::Detents;
pub use end_stop::EndStop;
pub use friction::Friction;
pub use guide::{Freedom, Guide};
pub use inertia::Inertia;
pub use magnet::Magnet;
pub use now::Motion;
pub use pendulum::Pendulum;
pub use pulse::Pulse;
pub use snaps::{MAX_OWN, SnapSet, Snaps};
pub use spring::{Spring, SpringLaw};
pub use target::{Anchor, Target};
pub use texture::Texture;
pub use track::{Track, TrackPath};
pub use vibration::{Vibration, Wave};

pub(crate) use inertia::mass_scale;
pub(crate) use now::{Now, Shared};
pub(crate) use target::Reference;

use crate::real::{Quat, Real, Vec3};

/// What a kind of effect does.
pub(crate) trait Law {
    /// What it remembers from tick to tick; fresh at load and at enable.
    type Memory: Copy + Default + PartialEq + core::fmt::Debug;

    /// Moves `memory` on by one tick. Returns the torque on the sphere in N, N m, before gain and fading.
    fn render(&self, now: &mut Now<'_>, memory: &mut Self::Memory) -> Vec3;

    /// The energy stored, J, for kinds whose torque (but for their damping) is the gradient of one.
    fn energy(&self, _now: &mut Now<'_>, _memory: &Self::Memory) -> Option<Real> {
        None
    }

    /// The reference and its anchor, for kinds that have one.
    fn reference(&self) -> Option<(Quat, Anchor)> {
        None
    }

    /// How far, rad, the orientation `q` is from where the effect would be at rest with its reference at `desired`, for kinds whose
    /// torque grows with that: what a rig's `enable_max_angle` limits.
    fn excess(&self, _desired: Quat, _q: Quat, _figures: &[Real]) -> Option<Real> {
        None
    }

    /// For a virtual mass: its largest eigenvalue or a bound of it, kg m², and the time constant of its smoothing, s.
    fn mass(&self) -> Option<(Real, Real)> {
        None
    }
}

/// One effect of a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effect {
    /// Where its memory stands in the controller, below [`MAX_EFFECTS`](crate::scene::MAX_EFFECTS).
    pub slot: u8,
    /// Which effect it is in the life of the server: a new number makes a fresh memory, the same one keeps it, as when a
    /// parameter of a running effect is set.
    pub epoch: u32,
    /// A change of this number (epoch kept) makes `reference` of the kind the new goal of a kept memory.
    pub reference_revision: u32,
    /// Factor on its torque.
    pub gain: Real,
    /// How long it takes to fade in, s.
    pub fade_s: Real,
    /// How long it takes to fade out once it is leaving, s.
    pub fade_out_s: Real,
    /// No longer part of the scene: it fades out, and is then silent.
    pub leaving: bool,
    /// Its part of the scene's table of figures.
    pub figures: Span,
    /// What it is.
    pub kind: Kind,
}

impl Effect {
    /// An effect that acts at once and fully, and needs no figures.
    #[must_use]
    pub fn new(slot: u8, epoch: u32, kind: Kind) -> Self {
        Self {
            slot,
            epoch,
            reference_revision: 0,
            gain: 1.0,
            fade_s: 0.0,
            fade_out_s: 0.0,
            leaving: false,
            figures: Span::EMPTY,
            kind,
        }
    }
}

/// A part of a scene's table of figures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Span {
    /// Its first figure.
    pub start: u16,
    /// How many.
    pub len: u16,
}

impl Span {
    /// No figures.
    pub const EMPTY: Self = Self { start: 0, len: 0 };
}

/// What an effect remembers from tick to tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct EffectState {
    /// The effect whose memory this is; 0 for none.
    pub(crate) epoch: u32,
    pub(crate) reference_revision: u32,
    /// Time since it began to fade in, s; stops at its fade time.
    pub(crate) age_s: Real,
    /// Time since it began to leave, s.
    pub(crate) leaving_s: Real,
    pub(crate) reference: Reference,
    pub(crate) memory: Memory,
}

impl EffectState {
    /// The memory of no effect.
    pub(crate) const EMPTY: Self = Self {
        epoch: 0,
        reference_revision: 0,
        age_s: 0.0,
        leaving_s: 0.0,
        reference: Reference::STILL,
        memory: Memory::None,
    };
}

/// Makes the list of kinds, and hands each its own memory.
macro_rules! kinds {
    ($($(#[$doc:meta])* $name:ident),* $(,)?) => {
        /// The list of kinds.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub enum Kind {
            $($(#[$doc])* $name($name)),*
        }

        /// The kinds' own memories.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub(crate) enum Memory {
            /// Fresh.
            None,
            $($name(<$name as Law>::Memory)),*
        }

        impl Kind {
            #[inline]
            pub(crate) fn render(&self, now: &mut Now<'_>, memory: &mut Memory) -> Vec3 {
                match self {
                    $(Self::$name(law) => {
                        if let Memory::$name(own) = memory {
                            return law.render(now, own);
                        }
                        let mut own = Default::default();
                        let torque = law.render(now, &mut own);
                        *memory = Memory::$name(own);
                        torque
                    })*
                }
            }

            pub(crate) fn energy(&self, now: &mut Now<'_>, memory: &Memory) -> Option<Real> {
                match self {
                    $(Self::$name(law) => match memory {
                        Memory::$name(own) => law.energy(now, own),
                        _ => law.energy(now, &Default::default()),
                    })*
                }
            }

            /// The reference and its anchor, for kinds that have one.
            #[inline]
            #[must_use]
            pub fn reference(&self) -> Option<(Quat, Anchor)> {
                match self {
                    $(Self::$name(law) => law.reference()),*
                }
            }

            pub(crate) fn excess(&self, desired: Quat, q: Quat, figures: &[Real]) -> Option<Real> {
                match self {
                    $(Self::$name(law) => law.excess(desired, q, figures)),*
                }
            }

            pub(crate) fn mass(&self) -> Option<(Real, Real)> {
                match self {
                    $(Self::$name(law) => law.mass()),*
                }
            }
        }
    };
}

kinds! {
    /// A torque that does not change.
    Constant,
    /// A spring with a damper towards a reference orientation.
    Spring,
    /// Resistance against turning.
    Damper,
    /// Resistance against being sped up or slowed down.
    Inertia,
    /// Dry friction that truly sticks.
    Friction,
    /// Notches of a dial.
    Detents,
    /// Orientations that it snaps into.
    Snaps,
    /// Walls about a cone of directions and a range of twist.
    EndStop,
    /// Holds some directions of turning and leaves others free.
    Guide,
    /// Bumps on the sphere's surface.
    Texture,
    /// Shaking.
    Vibration,
    /// A mass off the centre, under gravity.
    Pendulum,
    /// Attraction near an orientation.
    Magnet,
    /// Clicks.
    Pulse,
    /// A spring to a reference that moves by itself.
    Track,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The largest kind is a spring with its two matrices: what is bigger belongs in the scene's table of figures.
    #[test]
    fn no_kind_blows_up_all_others() {
        assert!(size_of::<Kind>() <= size_of::<Spring>() + size_of::<Real>(), "{}", size_of::<Kind>());
        assert!(size_of::<Memory>() <= 16 * size_of::<Real>(), "{}", size_of::<Memory>());
    }

    /// In either width every kind is finite.
    #[test]
    fn every_kind_works_in_this_width() {
        let target = Target::N;
        let axis = Vec3::new(0.48, -0.6, 0.64);
        let spring = Spring::new(
            SpringLaw::Geodesic,
            crate::real::Mat3::IDENTITY,
            crate::real::Mat3::IDENTITY,
            Quat::IDENTITY,
            Anchor::Here,
        );
        let swing = TrackPath::Swing { axis, amplitude: 0.3, from: 1.0, to: 2.0, sweep: 1.0, repeat: true };
        let mass = crate::real::Mat3::IDENTITY * 0.001;
        let kinds = [
            Kind::Constant(Constant { torque: axis, frame: Frame::Sphere }),
            Kind::Spring(spring.unwrap_or_else(|| unreachable!("a legal spring"))),
            Kind::Damper(Damper::new(mass).unwrap_or_else(|| unreachable!("a legal damping"))),
            Kind::Inertia(Inertia { mass, smoothing: 0.01 }),
            Kind::Friction(Friction { torque: 0.05, stiffness: 5.0, damping: 0.01 }),
            Kind::Detents(Detents {
                target,
                axis,
                strength: 0.1,
                width: 0.2,
                count: 12,
                end_stiffness: 0.0,
                damping: 0.01,
            }),
            Kind::Snaps(Snaps {
                target,
                set: SnapSet::Icosahedron,
                strength: 0.1,
                width: 0.2,
                rounding: Snaps::rounding(SnapSet::Icosahedron, &[]),
                damping: 0.01,
            }),
            Kind::EndStop(EndStop {
                target,
                axis,
                cone: Some(0.5),
                twist: Some([-0.5, 0.5]),
                stiffness: 3.0,
                damping: 0.1,
            }),
            Kind::Guide(Guide {
                target,
                axis,
                free: Freedom::Axis,
                stiffness: 3.0,
                damping: 0.1,
                deadband: 0.1,
            }),
            Kind::Texture(Texture { at: axis, wave_number: 30.0, depth: 0.05 }),
            Kind::Vibration(Vibration {
                axis,
                amplitude: 0.1,
                frequency: 40.0,
                wave: Wave::Sine,
                attack: 0.0,
                hold: 0.0,
                release: 0.0,
                repeat: 0.0,
            }),
            Kind::Pendulum(Pendulum { centre: axis * 0.05, weight: Vec3::new(0.0, 0.0, -4.0) }),
            Kind::Magnet(Magnet { target, strength: 0.1, width: 0.3 }),
            Kind::Pulse(Pulse {
                target,
                axis,
                strength: 0.1,
                duration: 0.01,
                fire: 1,
                period: 0.1,
                count: 12,
            }),
            Kind::Track(Track { target, path: swing, stiffness: 1.0, damping: 0.1, deadband: 0.0 }),
        ];
        let mut shared = Shared::EMPTY;
        for kind in kinds {
            let mut memory = Memory::None;
            for k in 0..500 {
                let turn = Vec3::new(0.013, -0.007, 0.011) * k as Real;
                let motion = Motion { q: crate::rotation::exp(turn), omega: axis * 3.0 };
                shared.begin();
                let mut now = Now {
                    motion: &motion,
                    dt: 0.001,
                    reference: &Reference::STILL,
                    figures: &[],
                    shared: &mut shared,
                };
                let torque = kind.render(&mut now, &mut memory);
                assert!(torque.is_finite(), "{kind:?} at {turn}: {torque}");
                let energy = kind.energy(&mut now, &memory);
                assert!(energy.is_none_or(Real::is_finite), "{kind:?} at {turn}: {energy:?}");
                shared.end(&motion, 0.001);
            }
        }
    }
}
