//! Energy that a wall without damping gives to a sphere that hits it, in the whole loop.

use hbot_core::{Vec3, rotation};
use hbot_sim::phenomena::Phenomena;
use serde_json::json;

use super::FACTOR;
use super::borders::{rig, whole};
use crate::context::Context;
use crate::report::{Report, row};

const STIFFNESSES: [f64; 4] = [20.0, 50.0, 75.0, 100.0];
const SPEEDS: [f64; 7] = [0.5, 1.0, 2.0, 2.5, 3.0, 4.0, 5.0];
/// Lag of the motors, s.
const LAG: f64 = 5.0e-4;
/// Number of phases of the tick at which the sphere reaches the wall.
const PHASES: u32 = 10;
/// Angle from the tap to the wall, rad, to which a part of a tick's way is added.
const EDGE: f64 = 0.02;
/// Largest part of its kinetic energy that a sphere may gain.
const MOST: f64 = 0.05;

/// Returns the energy with which a sphere leaves a wall of `stiffness` (N m/rad), less that with
/// which it came at `speed` (rad/s), relative to the latter. It comes at the fraction `phase` of a
/// tick.
fn gain(factor: f64, stiffness: f64, speed: f64, phase: f64) -> f64 {
    let edge = EDGE + 1.0e-3 * speed * phase;
    let scene = json!({"name": "study", "effect": [{
        "id": "wall", "kind": "end_stop", "walls": "twist", "axis": [1, 0, 0], "twist": [-3, edge],
        "stiffness": stiffness, "damping": 0, "fade_s": 0,
    }]});
    let config = rig(1000, LAG, factor);
    let phenomena = Phenomena { motor: Some(crate::whole::motor(LAG)), ..Phenomena::default() };
    let mut whole = whole(&config, scene, phenomena, 100_000);
    whole.run(0.55);
    whole.tap(Vec3::X * speed);
    let came = whole.rig().dynamics().energy(whole.rig().state());
    let (mut inside, mut left) = (false, 0);
    for _ in 0..whole.ticks(4.0) {
        whole.step(None);
        let angle = rotation::log(whole.rig().state().q).x;
        inside |= angle > edge;
        // The torque has ended some ticks after the sphere has left.
        if inside && angle < edge {
            left += 1;
            if left == 12 {
                break;
            }
        }
    }
    whole.rig().dynamics().energy(whole.rig().state()) / came - 1.0
}

/// Returns the largest gain over all phases of the tick.
pub(super) fn worst(factor: f64, stiffness: f64, speed: f64, phases: u32) -> f64 {
    let phases = (0..phases).map(|k| f64::from(k) / f64::from(phases));
    phases.map(|phase| gain(factor, stiffness, speed, phase)).fold(f64::NEG_INFINITY, f64::max)
}

pub(super) fn study(context: &Context, report: &mut Report) {
    context.part("a wall without damping");
    report.heading("A wall without damping");
    report.say(&format!(
        "The whole loop of the prototype at 1 kHz, motors with a lag of 0.5 ms, no damping anywhere. The sphere hits a wall at a speed. The table has the energy with which it leaves, less that with which it came, in % of the latter: \
         the worst of {PHASES} phases of the tick. The torque limit is 0.9 N m and the slew limit 200 N m/s, less than what walls above 40 N m/rad ask for at 5 rad/s: there the torque falls as early as it rises late."
    ));
    report.family("lead_wall_stiffness{K}_speed{v}_factor{c} | 1 | energy that a wall without damping gives out, relative to the kinetic energy of the sphere that hits it; v in 0.1 rad/s, c in hundredths");
    let head = SPEEDS.map(|speed| format!("{speed} rad/s, %"));
    let mut table = vec![row(["stiffness, N m/rad", "factor"].map(str::to_owned).into_iter().chain(head))];
    let mut most = f64::NEG_INFINITY;
    let (stiffnesses, phases) =
        if context.quick { (&STIFFNESSES[3..], 4) } else { (&STIFFNESSES[..], PHASES) };
    for stiffness in stiffnesses.iter().copied() {
        for factor in [0.0, 1.0, 1.1, 1.2] {
            let mut cells = vec![stiffness.to_string(), factor.to_string()];
            for speed in SPEEDS {
                let gain = worst(factor, stiffness, speed, phases);
                let id = format!(
                    "lead_wall_stiffness{stiffness}_speed{}_factor{}",
                    (10.0 * speed).round(),
                    (100.0 * factor).round()
                );
                report.figure(id, gain);
                cells.push(format!("{:.1}", 100.0 * gain));
                if factor == FACTOR {
                    most = most.max(gain);
                }
            }
            table.push(row(cells));
        }
    }
    report.table(&table);
    report.check(
        format!("with the factor {FACTOR} a wall gives out at most {} % of the energy", 100.0 * MOST),
        format!("{:.1} %", 100.0 * most),
        most <= MOST,
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At 4 rad/s the slew limit acts: without the early fall this wall gives out 26 %.
    #[test]
    fn a_wall_without_damping_gives_out_almost_no_energy() {
        for speed in [1.0, 2.5, 4.0] {
            let gain = worst(FACTOR, 100.0, speed, 5);
            assert!(gain <= MOST && gain > -0.2, "{speed} rad/s: {gain}");
        }
        assert!(worst(0.0, 100.0, 2.0, 1) > 1.0, "without a lead");
    }
}
