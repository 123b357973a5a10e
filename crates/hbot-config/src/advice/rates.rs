//! How good the estimates of the joint rates are on a rig, and which one `rate_estimate = "auto"`
//! picks.
//!
//! Angles are rounded to encoder counts, and an estimate of the rates makes more of the rounding.
//! With the lead, a spring's torque is K (x + t w): the rounding of x and the noise of w add up to
//! a ripple of the torque that a hand can feel. A smoother estimate is late, so the loop is stable
//! with less stiffness.
//!
//! ```text
//! <ripple²> = sum over the joints of u²/12 |f|² sum over k of (K d_k + (K t + B) c_k)²
//! ```
//!
//! u is the joint's angle per count, f the sphere's turn for a turn of the joint, c_k the weight of
//! the k-th last angle in the rate (1/s), d_k is 1 for the newest angle and 0 otherwise, K the
//! stiffness, B the damping and t the lead. The rounding of each reading counts as independent of
//! the others, as it is in motion.

use hbot_core::design::kinematics::Posture;
use hbot_core::design::rig::RateEstimate;
use hbot_core::{MAX_JOINTS, Rig};

use super::bound::{self, StiffnessBound, USUAL_DAMPING, without_tail};
use super::inertia::postures;
use super::sampled::Sampled;
use crate::RigConfig;

/// Acceleration of a surface from which a hand feels its vibration, m/s², rms. It is that of 0.1 um
/// at 200 Hz, about the least vibration that hands feel (Bolanowski et al. 1988). Some people who
/// grasp a thing feel a tenth of it (Brisben et al. 1999). At other frequencies it is a rough
/// measure.
const FELT: f64 = 0.1;
/// Largest damping that an estimate must keep stable, N m s/rad: five times that of the dampest
/// ready-made scene.
const LEAST_DAMPING: f64 = 0.25;
/// Estimates whose stiffness is within this fraction of the best count as equally stiff. The one
/// with the least ripple is picked.
const EQUAL: f64 = 0.02;
/// Accelerations of `kalman` (rad/s²) and cut-off frequencies of `low_pass` (Hz) that are tried.
/// With a lower cut-off frequency the rates are so late that a tap looks like a fault of the
/// feedback.
const ACCELERATIONS: [f64; 13] =
    [10.0, 20.0, 30.0, 50.0, 70.0, 100.0, 200.0, 300.0, 500.0, 1e3, 2e3, 5e3, 1e4];
const CUTOFFS_HZ: [f64; 4] = [60.0, 100.0, 200.0, 400.0];

/// Compares estimates of the joint rates on one rig.
#[derive(Debug, Clone)]
pub struct RateAdvice {
    rig: Rig,
    rate_lag: f64,
    sampled: Sampled,
    count: f64,
    /// For each joint: the mean square of the sphere's turn that the rounding of its angle makes,
    /// rad².
    rounding: Vec<f64>,
}

/// Noise and lag of one estimate of the joint rates, and what follows for springs.
#[derive(Debug, Clone, PartialEq)]
pub struct RateQuality {
    /// The estimate.
    pub estimate: RateEstimate,
    /// Delay of the rate of a steer joint in slow motion, s.
    pub lag: f64,
    /// Largest stable stiffness of a spring with the damping [`USUAL_DAMPING`], N m/rad.
    pub stable: f64,
    /// Largest stiffness of this spring whose ripple is not felt, N m/rad. 0 if the ripple of its
    /// damping alone is felt.
    pub smooth: f64,
    /// Largest stable damping without a spring, N m s/rad.
    pub most_damping: f64,
    /// Noise of the sphere's rate: rms of the length of the vector, rad/s.
    pub noise: f64,
    /// Ripple of the torque of a spring without damping for each N m/rad: rms of the length of the
    /// vector, N m.
    pub ripple: f64,
}

impl RateQuality {
    /// Returns the stiffness of the stiffest spring with the damping [`USUAL_DAMPING`] that is
    /// stable and whose ripple is not felt, N m/rad.
    #[must_use]
    pub fn usable(&self) -> f64 {
        self.stable.min(self.smooth)
    }
}

/// The estimate that `rate_estimate = "auto"` has picked, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct RatePick {
    /// The estimate, with its figures.
    pub picked: RateQuality,
    /// The rates of the motor controllers, with their figures. `None` if the rig file does not say
    /// how late they are.
    pub controllers: Option<RateQuality>,
    /// Ripple of the torque from which a hand feels it: rms of the length of the vector, N m.
    pub felt: f64,
}

