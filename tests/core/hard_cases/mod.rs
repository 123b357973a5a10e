//! Cases at which a controller of this kind usually breaks (docs/hard-cases.md). What depends on the width of a real is asked of
//! both widths.

mod caster;
mod stiff;

/// Everything in f64.
#[path = "."]
mod double {
    use hbot_core as core;

    #[path = "checks/mod.rs"]
    #[allow(clippy::duplicate_mod, reason = "the same checks in both widths")]
    mod checks;
}

/// Everything in f32.
#[path = "."]
mod single {
    use hbot_core_f32 as core;

    #[path = "checks/mod.rs"]
    #[allow(clippy::duplicate_mod, reason = "the same checks in both widths")]
    mod checks;
}
