//! Counters for each name of a closed list.

use crate::names::Name;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::BTreeMap;

/// One counter for each name of a fixed list, such as [`Fault`](crate::Fault). In messages it is a
/// map that contains every name, even if its count is 0. Counting does not allocate memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CountsByName<N>(Vec<(N, u64)>);

impl<N: Name> Default for CountsByName<N> {
    fn default() -> Self {
        Self(N::NAMES.iter().map(|name| (*name, 0)).collect())
    }
}

impl<N: Name> CountsByName<N> {
    /// Adds one to the count of `name`.
    pub fn add(&mut self, name: N) {
        if let Some((_, count)) = self.0.iter_mut().find(|(other, _)| *other == name) {
            *count += 1;
        }
    }

    /// Returns the count of `name`.
    #[must_use]
    pub fn of(&self, name: N) -> u64 {
        self.iter().find(|(other, _)| *other == name).map_or(0, |(_, count)| count)
    }

    /// Iterates over all names with their counts, in the order of the documentation.
    pub fn iter(&self) -> impl Iterator<Item = (N, u64)> + '_ {
        self.0.iter().copied()
    }

    /// Returns the sum of the counts of all names.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.iter().map(|(_, count)| count).sum()
    }
}

impl<N: Name> Serialize for CountsByName<N> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.iter())
    }
}

/// Reads the counts from a map. Unknown names are ignored, because a later version of the server
/// can have more names.
impl<'de, N: Name> Deserialize<'de> for CountsByName<N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let told = BTreeMap::<String, u64>::deserialize(deserializer)?;
        let mut counts = Self::default();
        for (name, count) in &mut counts.0 {
            *count = told.get(name.as_str()).copied().unwrap_or(0);
        }
        Ok(counts)
    }
}