impl RatePick {
    /// Returns what was picked and why, as one sentence without a full stop.
    #[must_use]
    pub fn sentence(&self) -> String {
        let Self { picked, controllers, felt } = self;
        let name = match picked.estimate {
            RateEstimate::Controller => "the rates of the motor controllers".to_owned(),
            RateEstimate::Difference => "difference".to_owned(),
            RateEstimate::LowPass { cutoff_hz } => format!("low_pass with cutoff_hz = {cutoff_hz}"),
            RateEstimate::AdaptiveWindow { longest_ticks, .. } => {
                format!("adaptive_window with longest_ticks = {longest_ticks}")
            }
            RateEstimate::Kalman { acceleration } => format!("kalman with acceleration = {acceleration}"),
        };
        let others = match controllers {
            None => "those of the motor controllers were not compared, because rate_lag is 0".to_owned(),
            Some(_) if picked.estimate == RateEstimate::Controller => {
                "no estimate from the counts allows more".to_owned()
            }
            Some(own) => {
                format!(
                    "those of the motor controllers, {:.1} ms late, allow {:.0}",
                    1e3 * own.lag,
                    own.usable()
                )
            }
        };
        format!(
            "rate_estimate = \"auto\" picked {name}: springs up to {} N m/rad with {USUAL_DAMPING} N m s/rad are stable (up to \
             {}) and their ripple from the counts stays below the {:.1} mN m that a hand feels (up to {}); {others}",
            digits(picked.usable()),
            digits(picked.stable),
            1e3 * felt,
            digits(picked.smooth)
        )
    }
}

impl RateAdvice {
    /// Prepares the comparison for the rig of `config`, as a mean over all postures. Returns `None`
    /// if the inertias in the rig file contradict each other.
    #[must_use]
    pub fn of(config: &RigConfig) -> Option<Self> {
        Self::over(config, postures())
    }

    /// Prepares the comparison in one posture: `steer` has the steer angle of each wheel, rad.
    /// Returns `None` if the inertias in the rig file contradict each other.
    #[must_use]
    pub fn at(config: &RigConfig, steer: &[f64]) -> Option<Self> {
        Self::over(config, std::iter::once(steer))
    }

    fn over<S: AsRef<[f64]>>(config: &RigConfig, postures: impl Iterator<Item = S>) -> Option<Self> {
        let (rig, n) = (config.rig, config.rig.device.joints());
        let bound = StiffnessBound::of(config)?;
        let (mut squares, mut count) = (vec![0.0; n], 0.0);
        for steer in postures {
            let posture = Posture::new(&rig.device, &steer.as_ref()[..n / 2]);
            for (j, sum) in squares.iter_mut().enumerate() {
                let mut rates = [0.0; MAX_JOINTS];
                rates[j] = rig.joints[j].radians_per_count();
                *sum += posture.forward(&rig.device, &rates).omega.length_squared();
            }
            count += 1.0;
        }
        let rounding = squares.into_iter().map(|sum| sum / (12.0 * count)).collect();
        let sampled = bound.sampled().clone();
        Some(Self { rig, rate_lag: config.rate_lag, sampled, count: bound.count(), rounding })
    }

    /// Returns the ripple of a torque on the sphere from which a hand feels it, N m, rms. The hand
    /// feels the acceleration of the surface of a sphere with the least apparent inertia.
    #[must_use]
    pub fn felt(&self) -> f64 {
        FELT * self.sampled.inertia.min_element() / self.rig.device.sphere_radius()
    }

    /// Returns the noise of the joint rates in slow motion that the counts make: of the noisiest
    /// joint, rms, rad/s. The rates of the motor controllers count as without noise.
    #[must_use]
    pub fn noise_at_rest(&self) -> f64 {
        let noise = |j: usize| {
            let weights = self.weights(self.rig.methods.rate, j);
            let squares = weights.iter().map(|weight| weight * weight).sum::<f64>();
            self.rig.joints[j].radians_per_count() * (squares / 12.0).sqrt()
        };
        (0..self.rounding.len()).map(noise).fold(0.0, f64::max)
    }

