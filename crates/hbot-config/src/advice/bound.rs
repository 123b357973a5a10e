//! The stiffness that a rig can render about one axis: the borders of the sampled loop, and the
//! turn of the sphere that corresponds to one encoder count.

use hbot_core::design::kinematics::Posture;
use hbot_core::{MAX_JOINTS, MAX_WHEELS, Rig};

use super::axis::Axis;
use super::inertia;
use super::sampled::{HOLDS, Sampled};
use crate::RigConfig;

/// Damping of a spring that is assumed when a stable stiffness is shown as an example, N m s/rad.
/// The hand can feel it, and it is small enough that the steps of the encoder counts do not make it
/// noisy.
pub const USUAL_DAMPING: f64 = 0.02;

/// Turn of the slowest swing that is examined, rad per tick. It is slower than the stiffest
/// spring's swing with the largest lag and the highest rate that a rig file can have: 0.1 s at 20
/// kHz, 0.013 rad per tick.
const SLOWEST_SWING: f64 = 1.0e-3;
/// Ratio between the frequencies of two swings that are examined. Between them the border is taken
/// as straight, which is off by less than 1e-5 of it.
const RATIO: f64 = 1.004;
/// Number of the last readings whose weights in a rate estimate are computed.
const LAST: usize = 1024;
/// Least number of them that are kept, and the fraction of the largest weight below which those of
/// older readings are left out.
const LEAST: usize = 128;
const SMALL: f64 = 1.0e-6;

/// Returns the weights of the last angles in the estimated rate of `joint`, 1/s, the newest angle
/// first. Empty if the rates are those of the motor controllers.
pub(super) fn weights(rig: &Rig, joint: usize) -> Vec<f64> {
    let mut steps = [0.0; LAST];
    if !hbot_core::motion::rates::step_response(rig, joint, &mut steps) {
        return Vec::new();
    }
    let before = std::iter::once(0.0).chain(steps);
    steps.iter().zip(before).map(|(step, before)| step - before).collect()
}

/// Leaves out the weights of old readings that are too small to count.
pub(super) fn without_tail(mut weights: Vec<f64>) -> Vec<f64> {
    let largest = weights.iter().fold(0.0_f64, |most, weight| most.max(weight.abs()));
    let counts = weights.iter().rposition(|weight| weight.abs() > SMALL * largest);
    weights.truncate(LEAST.max(counts.map_or(0, |last| last + 1)));
    weights
}

/// The springs about one axis that a rig keeps stable, without help from friction or the hand.
#[derive(Debug, Clone, PartialEq)]
pub struct StiffnessBound {
    sampled: Sampled,
    count: f64,
    /// Stiffness (N m/rad) and damping (N m s/rad) on the border of stability, from slow to fast
    /// swings.
    border: Vec<[f64; 2]>,
}

impl StiffnessBound {
    /// Computes what limits the stiffness, for the rig and the loop rate of `config`. Returns
    /// `None` if the inertias in the rig file contradict each other.
    #[must_use]
    pub fn of(config: &RigConfig) -> Option<Self> {
        let rig = &config.rig;
        let (inertia, axes) = inertia::least(&rig.device)?;
        let posture = Posture::new(&rig.device, &[0.0; MAX_WHEELS][..rig.device.wheels().len()]);
        let turn = |j: usize| {
            let mut rates = [0.0; MAX_JOINTS];
            rates[j] = rig.joints[j].radians_per_count().abs();
            posture.forward(&rig.device, &rates).omega.length()
        };
        // Those of the coarsest counts, whose estimate has the longest memory.
        let count = |joint: usize| rig.joints[joint].radians_per_count().abs();
        let coarser = |a: usize, b: usize| if count(b) > count(a) { b } else { a };
        let coarsest = (0..rig.device.joints()).fold(0, coarser);
        let taps = without_tail(weights(rig, coarsest));
        let sampled = Sampled {
            period: rig.timing.period_s(),
            delay: 1,
            lag: config.torque_lag,
            lead: rig.lead.map_or(0.0, |lead| {
                let late = 1.5 * rig.timing.period_s() + config.torque_lag;
                (lead.factor * late).min(lead.longest)
            }),
            rate_lag: config.rate_lag,
            taps,
            inertia,
            axes,
        };
        Some(Self::new(sampled, (0..rig.device.joints()).map(turn).fold(0.0, f64::max)))
    }

