//! Cases in which controllers of this kind usually fail (docs/internals/hard-cases.md). Checks that
//! depend on the width of numbers run in both widths.

mod caster;
mod stiff;

/// The checks in f64.
#[path = "."]
mod double {
    use hbot_core as core;

    #[path = "checks/mod.rs"]
    #[allow(clippy::duplicate_mod, reason = "the same checks in both widths")]
    mod checks;
}

/// The checks in f32.
#[path = "."]
mod single {
    use hbot_core_f32 as core;

    #[path = "checks/mod.rs"]
    #[allow(clippy::duplicate_mod, reason = "the same checks in both widths")]
    mod checks;
}
