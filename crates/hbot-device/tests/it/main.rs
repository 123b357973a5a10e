//! Tests of the controller's side of the link, through bytes, time and the builder's functions.

mod bench;
mod conversation;
mod firmware;
mod page;
mod run;
mod safety;
