//! How often each name of a closed list came about.

use crate::names::Name;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::BTreeMap;

/// A count of each name of a list, on the wire a map. Every name is in it, with 0 if it has not come about. Counting takes no memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CountsByName<N>(Vec<(N, u64)>);

impl<N: Name> Default for CountsByName<N> {
    fn default() -> Self {
        Self(N::NAMES.iter().map(|name| (*name, 0)).collect())
    }
}

impl<N: Name> CountsByName<N> {
    /// CountsByName `name` once more.
    pub fn add(&mut self, name: N) {
        if let Some((_, count)) = self.0.iter_mut().find(|(other, _)| *other == name) {
            *count += 1;
        }
    }

    /// How often `name` came about.
    #[must_use]
    pub fn of(&self, name: N) -> u64 {
        self.iter().find(|(other, _)| *other == name).map_or(0, |(_, count)| count)
    }

    /// Each name with its count, in the order of the documentation.
    pub fn iter(&self) -> impl Iterator<Item = (N, u64)> + '_ {
        self.0.iter().copied()
    }

    /// The sum of all counts.
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

/// Names that a later server may add are passed over.
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
