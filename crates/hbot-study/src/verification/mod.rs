//! Verification of this program: how far off its methods are, what its effects and phenomena cost, where stability ends.
//!
//! `stages` are the stages under study, compiled once with each width of the core.

pub(crate) mod accuracy;
pub(crate) mod effects;
pub(crate) mod stability;

/// The stages with `Real = f64`.
#[path = "."]
mod double {
    pub(crate) use hbot_core as core;

    #[path = "stages/mod.rs"]
    #[allow(clippy::duplicate_mod, reason = "the same stages in both widths")]
    pub(crate) mod stages;
}

/// The stages with `Real = f32`.
#[allow(dead_code, reason = "what both widths share, such as lists of names, is read from the other one")]
#[path = "."]
mod single {
    pub(crate) use hbot_core_f32 as core;

    #[path = "stages/mod.rs"]
    #[allow(clippy::duplicate_mod, reason = "the same stages in both widths")]
    pub(crate) mod stages;
}
