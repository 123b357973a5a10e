//! The abilities of a rig from the numbers that its server tells, so that a client judges a scene
//! as the server does.

use hbot_core::{Mat3, Vec3};

use super::abilities::Abilities;
use super::judge::Judge;
use super::sampled::Sampled;

/// The numbers by which a server judges scenes, as its answer to `info` tells them.
#[derive(Debug, Clone, PartialEq)]
pub struct Told {
    /// Rate of the loop, Hz.
    pub rate_hz: u32,
    /// Whether the rig is simulated.
    pub simulated: bool,
    /// Largest torque on the sphere, N m.
    pub torque: f64,
    /// Largest rate of change of the torque, N m/s.
    pub torque_rate: f64,
    /// Largest speed at which the rig runs, rad/s.
    pub speed: f64,
    /// Whether the rig limits the energy that it gives out.
    pub passive: bool,
    /// The loop. `None` if the server does not tell it. Then stability is not judged.
    pub sampled: Option<ToldLoop>,
}

/// The numbers of a loop as a server tells them. The fields are those of [`Sampled`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ToldLoop {
    /// [`Sampled::delay`].
    pub delay: u32,
    /// [`Sampled::lag`], s.
    pub lag: f64,
    /// [`Sampled::lead`], s.
    pub lead: f64,
    /// [`Sampled::rate_lag`], s.
    pub rate_lag: f64,
    /// [`Sampled::taps`], 1/s.
    pub taps: Vec<f64>,
    /// [`Sampled::inertia`], kg m².
    pub inertia: [f64; 3],
    /// The columns of [`Sampled::axes`].
    pub axes: [[f64; 3]; 3],
}

impl ToldLoop {
    /// Returns the numbers of `sampled` that a server tells.
    #[must_use]
    pub fn of(sampled: &Sampled) -> Self {
        let Sampled { period: _, delay, lag, lead, rate_lag, taps, inertia, axes } = sampled;
        let (inertia, axes) = (inertia.to_array(), axes.to_cols_array_2d());
        let taps = taps.clone();
        Self { delay: *delay, lag: *lag, lead: *lead, rate_lag: *rate_lag, taps, inertia, axes }
    }

    /// Returns the loop at `rate_hz` ticks per second. `None` if the numbers describe none: a rate
    /// or an inertia that is not above 0, a time below 0, or a number that is not finite.
    fn at_rate(self, rate_hz: u32) -> Option<Sampled> {
        let Self { delay, lag, lead, rate_lag, taps, inertia, axes } = self;
        let times = [lag, lead, rate_lag].into_iter().all(|x| x >= 0.0 && x.is_finite());
        let inertias = inertia.iter().all(|x| *x > 0.0 && x.is_finite());
        let others = axes.as_flattened().iter().chain(&taps).all(|x| x.is_finite());
        (rate_hz > 0 && times && inertias && others).then(|| Sampled {
            period: 1.0 / f64::from(rate_hz),
            delay,
            lag,
            lead,
            rate_lag,
            taps,
            inertia: Vec3::from_array(inertia),
            axes: Mat3::from_cols_array_2d(&axes),
        })
    }
}

impl Abilities {
    /// Computes the abilities of a rig from what its server tells. They are those that
    /// [`Abilities::of`] computes from the rig file.
    #[must_use]
    pub fn told(told: Told) -> Self {
        let Told { rate_hz, simulated, torque, torque_rate, speed, passive, sampled } = told;
        let sampled = sampled.and_then(|sampled| sampled.at_rate(rate_hz));
        let judge = sampled.map(|sampled| Judge { sampled, torque, torque_rate, speed, passive });
        let simulated_lag = judge.as_ref().filter(|_| simulated).map(|judge| judge.sampled.lag);
        Self { torque, rate_hz, judge, simulated_lag }
    }
}
