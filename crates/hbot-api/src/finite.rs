//! Serializes floats that must be finite, and fails on others. JSON has no NaN: serde_json would
//! write `null`, and the receiver would miss a promised number. A sender drops a message that fails
//! here.

use serde::{Serialize, Serializer, ser::Error};

fn checked<S: Serializer>(value: f64) -> Result<f64, S::Error> {
    if value.is_finite() { Ok(value) } else { Err(S::Error::custom("a number to be sent is not finite")) }
}

pub(crate) fn scalar<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_f64(checked::<S>(*value)?)
}

pub(crate) fn optional<S: Serializer>(value: &Option<f64>, serializer: S) -> Result<S::Ok, S::Error> {
    value.map(checked::<S>).transpose()?.serialize(serializer)
}

pub(crate) fn array<S: Serializer, const N: usize>(
    values: &[f64; N],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    for value in values {
        checked::<S>(*value)?;
    }
    serializer.collect_seq(values)
}

pub(crate) fn optional_array<S: Serializer, const N: usize>(
    values: &Option<[f64; N]>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    match values {
        Some(values) => array(values, serializer),
        None => serializer.serialize_none(),
    }
}

/// Returns true if a flag is not set, for fields that are then not sent.
pub(crate) fn is_false(flag: &bool) -> bool {
    !flag
}
