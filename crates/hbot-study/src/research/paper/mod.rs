//! The study `paper`: every analysis and experiment of the paper, repeated with this project's code
//! and compared with the values that it reports.
//!
//! The first sections compute from the geometry, in the order of the paper: `frames` (section II),
//! `singularity` with `nested` (III), `capability` (table II), `indices` with `grids`, `start_map`
//! and `readings` (V). They use `literal`, the paper's equations taken literally, and `torus`,
//! `so3` and `turns`, which provide the postures.
//!
//! The other sections use the simulated rig, with and without the `effects` of a real one:
//! `backdrive` and `bandwidth` with `position` (table II), `inverse` (V.D), `tracking` (fig. 7),
//! `stiffness` with `springs` (table III). Every section adds rows to the table at the start of the
//! report.

mod backdrive;
mod bandwidth;
mod capability;
mod effects;
mod frames;
mod grids;
mod indices;
mod inverse;
mod literal;
mod nested;
mod position;
mod readings;
mod short;
mod singularity;
mod so3;
mod springs;
mod start_map;
mod stiffness;
mod torus;
mod tracking;
mod turns;

use crate::context::Context;
use crate::report::Report;

/// Runs the study `paper` and returns its report.
pub(crate) fn study(context: &Context) -> Report {
    let mut report = Report::new("paper", context.quick);
    context.expect(16);
    report.say(
        "Every analysis and experiment of \"The Hbot: A Holonomic Spherical Haptic Interface Driven by Non-Holonomic Wheels\" (W. C. Agboh) on this \
         project's own parts: what is computed from the geometry first, what takes a simulated rig after it. The device is the prototype (`rigs/prototype.toml`) \
         where nothing else is said. Equations, sections, figures and tables by number are the paper's; where it must not be followed to the letter, \
         docs/internals/physics.md, section 11, says why.",
    );
    report.heading("The paper's figures and ours");
    report.begin_comparison();
    frames::study(context, &mut report);
    singularity::study(context, &mut report);
    capability::study(context, &mut report);
    backdrive::study(context, &mut report);
    bandwidth::study(context, &mut report);
    indices::study(context, &mut report);
    inverse::study(context, &mut report);
    tracking::study(context, &mut report);
    stiffness::study(context, &mut report);
    short::conclude(&mut report);
    report
}
