//! Shaking about an axis: a wave under an envelope. It gives energy: at most its amplitude times the path turned.

use super::{Law, Now};
use crate::real::{Real, TURN, Vec3, floor, sincos};

/// The shape of a wave. Each begins with a period's first half, which pushes along the axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wave {
    /// A sine.
    Sine,
    /// 1, then -1.
    Square,
    /// From 0 up to 1, then from -1 up to 0.
    Saw,
}

impl Wave {
    /// The wave at the phase 0 to 1.
    #[inline]
    fn at(self, phase: Real) -> Real {
        match self {
            Self::Sine => sincos(TURN * phase).0,
            Self::Square => {
                if phase < 0.5 {
                    1.0
                } else {
                    -1.0
                }
            }
            Self::Saw => {
                if phase < 0.5 {
                    2.0 * phase
                } else {
                    2.0 * phase - 2.0
                }
            }
        }
    }
}

/// Shaking about an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vibration {
    /// In N, unit.
    pub axis: Vec3,
    /// N m.
    pub amplitude: Real,
    /// Hz.
    pub frequency: Real,
    /// Its shape.
    pub wave: Wave,
    /// How long it takes to rise, s.
    pub attack: Real,
    /// When it begins to die away after its start, s; 0 for never.
    pub hold: Real,
    /// How long it takes to die away, s.
    pub release: Real,
    /// When it starts again after its start, s; 0 for never.
    pub repeat: Real,
}

/// Where a vibration stands.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Phase {
    /// Of the wave, 0 to 1.
    phase: Real,
    /// Since its start, s; no longer than the envelope.
    age: Real,
}

impl Vibration {
    /// The envelope at an age, 0 to 1.
    #[inline]
    fn envelope(&self, age: Real) -> Real {
        let rise = if age < self.attack { age / self.attack } else { 1.0 };
        if self.hold == 0.0 || age < self.hold {
            return rise;
        }
        let left = self.hold + self.release - age;
        if left > 0.0 { rise * (left / self.release) } else { 0.0 }
    }

    fn advance(&self, state: &mut Phase, dt: Real) {
        state.phase += self.frequency * dt;
        state.phase -= floor(state.phase);
        // Past the last change of the envelope there is nothing to count.
        let last =
            self.attack.max(self.repeat).max(if self.hold > 0.0 { self.hold + self.release } else { 0.0 });
        state.age = (state.age + dt).min(last);
        if self.repeat > 0.0 && state.age >= self.repeat {
            *state = Phase::default();
        }
    }
}

impl Law for Vibration {
    type Memory = Phase;

    #[inline]
    fn render(&self, now: &mut Now<'_>, state: &mut Phase) -> Vec3 {
        let level = self.amplitude * self.envelope(state.age);
        let torque = if level == 0.0 { Vec3::ZERO } else { self.axis * (level * self.wave.at(state.phase)) };
        self.advance(state, now.dt);
        torque
    }
}