    /// Returns the figures of `estimate`.
    ///
    /// Noise and lag of an adaptive window depend on the motion. Its noise here is that of its
    /// shortest chord, and its lag that of its longest. The rates of the motor controllers count as
    /// without noise.
    ///
    /// # Panics
    /// If a parameter of `estimate` is not legal.
    #[must_use]
    pub fn quality(&self, estimate: RateEstimate) -> RateQuality {
        let noisy = match estimate {
            RateEstimate::AdaptiveWindow { .. } => RateEstimate::Difference,
            other => other,
        };
        let n = self.rounding.len();
        let noisy: Vec<Vec<f64>> = (0..n).map(|joint| self.weights(noisy, joint)).collect();
        // Joints with equal counts have equal weights.
        let mut weights: Vec<Vec<f64>> =
            (0..n).map(|joint| without_tail(self.weights(estimate, joint))).collect();
        let lag = match estimate {
            RateEstimate::Controller => self.rate_lag,
            // Old readings add more to the lag than to the rate.
            _ => late(&self.weights(estimate, 0), self.sampled.period),
        };
        weights.sort_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
        weights.dedup();
        let bounds = weights
            .into_iter()
            .map(|taps| StiffnessBound::new(Sampled { taps, ..self.sampled.clone() }, self.count));
        let (mut stable, mut most_damping) = (f64::INFINITY, f64::INFINITY);
        for bound in bounds {
            stable = stable.min(bound.stable(USUAL_DAMPING));
            most_damping = most_damping.min(bound.most_damping());
        }
        let ripple = |stiffness: f64, damping: f64| self.ripple(&noisy, stiffness, damping);
        RateQuality {
            estimate,
            lag,
            stable,
            smooth: largest(|stiffness| ripple(stiffness, USUAL_DAMPING) <= self.felt()),
            most_damping,
            noise: ripple(0.0, 1.0),
            ripple: ripple(1.0, 0.0),
        }
    }

    /// Returns the rms of the ripple of a spring with `stiffness` and `damping`, N m. `weights` has
    /// those of each joint.
    fn ripple(&self, weights: &[Vec<f64>], stiffness: f64, damping: f64) -> f64 {
        let led = stiffness * self.sampled.lead + damping;
        let of = |weights: &Vec<f64>| {
            let newest = weights.first().map_or(stiffness, |weight| stiffness + led * weight);
            newest * newest + weights.iter().skip(1).map(|weight| (led * weight).powi(2)).sum::<f64>()
        };
        self.rounding.iter().zip(weights).map(|(square, weights)| square * of(weights)).sum::<f64>().sqrt()
    }

    /// Returns the weights of the last angles in the rate of `joint`, 1/s, the newest angle first.
    /// Empty if the rates are those of the motor controllers.
    fn weights(&self, estimate: RateEstimate, joint: usize) -> Vec<f64> {
        if let RateEstimate::AdaptiveWindow { longest_ticks, .. } = estimate {
            let n = longest_ticks as usize;
            let weight = 1.0 / (n as f64 * self.sampled.period);
            let mut chord = vec![0.0; n + 1];
            (chord[0], chord[n]) = (weight, -weight);
            return chord;
        }
        let rig = self.rig.with(|parts| parts.methods.rate = estimate);
        bound::weights(&rig.unwrap_or_else(|error| panic!("{error}")), joint)
    }

    /// Picks the estimate with which the stiffest spring is stable and its ripple is not felt.
    ///
    /// It must also keep a damping of 0.25 N m s/rad stable, or that of the passivity stage if it
    /// is on. The rates of the motor controllers take part if the rig file says how late they are.
    #[must_use]
    pub fn pick(&self) -> RatePick {
        let stage = self.rig.methods.passivity.map_or(0.0, |limit| 1.1 * limit.damping);
        let least = stage.max(LEAST_DAMPING);
        let controllers = (self.rate_lag > 0.0).then(|| self.quality(RateEstimate::Controller));
        let kalman = ACCELERATIONS.map(|acceleration| RateEstimate::Kalman { acceleration });
        let low_pass = CUTOFFS_HZ.map(|cutoff_hz| RateEstimate::LowPass { cutoff_hz });
        let estimates = kalman.into_iter().chain(low_pass).chain([RateEstimate::Difference]);
        let all: Vec<RateQuality> =
            controllers.iter().cloned().chain(estimates.map(|estimate| self.quality(estimate))).collect();
        // A rig that no estimate damps as much takes the one that damps most.
        let damps = all.iter().map(|quality| quality.most_damping).fold(0.0, f64::max).min(least);
        let able = || all.iter().filter(|quality| quality.most_damping >= damps);
        let best = able().map(RateQuality::usable).fold(0.0, f64::max);
        let picked = able()
            .filter(|quality| quality.usable() >= (1.0 - EQUAL) * best)
            .min_by(|a, b| a.ripple.total_cmp(&b.ripple))
            .unwrap_or(&all[0]);
        RatePick { picked: picked.clone(), controllers, felt: self.felt() }
    }
}

