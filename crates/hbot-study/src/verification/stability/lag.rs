//! Motors whose torque follows a command with a lag: the largest stable stiffness by the formula,
//! by the eigenvalues of the sampled loop, and of the whole loop, for nine rigs.

use hbot_config::{Override, RigConfig};
use hbot_core::Vec3;
use hbot_plot::short;
use hbot_sim::phenomena::Phenomena;
use serde_json::json;

use super::micro;
use crate::context::Context;
use crate::report::{Report, row};
use crate::whole::{Whole, inertia, motor, spring};

/// Rig files whose loops are simulated, each with its name in the report.
const FILES: [(&str, &str); 3] = [
    ("prototype", include_str!("../../../../../rigs/prototype.toml")),
    ("three_wheels", include_str!("../../../../../rigs/three_wheels.toml")),
    ("four_wheels", include_str!("../../../../../rigs/four_wheels.toml")),
];
/// Rates of the loop, Hz, and time constants of the torque, s, that each rig file is run with. The
/// lag is a quarter of a period, half a period and two periods.
const SETTINGS: [(u32, f64); 3] = [(500, 5.0e-4), (1000, 5.0e-4), (2000, 1.0e-3)];
/// Damping of the rendered spring, N m s/rad.
const DAMPING: f64 = 0.005;
/// Largest allowed relative difference between any two of the three stability limits.
const WITHIN: f64 = 0.01;
/// Time for which a swing is observed, s.
const WATCH_S: f64 = 4.0;
/// Amplitude of the initial swing, rad. The torques stay below a sixth of their limit.
const THROWN: f64 = 0.05;

/// One rig with its loop's rate and the lag of its motors.
struct Case {
    name: &'static str,
    config: RigConfig,
    lag: f64,
}

impl Case {
    fn all() -> impl Iterator<Item = Self> {
        FILES.into_iter().flat_map(|(name, text)| {
            SETTINGS.map(|(rate, lag)| {
                let with = [("loop.rate_hz", json!(rate)), ("loop.lead", json!(false))]
                    .map(|(path, value)| Override { path, value, from: "the study" });
                let config = RigConfig::from_toml_with(text, name, &with)
                    .unwrap_or_else(|mistakes| unreachable!("a legal rig: {mistakes}"));
                Self { name, config, lag }
            })
        })
    }

    /// Returns the stability limit of the linear theory, B / (h (1/2 + D) + lag), N m/rad.
    fn predicted(&self) -> f64 {
        DAMPING / (1.5 * self.config.rig.timing.period_s() + self.lag)
    }

    /// Returns the sphere's apparent inertia about n1 at the start, kg m².
    fn inertia(&self) -> f64 {
        inertia(&self.config.rig.device, Vec3::X)
    }

    /// Returns the stiffness at which the largest eigenvalue of the sampled loop has the absolute
    /// value 1, N m/rad.
    fn by_eigenvalues(&self) -> f64 {
        let (mut low, mut high) = (0.5 * self.predicted(), 2.0 * self.predicted());
        // The bracket of a factor of 4 becomes 1e-9 wide.
        for _ in 0..31 {
            let middle = (low * high).sqrt();
            let step = step(self.config.rig.timing.period_s(), self.lag, self.inertia(), [middle, DAMPING]);
            if spectral_radius(step) > 1.0 { high = middle } else { low = middle }
        }
        (low * high).sqrt()
    }

    /// Returns the stiffness at which a swing of the whole loop neither grows nor dies, N m/rad.
    fn measured(&self) -> f64 {
        without_growth(self.predicted(), |stiffness| self.growth(stiffness))
    }

    /// Returns how fast a swing about n1 grows in the whole loop, 1/s. Negative if it dies.
    fn growth(&self, stiffness: f64) -> f64 {
        let phenomena = Phenomena { motor: Some(motor(self.lag)), ..Phenomena::default() };
        let mut whole = Whole::new(&self.config, spring(stiffness, DAMPING), phenomena);
        let omega = Vec3::X * (THROWN * libm::sqrt(stiffness / self.inertia()));
        let energies = whole.swung(omega, stiffness, WATCH_S);
        // An energy grows at twice the rate of its swing.
        libm::log(energies[4] / energies[0]) / (2.0 * 0.8 * WATCH_S)
    }
}

