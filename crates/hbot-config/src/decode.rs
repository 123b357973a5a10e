//! From a tree of values to a typed one.

use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::document::Report;

/// The value at `path` as a `T`. After [`validate`](crate::validate::validate) this fails only where a type is stricter than
/// its schema; then the report says so.
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
