//! The op `hand`, which moves the hand of a simulated rig.

use super::{Op, OpRow, Who, may};
use crate::fields::{Fields, bad};
use crate::{Client, ClientError, ErrorBody, finite};
use serde::Serialize;

pub(super) const ROW: OpRow = OpRow::new(
    Who::Holder,
    &[may("q"), may("over_ms"), may("stiffness"), may("damping"), may("inertia"), may("release")],
)
.stream();

/// Longest time in which the simulated hand turns to an orientation, ms.
pub const MAX_OVER_MS: u64 = 60_000;

/// Default time in which the simulated hand turns to an orientation, ms.
pub const DEFAULT_OVER_MS: u64 = 50;

/// What the simulated hand does. Only a simulated rig has one.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum HandCommand {
    /// The hand holds the sphere and turns it.
    Hold(HandHold),
    /// The hand lets go of the sphere.
    Release {
        /// Always true.
        release: bool,
    },
}

impl HandCommand {
    /// The hand lets go of the sphere.
    pub const RELEASE: Self = Self::Release { release: true };
}

/// The orientation to which the simulated hand turns the sphere, and how firm its grip is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HandHold {
    /// The orientation as a unit quaternion `[w, x, y, z]`.
    #[serde(serialize_with = "finite::array")]
    pub q: [f64; 4],
    /// Time in which the hand's target turns there at a constant rate, ms, 0 to [`MAX_OVER_MS`].
    pub over_ms: u64,
    /// Spring stiffness of the grip, N m/rad, 0 to 100. `None`: that of a usual hand, 3.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "finite::optional")]
    pub stiffness: Option<f64>,
    /// Damping of the grip, N m s/rad, 0 to 10. `None`: that of a usual hand, 0.05.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "finite::optional")]
    pub damping: Option<f64>,
    /// Moment of inertia that the hand adds to the sphere, kg m², 0 to 1. `None`: that of a usual
    /// hand, 0.002.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "finite::optional")]
    pub inertia: Option<f64>,
}

pub(super) fn read(fields: &mut Fields) -> Result<Op, ErrorBody> {
    if fields.flag("release")? {
        return match fields.0.iter().find(|(_, value)| !value.is_null()) {
            None => Ok(Op::Hand(HandCommand::RELEASE)),
            Some((field, _)) => {
                Err(bad(format!("field {field:?} is there beside \"release\"; legal: no other field")))
            }
        };
    }
    Ok(Op::Hand(HandCommand::Hold(HandHold {
        q: fields.quaternion("q")?,
        over_ms: fields.optional_integer("over_ms", 0, MAX_OVER_MS)?.unwrap_or(DEFAULT_OVER_MS),
        stiffness: fields.optional_number("stiffness", 0.0, 100.0)?,
        damping: fields.optional_number("damping", 0.0, 10.0)?,
        inertia: fields.optional_number("inertia", 0.0, 1.0)?,
    })))
}

impl Client {
    /// Moves the hand of a simulated rig, without waiting for an answer. A real rig has none.
    pub fn hand(&mut self, command: HandCommand) -> Result<(), ClientError> {
        self.send(Op::Hand(command))
    }
}
