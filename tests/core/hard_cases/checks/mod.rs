//! The checks, in the width of the module around them.

mod angles;
mod clock;
mod doors;
mod edges;
mod machine;
mod million;
mod singular;
mod spin;
