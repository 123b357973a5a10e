//! Tests of recordings: made by a server in virtual time, replayed, altered, cut and damaged.

mod definitions;
mod flaws;
mod kept;
mod made;
mod runs;
mod snapshots;
