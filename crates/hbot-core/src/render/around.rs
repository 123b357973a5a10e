//! What a scene is like around an orientation: its stiffness, its damping, and the places where
//! its laws are steepest or change. All of it is taken from the code that renders.
//!
//! A law is linearised by a swing (the *describing function* of Krylov and Bogoliubov): the sphere
//! swings about one axis by a sine, and the part of the torque that follows the angle is the
//! stiffness, the part that follows the rate the damping. For a linear law this is its derivative,
//! whatever the swing. For other laws it is what a swing of that size feels: less than the steepest
//! slope of a notch that is narrower than the swing, half of a wall at its edge, and the energy
//! that dry friction takes in each cycle as damping.

use crate::real::{Mat3, Quat, Real, TURN, Vec3, sincos};
use crate::render::effects::{
    Anchor, Effect, Kind, Memory, Motion, Now, Reference, Shared, largest, mass_scale,
};
use crate::render::scene::{CompiledScene, MAX_EFFECTS};
use crate::rotation;

/// Number of moments of a swing at which a law is evaluated. The moments are symmetric, so a
/// constant torque and all even harmonics leave no rest.
const MOMENTS: usize = 16;

/// What a place of a law is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Spot {
    /// The reference of the effect. For an effect without a reference: any orientation.
    Rest,
    /// The bottom of a notch or well.
    Notch,
    /// The edge of a wall.
    Wall,
    /// The end of a dead band, where a spring begins.
    Edge,
    /// A slope of bumps on the surface.
    Bump,
}

/// A place at which a law of the scene is steepest or changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Index of the effect in the scene whose place it is.
    pub effect: usize,
    /// What the place is.
    pub spot: Spot,
    /// Orientation of the sphere at the place: it maps sphere axes to frame N.
    pub q: Quat,
    /// Axis in frame N about which a turn leads deeper into a wall or out of a dead band. Zero at
    /// other places.
    pub deeper: Vec3,
    memory: Memory,
}

impl Place {
    /// Returns the place after a turn by `depth` rad deeper into the wall or out of the dead band.
    /// Other places stay as they are.
    #[must_use]
    pub fn at_depth(&self, depth: Real) -> Self {
        Self { q: rotation::exp(self.deeper * depth) * self.q, ..*self }
    }

    /// Returns the orientation `q` as a place where the sphere rests. Its effect keeps the memory
    /// that it had.
    #[must_use]
    pub fn rest_at(&self, q: Quat) -> Self {
        Self { q, spot: Spot::Rest, deeper: Vec3::ZERO, ..*self }
    }
}

/// A swing of the sphere by which laws are linearised.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Swing {
    /// Axes of the swings in frame N, as columns: orthogonal unit vectors.
    pub axes: Mat3,
    /// Amplitude of the turn about each axis, rad. An axis with 0 is left out: stiffness and
    /// damping have nothing of it.
    pub turn: [Real; 3],
    /// Amplitude of the angular velocity, rad/s; above 0.
    pub speed: Real,
}

/// Stiffness and damping of an effect around an orientation, in frame N. The torque of a small
/// turn p (rotation vector, rad) and a rate w is `-stiffness p - damping w`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Linear {
    /// Stiffness, N m/rad. It is not symmetric for laws without an energy.
    pub stiffness: Mat3,
    /// Damping, N m s/rad.
    pub damping: Mat3,
}

/// The moments of a swing at which laws are evaluated.
struct Moments {
    /// Sine and cosine of each phase.
    phases: [[Real; 2]; MOMENTS],
    /// Orientations of a sphere that swings about each axis.
    q: [[Quat; MOMENTS]; 3],
}

impl Moments {
    fn new(place: &Place, swing: &Swing) -> Self {
        let phases = core::array::from_fn(|moment| {
            let (sine, cosine) = sincos((moment as Real + 0.5) * (TURN / MOMENTS as Real));
            [sine, cosine]
        });
        let mut q = [[place.q; MOMENTS]; 3];
        for (k, q) in q.iter_mut().enumerate().filter(|(k, _)| swing.turn[*k] > 0.0) {
            for (q, [sine, _]) in q.iter_mut().zip(phases) {
                *q = rotation::exp(swing.axes.col(k) * (swing.turn[k] * sine)) * place.q;
            }
        }
        Self { phases, q }
    }
}

/// An effect during a swing.
#[derive(Clone, Copy)]
struct Swung {
    reference: Reference,
    /// Its memory at the place, and in the swing.
    settled: Memory,
    memory: Memory,
    stiffness: [Vec3; 3],
    damping: [Vec3; 3],
}

impl Linear {
    /// No stiffness and no damping.
    pub const NONE: Self = Self { stiffness: Mat3::ZERO, damping: Mat3::ZERO };
}

