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
mod knock;
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
pub use knock::{Knock, Knocking};
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

pub(crate) use inertia::{largest, mass_scale};
use knock::Knocked;
pub(crate) use now::{Now, Shared};
pub(crate) use target::Reference;

use crate::real::{Mat3, Quat, Real, Vec3};
use crate::render::around::Spot;
use crate::render::outline::Outline;

/// The law of a kind of effect: how the effect computes torque and energy from the motion of the
/// sphere.
pub(crate) trait Law {
    /// Data that the law keeps from one tick to the next. They are reset when the effect is loaded,
    /// and at `enable`.
    type Memory: Copy + Default + PartialEq + core::fmt::Debug;

    /// True for a law that most scenes have. It is inlined into the loop over the effects.
    const COMMON: bool = false;

    /// True for a law that gives out energy on purpose, whatever the sphere does.
    const GIVES: bool = false;

    /// True for a law whose torque follows the orientation, so that delay makes it create energy.
    const ELASTIC: bool = true;

    /// Returns the torque on the sphere in frame N, in N m, before the effect's gain and fading.
    /// Advances `memory` by one tick.
    fn render(&self, now: &mut Now<'_>, memory: &mut Self::Memory) -> Vec3;

    /// Returns the energy that the effect stores, J. Returns `None` if the effect's torque, apart
    /// from damping, is not the gradient of an energy.
    fn energy(&self, _now: &mut Now<'_>, _memory: &Self::Memory) -> Option<Real> {
        None
    }

    /// Returns the orientation from which the effect is measured, and its anchor. Returns `None`
    /// for effects without such a reference.
    fn reference(&self) -> Option<(Quat, Anchor)> {
        None
    }

    /// Returns the angle between the orientation `q` and the nearest orientation at which the
    /// effect is at rest, rad. `desired` is the effect's reference. Returns `None` for effects
    /// whose torque does not grow with this angle. The rig refuses `enable` if the angle is above
    /// `enable_max_angle`.
    fn excess(&self, _desired: Quat, _q: Quat, _figures: &[Real]) -> Option<Real> {
        None
    }

    /// Returns a virtual mass in frame N (kg m²) and the time constant of its smoothing (s), or
    /// `None` for other effects.
    fn mass(&self) -> Option<(Mat3, Real)> {
        None
    }

    /// True if the torque depends on how the sphere came to its orientation, as that of dry
    /// friction does.
    const REMEMBERS: bool = false;

    /// Calls `visit` for each place at which the law is steepest or changes. A place is a turn from
    /// the effect's reference, the axis about which a turn leads deeper into a wall or out of a
    /// dead band (in the reference's frame; zero elsewhere), and the memory that the effect has
    /// there. A law that is the same everywhere, or steepest at its reference, has the default.
    fn places(&self, _numbers: &[Real], visit: &mut dyn FnMut(Spot, Quat, Vec3, Self::Memory)) {
        visit(Spot::Rest, Quat::IDENTITY, Vec3::ZERO, Self::Memory::default());
    }

    /// Calls `visit` for each wall, notch or other part of the law that has a place in space. Most
    /// laws act everywhere alike and have none.
    fn outline<'a>(&self, _numbers: &'a [Real], _visit: &mut dyn FnMut(Outline<'a>)) {}
}

/// One effect of a scene, such as a spring, with its parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Effect {
    /// Index of the controller's memory that the effect uses from tick to tick, below
    /// [`MAX_EFFECTS`](crate::render::scene::MAX_EFFECTS).
    pub slot: u8,
    /// Number that identifies the effect while the server runs. An effect with a new number starts
    /// with fresh memory. With the old number the memory is kept, for example when a parameter of a
    /// running effect is set.
    pub epoch: u32,
    /// Number that changes when the scene gives the effect a new reference. If it changes and
    /// `epoch` does not, the effect moves to the new reference and keeps its memory.
    pub reference_revision: u32,
    /// Factor by which the effect's torque is multiplied.
    pub gain: Real,
    /// Duration of the fade-in, s.
    pub fade_s: Real,
    /// Duration of the fade-out after the effect has been removed from the scene, s.
    pub fade_out_s: Real,
    /// True if the effect has been removed from the scene. It fades out and then makes no torque.
    pub leaving: bool,
    /// The effect's part of the scene's table of numbers, such as the angles of notches.
    pub numbers: Span,
    /// The kind of the effect and its parameters.
    pub kind: Kind,
}

impl Effect {
    /// Creates an effect that acts with its full torque from the start and uses no numbers of the
    /// scene's table.
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
            numbers: Span::EMPTY,
            kind,
        }
    }
}

/// A part of a scene's table of numbers. It contains data of an effect that are too long for the
/// effect's parameters, such as way-points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Span {
    /// Index of the first value of this part in the scene's table of numbers.
    pub start: u16,
    /// Count of values in this part of the scene's table of numbers.
    pub len: u16,
}

impl Span {
    /// A span that contains no numbers.
    pub const EMPTY: Self = Self { start: 0, len: 0 };
}

