//! Verification of this program: the errors of its methods, the cost of its effects and phenomena,
//! and the limits of stability.
//!
//! The module `stages` holds the stages under study. It is compiled twice, with the f64 and with
//! the f32 version of the core.

pub(crate) mod accuracy;
pub(crate) mod callgrind;
pub(crate) mod effects;
pub(crate) mod feel;
pub(crate) mod identify;
pub(crate) mod lead;
pub(crate) mod stability;

use hbot_core::design::kinematics::Posture;
use hbot_core::inputs::JointReadings;
use hbot_core::{MAX_JOINTS, Rig};
use hbot_sim::motion::{MotionSample, TrueMotion};
use serde_json::Value;

/// Work whose instructions are counted: a function that starts anew in each call and runs the given
/// number of ticks. It returns a sum of their results, so that the compiler cannot remove them.
type Job = Box<dyn FnMut(usize) -> f64>;

/// Returns the jobs that `all` describes. Returns `None` if one of them is no job of any study.
fn jobs(all: &[Value]) -> Option<Vec<Job>> {
    let desk = std::cell::OnceCell::new();
    all.iter().map(|job| effects::job(job, &desk).or_else(|| accuracy::job(job))).collect()
}

/// Returns the readings that motor controllers would send in each tick of a motion at 1 kHz.
fn readings(rig: &Rig, motion: &TrueMotion, moments: &[MotionSample]) -> Vec<JointReadings> {
    let each = |(k, moment): (usize, &MotionSample)| {
        let omega = motion.omega(k as f64 / 1000.0);
        let rates = Posture::new(&rig.device, &[moment.joints[0], moment.joints[2]]).inverse(omega);
        let mut counts = [0; MAX_JOINTS];
        for (j, angle) in moment.joints.iter().enumerate() {
            counts[j] = (angle / rig.joints[j].radians_per_count()).round() as i64 as i32;
        }
        JointReadings::new(k as u32, counts, rates)
    };
    moments.iter().enumerate().map(each).collect()
}

/// The stages of the computation under study, compiled with `Real = f64`.
#[path = "."]
mod double {
    pub(crate) use hbot_core as core;

    #[path = "stages/mod.rs"]
    #[allow(clippy::duplicate_mod, reason = "the same stages in both widths")]
    pub(crate) mod stages;
}

/// The stages of the computation under study, compiled with `Real = f32`.
#[allow(dead_code, reason = "what both widths share, such as lists of names, is read from the other one")]
#[path = "."]
mod single {
    pub(crate) use hbot_core_f32 as core;

    #[path = "stages/mod.rs"]
    #[allow(clippy::duplicate_mod, reason = "the same stages in both widths")]
    pub(crate) mod stages;
}
