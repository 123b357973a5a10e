//! What a rig keeps stable, and what a scene asks of it.
//!
//! ```text
//! RigConfig ──> inertia ──> sampled: the loop of three axes ──> bound: springs about one axis
//!                                │
//! SceneFile ──> the laws around their places (hbot_core::around) ──> judge ──> abilities: warnings
//! ```

mod abilities;
mod axis;
mod bound;
mod complex;
mod held;
mod inertia;
#[cfg(feature = "info")]
mod info;
mod judge;
mod sampled;
mod told;

pub use abilities::{Abilities, in_vain};
pub use bound::{StiffnessBound, USUAL_DAMPING};
pub use judge::{Cure, Finding, Judge, Why};
pub use sampled::{HOLDS, Hold, Sampled, Scene};
pub use told::{Told, ToldLoop};
