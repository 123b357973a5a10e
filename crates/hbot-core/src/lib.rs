//! Kinematics, rendering and the control tick of an Hbot: a caged sphere, held by a hand, turned by steered and driven
//! wheels.
//!
//! `no_std`, no allocation, no clock, no input or output, no unsafe code. Same inputs, same bits, on any machine.
//!
//! # Layers, from the hand down
//!
//! 1. [`controller`]: [`Controller::tick`], a pure function from [`Inputs`] and a [`CompiledScene`] to [`Outputs`].
//! 2. [`scene`] and [`effects`]: what the sphere is to feel like; [`render`] makes torques of it; [`impedance`]: the spring laws and the damper.
//! 3. [`mode`]: the state table, with every cause of a fault.
//! 4. [`allocation`]: a torque on the sphere as joint torques within limits, its direction kept.
//! 5. [`odometry`]: orientation from joint angles along a [`path`]; [`kinematics`]: contact frames, G, forward and inverse.
//! 6. [`singularity`]: margins and indices; [`device`]: a legal design, checked over all steering angles.
//! 7. [`rotation`]: exponential, logarithm and errors of unit quaternions.
//!
//! # Conventions
//!
//! SI units: m, rad, s, kg, N m. Quaternions map sphere axes to N and stand as `[w, x, y, z]` at the borders. Vectors are in the
//! inertial frame N unless a frame is named: gravity along -n3, the open half of the cage up. A torque acts on the
//! sphere; joint torques are called so. Joints go steer, drive of wheel 1, then wheel 2, and so on. The equations are
//! those of docs/physics.md.
#![no_std]

pub mod allocation;
mod burst;
pub mod controller;
pub mod device;
pub mod effects;
mod encoder;
mod heat;
pub mod impedance;
pub mod inputs;
mod joints;
pub mod kinematics;
pub mod mode;
pub mod odometry;
mod orientation;
pub mod outputs;
mod passivity;
pub mod path;
mod rates;
mod real;
pub mod render;
pub mod rig;
pub mod rotation;
pub mod scene;
mod shaping;
pub mod singularity;
mod watch;

pub use controller::Controller;
pub use device::{Device, MAX_JOINTS, MAX_WHEELS, WheelSpec};
pub use inputs::Inputs;
pub use outputs::Outputs;
pub use real::{Mat3, Quat, Real, Vec3};
pub use rig::{Rig, RigParts};
pub use scene::CompiledScene;
