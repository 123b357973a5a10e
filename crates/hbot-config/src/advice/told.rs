//! The abilities of a rig from the numbers that its server tells in its answer to `info`, so that a
//! client judges a scene as the server does.

use hbot_api::{InfoOk, LoopInfo};
use hbot_core::{Mat3, Vec3};

use super::abilities::Abilities;
use super::judge::Judge;
use super::sampled::Sampled;

/// The numbers by which a server judges scenes, as its answer to `info` tells them.
#[derive(Debug, Clone, PartialEq)]
pub struct Told {
    /// Rate of the loop, Hz.
    rate_hz: u32,
    /// Whether the rig is simulated.
    simulated: bool,
    /// Largest torque on the sphere, N m.
    torque: f64,
    /// Largest rate of change of the torque, N m/s.
    torque_rate: f64,
    /// Largest speed at which the rig runs, rad/s.
    speed: f64,
    /// Whether the rig limits the energy that it gives out.
    passive: bool,
    /// The loop. `None` if the server, an older one, does not tell it. Then stability is not
    /// judged.
    sampled: Option<LoopInfo>,
}

impl From<&InfoOk> for Told {
    fn from(info: &InfoOk) -> Self {
        Self {
            rate_hz: info.rig.rate_hz,
            simulated: info.rig.simulated,
            torque: info.limits.torque,
            torque_rate: info.limits.torque_rate,
            speed: info.limits.speed,
            passive: info.limits.passivity.is_some(),
            sampled: info.render.as_ref().and_then(|render| render.sampled.clone()),
        }
    }
}

impl From<&Sampled> for LoopInfo {
    fn from(sampled: &Sampled) -> Self {
        let Sampled { period: _, delay, lag, lead, rate_lag, taps, inertia, axes } = sampled;
        Self {
            delay_ticks: *delay,
            lag_s: *lag,
            lead_s: *lead,
            rate_lag_s: *rate_lag,
            rate_weights: taps.clone(),
            inertia: inertia.to_array(),
            axes: axes.to_cols_array_2d(),
        }
    }
}

/// Returns the loop that a server with `rate_hz` ticks per second tells. `None` if the numbers
/// describe none: a rate or an inertia that is not above 0, a time below 0, or a number that is not
/// finite.
fn sampled(told: LoopInfo, rate_hz: u32) -> Option<Sampled> {
    let LoopInfo { delay_ticks, lag_s, lead_s, rate_lag_s, rate_weights, inertia, axes } = told;
    let times = [lag_s, lead_s, rate_lag_s].into_iter().all(|x| x >= 0.0 && x.is_finite());
    let inertias = inertia.iter().all(|x| *x > 0.0 && x.is_finite());
    let others = axes.as_flattened().iter().chain(&rate_weights).all(|x| x.is_finite());
    (rate_hz > 0 && times && inertias && others).then(|| Sampled {
        period: 1.0 / f64::from(rate_hz),
        delay: delay_ticks,
        lag: lag_s,
        lead: lead_s,
        rate_lag: rate_lag_s,
        taps: rate_weights,
        inertia: Vec3::from_array(inertia),
        axes: Mat3::from_cols_array_2d(&axes),
    })
}

impl Abilities {
    /// Computes the abilities of a rig from what its server tells. They are those that
    /// [`Abilities::of`] computes from the rig file.
    #[must_use]
    pub fn told(told: Told) -> Self {
        let Told { rate_hz, simulated, torque, torque_rate, speed, passive, sampled: told } = told;
        let sampled = told.and_then(|told| sampled(told, rate_hz));
        let judge = sampled.map(|sampled| Judge { sampled, torque, torque_rate, speed, passive });
        let simulated_lag = judge.as_ref().filter(|_| simulated).map(|judge| judge.sampled.lag);
        Self { torque, rate_hz, inertia: None, judge, simulated_lag }
    }
}
