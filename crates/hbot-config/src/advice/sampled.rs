//! The sampled loop of three axes: from a reading of the sphere's motion to the torque that acts
//! on it, and back. It says whether a stiffness and a damping are stable in it.
//!
//! The torque of a tick is computed from the motion at its reading, acts a whole number of ticks
//! later, is held for a period, and reaches the sphere by the motors' lag. The rates are late by
//! the lag of their filter. All of it is linear, so the loop is stable if no zero of
//! det(I + L(z)) is outside the unit circle. L is the loop's transfer matrix. The number of these
//! zeros is the number of turns that the determinant makes about 0 around the region outside
//! (Cauchy's argument principle), because no pole of L is in it.

use hbot_core::{Mat3, Vec3};

use super::axis::Axis;
use super::complex::Complex;
use super::held::Held;

/// A person's hand on the sphere: a spring and a damper to a place that the hand holds, and an
/// inertia that turns with the sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hold {
    /// Name of the hand, for sentences.
    pub name: &'static str,
    /// Stiffness of the grip, N m/rad.
    pub stiffness: f64,
    /// Damping of the grip, N m s/rad.
    pub damping: f64,
    /// Inertia that the hand adds to the sphere, kg m².
    pub inertia: f64,
}

/// Nobody holds the sphere, a hand of 3 N m/rad holds it, and one of 30 N m/rad. The first hand is
/// the default hand of the simulated rig. The second grips ten times as hard; its damping grows by
/// the square root, as that of muscles does in measurements of the wrist.
pub const HOLDS: [Hold; 3] = [
    Hold { name: "the free sphere", stiffness: 0.0, damping: 0.0, inertia: 0.0 },
    Hold { name: "a hand of 3 N m/rad", stiffness: 3.0, damping: 0.05, inertia: 2.0e-3 },
    Hold { name: "a hand of 30 N m/rad", stiffness: 30.0, damping: 0.16, inertia: 2.0e-3 },
];

/// The numbers of a loop that decide what it keeps stable.
#[derive(Debug, Clone, PartialEq)]
pub struct Sampled {
    /// Period, s.
    pub period: f64,
    /// Whole ticks from a reading to the torque that is computed from it.
    pub delay: u32,
    /// Time constant with which the torque follows its command, s.
    pub lag: f64,
    /// Time by which the scene is rendered ahead of its reading, s: 0 without a lead.
    pub lead: f64,
    /// Time constant 2/w of the filter of the motor controllers' encoders, s: a phase-locked loop
    /// with critical damping and the bandwidth w (rad/s), which filters angle and rate. 0 for none.
    pub rate_lag: f64,
    /// The numbers by which the last angles are multiplied to give the rate, 1/s; the newest angle
    /// comes first. Empty if the rates are those of the motor controllers.
    pub taps: Vec<f64>,
    /// Inertia of the sphere about three axes, kg m².
    pub inertia: Vec3,
    /// The axes of `inertia` in frame N, as columns.
    pub axes: Mat3,
}

/// A scene around one orientation, as the loop renders it.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Stiffness in frame N, N m/rad.
    pub stiffness: Mat3,
    /// Damping in frame N, N m s/rad.
    pub damping: Mat3,
    /// Virtual masses in frame N (kg m²), with the time constants of their smoothing (s).
    pub masses: Vec<(Mat3, f64)>,
}

impl Sampled {
    /// Returns whether the loop keeps `scene` stable while `hold` holds the sphere.
    ///
    /// A place from which the sphere rolls away, such as the ridge between two notches, is no
    /// instability of the loop. It counts as stable if nothing swings there.
    #[must_use]
    pub fn is_stable(&self, scene: &Scene, hold: &Hold) -> bool {
        Held::new(self, hold).is_stable(scene, None)
    }

