//! A spring under known torques: its deflection at rest, and a straight line fitted to the
//! readings.

use hbot_core::safety::mode::Mode;
use hbot_core::{Vec3, rotation};
use hbot_sim::phenomena::Phenomena;
use serde_json::json;

use crate::fit::Fit;
use crate::whole::{Whole, prototype, scene_of};

/// Number of equal steps in which the load rises from zero to its largest value.
pub(super) const STEPS: i32 = 4;
/// Damping of the rendered springs, N m s/rad. It has no effect on the deflection at rest.
pub(super) const DAMPING: f64 = 0.2;
/// Time for which the control loop runs before the first load, so that the motors become active, s.
const START_S: f64 = 0.7;
/// Time in which the load changes from one step to the next, s.
pub(super) const LOAD_S: f64 = 0.2;
/// Time for which the sphere settles after each change of the load, s.
pub(super) const REST_S: f64 = 0.4;
/// Time over which the deflection is averaged after settling, s.
pub(super) const LOOK_S: f64 = 0.1;

/// Settings of a stiffness measurement: the axis, the rendered spring, and the simulated rig.
#[derive(Debug, Clone, Copy)]
pub(super) struct Setting {
    pub(super) axis: Vec3,
    /// Stiffness of the spring as commanded, N m/rad.
    pub(super) asked: f64,
    pub(super) law: &'static str,
    pub(super) phenomena: Phenomena,
    /// Largest load on the sphere, N m.
    pub(super) most: f64,
    /// Whether the torque limits of the rig apply.
    pub(super) limited: bool,
    /// Whether the scene is rendered with the lead.
    pub(super) lead: bool,
}

/// The readings of one stiffness measurement: pairs of deflection (rad) and load (N m), and whether
/// the motors stayed active to the end.
pub(super) struct Measured {
    pub(super) asked: f64,
    pub(super) points: Vec<(f64, f64)>,
    pub(super) active: bool,
}

impl Measured {
    /// Returns the line through the readings. Its slope is the measured stiffness, N m/rad.
    pub(super) fn fit(&self) -> Fit {
        Fit::through(&self.points)
    }

    /// Returns the deviation of the measured stiffness from the commanded one, in per cent.
    pub(super) fn error(&self) -> f64 {
        100.0 * (self.fit().slope / self.asked - 1.0)
    }
}

/// Measures the deflection of a rendered spring under successive loads. The load rises in steps to
/// its largest value and falls to zero, then does so in the other direction.
pub(super) fn measure(setting: &Setting) -> Measured {
    let Setting { axis, asked, .. } = *setting;
    let limits = [("limits.torque", json!(2.0)), ("limits.traction", json!({"mu": 5, "normal_force": 100}))];
    let lead = [("loop.lead", json!(setting.lead))];
    let config = prototype(if setting.limited { &lead } else { &limits });
    let scene = json!({"name": "study", "effect": [
        {"id": "spring", "kind": "spring", "law": setting.law, "stiffness": asked, "damping": DAMPING, "fade_s": 0}
    ]});
    let mut run = Whole::new(&config, scene_of(scene), setting.phenomena);
    run.run(START_S);
    let loads = (0..=STEPS).chain((0..STEPS).rev()).chain((-STEPS..0).rev()).chain(1 - STEPS..=0);
    let mut measured = Measured { asked, points: Vec::new(), active: true };
    let (coming, alone, looks) = (run.ticks(LOAD_S), run.ticks(REST_S), run.ticks(LOOK_S));
    let mut before = 0.0;
    for load in loads.map(|k| setting.most * f64::from(k) / f64::from(STEPS)) {
        let mut deflection = 0.0;
        for k in 1..=coming + alone + looks {
            let x = (f64::from(k) / f64::from(coming)).min(1.0);
            run.rig_mut().set_external(axis * (before + (load - before) * x * x * (3.0 - 2.0 * x)));
            measured.active &= run.step(None).state.mode == Mode::Active;
            if k > coming + alone {
                deflection += rotation::log(run.rig().state().q).dot(axis) / f64::from(looks);
            }
        }
        if !measured.active {
            break;
        }
        measured.points.push((deflection, load));
        before = load;
    }
    measured
}
