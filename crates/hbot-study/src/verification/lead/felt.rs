//! What a hand feels of a spring, by harmonic balance.

use std::f64::consts::TAU;

use hbot_plot::short;

use super::FACTOR;
use crate::report::{Report, row};

/// Stiffness (N m/rad) and damping (N m s/rad) of the spring.
const STIFFNESS: f64 = 5.0;
const DAMPING: f64 = 0.02;
/// Period of the loop and lag of its motors, s.
const PERIOD: f64 = 1.0e-3;
const LAG: f64 = 5.0e-4;
const FREQUENCIES: [f64; 4] = [0.5, 2.0, 5.0, 10.0];
/// Largest difference from what the scene says.
const WITHIN: f64 = 0.05;

/// Returns the stiffness (N m/rad) and the damping (N m s/rad) that are felt at `frequency`, Hz:
/// the parts of the torque that follow the angle and the rate of a sine. The torque is late by y =
/// W h (1/2 + D) + atan(W lag) and smaller by g = sinc(W h/2) / sqrt(1 + (W lag)²), so it is g
/// exp(-i y) (K (1 + i W t) + i W B) times the angle.
fn felt(factor: f64, frequency: f64) -> [f64; 2] {
    let w = TAU * frequency;
    let y = 1.5 * w * PERIOD + libm::atan(w * LAG);
    let half = 0.5 * w * PERIOD;
    let gain = libm::sin(half) / half / libm::sqrt(1.0 + (w * LAG) * (w * LAG));
    let lead = factor * (1.5 * PERIOD + LAG);
    let rate = w * (STIFFNESS * lead + DAMPING);
    let (sin, cos) = (libm::sin(y), libm::cos(y));
    [gain * (STIFFNESS * cos + rate * sin), gain * (rate * cos - STIFFNESS * sin) / w]
}

pub(super) fn study(report: &mut Report) {
    report.heading("What is felt");
    report.say(&format!(
        "A spring of {STIFFNESS} N m/rad with {DAMPING} N m s/rad at 1 kHz, motors with a lag of 0.5 ms, moved by a sine: the stiffness and the damping that the hand feels, by harmonic balance."
    ));
    report.family("lead_felt_{what}_{f}dhz_factor{c} | N m/rad or N m s/rad | felt stiffness or damping of a spring at f tenths of a Hz, c in hundredths");
    let head = ["Hz", "factor", "stiffness, N m/rad", "off, %", "damping, N m s/rad", "off, %"];
    let mut table = vec![row(head)];
    let mut worst = 0.0_f64;
    for frequency in FREQUENCIES {
        for factor in [0.0, 1.0, 1.1, 1.2] {
            let found = felt(factor, frequency);
            let off = [found[0] / STIFFNESS - 1.0, found[1] / DAMPING - 1.0];
            for (what, value) in ["stiffness", "damping"].into_iter().zip(found) {
                let id = format!(
                    "lead_felt_{what}_{}dhz_factor{}",
                    (10.0 * frequency).round(),
                    (100.0 * factor).round()
                );
                report.figure(id, value);
            }
            if factor == FACTOR {
                worst = off.into_iter().fold(worst, |worst, off| worst.max(off.abs()));
            }
            table.push(row([
                short(frequency),
                short(factor),
                short(found[0]),
                format!("{:.1}", 100.0 * off[0]),
                format!("{:.4}", found[1]),
                format!("{:.1}", 100.0 * off[1]),
            ]));
        }
    }
    report.table(&table);
    report.check_within("with the lead a spring feels as the scene says", worst, WITHIN);
}
