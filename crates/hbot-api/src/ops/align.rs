//! The ops `align` and `align_direction`: an orientation or a direction, as measured from outside.

use super::{Op, OpRow, Who, may, must};
use crate::fields::Fields;
use crate::{Client, ClientError, ErrorBody, finite};
use serde::{Deserialize, Serialize};

pub(super) const ROW: OpRow =
    OpRow::new(Who::Holder, &[must("q"), may("weight"), may("sigma"), may("t")]).stream();

pub(super) const DIRECTION_ROW: OpRow =
    OpRow::new(Who::Holder, &[must("body"), must("world"), must("sigma"), may("t")]).stream();

/// Smallest standard deviation of a measured angle, rad.
pub const MIN_SIGMA: f64 = 1.0e-5;

/// The sphere's orientation as measured from outside, for example by a camera. The server uses it
/// to correct the drift of the orientation that it computes from the joints.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Align {
    /// Measured orientation as a unit quaternion `[w, x, y, z]`.
    #[serde(serialize_with = "finite::array")]
    pub q: [f64; 4],
    /// Fraction of the difference to correct: from 0, which only records the measurement, to 1.
    /// With `sigma`, its variances are divided by the weight.
    #[serde(serialize_with = "finite::scalar")]
    pub weight: f64,
    /// Standard deviations of the error of `q` about the axes of frame N (fixed in space), rad,
    /// each [`MIN_SIGMA`] to pi. The server then weighs the measurement by them and by its own
    /// uncertainty, and does not use one that is too far away. `None`: `weight` alone decides.
    #[serde(default, skip_serializing_if = "Option::is_none", serialize_with = "finite::optional_array")]
    pub sigma: Option<[f64; 3]>,
    /// Time of the measurement, s, on the same clock as the `t` of state messages. Default: the
    /// time of arrival at the server.
    #[serde(default, skip_serializing_if = "Option::is_none", serialize_with = "finite::optional")]
    pub t: Option<f64>,
}

/// A direction of the sphere as measured from outside or by a sensor in the sphere, for example
/// that of gravity. It corrects the orientation except for the turn around the direction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AlignDirection {
    /// The direction in the sphere's axes, a unit vector.
    #[serde(serialize_with = "finite::array")]
    pub body: [f64; 3],
    /// The same direction in frame N (fixed in space), a unit vector.
    #[serde(serialize_with = "finite::array")]
    pub world: [f64; 3],
    /// Standard deviation of the error about each axis across the direction, rad, [`MIN_SIGMA`] to
    /// pi.
    #[serde(serialize_with = "finite::scalar")]
    pub sigma: f64,
    /// Time of the measurement, s, on the same clock as the `t` of state messages. Default: the
    /// time of arrival at the server.
    #[serde(default, skip_serializing_if = "Option::is_none", serialize_with = "finite::optional")]
    pub t: Option<f64>,
}

/// The answer to the ops `align` and `align_direction`, with which a client sends an orientation or
/// a direction measured from outside.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AlignOk {
    /// Angle between the measured orientation and the server's own at the time of the measurement,
    /// 0 to pi rad.
    #[serde(serialize_with = "crate::finite::scalar")]
    pub angle: f64,
    /// False if a measurement with a sigma does not correct the orientation: it is too far from the
    /// server's own, or its weight is 0.
    #[serde(default = "yes", skip_serializing_if = "is_true")]
    pub used: bool,
}

pub(super) fn read(fields: &mut Fields) -> Result<Op, ErrorBody> {
    let q = fields.quaternion("q")?;
    let sigma = fields.optional_sigmas("sigma")?;
    let weight = match sigma {
        None => fields.number("weight", 0.0, 1.0)?,
        Some(_) => fields.optional_number("weight", 0.0, 1.0)?.unwrap_or(1.0),
    };
    Ok(Op::Align(Align { q, weight, sigma, t: fields.optional_number("t", 0.0, f64::MAX)? }))
}

pub(super) fn read_direction(fields: &mut Fields) -> Result<Op, ErrorBody> {
    Ok(Op::AlignDirection(AlignDirection {
        body: fields.direction("body")?,
        world: fields.direction("world")?,
        sigma: fields.number("sigma", MIN_SIGMA, std::f64::consts::PI)?,
        t: fields.optional_number("t", 0.0, f64::MAX)?,
    }))
}

fn yes() -> bool {
    true
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde calls it with a reference")]
fn is_true(used: &bool) -> bool {
    *used
}

impl Client {
    /// Sends the sphere's orientation as measured from outside, for example by a camera. Returns
    /// the angle between it and the server's own orientation, rad.
    pub fn align(&mut self, align: Align) -> Result<f64, ClientError> {
        self.ask(Op::Align(align)).map(|AlignOk { angle, .. }| angle)
    }

    /// Sends a direction of the sphere as measured, for example that of gravity. Returns the angle
    /// between it and the server's own, and whether it is used.
    pub fn align_direction(&mut self, direction: AlignDirection) -> Result<AlignOk, ClientError> {
        self.ask(Op::AlignDirection(direction))
    }
}
