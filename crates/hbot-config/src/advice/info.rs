//! The loop and the abilities of a rig in the words of an answer to `info`.

use hbot_api::{InfoOk, LoopInfo};

use super::told::{Told, ToldLoop};

impl From<&InfoOk> for Told {
    /// Takes the numbers by which the server that gave the answer judges scenes. An older server
    /// does not tell its loop.
    fn from(info: &InfoOk) -> Self {
        let sampled = info.render.as_ref().and_then(|render| render.sampled.clone());
        Self {
            rate_hz: info.rig.rate_hz,
            simulated: info.rig.simulated,
            torque: info.limits.torque,
            torque_rate: info.limits.torque_rate,
            speed: info.limits.speed,
            passive: info.limits.passivity.is_some(),
            sampled: sampled.map(ToldLoop::from),
        }
    }
}

impl From<LoopInfo> for ToldLoop {
    fn from(info: LoopInfo) -> Self {
        let LoopInfo { delay_ticks, lag_s, lead_s, rate_lag_s, rate_weights, inertia, axes } = info;
        Self {
            delay: delay_ticks,
            lag: lag_s,
            lead: lead_s,
            rate_lag: rate_lag_s,
            taps: rate_weights,
            inertia,
            axes,
        }
    }
}

impl From<ToldLoop> for LoopInfo {
    fn from(told: ToldLoop) -> Self {
        let ToldLoop { delay, lag, lead, rate_lag, taps, inertia, axes } = told;
        Self {
            delay_ticks: delay,
            lag_s: lag,
            lead_s: lead,
            rate_lag_s: rate_lag,
            rate_weights: taps,
            inertia,
            axes,
        }
    }
}
