//! The adaptive reference integrator, slow and exact. Studies and tests compare the fixed-step
//! methods with it.
//!
//! It takes steps of order 5 with an error estimate of order 4 (Dormand and Prince 1980). The
//! orientation is integrated in the coordinates of the exponential map (Munthe-Kaas 1999).

use core::fmt;

use hbot_core::design::device::MAX_WHEELS;
use hbot_core::{Vec3, rotation};

use super::{JointTorques, Load, Plant, PlantState};

/// Number of coordinates of the integration: the turn since the start of the step, the angular
/// velocity, the steer angles and the drive angles.
const SIZE: usize = 6 + 2 * MAX_WHEELS;
type Coordinates = [f64; SIZE];

/// Times of the seven stages of the method, as fractions of the step.
const AT: [f64; 7] = [0.0, 1.0 / 5.0, 3.0 / 10.0, 4.0 / 5.0, 8.0 / 9.0, 1.0, 1.0];

/// Weights with which each stage of the method uses the rates of the stages before it. The last row
/// gives the result of order 5.
const FROM: [&[f64]; 7] = [
    &[],
    &[1.0 / 5.0],
    &[3.0 / 40.0, 9.0 / 40.0],
    &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
    &[19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0],
    &[9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0],
    &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];

/// Weights of the stages in the error estimate, which is the result of order 5 minus that of order
/// 4.
const ERROR: [f64; 7] =
    [71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0];

/// Error: the adaptive reference integrator cannot meet its tolerance with any step.
///
/// The tolerance is below what rounding allows, or the load is not smooth or not finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepTooSmall {
    /// Time at which the integration stopped, s.
    pub t: f64,
}

impl fmt::Display for StepTooSmall {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the adaptive reference found no step small enough at t = {} s: ask for a larger tolerance, or split the \
             interval where the load jumps",
            self.t
        )
    }
}

impl core::error::Error for StepTooSmall {}

impl Plant {
    /// Advances `state` by `duration` seconds (positive) from time `t` (s), with an error bounded
    /// by `tolerance`.
    ///
    /// Steps are chosen so that the estimated error of each coordinate in each step is below
    /// `tolerance` times 1 + the coordinate's magnitude. The smallest tolerance that rounding
    /// allows is about 1e-13. `load` must be smooth over the interval: five times differentiable.
    ///
    /// # Errors
    /// Fails if no step is small enough. `state` then holds the state at the time of the failure.
    pub fn advance_exactly<L: Load>(
        &self,
        state: &mut PlantState,
        t: f64,
        duration: f64,
        tau: &JointTorques,
        load: &L,
        tolerance: f64,
    ) -> Result<(), StepTooSmall> {
        let mut done = 0.0;
        let mut h = duration.min(1.0e-3);
        while done < duration {
            let last = h >= duration - done;
            if last {
                h = duration - done;
            }
            let (end, error) = self.try_step(state, t + done, h, tau, load, tolerance);
            if error <= 1.0 {
                *state = end;
                done = if last { duration } else { done + h };
            } else if !(h > 1.0e-9) {
                return Err(StepTooSmall { t: t + done });
            }
            // The error of a step is proportional to h^5. A NaN load gives no estimate, so the step
            // shrinks.
            h *= if error.is_nan() { 0.2 } else { (0.9 * libm::pow(error, -0.2)).clamp(0.2, 5.0) };
        }
        Ok(())
    }

    /// Computes one step of `h` seconds. Returns the state at its end and the estimated error, in
    /// units of the tolerance.
    fn try_step<L: Load>(
        &self,
        state: &PlantState,
        t: f64,
        h: f64,
        tau: &JointTorques,
        load: &L,
        tolerance: f64,
    ) -> (PlantState, f64) {
        let start = coordinates(state);
        let mut y = start;
        let mut k = [[0.0; SIZE]; 7];
        for stage in 0..7 {
            for i in 0..SIZE {
                y[i] = start[i] + h * FROM[stage].iter().zip(&k).map(|(a, k)| a * k[i]).sum::<f64>();
            }
            k[stage] = self.rates_at(state, &y, t + AT[stage] * h, tau, load);
        }
        let mut worst: f64 = 0.0;
        for i in 0..SIZE {
            let error = h * ERROR.iter().zip(&k).map(|(e, k)| e * k[i]).sum::<f64>();
            let share = error.abs() / (tolerance * (1.0 + y[i].abs()));
            // A NaN stays the worst error.
            if share > worst || share.is_nan() {
                worst = share;
            }
        }
        (state_at(state, &y), worst)
    }

    fn rates_at<L: Load>(
        &self,
        start: &PlantState,
        y: &Coordinates,
        t: f64,
        tau: &JointTorques,
        load: &L,
    ) -> Coordinates {
        let state = state_at(start, y);
        let external = load.torque(&load.at(t), state.q, state.omega);
        let mut rates = [0.0; SIZE];
        rates[..3].copy_from_slice(&turn_rate(Vec3::from_slice(&y[..3]), state.omega).to_array());
        rates[3..6].copy_from_slice(&self.acceleration(&state, external, tau).to_array());
        let joints = self.joint_rates(&state);
        for i in 0..MAX_WHEELS {
            rates[6 + i] = joints[2 * i];
            rates[6 + MAX_WHEELS + i] = joints[2 * i + 1];
        }
        rates
    }
}

/// Returns the rate du/dt of the rotation vector u, for the orientation q = exp(u) q0 and the
/// angular velocity w in frame N.
///
/// With t = |u|, du/dt = w - 1/2 u x w + (1/t²)(1 - (t/2) cot(t/2)) u x (u x w).
fn turn_rate(u: Vec3, omega: Vec3) -> Vec3 {
    let t2 = u.length_squared();
    // Below this limit the series is exact to rounding: its next term is t^6 / 1,209,600.
    let c = if t2 < 1.0e-4 {
        1.0 / 12.0 + t2 * (1.0 / 720.0 + t2 * (1.0 / 30240.0))
    } else {
        let half = 0.5 * libm::sqrt(t2);
        let (s, c) = libm::sincos(half);
        (1.0 - half * c / s) / t2
    };
    let cross = u.cross(omega);
    omega - cross * 0.5 + u.cross(cross) * c
}

fn coordinates(state: &PlantState) -> Coordinates {
    let mut y = [0.0; SIZE];
    y[3..6].copy_from_slice(&state.omega.to_array());
    y[6..6 + MAX_WHEELS].copy_from_slice(&state.steer);
    y[6 + MAX_WHEELS..].copy_from_slice(&state.drive);
    y
}

fn state_at(start: &PlantState, y: &Coordinates) -> PlantState {
    PlantState {
        q: rotation::renormalized(rotation::exp(Vec3::from_slice(&y[..3])) * start.q),
        omega: Vec3::from_slice(&y[3..6]),
        steer: core::array::from_fn(|i| y[6 + i]),
        drive: core::array::from_fn(|i| y[6 + MAX_WHEELS + i]),
    }
}
