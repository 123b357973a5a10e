//! Estimates the stiffness that a rig can render: the linear stability limit of a spring in a
//! sampled loop, and the turn of the sphere that corresponds to one encoder count.

use hbot_config::RigConfig;
use hbot_core::kinematics::Posture;
use hbot_core::{MAX_JOINTS, MAX_WHEELS, Mat3, Vec3};
use hbot_sim::plant::{Plant, PlantState};

/// Delay from a reading to the torque computed from it, ticks: the loop uses the reading that
/// arrived in the last tick.
pub const DELAY_TICKS: f64 = 1.0;

/// Damping of a spring that is assumed when a stable stiffness is shown as an example, N m s/rad.
/// The hand can feel it, and it is small enough that the steps of the encoder counts do not make it
/// noisy.
pub const USUAL_DAMPING: f64 = 0.02;

/// Number of postures that are examined to find the smallest inertia.
const SAMPLES: usize = 256;

/// The properties of a rig that limit the stiffness of a spring, without help from friction or the
/// hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StiffnessBound {
    /// Loop period, s.
    pub period: f64,
    /// Time constant with which the joint torques follow their commands, s.
    pub lag: f64,
    /// Smallest apparent inertia of the sphere about any axis in all examined postures, kg m².
    pub inertia: f64,
    /// Largest turn of the sphere while one joint moves by one encoder count, with all steer angles
    /// at zero, rad.
    pub count: f64,
}

impl StiffnessBound {
    /// Computes the properties that limit the stiffness, for the rig and the loop rate of `config`.
    /// Returns `None` if the inertias in the rig file contradict each other.
    #[must_use]
    pub fn of(config: &RigConfig) -> Option<Self> {
        let rig = &config.rig;
        let plant = Plant::new(&rig.device).ok()?;
        let inertia = postures(rig.device.wheels().len()).map(|state| least(plant.apparent_inertia(&state)));
        let posture = Posture::new(&rig.device, &PlantState::default().steer[..rig.device.wheels().len()]);
        let turn = |j: usize| {
            let mut rates = [0.0; MAX_JOINTS];
            rates[j] = rig.joints[j].radians_per_count().abs();
            posture.forward(&rig.device, &rates).omega.length()
        };
        Some(Self {
            period: rig.timing.period_s(),
            lag: config.torque_lag,
            inertia: inertia.fold(f64::INFINITY, f64::min),
            count: (0..rig.device.joints()).map(turn).fold(0.0, f64::max),
        })
    }

    /// Returns the mean time from a reading to the effect of the torque that is computed from it,
    /// s: the delay, half a period because the torque is held for a period, and the motors' lag.
    #[must_use]
    pub fn lateness(&self) -> f64 {
        self.period * (0.5 + DELAY_TICKS) + self.lag
    }

    /// Returns the largest stiffness at which a spring is stable, N m/rad. `damping` (N m s/rad) is
    /// the sum of the damping of the spring and that of the device.
    ///
    /// The formula is damping / (h (1/2 + D) + lag), with the period h and the delay D
    /// (docs/physics.md, section 9). It holds if the damping is small relative to the inertia
    /// divided by [`lateness`](Self::lateness).
    #[must_use]
    pub fn stable(&self, damping: f64) -> f64 {
        damping / self.lateness()
    }

    /// Returns the largest stiffness at which a spring is stable with the best choice of its
    /// damping, N m/rad, and this damping, N m s/rad.
    ///
    /// It is the maximum of k = K h²/J on the border of stability, computed by `border`.
    /// Without a lag it is k = 1/4, at B h/J = 5/8.
    #[must_use]
    pub fn most(&self) -> [f64; 2] {
        let lag = self.lag / self.period;
        let stiffness = |phi: f64| border(phi, lag)[0];
        // The border begins at k = 0 with slow swings. The frequency rises by 1 % until k falls.
        let mut phi = SLOWEST_SWING;
        while stiffness(phi * 1.01) > stiffness(phi) {
            phi *= 1.01;
        }
        let [k, d] = border(largest_within(phi / 1.01, phi * 1.01, stiffness), lag);
        [k * self.inertia / (self.period * self.period), d * self.inertia / self.period]
    }

