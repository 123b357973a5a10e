//! What the limits of torque and slew leave of a swing: their describing function.

use std::f64::consts::PI;

use super::complex::Complex;

/// The limits of the torque, for swings of one speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Limit {
    /// Amplitude of the angular velocity, rad/s.
    pub(super) speed: f64,
    /// Largest torque, N m.
    pub(super) torque: f64,
    /// Largest change of the torque, N m/s.
    pub(super) rate: f64,
}

/// Steepness of a command, over the slew limit, up to which the slew limit does not count.
const SLOW: f64 = 0.5;

impl Limit {
    /// Returns the part of a torque with the amplitude `asked` (N m) that is made in a swing of the
    /// pace `pace` (rad/s), with its phase. It is continuous in both.
    ///
    /// A sine that is cut off at the torque T has the fundamental 2/pi (asin r + r sqrt(1 - r²))
    /// with r = T/asked. With a slew limit R, s = asked pace/R: the torque leaves the command where
    /// the command becomes steeper than R, at the phase p = acos(1/s) before 0 or where it leaves
    /// T, asin r before 0. It falls along a line, and so it crosses 0 later by s sin p - p. If it
    /// does not reach its command before this falls again, it is a triangle with the fundamental
    /// 4/(pi s), which is late by acos(pi/(2 s)).
    pub(super) fn part(&self, asked: f64, pace: f64) -> Complex {
        let s = asked * pace / self.rate;
        // Far below both limits less than a thousandth is missing.
        if asked <= self.torque && s <= SLOW {
            return Complex::real(1.0);
        }
        let r = (self.torque / asked).min(1.0);
        let cut = 2.0 / PI * (r.asin() + r * (1.0 - r * r).sqrt());
        // Both limits together, within a tenth. It has no step where the slew limit begins to
        // count: the determinant could not be followed over one.
        let triangle = |s: f64| (0.25 * PI * s).powi(6);
        let size = (cut.powi(-6) + (triangle(s) - triangle(SLOW)).max(0.0)).powf(-1.0 / 6.0);
        let leaves = r.asin().min((1.0 / s).min(1.0).acos());
        // The triangle meets its command where this falls faster than R, below T.
        let is_triangle = s * s > 1.0 + 0.25 * PI * PI && r * s > 0.5 * PI;
        let late = if is_triangle { (0.5 * PI / s).acos() } else { s * leaves.sin() - leaves };
        Complex::polar(size, -late.max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the fundamental of a sine behind the two limits, by running it.
    fn run(limit: &Limit, asked: f64, pace: f64) -> Complex {
        const STEPS: u32 = 4000;
        let dt = 2.0 * PI / pace / f64::from(STEPS);
        let (mut torque, mut sum) = (0.0_f64, Complex::real(0.0));
        for k in 0..6 * STEPS {
            let phase = f64::from(k) * 2.0 * PI / f64::from(STEPS);
            let want = (asked * phase.sin()).clamp(-limit.torque, limit.torque);
            torque += (want - torque).clamp(-limit.rate * dt, limit.rate * dt);
            if k >= 5 * STEPS {
                sum = sum + Complex { re: phase.sin(), im: phase.cos() } * (torque * 2.0 / f64::from(STEPS));
            }
        }
        sum * (1.0 / asked)
    }

    #[test]
    fn the_part_is_the_fundamental_of_the_sine_behind_the_limits() {
        let limit = Limit { speed: 1.0, torque: 0.8, rate: 200.0 };
        for pace in [20.0, 80.0, 200.0, 350.0, 600.0, 1500.0] {
            for asked in [0.1, 0.5, 0.79, 1.0, 2.0, 8.0, 100.0] {
                let (found, want) = (limit.part(asked, pace), run(&limit, asked, pace));
                // The size is an interpolation, 8 % off at worst, and the phase that of the zeros.
                let off = (found - want).size() / want.size();
                assert!(off < 0.12, "{asked} N m at {pace} rad/s: {found:?}, not {want:?}");
            }
        }
    }

    /// The turns of a determinant can only be counted along a curve without steps.
    #[test]
    fn the_part_has_no_steps() {
        let limit = Limit { speed: 1.0, torque: 0.8, rate: 200.0 };
        // Pairs of a larger torque and a faster pace, a millionth apart.
        const NEXT: f64 = 1.0 + 1.0e-6;
        for asked in (0..4000).map(|k| 0.01 * 1.002_f64.powi(k)) {
            for pace in [20.0, 100.0, 124.9, 250.0, 390.0, 465.4, 1000.0, 3000.0] {
                let here = limit.part(asked, pace);
                for next in [limit.part(asked * NEXT, pace), limit.part(asked, pace * NEXT)] {
                    assert!((next - here).size() < 1.0e-4 * here.size(), "{asked} N m at {pace} rad/s");
                }
            }
        }
        // Across the places where the formula changes: the slew limit begins to count, the torque
        // begins to lag, it begins to be cut off, and it becomes a triangle.
        for (r, s) in
            [(2.0, SLOW), (2.0, 1.0), (1.0, 0.7), (1.0, 3.0), (2.0, 1.862_096), (0.5, PI), (0.3, 2.0)]
        {
            let (asked, pace) = (limit.torque / r, s * limit.rate * r / limit.torque);
            let [before, after] = [1.0 / NEXT, NEXT].map(|x| limit.part(asked * x, pace));
            assert!((after - before).size() < 1.0e-4 * before.size(), "{r} {s}: {before:?} {after:?}");
        }
    }
}
