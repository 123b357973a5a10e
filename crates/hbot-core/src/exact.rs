//! Checks of what is read from a recording.

use serde::de::Error;
use serde::{Deserialize, Deserializer};

/// Reads a count that says how much of an array is in use. Fails if it is not from `LEAST` to
/// `MOST`, so that a damaged recording cannot name elements that the array does not have.
pub(crate) fn count<'de, D: Deserializer<'de>, const LEAST: usize, const MOST: usize>(
    from: D,
) -> Result<usize, D::Error> {
    let count = usize::deserialize(from)?;
    if (LEAST..=MOST).contains(&count) {
        Ok(count)
    } else {
        Err(D::Error::custom("a count out of its range"))
    }
}
