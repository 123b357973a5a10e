//! Reports a sphere that shakes by itself, as the loop's guard finds it.

use hbot_api::ShakingEvent;
use hbot_core::safety::shaking::Shaking;
use hbot_host::run_loop::sample::Sample;

use super::scenes::Scenes;

/// Compares what the guard finds from sample to sample.
#[derive(Debug, Default)]
pub(super) struct Shakes {
    /// The event of the last finding, while the guard lowers the torque.
    last: Option<ShakingEvent>,
}

impl Shakes {
    /// Returns the event for all clients, if the sample has a new finding or the torque has its
    /// full value again. The event is also logged.
    #[inline]
    pub(super) fn look(&mut self, sample: &Sample, scenes: &Scenes) -> Option<ShakingEvent> {
        let found = sample.state.shaking;
        if found.map(|found| found.tick) == self.last.as_ref().map(|event| event.tick) {
            return None;
        }
        self.last = found.map(|found| shaking(sample, &found, scenes));
        Some(self.last.clone().unwrap_or_else(|| over(sample)))
    }

    /// Returns the last event, while the torque is lowered.
    pub(super) fn present(&self) -> Option<&ShakingEvent> {
        self.last.as_ref()
    }
}

fn shaking(sample: &Sample, found: &Shaking, scenes: &Scenes) -> ShakingEvent {
    let Shaking { frequency, amplitude, gain, .. } = *found;
    let effect = found.slot.and_then(|slot| scenes.id_at(slot)).map(str::to_owned);
    let who = effect.as_deref().unwrap_or("the scene");
    let message = format!(
        "the sphere shakes by itself at {frequency:.0} Hz and {amplitude:.1} rad/s; {who} gives the energy. The torque is \
         lowered until it stops. Lower the stiffness or raise the damping of {who}"
    );
    tracing::warn!(tick = found.tick, "{message}");
    ShakingEvent {
        tick: found.tick,
        t: sample.t_ns as f64 * 1e-9,
        shaking: true,
        frequency,
        amplitude,
        effect,
        gain,
        message,
    }
}

fn over(sample: &Sample) -> ShakingEvent {
    let message = "the sphere is calm, and the torque has its full value again".to_owned();
    tracing::info!(tick = sample.state.tick, "{message}");
    ShakingEvent {
        tick: sample.state.tick,
        t: sample.t_ns as f64 * 1e-9,
        shaking: false,
        frequency: 0.0,
        amplitude: 0.0,
        effect: None,
        gain: 1.0,
        message,
    }
}
