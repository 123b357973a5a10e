//! Tests of recordings.

mod definitions;
