//! Research on the device: what its paper reports, and which dimensions a better one would have.

pub(crate) mod design;
pub(crate) mod paper;
