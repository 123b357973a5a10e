//! Vibration about an axis: a wave with an envelope. It gives out energy: at most its amplitude
//! times the angle turned.

use super::{Law, Now};
use crate::real::{Real, TURN, Vec3, floor, sincos};

/// The shape of a vibration's wave. Each shape begins with the half period of positive torque about
/// the axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub enum Wave {
    /// A sine.
    Sine,
    /// A square wave: 1, then -1.
    Square,
    /// A saw-tooth: from 0 up to 1, then from -1 up to 0.
    Saw,
}

impl Wave {
    /// Returns the value of the wave, -1 to 1. `phase` is the fraction of the period, 0 to 1.
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

/// An effect that makes the sphere vibrate about an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Vibration {
    /// Axis of the vibration in frame N, a unit vector.
    pub axis: Vec3,
    /// Amplitude of the torque, N m.
    pub amplitude: Real,
    /// Frequency of the wave, Hz.
    pub frequency: Real,
    /// Shape of the wave.
    pub wave: Wave,
    /// Duration of the rise of the amplitude from zero at the start, s.
    pub attack: Real,
    /// Time from the start until the amplitude begins to fall, s. If 0, it never falls.
    pub hold: Real,
    /// Duration of the fall of the amplitude to zero, s.
    pub release: Real,
    /// Time from one start of the vibration to the next, s. If 0, it starts only once.
    pub repeat: Real,
}

/// The memory of a vibration effect from one tick to the next.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Phase {
    /// Position within the period of the wave, 0 to 1.
    phase: Real,
    /// Time since the vibration started, s. It stops growing when the amplitude no longer changes.
    age: Real,
}

impl Vibration {
    /// Returns the factor on the amplitude `age` seconds after the start of the vibration, 0 to 1.
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
        // After its last change, the envelope needs no more time.
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

    const GIVES: bool = true;
    const ELASTIC: bool = false;

    #[inline]
    fn render(&self, now: &mut Now<'_>, state: &mut Phase) -> Vec3 {
        let level = self.amplitude * self.envelope(state.age);
        let torque = if level == 0.0 { Vec3::ZERO } else { self.axis * (level * self.wave.at(state.phase)) };
        self.advance(state, now.dt);
        torque
    }
}