    /// Returns the stiffness K (N m/rad) and the damping B (N m s/rad) with which a sphere swings
    /// about `axis` by `phi` rad per tick, and its swing neither grows nor decays.
    ///
    /// Then 1 + K (X + t W) + B W = 0 at z = exp(i phi), with the transfer functions X to the angle
    /// and W to the rate, and the lead t. Its real and imaginary parts are two linear equations.
    pub(super) fn border_of(&self, axis: &Axis, phi: f64) -> [f64; 2] {
        let z = Complex::polar(1.0, phi);
        let [angle, rate] = axis.responses(self, z);
        let stiffness = angle + rate * self.lead;
        let cross = |p: Complex, q: Complex| p.re * q.im - p.im * q.re;
        let one = Complex::real(1.0);
        let scale = -1.0 / cross(stiffness, rate);
        [scale * cross(one, rate), scale * cross(stiffness, one)]
    }

    /// Returns the time constant of the whole loop: the mean time from a reading to the effect of
    /// the torque that is computed from it, s.
    #[must_use]
    pub fn lateness(&self) -> f64 {
        self.period * (0.5 + f64::from(self.delay)) + self.lag
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const J: f64 = 3.4e-3;

    fn rig(lag: f64, lead: f64) -> Sampled {
        Sampled {
            period: 1.0e-3,
            delay: 1,
            lag,
            lead,
            rate_lag: 0.0,
            taps: Vec::new(),
            inertia: Vec3::splat(J),
            axes: Mat3::IDENTITY,
        }
    }

    fn spring(k: f64, b: f64) -> Scene {
        Scene { stiffness: Mat3::IDENTITY * k, damping: Mat3::IDENTITY * b, masses: Vec::new() }
    }

    /// Returns the first unstable stiffness with the damping `b`, N m/rad, to 1e-4 of it.
    fn border(rig: &Sampled, b: f64, hold: &Hold) -> f64 {
        let mut k = 0.01;
        while rig.is_stable(&spring(k * 1.1, b), hold) {
            k *= 1.1;
            assert!(k < 1.0e5);
        }
        let (mut low, mut high) = (k, k * 1.1);
        while high - low > 1.0e-4 * low {
            let middle = 0.5 * (low + high);
            if rig.is_stable(&spring(middle, b), hold) { low = middle } else { high = middle }
        }
        low
    }

    /// The table of first unstable springs that was computed independently: lag 0.5 ms, damping
    /// 0.01 N m s/rad, with no lead and with leads of a part of the loop's time constant. Its
    /// numbers have three digits at most, and its growth is 0.
    #[test]
    fn a_lead_moves_the_border_as_computed_independently() {
        let lateness = rig(5.0e-4, 0.0).lateness();
        for (part, want) in [(0.0, 5.0), (0.8, 24.0), (1.0, 110.0), (1.1, 238.0), (1.2, 343.0)] {
            let found = border(&rig(5.0e-4, part * lateness), 0.01, &HOLDS[0]);
            assert!((found / want - 1.0).abs() < 0.04, "{part}: {found}, not {want}");
        }
    }

    /// Returns whether a unit inertia on a spring comes to rest. The period is 1, the torque is
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
    fn the_swings_on_the_border_separate_what_rests_from_what_does_not() {
        for lag in [0.0, 0.25, 0.5, 2.0] {
            for phi in [0.1, 0.2] {
                let unit = Sampled { period: 1.0, ..rig(lag, 0.0) };
                let [stiffness, damping] = unit.border_of(&Axis::new(&unit, 1.0, &HOLDS[0]), phi);
                // Nearer to the border a swing decays too slowly to wait for.
                assert!(rests(lag, 0.9 * stiffness, damping), "{lag} {phi}");
                assert!(!rests(lag, 1.1 * stiffness, damping), "{lag} {phi}");
            }
        }
    }

    /// Two axes with the same border have their zeros at one place, where the angle of the
    /// determinant turns by whole turns.
    #[test]
    fn equal_axes_are_as_stable_as_one() {
        let j = Vec3::new(J, 1.3 * J, 2.0 * J);
        let one = border(&Sampled { inertia: j, ..rig(5.0e-4, 0.0) }, 0.02, &HOLDS[0]);
        for inertia in [Vec3::splat(J), Vec3::new(J, J, 2.0 * J)] {
            let equal = border(&Sampled { inertia, ..rig(5.0e-4, 0.0) }, 0.02, &HOLDS[0]);
            // The heavier axes have their border a little higher.
            assert!((equal / one - 1.0).abs() < 0.02, "{inertia}: {equal}, {one}");
        }
    }

    #[test]
    fn a_matrix_in_any_frame_is_as_stable_as_in_its_axes() {
        let stiffness = Mat3::from_diagonal(Vec3::new(12.0, 3.0, 1.0));
        let damping = Mat3::from_diagonal(Vec3::new(0.02, 0.01, 0.01));
        let turn = Mat3::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 0.7);
        for scale in [0.7, 0.9, 1.1, 1.5] {
            let plain = Scene { stiffness: stiffness * scale, damping, masses: Vec::new() };
            let turned = Scene {
                stiffness: turn * plain.stiffness * turn.transpose(),
                damping: turn * damping * turn.transpose(),
                masses: Vec::new(),
            };
            let stable = |scene: &Scene| rig(5.0e-4, 0.0).is_stable(scene, &HOLDS[0]);
            assert_eq!(stable(&plain), stable(&turned), "{scale}");
            assert_eq!(stable(&plain), scale < 0.86, "{scale}: 0.02 N m s/rad over 2 ms is 10 N m/rad");
        }
    }