/// Returns the stiffness near `near` at which the growth of a swing is zero, N m/rad.
///
/// Near this stiffness the growth is linear in the stiffness. So the secant through the growth at
/// two stiffnesses finds it, and a second secant confirms it.
pub(crate) fn without_growth(near: f64, growth: impl Fn(f64) -> f64) -> f64 {
    let ends = [0.97 * near, 1.03 * near];
    let [low, high] = ends.map(&growth);
    let first = ends[0] - low * (ends[1] - ends[0]) / (high - low);
    let between = growth(first);
    first - between * (ends[1] - first) / (high - between)
}

/// Returns the matrix that advances the linear loop by a tick. Its state is the angle x, the rate
/// v, the motor's torque and the commanded torque u, which was computed from the reading of the
/// tick before: u = -k x - d v, with `gains` = \[k, d\]. Each tick is solved exactly: J dv/dt = i,
/// lag di/dt = u - i.
pub(crate) fn step(h: f64, lag: f64, inertia: f64, gains: [f64; 2]) -> [[f64; 4]; 4] {
    let left = libm::exp(-h / lag);
    // Integrals over a tick of exp(-t/lag), and of that integral.
    let once = lag * (1.0 - left);
    let twice = lag * (h - once);
    [
        [1.0, h, twice / inertia, (0.5 * h * h - twice) / inertia],
        [0.0, 1.0, once / inertia, (h - once) / inertia],
        [0.0, 0.0, left, 1.0 - left],
        [-gains[0], -gains[1], 0.0, 0.0],
    ]
}

/// Returns the largest absolute value of an eigenvalue of `matrix`: the 2^40-th root of the size of
/// its 2^40-th power (Gelfand's formula). This size is r^n to within a factor. If the factor is at
/// most 10^4, its root is within 8e-12 of 1.
pub(crate) fn spectral_radius(mut matrix: [[f64; 4]; 4]) -> f64 {
    let mut log = 0.0;
    let mut share = 1.0;
    for _ in 0..40 {
        let size = matrix.iter().flatten().fold(0.0, |size: f64, x| size.max(x.abs()));
        matrix = matrix.map(|row| row.map(|x| x / size));
        log += share * libm::log(size);
        share *= 0.5;
        matrix = matrix.map(|row| {
            core::array::from_fn(|j| row.iter().zip(&matrix).map(|(x, other)| x * other[j]).sum())
        });
    }
    libm::exp(log)
}

/// The stability limits of one rig by the three ways, N m/rad.
#[derive(Debug)]
struct Found {
    name: &'static str,
    rate: u32,
    lag: f64,
    predicted: f64,
    eigenvalues: f64,
    measured: f64,
}

impl Found {
    fn of(case: &Case) -> Self {
        Self {
            name: case.name,
            rate: case.config.rate_hz,
            lag: case.lag,
            predicted: case.predicted(),
            eigenvalues: case.by_eigenvalues(),
            measured: case.measured(),
        }
    }

    /// Returns the largest relative difference of the other two limits from the formula.
    fn off_formula(&self) -> f64 {
        [self.measured, self.eigenvalues]
            .map(|limit| (limit / self.predicted - 1.0).abs())
            .into_iter()
            .fold(0.0, f64::max)
    }

    /// Returns the relative difference of the whole loop from the eigenvalues.
    fn off_eigenvalues(&self) -> f64 {
        (self.measured / self.eigenvalues - 1.0).abs()
    }

    fn row(&self) -> Vec<String> {
        let Self { name, rate, lag, predicted, eigenvalues, measured } = self;
        let fine = |x: f64| format!("{x:.4}");
        let numbers =
            [*predicted, *eigenvalues, *measured, eigenvalues / predicted, measured / predicted].map(fine);
        row([(*name).to_owned(), rate.to_string(), short(1.0e3 * lag)].into_iter().chain(numbers))
    }

