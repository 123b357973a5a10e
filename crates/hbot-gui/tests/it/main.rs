//! The panel as its users meet it: every control against a real server in virtual time, and a real window.

mod bench;
mod connection;
mod controls;
mod identity;
mod plots;
mod scene;
mod window;