/// Returns a stiffness with two digits or more.
fn digits(stiffness: f64) -> String {
    if stiffness < 10.0 { format!("{stiffness:.1}") } else { format!("{stiffness:.0}") }
}

/// Returns the delay in slow motion of a rate with these weights of the last angles, s. Of an angle
/// t²/2 they make t - lag.
fn late(weights: &[f64], period: f64) -> f64 {
    let squares = weights.iter().enumerate().map(|(k, weight)| weight * (k * k) as f64);
    -0.5 * period * period * squares.sum::<f64>()
}

/// Returns the largest number for which `holds` is true, to 1e-4 of it, if it is true below this
/// number and false above. 0 if it is never true.
fn largest(holds: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (1.0e-3, 1.0e6);
    if !holds(low) {
        return 0.0;
    }
    while high > low * (1.0 + 1.0e-4) {
        let middle = f64::sqrt(low * high);
        if holds(middle) { low = middle } else { high = middle }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Override;

    /// Returns `text` as a rig with `rate_estimate = "auto"`, a lead and no passivity stage. `with`
    /// replaces more keys.
    fn auto(text: &str, with: &[(&'static str, serde_json::Value)]) -> RigConfig {
        let usual = [
            ("loop.rate_estimate", "auto".into()),
            ("loop.lead", true.into()),
            ("loop.passivity", false.into()),
        ];
        let replaced = |(path, value): (&'static str, serde_json::Value)| Override { path, value, from: "" };
        let all: Vec<Override> = usual.into_iter().chain(with.iter().cloned()).map(replaced).collect();
        RigConfig::from_toml_with(text, "x.toml", &all).unwrap_or_else(|error| panic!("{error}"))
    }

    fn pick(config: &RigConfig) -> &RatePick {
        let pick = config.rate_pick.as_ref().expect("picked");
        assert_eq!(config.rig.methods.rate, pick.picked.estimate, "it is used");
        pick
    }

    const PROTOTYPE: &str = include_str!("../../../../rigs/prototype.toml");
    const MOTEUS: &str = include_str!("../../../../rigs/prototype-moteus.toml");

    #[test]
    fn no_other_estimate_allows_a_stiffer_spring() {
        for counts in ["16384", "2048"] {
            let config = auto(&PROTOTYPE.replace("= 16384", &format!("= {counts}")), &[]);
            let pick = pick(&config);
            let advice = RateAdvice::of(&config).expect("legal inertias");
            let kalman = [8.0, 25.0, 40.0, 150.0, 700.0, 3e3]
                .map(|acceleration| RateEstimate::Kalman { acceleration });
            let low_pass = [60.0, 150.0, 1e3].map(|cutoff_hz| RateEstimate::LowPass { cutoff_hz });
            for other in kalman.into_iter().chain(low_pass).chain([RateEstimate::Difference]) {
                let other = advice.quality(other);
                // The accelerations that are tried are up to 2.5 times apart.
                assert!(other.usable() < 1.15 * pick.picked.usable(), "{other:?}, {pick:?}");
            }
            let felt = advice.felt();
            // 0.1 m/s² of 3.38e-3 kg m² at 0.102 m.
            assert!((felt / 3.32e-3 - 1.0).abs() < 0.01 && felt == pick.felt, "{felt}");
        }
    }

    /// The stiffness that the lead is to allow with 4096 x 4 counts: at least 60 N m/rad with 0.01
    /// N m s/rad.
    #[test]
    fn fine_counts_allow_stiff_springs_and_coarse_counts_a_smoother_estimate() {
        let fine = auto(PROTOTYPE, &[]);
        assert!(StiffnessBound::of(&fine).expect("legal inertias").stable(0.01) > 60.0);
        assert!(pick(&fine).picked.usable() > 90.0, "{fine:?}");
        let coarse = auto(&PROTOTYPE.replace("= 16384", "= 2048"), &[]);
        let acceleration = |config: &RigConfig| match pick(config).picked.estimate {
            RateEstimate::Kalman { acceleration } => acceleration,
            other => panic!("{other:?}"),
        };
        assert!(acceleration(&coarse) < acceleration(&fine));
        // The rounding of the angle alone allows no more than this, and eight times as much with
        // fine counts.
        assert!(pick(&coarse).picked.usable() < 20.0, "{coarse:?}");
    }

    #[test]
    fn an_estimate_that_is_too_late_for_the_passivity_stage_is_not_picked() {
        for counts in ["16384", "2048"] {
            let text = PROTOTYPE.replace("= 16384", &format!("= {counts}"));
            let config = auto(&text, &[("loop.passivity", true.into())]);
            let stage = config.rig.methods.passivity.expect("on").damping;
            assert!(pick(&config).picked.most_damping > 1.1 * stage, "{config:?}");
            let without = auto(&text, &[]);
            assert!(pick(&without).picked.most_damping < stage, "{without:?}");
        }
    }

    /// At 8 kHz the filter remembers more than 128 readings. Without the weights of older ones the
    /// damping on the border would be 0.92 N m s/rad; an independent model of the loop has 0.793.
    #[test]
    fn all_readings_that_a_slow_estimate_remembers_count() {
        let kalman = serde_json::json!({"method": "kalman", "acceleration": 10});
        let estimate = ("loop.rate_estimate", kalman);
        let config = auto(PROTOTYPE, &[("loop.rate_hz", 8000.into()), estimate]);
        let most = StiffnessBound::of(&config).expect("a legal rig").most_damping();
        assert!((most / 0.793 - 1.0).abs() < 0.02, "{most}");
    }

    #[test]
    fn rates_of_the_controllers_take_part_if_the_rig_file_says_how_late_they_are() {
        let late = auto(MOTEUS, &[]);
        let pick_of_late = pick(&late);
        assert!(matches!(pick_of_late.picked.estimate, RateEstimate::Kalman { .. }));
        let controllers = pick_of_late.controllers.as_ref().expect("compared");
        assert!(controllers.usable() < 0.5 * pick_of_late.picked.usable(), "{pick_of_late:?}");
        let said = pick_of_late.sentence();
        assert!(
            said.contains("picked kalman") && said.contains("controllers, 3.9 ms late, allow 30"),
            "{said}"
        );

        let unknown = pick(&auto(PROTOTYPE, &[])).sentence();
        assert!(unknown.ends_with("were not compared, because rate_lag is 0"), "{unknown}");
        let soon = auto(&PROTOTYPE.replacen("torque_lag", "rate_lag = 0.0003\ntorque_lag", 1), &[]);
        assert_eq!(pick(&soon).picked.estimate, RateEstimate::Controller, "{:?}", pick(&soon));
        let said = pick(&soon).sentence();
        assert!(said.contains("picked the rates of the motor controllers: springs up to"), "{said}");
        assert!(said.ends_with("no estimate from the counts allows more"), "{said}");
    }

    #[test]
    fn a_named_estimate_is_not_replaced() {
        let named = auto(PROTOTYPE, &[("loop.rate_estimate", "kalman".into())]);
        assert_eq!(named.rate_pick, None);
        assert_eq!(named.rig.methods.rate, RateEstimate::Kalman { acceleration: 100.0 });
        assert_eq!(RigConfig::prototype().rate_pick, None, "the default names one");
    }

    #[test]
    fn lags_are_those_of_the_formulas() {
        let advice = RateAdvice::of(&RigConfig::prototype()).expect("legal inertias");
        let lag = |estimate| advice.quality(estimate).lag;
        let near = |lag: f64, want: f64| assert!((lag - want).abs() < 2.0e-6, "{lag} s, not {want} s");
        near(lag(RateEstimate::Difference), 0.5e-3);
        // The filter keeps the part e of its last value, which adds e/(1 - e) ticks.
        let kept = (-std::f64::consts::TAU * 0.1_f64).exp();
        near(lag(RateEstimate::LowPass { cutoff_hz: 100.0 }), 1.0e-3 * (0.5 + kept / (1.0 - kept)));
        // The filter follows a constant acceleration without an error.
        near(lag(RateEstimate::Kalman { acceleration: 100.0 }), 0.0);
        near(lag(RateEstimate::AdaptiveWindow { tolerance_counts: 1, longest_ticks: 32 }), 16.0e-3);
        near(lag(RateEstimate::Controller), 0.0);
    }
}