/// The memory that an effect keeps from one tick to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct EffectState {
    /// Epoch of the effect to which this memory belongs (see [`Effect::epoch`]); 0 if it belongs to
    /// none.
    pub(crate) epoch: u32,
    pub(crate) reference_revision: u32,
    /// Time since the fade-in began, s. It stops growing at the end of the fade-in.
    pub(crate) age_s: Real,
    /// Time since the fade-out began, s.
    pub(crate) leaving_s: Real,
    pub(crate) reference: Reference,
    pub(crate) memory: Memory,
}

impl EffectState {
    /// A memory that belongs to no effect.
    pub(crate) const EMPTY: Self = Self {
        epoch: 0,
        reference_revision: 0,
        age_s: 0.0,
        leaving_s: 0.0,
        reference: Reference::STILL,
        memory: Memory::None,
    };
}

/// Returns the torque of `law` times `gain`. Each law is a separate function unless it is
/// [`Law::COMMON`]. If all were inlined into the loop over the effects, each tick would compute
/// values for laws that are not in the scene.
///
/// A separate function gets a copy of `now`. So the compiler can hold the fields of `now` in
/// registers for the common laws. If they were in memory, a vector would be written and read in
/// different parts, which stops the processor for some nanoseconds.
#[inline(always)]
fn apply<L: Law>(law: &L, gain: Real, mut now: Now<'_>, memory: &mut L::Memory) -> Vec3 {
    #[inline(never)]
    fn apart<L: Law>(law: &L, now: &mut Now<'_>, memory: &mut L::Memory) -> Vec3 {
        law.render(now, memory)
    }
    let torque =
        if L::COMMON { law.render(&mut now, memory) } else { apart(law, &mut Now { ..now }, memory) };
    torque * gain
}