/// What a scene does to a sphere that keeps turning about one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turned {
    /// Mean square of the torque about the axis that depends on the angle, without its mean, N² m².
    pub ripple: Real,
    /// Energy that the sphere needs to pass from the lowest to the highest place, J.
    pub barrier: Real,
    /// Mean damping, N m s/rad.
    pub damping: Real,
}

impl CompiledScene {
    /// Calls `visit` for each place at which a law of the scene is steepest or changes. References
    /// that are relative to the sphere's orientation are placed as if it were `here`. Effects that
    /// fade out or have no gain have no places.
    pub fn places(&self, here: Quat, mut visit: impl FnMut(Place)) {
        for (index, effect) in self.effects().iter().enumerate().filter(|(_, effect)| acts(effect)) {
            let reference = placed(effect, here).q;
            effect.kind.places(self.numbers(effect.numbers), &mut |spot, x, deeper, memory| {
                visit(Place { effect: index, spot, q: reference * x, deeper: reference * deeper, memory });
            });
        }
    }

    /// Returns the stiffness and damping of the effect with the index `index` around `place`, for a
    /// sphere that swings by `swing`. `here` is that of [`places`](Self::places).
    ///
    /// The effect has the memory that it would have there. A virtual mass has neither stiffness nor
    /// damping: [`masses`](Self::masses) returns it.
    ///
    /// # Panics
    /// Panics if `index` is not below the number of effects.
    #[must_use]
    pub fn around(&self, index: usize, place: &Place, here: Quat, swing: &Swing) -> Linear {
        let mut all = [Linear::NONE; MAX_EFFECTS];
        let mut linear = all.iter_mut();
        self.all_around(
            place,
            here,
            swing,
            |i| i != index,
            |part| {
                if let Some(linear) = linear.next() {
                    *linear = part;
                }
            },
        );
        all[..self.effects().len()][index]
    }

    /// Calls `visit` for each effect of the scene, in their order, with its stiffness and damping
    /// as [`around`](Self::around) returns them. Those whose index is `idle` count as none.
    pub fn all_around(
        &self,
        place: &Place,
        here: Quat,
        swing: &Swing,
        idle: impl Fn(usize) -> bool,
        mut visit: impl FnMut(Linear),
    ) {
        let Moments { phases, q } = Moments::new(place, swing);
        let effects = self.effects();
        // `None` for an effect that takes no part.
        let mut swung: [Option<Swung>; MAX_EFFECTS] = [None; MAX_EFFECTS];
        let mut shared = Shared::EMPTY;
        // The memory settles at the place itself: dry friction sticks there.
        let at_place = Motion { q: place.q, omega: Vec3::ZERO };
        for (index, (effect, swung)) in effects.iter().zip(&mut swung).enumerate() {
            if acts(effect) && !idle(index) {
                let reference = placed(effect, here);
                let mut settled = if place.effect == index { place.memory } else { Memory::None };
                self.torque(effect, &reference, at_place, &mut settled, &mut shared);
                let (stiffness, damping) = ([Vec3::ZERO; 3], [Vec3::ZERO; 3]);
                *swung = Some(Swung { reference, settled, memory: settled, stiffness, damping });
            }
        }
        for k in (0..3).filter(|k| swing.turn[*k] > 0.0) {
            let (axis, turn) = (swing.axes.col(k), swing.turn[k]);
            swung.iter_mut().flatten().for_each(|swung| swung.memory = swung.settled);
            // The first cycle brings a law with a memory into its steady cycle.
            for is_steady in [false, true] {
                for (q, [sine, cosine]) in q[k].iter().zip(phases) {
                    let motion = Motion { q: *q, omega: axis * (swing.speed * cosine) };
                    shared.begin();
                    for (effect, swung) in effects.iter().zip(&mut swung) {
                        let Some(swung) = swung else { continue };
                        if !is_steady && !effect.kind.remembers() {
                            continue;
                        }
                        let Swung { reference, memory, .. } = swung;
                        let torque = self.torque(effect, reference, motion, memory, &mut shared);
                        if is_steady {
                            swung.stiffness[k] -= torque * (sine * 2.0 / (MOMENTS as Real * turn));
                            swung.damping[k] -= torque * (cosine * 2.0 / (MOMENTS as Real * swing.speed));
                        }
                    }
                }
            }
        }
        let back = swing.axes.transpose();
        let whole = |[x, y, z]: [Vec3; 3]| Mat3::from_cols(x, y, z) * back;
        for swung in &swung[..effects.len()] {
            visit(swung.map_or(Linear::NONE, |Swung { stiffness, damping, .. }| Linear {
                stiffness: whole(stiffness),
                damping: whole(damping),
            }));
        }
    }

