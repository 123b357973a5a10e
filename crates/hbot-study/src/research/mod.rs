//! Research on the rig: reproduction of the paper's results, and a search for better dimensions.

pub(crate) mod design;
pub(crate) mod paper;
