//! Deserializes a validated tree of values into a Rust type.

use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::document::Report;

/// Converts `value` to the type `T`. `path` is the place of the value in the file, for the error
/// message. If the conversion fails, adds a mistake to the report and returns `None`. After
/// [`validate`](crate::validate::validate) this happens only if the type is stricter than its
/// schema.
pub(crate) fn decode<T: DeserializeOwned>(value: &Value, path: &str, report: &mut Report) -> Option<T> {
    match serde_path_to_error::deserialize(value) {
        Ok(decoded) => Some(decoded),
        Err(error) => {
            let below = error.path().to_string();
            let at = match (path, below.as_str()) {
                (_, ".") => path.to_owned(),
                ("", _) => below,
                _ => format!("{path}.{below}"),
            };
            report.push(&at, error.inner().to_string(), None);
            None
        }
    }
}
