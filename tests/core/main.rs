//! Tests of the core's behaviour: what a rig renders, does and refuses. They are one binary with a
//! module for each subject.

#![allow(unreachable_pub, reason = "a test has no outside")]

mod anew;
mod bench;
mod budgets;
mod compensation;
mod counted;
mod designs;
mod determinism;
mod effects;
mod energy;
mod fades;
mod faults;
mod geometry;
mod hard_cases;
mod held;
mod hostile;
mod inputs;
mod laws;
mod lead;
mod lies;
mod models;
mod motion;
mod motors;
mod odometry;
mod outside;
mod passivity;
mod prelude;
mod rates;
mod readings;
mod references;
mod same_bits;
mod sessions;
mod shaking;
mod shaping;
mod shelf;
mod singularity;
mod slow_clients;
mod states;
mod streams;
