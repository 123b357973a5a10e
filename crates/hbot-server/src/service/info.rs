//! The answer to `info`: the rig, its limits, what it can render, and what is running.

use hbot_api::{
    ClockInfo, Fault, FaultEvent, FaultWords, InfoOk, KindInfo, LeaseInfo, Mode, ModeWords, RenderInfo,
    SceneInfo, ShakingEvent,
};
use hbot_config::RigConfig;
use hbot_config::scene::{Listed, SHELF};
use hbot_core::allocation::{JointLimits, capability};
use hbot_core::design::kinematics::Posture;
use hbot_core::{MAX_WHEELS, Vec3};
use serde_json::Value;

use super::convert;
use super::outlook::Said;
use hbot_config::advice::{RatePick, StiffnessBound, USUAL_DAMPING, Warning, told_limits, told_rig};
use hbot_host::run_loop::clock::Origin;
use hbot_host::run_loop::sample::Sample;

/// The parts of the answer to `info` that do not change while the server runs.
pub(super) struct Info {
    fixed: InfoOk,
    limits: JointLimits,
    clock: Clock,
}

/// The parts of the answer to `info` that change while the server runs.
pub(super) struct Now<'a> {
    /// The running scene.
    pub(super) scene: Value,
    /// The warnings about it.
    pub(super) warnings: &'a [Warning],
    /// What takes longer to say of it, as far as it is known.
    pub(super) outlook: Said,
    /// The newest sample of the loop, if there is one.
    pub(super) sample: Option<&'a Sample>,
    /// The lease and its holder.
    pub(super) lease: LeaseInfo,
    /// The fault or stop in which the rig is now.
    pub(super) incident: Option<FaultEvent>,
    /// What shakes the sphere, while the torque is lowered for it.
    pub(super) shaking: Option<ShakingEvent>,
}

/// How the time of the loop relates to the clocks of the system.
#[derive(Debug, Clone, Copy)]
pub(super) struct Clock {
    /// The time of tick 0 when the loop started.
    pub(super) origin: Origin,
    /// Whether each skipped tick moves all later ticks one period away from the origin.
    pub(super) time_waits: bool,
}

impl Clock {
    /// Returns the time of tick 0 from which the time of `sample` is counted.
    fn at(self, sample: Option<&Sample>, period_ns: u64) -> ClockInfo {
        let skipped = sample.filter(|_| self.time_waits).map_or(0, |sample| sample.counters.skipped);
        let waited_ns = skipped * period_ns;
        ClockInfo {
            monotonic_ns: self.origin.monotonic_ns + waited_ns,
            unix_ns: self.origin.unix_ns + waited_ns,
        }
    }
}

impl Info {
    pub(super) fn new(config: &RigConfig, accuracy: &str, simulated: bool, clock: Clock) -> Self {
        let fixed = InfoOk {
            rig: told_rig(config, simulated),
            limits: told_limits(config),
            render: render(config),
            accuracy: accuracy.to_owned(),
            on_client_lost: convert::client_lost_policy(config.api.on_client_lost),
            effects: listed(hbot_config::scene::kinds()),
            phenomena: simulated.then(|| listed(hbot_config::scene::phenomena())),
            scenes: scenes(),
            modes: Mode::ALL.map(mode).into(),
            faults: Fault::ALL.map(fault).into(),
            ..InfoOk::default()
        };
        Self { fixed, limits: JointLimits::of(&config.rig), clock }
    }

    /// Returns the complete answer to `info`. The largest torque about each axis is computed for
    /// the posture in the sample, and is absent without a sample.
    pub(super) fn answer(&self, config: &RigConfig, now: Now<'_>) -> InfoOk {
        let Now { scene, warnings, outlook, sample, lease, incident, shaking } = now;
        let capability = sample.map(|sample| {
            let device = &config.rig.device;
            let mut steering = [0.0; MAX_WHEELS];
            for (i, th) in steering.iter_mut().enumerate() {
                *th = sample.state.angle[2 * i];
            }
            let posture = Posture::new(device, &steering[..device.wheels().len()]);
            Vec3::AXES.map(|axis| capability(posture.rows(), &self.limits, axis))
        });
        let clock = Some(self.clock.at(sample, config.rig.timing.period_ns));
        let mode = sample.map(|sample| convert::mode(sample.state.mode));
        InfoOk {
            clock,
            scene,
            warnings: convert::sentences(warnings),
            advice: warnings.iter().map(Into::into).collect(),
            stable: outlook.stable,
            curves: outlook.curves,
            capability,
            lease: Some(lease),
            mode,
            incident,
            shaking,
            ..self.fixed.clone()
        }
    }
}