    /// Returns the largest damping that is stable, N m s/rad, if nothing else holds the sphere. A
    /// larger one reacts too late, and shakes the sphere instead of slowing it down.
    ///
    /// It is the damping where the border of stability, computed by `border`, comes back to a
    /// stiffness of 0. Without a lag it is J/h, with the inertia J and the period h.
    #[must_use]
    pub fn most_damping(&self) -> f64 {
        let lag = self.lag / self.period;
        let is_spring = |phi: f64| border(phi, lag)[0] > 0.0;
        let mut low = SLOWEST_SWING;
        while is_spring(low * 1.01) {
            low *= 1.01;
        }
        let mut high = low * 1.01;
        // Each step halves the interval, and 50 steps make it as small as rounding.
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            if is_spring(middle) { low = middle } else { high = middle }
        }
        border(low, lag)[1] * self.inertia / self.period
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

/// Turn of the slowest swing with which the search for the stiffest spring begins, rad per tick. It
/// is slower than the stiffest spring's swing with the largest lag and the highest rate that a rig
/// file can have: 0.1 s at 20 kHz, 0.013 rad per tick.
const SLOWEST_SWING: f64 = 1.0e-3;

/// Returns the stiffness k = K h²/J and the damping d = B h/J, both without unit, with which a free
/// inertia swings by `phi` rad per tick and its swing neither grows nor decays. `lag` is the time
/// constant of the torque, in ticks.
///
/// The torque is computed from a reading one tick before it acts, and the motor follows it with the
/// lag, exactly solved over a tick. The characteristic polynomial is A + k B + d C with the
/// polynomials A, B and C below (docs/physics.md, section 9). The swing has the root exp(i phi), so
/// its real and imaginary parts are two linear equations for k and d.
fn border(phi: f64, lag: f64) -> [f64; 2] {
    let left = (-1.0 / lag).exp();
    let rate_gap = lag * (1.0 - left);
    let angle_gap = lag * (1.0 - rate_gap);
    let a = on_circle(&[0.0, -left, 1.0 + 2.0 * left, -2.0 - left, 1.0], phi);
    let b = on_circle(
        &[
            rate_gap - angle_gap - 0.5 * left,
            0.5 * (1.0 - left) - rate_gap + 2.0 * angle_gap,
            0.5 - angle_gap,
        ],
        phi,
    );
    let c = on_circle(&[left - rate_gap, 2.0 * rate_gap - 1.0 - left, 1.0 - rate_gap], phi);
    let cross = |p: [f64; 2], q: [f64; 2]| p[0] * q[1] - p[1] * q[0];
    let scale = -1.0 / cross(b, c);
    [scale * cross(a, c), scale * cross(b, a)]
}

/// Returns the real and the imaginary part of a polynomial at exp(i `phi`). Its coefficients are in
/// rising order.
fn on_circle(coefficients: &[f64], phi: f64) -> [f64; 2] {
    coefficients.iter().zip(0_u8..).fold([0.0; 2], |[re, im], (coefficient, power)| {
        let (sin, cos) = (f64::from(power) * phi).sin_cos();
        [re + coefficient * cos, im + coefficient * sin]
    })
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

/// Number of turns by which the steer angle of each wheel advances from one sample posture to the
/// next. The values are square roots of primes. The ratio of any two is irrational, so no two
/// wheels advance together.
const TURNS_PER_SAMPLE: [f64; MAX_WHEELS] = [
    core::f64::consts::SQRT_2,
    1.732_050_807_568_877_2,
    2.236_067_977_499_79,
    2.645_751_311_064_590_7,
    3.316_624_790_355_4,
    3.605_551_275_463_989,
    4.123_105_625_617_661,
    4.358_898_943_540_674,
];

/// Returns sample postures that fill the space of all steer angles evenly. From one sample to the
/// next, the steer angle of wheel i advances by `TURNS_PER_SAMPLE[i]` turns.
fn postures(wheels: usize) -> impl Iterator<Item = PlantState> {
    (0..SAMPLES).map(move |k| {
        let mut state = PlantState::default();
        for (th, turns) in state.steer[..wheels].iter_mut().zip(TURNS_PER_SAMPLE) {
            *th = (k as f64 * turns).fract() * core::f64::consts::TAU;
        }
        state
    })
}

/// Returns the smallest eigenvalue of a symmetric positive definite matrix, by power iteration on
/// its inverse.
fn least(matrix: Mat3) -> f64 {
    let inverse = matrix.inverse();
    let mut v = Vec3::new(0.6, 0.64, 0.48);
    for _ in 0..64 {
        v = (inverse * v).normalize();
    }
    1.0 / v.dot(inverse * v)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit inertia in a loop of period 1, whose torque has the time constant `lag`.
    fn unit(lag: f64) -> StiffnessBound {
        StiffnessBound { period: 1.0, lag, inertia: 1.0, count: 1.0 }
    }

    /// Returns whether a unit inertia on a spring comes to rest, if the period is 1, the torque is
    /// commanded one tick late, and the motor follows it with the time constant `lag`. Each tick is
    /// integrated in steps that are far shorter than the lag.
    fn rests(lag: f64, stiffness: f64, damping: f64) -> bool {
        let steps = if lag > 0.0 { (40.0 / lag).clamp(40.0, 400.0) } else { 1.0 };
        let (h, mut x, mut v) = (1.0 / steps, 1.0_f64, 0.0_f64);
        let (mut command, mut torque) = (0.0, 0.0);
        for _ in 0..20_000 {
            let next = -stiffness * x - damping * v;
            for _ in 0..steps as u32 {
                // The trapezoidal rule.
                let after = if lag > 0.0 {
                    (torque * (lag - 0.5 * h) + h * command) / (lag + 0.5 * h)
                } else {
                    torque = command;
                    command
                };
                let mean = 0.5 * (torque + after);
                (x, v, torque) = (x + h * (v + 0.5 * h * mean), v + h * mean, after);
            }
            command = next;
            if !(x.abs() < 1.0e3) {
                return false;
            }
        }
        x.abs() < 1.0e-3
    }

    #[test]
    fn no_damping_carries_more_than_the_most() {
        for lag in [0.0, 0.25, 0.5, 2.0] {
            let [most, damping] = unit(lag).most();
            assert!(rests(lag, 0.99 * most, damping), "{lag}");
            // Tries dampings from zero up to where the damping itself makes the motion unstable.
            for k in 0..=25 {
                assert!(!rests(lag, 1.01 * most, 0.04 * f64::from(k)), "{lag}, {k}");
            }
        }
    }

    #[test]
    fn without_a_lag_the_most_is_a_quarter() {
        let [most, damping] = unit(0.0).most();
        // The golden section finds the place to 1e-8, and the top to the square of that. The
        // damping is as exact as the place.
        assert!((most - 0.25).abs() < 1e-12 && (damping - 0.625).abs() < 1e-7, "{most} {damping}");
    }

    #[test]
    fn more_than_the_most_damping_shakes_the_sphere() {
        let most = unit(0.0).most_damping();
        assert!((most - 1.0).abs() < 1e-9, "without a lag it is J/h: {most}");
        for lag in [0.0, 0.25, 0.5, 2.0] {
            // The spring is so soft that only the damping decides.
            let most = unit(lag).most_damping();
            assert!(rests(lag, 0.001, 0.98 * most), "{lag}");
            assert!(!rests(lag, 0.001, 1.02 * most), "{lag}");
        }
    }

    #[test]
    fn little_damping_carries_what_the_linear_border_says() {
        for lag in [0.0, 0.5, 2.0] {
            // The next order of the formula is about d times the lateness, 4 % at most. The last
            // tenth of the motion decays too slowly to wait for.
            let border = unit(lag).stable(0.01);
            assert!(rests(lag, 0.9 * border, 0.01), "{lag}");
            assert!(!rests(lag, 1.1 * border, 0.01), "{lag}");
        }
    }

    /// The sample postures fill the circle of every steer angle, and of every difference of two
    /// steer angles. Otherwise, postures with a smaller inertia could be missed.
    #[test]
    fn the_sample_postures_turn_every_wheel_and_no_two_together() {
        let samples: Vec<PlantState> = postures(MAX_WHEELS).collect();
        // Even spacing is 2 pi / 256 = 0.025 rad. The widest gap of an irrational step is up to
        // about seven times that. A wheel that stands still leaves a gap of a whole turn.
        let fills = |angles: &mut Vec<f64>| {
            angles.sort_by(f64::total_cmp);
            let wrap = angles[0] + core::f64::consts::TAU - angles[angles.len() - 1];
            let widest = angles.windows(2).fold(wrap, |most, pair| most.max(pair[1] - pair[0]));
            assert!(widest < 0.2, "a gap of {widest} rad");
        };
        for i in 0..MAX_WHEELS {
            fills(&mut samples.iter().map(|state| state.steer[i]).collect());
            for j in 0..i {
                let apart =
                    |state: &PlantState| (state.steer[i] - state.steer[j]).rem_euclid(core::f64::consts::TAU);
                fills(&mut samples.iter().map(apart).collect());
            }
        }
    }

    #[test]
    fn the_prototype_is_as_the_notes_have_it() {
        let config = RigConfig::prototype();
        let expected = StiffnessBound::of(&config).expect("the prototype is a plant");
        // Physics notes, section 6: lambda_min of the apparent inertia is 3.4e-3 kg m².
        assert!((expected.inertia - 3.4e-3).abs() < 0.05e-3, "{}", expected.inertia);
        // The bare sphere has 3.239e-3 kg m², and the wheels only add to it.
        assert!(expected.inertia > config.rig.device.sphere_inertia());
        // The lag of the rig file, and what it leaves of 13.3 N m/rad and of J/(4 h²).
        assert_eq!(expected.lag, 5.0e-4);
        assert!((expected.stable(USUAL_DAMPING) - 10.0).abs() < 1e-9);
        let share = expected.most()[0] / (0.25e6 * expected.inertia);
        // docs/physics.md, section 9: k = 0.1465 at a lag of half a period.
        assert!((share - 4.0 * 0.146_457).abs() < 1e-5, "{share}");
        // One count of a steer joint, 2 pi/16384 rad, turns the sphere by no more than that angle.
        assert!(
            expected.count > 0.0 && expected.count <= core::f64::consts::TAU / 16384.0,
            "{}",
            expected.count
        );
    }

    #[test]
    fn the_least_eigenvalue_of_a_turned_diagonal() {
        let turn = Mat3::from_quat(hbot_core::rotation::exp(Vec3::new(0.3, -1.0, 0.7)));
        let matrix = turn * Mat3::from_diagonal(Vec3::new(3.0, 1.5, 2.0)) * turn.transpose();
        assert!((least(matrix) - 1.5).abs() < 1.0e-12, "{}", least(matrix));
    }
}