    fn figure(&self, report: &mut Report) {
        let us = (1.0e6 * self.lag).round();
        let id = format!("border_lag_{}_{}hz_lag{us}us_damping{}", self.name, self.rate, micro(DAMPING));
        let figure = report.figure(id, self.measured).note("measured", self.measured);
        figure.note("predicted", self.predicted).note("eigenvalues", self.eigenvalues);
    }
}

pub(super) fn study(context: &Context, report: &mut Report) {
    context.part("motors with a lag");
    introduce(report);
    let head = ["rig", "Hz", "lag, ms", "formula, N m/rad", "eigenvalues", "whole loop"];
    let mut table = vec![row(head.into_iter().chain(["eigenvalues/formula", "whole loop/formula"]))];
    let mut worst = [0.0_f64; 2];
    for case in Case::all().take(if context.quick { SETTINGS.len() } else { usize::MAX }) {
        let found = Found::of(&case);
        found.figure(report);
        table.push(found.row());
        worst = [worst[0].max(found.off_formula()), worst[1].max(found.off_eigenvalues())];
    }
    report.table(&table);
    let [formula, exact] = worst;
    report.check_within("with a lag the border is B/(h (1/2 + D) + lag), D = 1,", formula, WITHIN);
    report.check_within("with a lag the whole loop swings up where its eigenvalues say", exact, WITHIN);
}

fn introduce(report: &mut Report) {
    report.heading("Motors with a lag");
    report.say(&format!(
        "The whole loops of three rig files, each with three combinations of loop rate and lag. The motors follow their commands with the lag as time constant; they are ideal \
         otherwise. A spring with a damping of {DAMPING} N m s/rad holds a sphere that was tapped about n1. The table has the stiffness from which the swing grows: by the formula B/(h (1/2 + D) + lag); by the eigenvalues \
         of a free inertia on this spring, with the lag solved exactly over each tick; and in the whole loop, by the growth of the swing's energy over {WATCH_S} s.",
    ));
    report.family("border_lag_{rig}_{rate}hz_lag{lag}us_damping{B} | N m/rad | stiffness of a spring from which the whole loop swings up, if the motors follow with this lag; damping in 1e-6 N m s/rad; `measured`, `predicted` by the formula and `eigenvalues` in the row");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_eigenvalue_of_a_matrix_that_is_known() {
        // A turn by 0.3 rad that grows by 1.01, beside 0.5 and -0.9, all sheared.
        let (sin, cos) = (1.01 * libm::sin(0.3), 1.01 * libm::cos(0.3));
        let matrix =
            [[cos, -sin, 3.0, 1.0], [sin, cos, 0.0, -2.0], [0.0, 0.0, 0.5, 4.0], [0.0, 0.0, 0.0, -0.9]];
        // ln(10^4)/2^40 is 8e-12, and the shear's factor is far below 10^4.
        assert!((spectral_radius(matrix) - 1.01).abs() < 8e-12, "{}", spectral_radius(matrix));
    }

    /// If the lag is negligible, the border is that of the characteristic polynomial without one:
    /// k = u - u² with u = d - k/2 (docs/internals/borders.md).
    #[test]
    fn without_a_lag_the_eigenvalues_are_those_of_the_polynomial() {
        let case = Case { lag: 1.0e-9, ..Case::all().nth(1).expect("nine") };
        let (h, inertia) = (case.config.rig.timing.period_s(), case.inertia());
        let d = DAMPING * h / inertia;
        let u = 0.5 * (3.0 - libm::sqrt(9.0 - 8.0 * d));
        let stiffness = (u - u * u) * inertia / (h * h);
        // The lag of 1e-9 s is 1e-6 of 1.5 ms.
        let ratio = case.by_eigenvalues() / stiffness;
        assert!((ratio - 1.0).abs() < 1e-6, "{ratio}");
    }

    #[test]
    fn formula_eigenvalues_and_the_whole_loop_agree_on_nine_rigs() {
        let found: Vec<_> = Case::all().map(|case| Found::of(&case)).collect();
        assert_eq!(found.len(), 9);
        for found in found {
            assert!(found.off_formula() <= WITHIN && found.off_eigenvalues() <= WITHIN, "{found:?}");
        }
    }
}
