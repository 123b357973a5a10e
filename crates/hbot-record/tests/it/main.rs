//! Tests of recordings: made by a server in virtual time, replayed, altered, cut and damaged.

mod definitions;
mod flaws;
mod kept;
mod made;
mod recovered;
mod runs;
mod snapshots;