/// Defines [`Kind`] and [`Memory`] from the list of effects and their laws, and functions that call
/// the law of each kind with its own memory.
macro_rules! kinds {
    ($($(#[$doc:meta])* $name:ident($law:ty)),* $(,)?) => {
        /// The kinds of effects. Each variant contains the parameters of the effect.
        #[derive(Debug, Clone, Copy, PartialEq)]
        #[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
        pub enum Kind {
            $($(#[$doc])* $name($law)),*
        }

        /// The memories of all kinds of effects. Each effect uses the variant of its kind.
        #[derive(Debug, Clone, Copy, PartialEq)]
        #[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
        pub(crate) enum Memory {
            /// Fresh memory: no tick has been rendered yet.
            None,
            $($name(<$law as Law>::Memory)),*
        }

        impl Kind {
            /// Returns the torque of the effect times `gain`, in frame N, N m. Advances `memory` by
            /// one tick.
            #[inline(always)]
            pub(crate) fn render(&self, gain: Real, now: Now<'_>, memory: &mut Memory) -> Vec3 {
                match self {
                    $(Self::$name(law) => {
                        if !matches!(memory, Memory::$name(_)) {
                            *memory = Memory::$name(Default::default());
                        }
                        match memory {
                            Memory::$name(own) => apply(law, gain, now, own),
                            // Not reached, because the memory has just got this variant.
                            _ => Vec3::ZERO,
                        }
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

            /// Returns the orientation from which the effect is measured, and its anchor. Returns
            /// `None` for kinds without such a reference.
            #[inline]
            #[must_use]
            pub fn reference(&self) -> Option<(Quat, Anchor)> {
                match self {
                    $(Self::$name(law) => law.reference()),*
                }
            }

            /// Returns the angle between the orientation `q` and the nearest orientation at which
            /// the effect is at rest, rad. `desired` is the effect's reference, and `numbers` is
            /// its list of numbers, such as the angles of notches. Returns `None` for kinds whose
            /// torque does not grow with this angle. The rig refuses `enable` if the angle is
            /// above `enable_max_angle`.
            #[must_use]
            pub fn excess(&self, desired: Quat, q: Quat, numbers: &[Real]) -> Option<Real> {
                match self {
                    $(Self::$name(law) => law.excess(desired, q, numbers)),*
                }
            }

            /// Calls `visit` for each part of the effect's geometry, such as a wall. `numbers` is
            /// its list of numbers. An effect that acts everywhere alike, such as a damper, has
            /// none; neither has one whose only place is its reference, such as a spring.
            pub fn outline<'a>(&self, numbers: &'a [Real], visit: &mut dyn FnMut(Outline<'a>)) {
                match self {
                    $(Self::$name(law) => law.outline(numbers, visit)),*
                }
            }

            /// Returns true for kinds that give out energy on purpose, whatever the sphere does.
            pub(crate) const fn gives(&self) -> bool {
                match self {
                    $(Self::$name(_) => <$law as Law>::GIVES),*
                }
            }

            pub(crate) const fn is_elastic(&self) -> bool {
                match self {
                    $(Self::$name(_) => <$law as Law>::ELASTIC),*
                }
            }

            pub(crate) fn mass(&self) -> Option<(Mat3, Real)> {
                match self {
                    $(Self::$name(law) => law.mass()),*
                }
            }

            pub(crate) fn remembers(&self) -> bool {
                match self {
                    $(Self::$name(_) => <$law as Law>::REMEMBERS),*
                }
            }

            pub(crate) fn places(&self, numbers: &[Real], visit: &mut dyn FnMut(Spot, Quat, Vec3, Memory)) {
                match self {
                    $(Self::$name(law) => law.places(numbers, &mut |spot, x, deeper, memory| {
                        visit(spot, x, deeper, Memory::$name(memory));
                    })),*
                }
            }
        }
    };
}

kinds! {
    /// A constant torque.
    Constant(Constant),
    /// A spring that pulls the sphere to a reference orientation, with a damper.
    Spring(Spring),
    /// Viscous resistance against turning.
    Damper(Damper),
    /// A virtual mass that resists acceleration of the sphere.
    Inertia(Inertia),
    /// Dry friction that lets a sphere at rest truly stick.
    Friction(Friction),
    /// The notches of a dial about an axis.
    Detents(Detents),
    /// A set of orientations into which the sphere snaps.
    Snaps(Snaps),
    /// Walls that keep an axis of the sphere within a cone, and its twist within a range.
    EndStop(EndStop),
    /// A guide that lets the sphere turn freely in some directions and holds it in the others.
    Guide(Guide),
    /// Bumps on the sphere's surface that the hand feels when the sphere turns.
    Texture(Texture),
    /// A vibration about an axis.
    Vibration(Vibration),
    /// An off-centre mass under gravity, as in a pendulum.
    Pendulum(Pendulum),
    /// Attraction near an orientation, and almost no torque far from it.
    Magnet(Magnet),
    /// Clicks: short pulses of torque about an axis.
    Pulse(Pulse),
    /// A spring that pulls the sphere along with a moving reference.
    Track(Track),
    /// Detents with a knock.
    KnockingDetents(Knocking<Detents>),
    /// Snaps with a knock.
    KnockingSnaps(Knocking<Snaps>),
    /// End stops with a knock.
    KnockingEndStop(Knocking<EndStop>),
}

impl Memory {
    /// Converts the memory of an effect that has been given a knock, or has lost it, to that of
    /// `kind`. So the effect keeps what its law remembers, the number of turns. Snaps remember
    /// nothing.
    pub(crate) fn fit(&mut self, kind: &Kind) {
        *self = match (kind, &*self) {
            (Kind::Detents(_), Self::KnockingDetents(knocked)) => Self::Detents(knocked.law()),
            (Kind::KnockingDetents(_), Self::Detents(law)) => Self::KnockingDetents(Knocked::silent(*law)),
            (Kind::EndStop(_), Self::KnockingEndStop(knocked)) => Self::EndStop(knocked.law()),
            (Kind::KnockingEndStop(_), Self::EndStop(law)) => Self::KnockingEndStop(Knocked::silent(*law)),
            _ => return,
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks that no kind of effect is much larger than a spring with its two matrices, because
    /// every effect takes the space of the largest kind. Larger data belong in the scene's table of
    /// numbers.
    #[test]
    fn no_kind_blows_up_all_others() {
        assert!(size_of::<Kind>() <= size_of::<Spring>() + size_of::<Real>(), "{}", size_of::<Kind>());
        assert!(size_of::<Memory>() <= 16 * size_of::<Real>(), "{}", size_of::<Memory>());
    }

    fn now(motion: Motion, shared: &mut Shared) -> Now<'_> {
        Now {
            motion,
            dt: 0.001,
            lead: 0.0,
            ahead: 0.0,
            reference: &Reference::STILL,
            numbers: &[],
            shared,
            shares: true,
        }
    }

    /// Checks that every kind of effect gives finite torques and energies, in builds with `f32` and
    /// with `f64`.
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
        let end_stop =
            EndStop { target, axis, cone: Some(0.5), twist: Some([-0.5, 0.5]), stiffness: 3.0, damping: 0.1 };
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
            Kind::EndStop(end_stop),
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
            Kind::KnockingEndStop(Knocking {
                law: end_stop,
                knock: Knock { amplitude: 0.1, frequency: 100.0, decay: 0.01 },
            }),
        ];
        let mut shared = Shared::EMPTY;
        for kind in kinds {
            let mut memory = Memory::None;
            for k in 0..500 {
                let turn = Vec3::new(0.013, -0.007, 0.011) * k as Real;
                let motion = Motion { q: crate::rotation::exp(turn), omega: axis * 3.0 };
                shared.begin();
                let torque = kind.render(1.0, now(motion, &mut shared), &mut memory);
                assert!(torque.is_finite(), "{kind:?} at {turn}: {torque}");
                let energy = kind.energy(&mut now(motion, &mut shared), &memory);
                assert!(energy.is_none_or(Real::is_finite), "{kind:?} at {turn}: {energy:?}");
                shared.end(&motion, 0.001);
            }
        }
    }
}
