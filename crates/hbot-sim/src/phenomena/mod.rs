//! What a real rig shows besides the ideal one, each on request, none otherwise.
//!
//! Every phenomenon is a small table of figures; its `default()` has the prototype's, or those usual of such parts
//! (physics notes, sections 8 and 12). What is `None` costs nothing: no state, no instruction but the look whether it is
//! there. `docs/simulator.md` has the equation, the source and the validation of each.
//!
//! | where it acts | phenomena |
//! |---|---|
//! | the plant | [`JointFriction`], [`CageFriction`], [`Slip`], [`Pivoting`], [`Eccentric`], [`WheelModules`], [`Gear`] |
//! | the controllers | [`Encoder`], [`Motor`] |
//! | the line | [`Link`] |
//! | the sphere | [`Hand`] |
//!
//! What is random comes from a seed: the same figures and the same bytes in give the same bytes out.

mod contact;
mod encoder;
mod friction;
mod gear;
mod link;
mod masses;
mod motor;

pub use contact::{Pivoting, Slip};
pub use encoder::Encoder;
pub use friction::{CageFriction, JointFriction};
pub use gear::Gear;
pub use link::Link;
pub use masses::{Eccentric, WheelModules};
pub use motor::Motor;

pub use crate::hand::Hand;

/// The phenomena of a simulated rig; the default has none.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Phenomena {
    /// Friction at every joint.
    pub joint_friction: Option<JointFriction>,
    /// Friction of the sphere in its cage.
    pub cage_friction: Option<CageFriction>,
    /// Contacts that hold only so much.
    pub slip: Option<Slip>,
    /// Friction of the contacts against pivoting.
    pub pivoting: Option<Pivoting>,
    /// A sphere that is out of centre.
    pub eccentric: Option<Eccentric>,
    /// Wheels that weigh on their steering joints.
    pub wheel_modules: Option<WheelModules>,
    /// Gears of the drive joints with play and losses.
    pub gear: Option<Gear>,
    /// Encoders that are coarse, out of centre, or wrongly zeroed.
    pub encoder: Option<Encoder>,
    /// Motors that are weak, late, slow and get hot.
    pub motor: Option<Motor>,
    /// A line that is late and loses and spoils frames.
    pub link: Option<Link>,
    /// A person's hand that holds the sphere.
    pub hand: Option<Hand>,
}

impl Phenomena {
    /// Those of the plant alone; a hand is not the plant's.
    #[must_use]
    pub fn of_plant(&self) -> Self {
        Self { encoder: None, motor: None, link: None, hand: None, ..*self }
    }
}
