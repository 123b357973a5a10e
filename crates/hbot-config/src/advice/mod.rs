//! What a rig keeps stable, and what a scene asks of it.
//!
//! ```text
//! RigConfig ──> inertia ──> sampled: the loop of three axes ──> bound: springs about one axis
//!                                │                      bound ──> model_bound: models of clients
//! RigConfig ──> rates: noise and lag of each rate estimate, and which one is picked
//! SceneFile ──> the laws around their places (render::around) ──> judge ──> abilities: warnings
//! ```

mod abilities;
mod axis;
mod border;
mod bound;
mod complex;
mod finding;
mod held;
mod inertia;
#[cfg(feature = "info")]
mod info;
mod judge;
mod lasting;
mod limit;
mod model_bound;
mod places;
mod rates;
mod sampled;
#[cfg(feature = "info")]
mod told;
mod warning;

pub use abilities::{Abilities, in_vain, rounded_down};
pub use border::{StiffnessBorder, StiffnessKey};
pub use bound::{StiffnessBound, USUAL_DAMPING};
pub use finding::{Cure, Finding, Why};
#[cfg(feature = "info")]
pub use info::{told_limits, told_rig};
pub use judge::Judge;
pub use model_bound::{ModelBound, UnstableModel, smallest_eigenvalue};
pub use rates::{RateAdvice, RatePick, RateQuality};
pub use sampled::{HOLDS, Hold, Sampled, Scene};
#[cfg(feature = "info")]
pub use told::Told;
pub use warning::Warning;