    /// Computes the borders of the loop `sampled`. `count` is the turn of the sphere for one
    /// encoder count, rad.
    #[must_use]
    pub fn new(sampled: Sampled, count: f64) -> Self {
        let inertia = sampled.inertia.min_element();
        let swings = std::iter::successors(Some(SLOWEST_SWING), |phi| Some(phi * RATIO));
        let swings = swings.take_while(|phi| *phi < std::f64::consts::PI);
        let axis = Axis::new(&sampled, inertia, &HOLDS[0]);
        let border = swings.map(|phi| sampled.border_of(&axis, phi)).collect();
        Self { sampled, count, border }
    }

    /// Returns the same rig with a loop of `rate_hz` ticks per second. An estimate of the joint
    /// rates keeps its length in ticks, and a lead its part of the loop's time constant.
    #[must_use]
    pub fn at_rate(&self, rate_hz: f64) -> Self {
        let (before, period) = (&self.sampled, 1.0 / rate_hz);
        let taps = before.taps.iter().map(|tap| tap * before.period / period).collect();
        let mut sampled = Sampled { period, taps, ..before.clone() };
        sampled.lead *= sampled.lateness() / before.lateness();
        Self::new(sampled, self.count)
    }

    /// Returns the loop whose borders these are.
    #[must_use]
    pub fn sampled(&self) -> &Sampled {
        &self.sampled
    }

    /// Returns the smallest apparent inertia of the sphere about any axis in all examined postures,
    /// kg m².
    #[must_use]
    pub fn inertia(&self) -> f64 {
        self.sampled.inertia.min_element()
    }

    /// Returns the largest turn of the sphere while one joint moves by one encoder count, with all
    /// steer angles at zero, rad.
    #[must_use]
    pub fn count(&self) -> f64 {
        self.count
    }

    /// Returns the straight pieces of the border.
    ///
    /// If the rates are estimated from the angles, angle and rate can have the same phase at some
    /// frequency. The border goes to infinity there and comes back from the opposite side. No piece
    /// joins its two ends.
    fn pieces(&self) -> impl Iterator<Item = [[f64; 2]; 2]> {
        let h = self.sampled.period;
        let pairs = self.border.windows(2).map(|pair| [pair[0], pair[1]]);
        pairs.filter(move |[[k0, b0], [k1, b1]]| k0 * k1 * h * h + b0 * b1 > 0.0)
    }

    /// Returns the largest stiffness at which a spring with the damping `damping` (N m s/rad) is
    /// stable, N m/rad. 0 if no spring is stable with it.
    ///
    /// To first order it is damping / (h (1/2 + D) + lag), with the period h and the delay D
    /// (docs/internals/physics.md, section 9).
    #[must_use]
    pub fn stable(&self, damping: f64) -> f64 {
        if damping >= self.most_damping() {
            return 0.0;
        }
        let crossings = self.pieces().filter_map(|[[k0, b0], [k1, b1]]| {
            let part = (damping - b0) / (b1 - b0);
            (0.0..=1.0).contains(&part).then_some(k0 + part * (k1 - k0)).filter(|k| *k >= 0.0)
        });
        // A damping below that of the slowest swing on the border is stable with less stiffness.
        let [k, b] = self.border[0];
        let slowest = if damping < b { (k * damping / b).max(0.0) } else { f64::INFINITY };
        crossings.fold(slowest, f64::min)
    }

