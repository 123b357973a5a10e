//! Deserializes a validated tree of values into a Rust type.

use serde::Deserialize;
use serde_json::Value;

use crate::document::Report;

/// Converts `value` to the type `T`. `path` is the place of the value in the file, for the error
/// message. If the conversion fails, adds a mistake to the report and returns `None`. After
/// [`validate`](crate::validate::validate) this happens only if the type is stricter than its
/// schema.
pub(crate) fn decode<'a, T: Deserialize<'a>>(value: &'a Value, path: &str, report: &mut Report) -> Option<T> {
    T::deserialize(value).map_err(|error| report.push(path, error.to_string(), None)).ok()
}
