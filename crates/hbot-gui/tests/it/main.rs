//! Tests of the panel as users see it: every control with a real server in virtual time, and a real
//! window.

mod bench;
mod connection;
mod controls;
mod display;
mod hand;
mod identity;
mod joints;
mod plots;
mod recordings;
mod scene;
mod start;
mod states;
mod window;