    #[test]
    fn damping_alone_is_stable_up_to_j_over_h() {
        let loop_ = rig(0.0, 0.0);
        let most = J / loop_.period;
        for (part, stable) in [(0.5, true), (0.97, true), (1.03, false), (40.0, false)] {
            for directions in [Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::ONE] {
                let damping = Mat3::from_diagonal(directions * (part * most));
                let scene = Scene { stiffness: Mat3::ZERO, damping, masses: Vec::new() };
                assert_eq!(loop_.is_stable(&scene, &HOLDS[0]), stable, "{damping}");
            }
        }
    }

    #[test]
    fn a_place_from_which_the_sphere_rolls_away_does_not_shake() {
        for directions in [Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::ONE] {
            let ridge = Scene { stiffness: Mat3::from_diagonal(directions * -5.0), ..spring(0.0, 0.02) };
            assert!(rig(5.0e-4, 0.0).is_stable(&ridge, &HOLDS[0]), "{directions}");
        }
        let saddle =
            Scene { stiffness: Mat3::from_diagonal(Vec3::new(-5.0, 40.0, 0.0)), ..spring(0.0, 0.02) };
        assert!(!rig(5.0e-4, 0.0).is_stable(&saddle, &HOLDS[0]), "about n2 it shakes");
    }

    /// The borders of the whole loop with filters of 200, 400 and 1000 Hz (2/w with w = 2 pi
    /// f/2.48) at a lag of 0.8 ms, of a one-axis model that was written independently.
    #[test]
    fn filters_of_the_encoders_lower_the_border() {
        for (filter_hz, wants) in [(200.0, [8.02, 46.46]), (400.0, [8.45, 66.19]), (1000.0, [8.60, 77.71])] {
            let rate_lag = 2.0 / (std::f64::consts::TAU * filter_hz / 2.48);
            let rig = Sampled { rate_lag, inertia: Vec3::splat(3.396e-3), ..rig(8.0e-4, 0.0) };
            for (damping, want) in [0.02, 0.2].into_iter().zip(wants) {
                let found = border(&rig, damping, &HOLDS[0]);
                assert!((found / want - 1.0).abs() < 0.02, "{filter_hz} Hz, {damping}: {found}, not {want}");
            }
        }
    }

    /// The difference of two readings is the mean rate over the tick before the newest, so it is
    /// half a tick late.
    #[test]
    fn rates_from_angles_are_late() {
        let difference = Sampled { taps: vec![1.0e3, -1.0e3], ..rig(5.0e-4, 0.0) };
        let exact = border(&rig(5.0e-4, 0.0), 0.05, &HOLDS[0]);
        let late = border(&difference, 0.05, &HOLDS[0]);
        // To first order a rate that is late by t adds B t to the inertia, so the border does not
        // move. To the next order it falls.
        assert!(late < exact && late > 0.9 * exact, "{late} {exact}");
    }
}
