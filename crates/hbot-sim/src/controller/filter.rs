//! The filter by which a motor controller computes position and rate from what its encoder reads.

use core::f64::consts::TAU;

/// Ratio of the 3 dB bandwidth of the filter, 2 pi `pll_filter_hz`, to its natural frequency, as
/// the firmware of moteus has it: r(1) in `HandleConfigUpdate` of the vendor's
/// `fw/motor_position.h`, rounded there to three digits.
const MOTEUS_BANDWIDTH: f64 = 2.48;

/// A phase-locked loop of second order, critically damped: the filter of moteus (vendor's
/// `fw/motor_position.h`, `ISR_UpdateSources`) and of ODrive (`Encoder::update` of firmware 0.5.6).
///
/// Both controllers compute it in every cycle from the angle x that the encoder reads. The cycle
/// is 33 us for moteus and 125 us for ODrive. With the natural frequency w and the gains
/// kp = 2 w and ki = w²:
///
/// ```text
/// X' = V + kp (x - X)      X: the position that is reported
/// V' = ki (x - X)          V: the rate that is reported
/// ```
///
/// So position and rate are both filtered:
///
/// ```text
/// X / x  = (2 w s + w²) / (s + w)²     no delay of a slow motion; an acceleration a: a/w² behind
/// V / x' = w² / (s + w)²               2/w late; an acceleration a: 2 a/w behind
/// ```
///
/// This type solves these equations exactly for an acceleration that is constant during a step. It
/// keeps what the reported values lack, e = x - X and d = x' - V, so that large angles lose no
/// digits. They obey e' = d - 2 w e and d' = a - w² e, whose solution decays as exp(-w t) towards
/// e = a/w², d = 2 a/w. The Euler steps of the firmware differ by a delay of half a cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EncoderFilter {
    /// Natural frequency w, rad/s.
    natural: f64,
    /// The true angle minus the reported one, rad.
    angle: f64,
    /// The true rate minus the reported one, rad/s.
    rate: f64,
}

impl EncoderFilter {
    /// Returns a filter at rest with the natural frequency `natural`, rad/s. It must be positive
    /// and finite.
    #[must_use]
    pub fn new(natural: f64) -> Self {
        Self { natural, angle: 0.0, rate: 0.0 }
    }

    /// Returns the natural frequency of a moteus's filter, rad/s, for its setting
    /// `motor_position.sources.N.pll_filter_hz` in Hz: 2 pi f / 2.48.
    #[must_use]
    pub fn of_moteus(pll_filter_hz: f64) -> f64 {
        TAU * pll_filter_hz / MOTEUS_BANDWIDTH
    }

    /// Returns the setting `pll_filter_hz` of a moteus, in Hz, with which its rate is `lag` s late.
    /// It is infinite if the rate is not late.
    #[must_use]
    pub fn moteus_hz(lag: f64) -> f64 {
        2.0 / lag * MOTEUS_BANDWIDTH / TAU
    }

    /// Returns the delay of the reported rate in a slow motion, 2/w, s.
    #[must_use]
    pub fn rate_lag(&self) -> f64 {
        2.0 / self.natural
    }

    /// Returns the true angle minus the reported one, rad.
    #[must_use]
    pub fn angle_behind(&self) -> f64 {
        self.angle
    }

    /// Returns the true rate minus the reported one, rad/s.
    #[must_use]
    pub fn rate_behind(&self) -> f64 {
        self.rate
    }

    /// Forgets the motion before: the reported angle and rate are the true ones, as after a start.
    pub fn settle(&mut self) {
        (self.angle, self.rate) = (0.0, 0.0);
    }

    /// Changes the natural frequency, rad/s, while the filter runs.
    pub fn tune(&mut self, natural: f64) {
        self.natural = natural;
    }