    /// Calls `visit` for each virtual mass of the scene: its inertia in frame N (kg m², with the
    /// effect's gain, and scaled as the renderer scales it) and the time constant of its smoothing
    /// (s). `inertia` is that of the sphere (kg m²), and `period` that of the loop (s). Returns the
    /// factor by which the masses are scaled, 1 if the loop renders all of them.
    pub fn masses(&self, inertia: Real, period: Real, mut visit: impl FnMut(Mat3, Real)) -> Real {
        let all = || {
            let masses = self.effects().iter().filter(|effect| acts(effect));
            masses.filter_map(|effect| Some((effect.gain, effect.kind.mass()?)))
        };
        let sizes = all().map(|(gain, (mass, smoothing))| (largest(&mass) * gain, smoothing));
        let scale = mass_scale(sizes, inertia, period);
        all().for_each(|(gain, (mass, smoothing))| visit(mass * (gain * scale), smoothing));
        scale
    }

    /// Returns what the scene does to a sphere that turns once about `axis` (unit vector in frame
    /// N), beginning at the orientation `from`, at the speed `speed` (rad/s; above 0). The laws are
    /// evaluated at `samples` places. `here` is that of [`places`](Self::places).
    #[must_use]
    pub fn turned(&self, axis: Vec3, from: Quat, here: Quat, speed: Real, samples: u32) -> Turned {
        let step = TURN / samples as Real;
        let (mut sum, mut squares, mut damping) = (0.0, 0.0, 0.0);
        let (mut energy, mut low, mut high): (Real, Real, Real) = (0.0, 0.0, 0.0);
        let mut shared = Shared::EMPTY;
        for k in 0..samples {
            let q = rotation::exp(axis * (step * k as Real)) * from;
            let [mut still, mut turning] = [0.0; 2];
            shared.begin();
            for effect in self.effects().iter().filter(|effect| acts(effect)) {
                let reference = placed(effect, here);
                let mut about = |omega| {
                    let motion = Motion { q, omega };
                    self.torque(effect, &reference, motion, &mut Memory::None, &mut shared).dot(axis)
                };
                still += about(Vec3::ZERO);
                turning += about(axis * speed);
            }
            sum += still;
            squares += still * still;
            damping += (still - turning) / speed;
            energy -= still * step;
            (low, high) = (low.min(energy), high.max(energy));
        }
        let n = samples as Real;
        let ripple = (squares / n - (sum / n) * (sum / n)).max(0.0);
        Turned { ripple, barrier: high - low, damping: damping / n }
    }

    /// Returns the torque of the effect with the index `index` on a sphere that rests at the
    /// orientation `q` after it came there from `place`, N m. `here` is that of
    /// [`places`](Self::places).
    ///
    /// # Panics
    /// Panics if `index` is not below the number of effects.
    #[must_use]
    pub fn pull(&self, index: usize, place: &Place, here: Quat, q: Quat) -> Vec3 {
        let effect = &self.effects()[index];
        let reference = placed(effect, here);
        let (mut memory, mut shared) = (place.memory, Shared::EMPTY);
        let mut at = |q| {
            let motion = Motion { q, omega: Vec3::ZERO };
            shared.begin();
            self.torque(effect, &reference, motion, &mut memory, &mut shared)
        };
        at(place.q);
        at(q)
    }

    /// Returns the torque of `effect` with its gain, N m. The time stands still. What effects share
    /// begins anew with each motion.
    fn torque(
        &self,
        effect: &Effect,
        reference: &Reference,
        motion: Motion,
        memory: &mut Memory,
        shared: &mut Shared,
    ) -> Vec3 {
        let numbers = self.numbers(effect.numbers);
        effect.kind.render(
            effect.gain,
            Now { motion, dt: 0.0, lead: 0.0, ahead: 0.0, reference, numbers, shared, shares: true },
            memory,
        )
    }
}

/// Returns the torque of `kind` at the orientation `q`, with fresh memory (see
/// [`Kind::at_rest`]).
pub(crate) fn still(kind: &Kind, reference: Quat, q: Quat, numbers: &[Real]) -> Vec3 {
    let reference = &Reference { q: reference, goal: reference, ..Reference::STILL };
    let (mut shared, motion) = (Shared::EMPTY, Motion { q, omega: Vec3::ZERO });
    let shared = &mut shared;
    let now = Now { motion, dt: 0.0, lead: 0.0, ahead: 0.0, reference, numbers, shared, shares: false };
    kind.render(1.0, now, &mut Memory::None)
}

fn acts(effect: &Effect) -> bool {
    !effect.leaving && effect.gain != 0.0
}

/// Returns the reference of `effect` at rest, placed as if the sphere had the orientation `here`.
fn placed(effect: &Effect, here: Quat) -> Reference {
    let q = match effect.kind.reference() {
        Some((reference, Anchor::Absolute)) => reference,
        Some((reference, Anchor::Here)) => reference * here,
        None => Quat::IDENTITY,
    };
    Reference { q, goal: q, ..Reference::STILL }
}