/// Returns the stiffness of springs that the rig is expected to render, or `None` if the inertias
/// of a wheel contradict each other.
fn render(config: &RigConfig) -> Option<RenderInfo> {
    let expected = StiffnessBound::of(config)?;
    let [stiffness_most, _] = expected.most();
    Some(RenderInfo {
        inertia: expected.inertia(),
        damping: USUAL_DAMPING,
        stiffness_stable: expected.stable(USUAL_DAMPING),
        stiffness_most,
        damping_most: expected.most_damping(),
        border: border(&expected),
        rate_pick: config.rate_pick.as_ref().map(RatePick::sentence),
        sampled: Some(expected.sampled().into()),
    })
}

/// Returns pairs of a damping and the largest stiffness that is stable with it.
fn border(expected: &StiffnessBound) -> Vec<[f64; 2]> {
    /// Number of dampings, and the ratio of one to the next. The first is a 300th of the largest,
    /// below which the border is straight.
    const PAIRS: i32 = 32;
    const STEP: f64 = 1.2;
    let most = expected.most_damping();
    let dampings = (0..PAIRS).rev().map(|k| most * STEP.powi(-k));
    let pairs = std::iter::once(0.0).chain(dampings).map(|damping| [damping, expected.stable(damping)]);
    pairs.filter(|pair| pair.iter().all(|x| x.is_finite())).collect()
}

fn scenes() -> Vec<SceneInfo> {
    let told = SHELF.iter().map(|entry| {
        let scene = entry.scene();
        let (name, description) = (scene.name().to_owned(), scene.description().to_owned());
        SceneInfo { file: entry.file.to_owned(), name, description }
    });
    told.collect()
}

fn mode(mode: Mode) -> ModeWords {
    ModeWords { name: mode.to_string(), sentence: mode.sentence().to_owned() }
}

fn fault(fault: Fault) -> FaultWords {
    let (sentence, remedy) = fault.words();
    FaultWords { name: fault.to_string(), sentence: sentence.to_owned(), remedy: remedy.to_owned() }
}

fn listed(kinds: Vec<Listed>) -> Vec<KindInfo> {
    let kinds = kinds.into_iter();
    kinds
        .map(|Listed { name, description, schema }| KindInfo { name: name.to_owned(), description, schema })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use hbot_core::MAX_JOINTS;
    use hbot_core::design::rig::{Compensation, Imperfect};
    use hbot_host::run_loop::sample::Counters;

    #[test]
    fn the_origin_moves_by_the_ticks_for_which_the_time_has_waited() {
        let origin = Origin { monotonic_ns: 1_000, unix_ns: 5_000 };
        let counters = Counters { skipped: 3, ..Counters::default() };
        let sample = Sample { counters, ..crate::still::still(3) };
        let at = |time_waits| Clock { origin, time_waits }.at(Some(&sample), 100);
        assert_eq!(at(true), ClockInfo { monotonic_ns: 1_300, unix_ns: 5_300 });
        assert_eq!(at(false), ClockInfo { monotonic_ns: 1_000, unix_ns: 5_000 });
    }

    #[test]
    fn the_capability_counts_what_the_motors_make() {
        let capability = |torque_scale| {
            let mut config = RigConfig::prototype();
            let joints = [Imperfect { torque_scale, ..Imperfect::default() }; MAX_JOINTS];
            let known = Compensation { joints, ..Compensation::default() };
            config.rig = config.rig.with(|rig| rig.compensation = Some(known)).expect("a rig");
            let origin = Origin { monotonic_ns: 0, unix_ns: 0 };
            let info = Info::new(&config, "", true, Clock { origin, time_waits: false });
            let now = Now {
                scene: Value::Null,
                warnings: &[],
                outlook: Said::default(),
                sample: Some(&crate::still::still(1)),
                lease: LeaseInfo::default(),
                incident: None,
                shaking: None,
            };
            info.answer(&config, now).capability.expect("a sample")
        };
        for (weaker, whole) in capability(0.9).into_iter().zip(capability(1.0)) {
            assert!((weaker - 0.9 * whole).abs() < 1e-12, "{weaker} of {whole}");
        }
    }
}