    /// Advances the filter by `h` seconds, in which the rate that the encoder reads changes evenly
    /// from `from` to `to`, rad/s.
    pub fn follow(&mut self, h: f64, from: f64, to: f64) {
        let w = self.natural;
        let acceleration = (to - from) / h;
        let [angle, rate] = [acceleration / (w * w), 2.0 * acceleration / w];
        let [e, d] = [self.angle - angle, self.rate - rate];
        // exp(A h) = exp(-w h) (1 + (A + w) h), because -w is a double eigenvalue of A.
        let left = libm::exp(-w * h);
        self.angle = angle + left * (e + h * (d - w * e));
        self.rate = rate + left * (d + h * (w * d - w * w * e));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Follows x = sin(p t) in steps of `h` and returns the amplitudes of angle and rate behind,
    /// and their phases, from a correlation over whole swings after the start has decayed.
    fn swing(filter: &mut EncoderFilter, p: f64, steps: u32) -> [[f64; 2]; 2] {
        let h = TAU / p / f64::from(steps);
        let mut sums = [[0.0; 2]; 2];
        for k in 0..40 * steps {
            let t = f64::from(k) * h;
            filter.follow(h, p * (p * t).cos(), p * (p * (t + h)).cos());
            if k >= 20 * steps {
                let (sin, cos) = (p * (t + h)).sin_cos();
                for (sum, value) in sums.iter_mut().zip([filter.angle_behind(), filter.rate_behind()]) {
                    sum[0] += value * sin / f64::from(10 * steps);
                    sum[1] += value * cos / f64::from(10 * steps);
                }
            }
        }
        sums
    }

    /// The transfer functions in the documentation, at frequencies from far below to far above w.
    #[test]
    fn swings_are_filtered_as_the_transfer_functions_say() {
        for ratio in [0.05, 0.3, 1.0, 3.0] {
            let w = EncoderFilter::of_moteus(200.0);
            let p = ratio * w;
            let [angle, rate] = swing(&mut EncoderFilter::new(w), p, 2000);
            // 1 - (2 w s + w²)/(s + w)² = s²/(s + w)² at s = i p, and s times the same for the
            // rate: 1 - w²/(s + w)² = (s² + 2 w s)/(s + w)², times the rate p cos.
            let square = |[re, im]: [f64; 2]| [re * re - im * im, 2.0 * re * im];
            let over = |[a, b]: [f64; 2], [c, d]: [f64; 2]| {
                let n = c * c + d * d;
                [(a * c + b * d) / n, (b * c - a * d) / n]
            };
            let below = square([w, p]);
            let [re, im] = over([-p * p, 0.0], below);
            // sin(p t) filtered by re + i im is re sin + im cos.
            assert!((angle[0] - re).abs() < 1e-5 && (angle[1] - im).abs() < 1e-5, "{ratio}: {angle:?}");
            let [re, im] = over([-p * p, 2.0 * w * p], below);
            // p cos(p t) filtered by it is p (re cos - im sin). The steps make an error of order
            // h².
            let [sin, cos] = [rate[0] / p, rate[1] / p];
            assert!((cos - re).abs() < 1e-5 && (sin + im).abs() < 1e-5, "{ratio}: {rate:?}");
        }
    }

    /// The vendor's own loop: forward steps at 30 kHz. In a steady acceleration its rate is half a
    /// cycle less late, and otherwise the same.
    #[test]
    fn it_is_what_the_firmware_of_a_moteus_computes() {
        for hz in [200.0, 400.0, 1000.0] {
            let w = EncoderFilter::of_moteus(hz);
            let (kp, ki, dt) = (2.0 * w, w * w, 1.0 / 30_000.0);
            let (mut filtered, mut integral) = (0.0, 0.0);
            let mut filter = EncoderFilter::new(w);
            let rate = |t: f64| if t < 0.02 { 100.0 * t } else { 2.0 };
            let angle = |t: f64| if t < 0.02 { 50.0 * t * t } else { 0.02 + 2.0 * (t - 0.02) };
            let mut worst = [0.0_f64; 2];
            for k in 0..1800 {
                let t = f64::from(k) * dt;
                let error = angle(t) - filtered;
                integral += dt * ki * error;
                filtered += dt * (integral + kp * error);
                filter.follow(dt, rate(t), rate(t + dt));
                let off = [
                    angle(t + dt) - filter.angle_behind() - filtered,
                    rate(t + dt) - filter.rate_behind() - integral,
                ];
                worst = [worst[0].max(off[0].abs()), worst[1].max(off[1].abs())];
            }
            // An acceleration of 100 rad/s² during at most two cycles.
            assert!(worst[1] < 100.0 * 2.0 * dt, "{hz}: {worst:?}");
            assert!(worst[0] < 2.0 * dt * worst[1].max(100.0 / w), "{hz}: {worst:?}");
            // Half of the 3 dB bandwidth's delay: 3.9 ms at 200 Hz.
            assert!((filter.rate_lag() - 0.789_409 / hz).abs() < 1e-6 / hz, "{}", filter.rate_lag());
            assert!((EncoderFilter::moteus_hz(filter.rate_lag()) / hz - 1.0).abs() < 1e-12);
        }
    }
}