    /// Returns the largest stiffness at which a spring is stable with the best choice of its
    /// damping, N m/rad, and this damping, N m s/rad.
    ///
    /// Without a lag and a lead it is K h²/J = 1/4, at B h/J = 5/8.
    #[must_use]
    pub fn most(&self) -> [f64; 2] {
        let stiffness = |damping: f64| self.stable(damping);
        let all = self.most_damping();
        let mut best = 1.0e-3 * all;
        let mut damping = best;
        while damping < all {
            damping *= 1.05;
            best = if stiffness(damping) > stiffness(best) { damping } else { best };
        }
        let best = largest_within(best / 1.05, best * 1.05, stiffness);
        [stiffness(best), best]
    }

    /// Returns the largest damping that is stable, N m s/rad, if nothing else holds the sphere. A
    /// larger one reacts too late, and shakes the sphere instead of slowing it down.
    ///
    /// It is the damping where the border of stability comes back to a stiffness of 0. Without a
    /// lag it is J/h, with the inertia J and the period h.
    #[must_use]
    pub fn most_damping(&self) -> f64 {
        let ends = self.pieces().filter(|[[k0, _], [k1, _]]| *k0 > 0.0 && *k1 <= 0.0);
        let at = ends.map(|[[k0, b0], [k1, b1]]| b0 + k0 / (k0 - k1) * (b1 - b0));
        at.filter(|damping| *damping > 0.0).fold(f64::INFINITY, f64::min)
    }

    /// Returns the largest stiffness of a spring, N m/rad, at which the device's Coulomb friction
    /// makes up for the steps of its encoder counts, so that the spring stays passive. `coulomb` is
    /// the friction, N m.
    ///
    /// The formula is 2 c / d, with the friction c and the turn d per count (Abbott and Okamura
    /// 2005).
    #[must_use]
    pub fn quiet(&self, coulomb: f64) -> f64 {
        2.0 * coulomb / self.count
    }
}

/// Returns where `value` is largest between `low` and `high`, if it has one maximum there: by
/// golden section, to 1e-7 of the interval or better.
fn largest_within(mut low: f64, mut high: f64, value: impl Fn(f64) -> f64) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    for _ in 0..34 {
        let step = GOLDEN * (high - low);
        if value(high - step) > value(low + step) { high = low + step } else { low = high - step }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use hbot_core::design::rig::{LeadTime, RateEstimate};
    use hbot_core::{Mat3, Vec3};

    use super::super::sampled::{HOLDS, Scene};
    use super::*;

    /// With rates from a Kalman filter the border goes through infinity. What looks like a piece of
    /// it there once gave 67 N m/rad, where springs up to 148 N m/rad are stable.
    #[test]
    fn rates_from_a_filter_leave_the_border_where_the_determinant_has_it() {
        for acceleration in [20.0, 50.0, 500.0] {
            let mut config = RigConfig::prototype();
            let led = config.rig.with(|parts| {
                parts.lead = Some(LeadTime::default());
                parts.methods.rate = RateEstimate::Kalman { acceleration };
            });
            config.rig = led.unwrap_or_else(|error| panic!("{error}"));
            let bound = StiffnessBound::of(&config).expect("legal inertias");
            let one = Sampled { inertia: Vec3::splat(bound.inertia()), ..bound.sampled().clone() };
            let border = bound.stable(0.01);
            assert!(bound.most()[0] >= bound.stable(USUAL_DAMPING), "{acceleration}");
            for (part, stable) in [(0.3, true), (0.6, true), (0.97, true), (1.03, false), (1.3, false)] {
                let scene = Scene {
                    stiffness: Mat3::IDENTITY * (part * border),
                    damping: Mat3::IDENTITY * 0.01,
                    masses: Vec::new(),
                };
                assert_eq!(one.is_stable(&scene, &HOLDS[0]), stable, "{acceleration}: {part} of {border}");
            }
        }
    }
}
