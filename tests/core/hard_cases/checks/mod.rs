//! The checks, in the floating-point width of the module that includes them.

#![allow(
    clippy::useless_conversion,
    clippy::unnecessary_cast,
    reason = "a conversion in one width is none in the other"
)]

mod angles;
mod clock;
mod doors;
mod edges;
mod lead;
mod machine;
mod million;
mod singular;
mod spin;
