//! The effects that scenes are made of: one file per kind, and the list of kinds at the end of this
//! file.
//!
//! An effect is a small immutable description. Its memory from tick to tick is in its slot of the
//! renderer. To add a kind, add a file here with its type, its `Law` and its memory, and a line in
//! the list. Equations and sources are in docs/effects.md.
//!
//! Kinds are plain structs. hbot-config checks every range before it fills them, and the core takes
//! the values as they are.

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
pub use track::{Path, Track};
pub use vibration::{Vibration, Wave};

pub(crate) use inertia::mass_scale;
pub(crate) use now::{Now, Shared};
pub(crate) use target::Reference;

use crate::real::{Quat, Real, Vec3};

/// The law of a kind of effect: how it computes torque and energy from the motion of the sphere.
pub(crate) trait Law {
    /// Data of the law that are kept from tick to tick. They start fresh at load and at enable.
    type Memory: Copy + Default + PartialEq + core::fmt::Debug;

    /// Advances `memory` by one tick. Returns the torque on the sphere in frame N, N m, before gain
    /// and fading.
    fn render(&self, now: &mut Now<'_>, memory: &mut Self::Memory) -> Vec3;

    /// Returns the stored energy, J, for kinds whose torque, apart from damping, is the gradient of
    /// an energy.
    fn energy(&self, _now: &mut Now<'_>, _memory: &Self::Memory) -> Option<Real> {
        None
    }

    /// Returns the reference and its anchor, for kinds that have one.
    fn reference(&self) -> Option<(Quat, Anchor)> {
        None
    }

    /// Returns the distance in rad from the orientation `q` to where the effect would rest with its
    /// reference at `desired`. Only for kinds whose torque grows with this distance. The rig's
    /// `enable_max_angle` limits it.
    fn excess(&self, _desired: Quat, _q: Quat, _figures: &[Real]) -> Option<Real> {
        None
    }

    /// Returns, for a virtual mass, its largest eigenvalue or an upper bound of it, kg m², and the
    /// time constant of its smoothing, s.
    fn mass(&self) -> Option<(Real, Real)> {
        None
    }
}

/// One effect of a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effect {
    /// Index of the effect's memory in the controller, below
    /// [`MAX_EFFECTS`](crate::scene::MAX_EFFECTS).
    pub slot: u8,
    /// Number that identifies the effect during the life of the server. A new number makes a fresh
    /// memory. The old number keeps the memory, for example when a parameter of a running effect is
    /// set.
    pub epoch: u32,
    /// Revision of the reference. If it changes and `epoch` does not, the kind's `reference`
    /// becomes the new goal, and the memory is kept.
    pub reference_revision: u32,
    /// Factor on the effect's torque.
    pub gain: Real,
    /// Duration of the fade-in, s.
    pub fade_s: Real,
    /// Duration of the fade-out after the effect has left the scene, s.
    pub fade_out_s: Real,
    /// True if the effect is no longer part of the scene: it fades out and is then silent.
    pub leaving: bool,
    /// The effect's part of the scene's table of figures.
    pub figures: Span,
    /// The kind of the effect with its parameters.
    pub kind: Kind,
}

impl Effect {
    /// Creates an effect that acts fully at once and needs no figures.
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
    /// Index of the first figure.
    pub start: u16,
    /// Number of figures.
    pub len: u16,
}

impl Span {
    /// A span without figures.
    pub const EMPTY: Self = Self { start: 0, len: 0 };
}

/// The memory of an effect from tick to tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct EffectState {
    /// Epoch of the effect that this memory belongs to; 0 for none.
    pub(crate) epoch: u32,
    pub(crate) reference_revision: u32,
    /// Time since the fade-in began, s. It stops at the fade time.
    pub(crate) age_s: Real,
    /// Time since the fade-out began, s.
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

/// Builds the list of kinds and passes each kind its own memory.
macro_rules! kinds {
    ($($(#[$doc:meta])* $name:ident),* $(,)?) => {
        /// The kinds of effects, each with its parameters.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub enum Kind {
            $($(#[$doc])* $name($name)),*
        }

        /// The memories of the kinds.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub(crate) enum Memory {
            /// Fresh: nothing is remembered yet.
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

            /// Returns the reference and its anchor, for kinds that have one.
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
    /// A torque that is constant.
    Constant,
    /// A spring with a damper towards a reference orientation.
    Spring,
    /// Resistance against turning, proportional to the rate.
    Damper,
    /// A virtual mass, which resists acceleration.
    Inertia,
    /// Dry friction that truly sticks.
    Friction,
    /// Notches of a dial about an axis.
    Detents,
    /// A set of orientations into which the sphere snaps.
    Snaps,
    /// Walls that limit the directions of an axis to a cone and the twist to a range.
    EndStop,
    /// A guide that holds some directions of turning and leaves others free.
    Guide,
    /// Bumps on the sphere's surface, felt when it turns.
    Texture,
    /// A vibration about an axis.
    Vibration,
    /// An off-centre mass under gravity.
    Pendulum,
    /// Attraction near an orientation, and almost no torque far from it.
    Magnet,
    /// Clicks: short pulses of torque.
    Pulse,
    /// A spring to a reference that moves by itself.
    Track,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The largest kind is a spring with its two matrices. Larger data belong in the scene's table
    /// of figures.
    #[test]
    fn no_kind_blows_up_all_others() {
        assert!(size_of::<Kind>() <= size_of::<Spring>() + size_of::<Real>(), "{}", size_of::<Kind>());
        assert!(size_of::<Memory>() <= 16 * size_of::<Real>(), "{}", size_of::<Memory>());
    }

    /// Checks in either width of reals that every kind gives finite torques and energies.
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
        let swing = Path::Swing { axis, amplitude: 0.3, from: 1.0, to: 2.0, sweep: 1.0, repeat: true };
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
