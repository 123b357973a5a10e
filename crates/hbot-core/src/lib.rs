//! Kinematics, haptic rendering and the control law of an Hbot. An Hbot is a haptic device: a
//! sphere in a cage, held by a hand and turned by steered and driven wheels.
//!
//! The crate is `no_std`. It uses no heap, no clock, no input or output and no unsafe code. The
//! same inputs give the same bits on any machine.
//!
//! # Modules, from the hand down to the wheels
//!
//! 1. [`controller`]: [`Controller::tick`], a pure function from [`Inputs`] and a [`CompiledScene`]
//!    to [`Outputs`].
//! 2. [`render`]: the torque of a scene. [`render::scene`] and [`render::effects`] define how the
//!    sphere feels; [`render::impedance`] holds the spring laws and the damper. The lead, and what
//!    the laws say about themselves for warnings and plots, are here too.
//! 3. [`safety`]: the state machine with every cause of a fault, the watch on counts, heat,
//!    passivity, the guard against shaking, limits of size and slew.
//! 4. [`allocation`]: finds joint torques within their limits for a torque on the sphere, and keeps
//!    its direction.
//! 5. [`motion`]: computes orientation and rates of the sphere from encoder counts.
//! 6. [`design`]: the device and its rig, kinematics, margins to singularities. A design that
//!    exists has been checked over all steer angles.
//! 7. [`rotation`]: exponential, logarithm and differences of unit quaternions.
//!
//! # Conventions
//!
//! - Units are SI: m, rad, s, kg, N m.
//! - Quaternions map sphere axes to frame N. At interfaces they are written `[w, x, y, z]`.
//! - Vectors are in the inertial frame N unless another frame is named. Gravity points along -n3,
//!   and the open half of the cage is up.
//! - A torque acts on the sphere. Torques at the joints are called joint torques.
//! - Joints are ordered steer, drive of wheel 1, then steer, drive of wheel 2, and so on.
//! - The equations are those of docs/internals/physics.md.
//!
//! # A tick
//!
//! A program owns a [`Controller`] and calls it once per period with the inputs that have arrived.
//! It then sends [`Outputs::drive`] to the motor controllers. In the repository, tests/no_std is a
//! complete program without a standard library. examples/own_effect.rs runs a new haptic law on a
//! simulated rig.
//!
//! ```
//! use hbot_core::render::effects::{Anchor, Effect, Kind, Spring, SpringLaw};
//! use hbot_core::inputs::{Command, Inputs, JointReadings};
//! use hbot_core::safety::mode::Mode;
//! use hbot_core::design::rig::{Joint, RigParts, Zero};
//! use hbot_core::{
//!     CompiledScene, Controller, Device, MAX_JOINTS, Mat3, Rig, Vec3, WheelSpec, rotation,
//! };
//!
//! let wheel = |side| WheelSpec {
//!     axis: Vec3::new(side, 0.0, -1.0),
//!     cone: 0.1745,
//!     radius: 0.0155,
//!     ..WheelSpec::default()
//! };
//! let device = Device::new(0.102, 0.467, &[wheel(1.0), wheel(-1.0)])?;
//! let joint = Joint { zero: Zero::Assume, ..Joint::new(16384, 2.0) };
//! let rig = Rig::new(RigParts::new(device).with_joints(joint, joint))?;
//!
//! // A spring of 2 N m/rad to an orientation 0.25 rad about n1 from that of the sphere.
//! let stiffness = Mat3::from_diagonal(Vec3::splat(2.0));
//! let reference = rotation::exp(Vec3::new(0.25, 0.0, 0.0));
//! let (law, no_damping) = (SpringLaw::Geodesic, Mat3::ZERO);
//! let spring = Spring::new(law, stiffness, no_damping, reference, Anchor::Absolute);
//! let spring = Kind::Spring(spring.ok_or("not a stiffness")?);
//! let scene = CompiledScene::new(1, &[Effect::new(0, 1, spring)])?;
//!
//! let mut controller = Controller::new(rig);
//! for tick in 1..=600 {
//!     // Encoders at rest. Their reading answers the command of the last tick.
//!     let feedback = JointReadings::new(tick as u32 - 1, [0; MAX_JOINTS], [0.0; MAX_JOINTS]);
//!     let mut inputs = Inputs { feedback: Some(feedback), ..Inputs::quiet(tick) };
//!     if tick == 3 {
//!         inputs.commands.push(Command::Enable).map_err(|_| "no room for a command")?;
//!     }
//!     let outputs = controller.tick(&scene, &inputs);
//!     // A real program sends `outputs.drive` here.
//!     if tick == 600 {
//!         // The soft start of half a second is over. The torque is 2 N m/rad times 0.25 rad.
//!         assert_eq!(outputs.state.mode, Mode::Active);
//!         assert!((outputs.state.torque - Vec3::new(0.5, 0.0, 0.0)).length() < 1e-9);
//!         assert!(outputs.drive.enable && outputs.drive.torque[1] != 0.0);
//!     }
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Memory
//!
//! Sizes are in bytes on a 64-bit machine. There is no heap. A tick takes some kilobytes of stack.
//! A tick after a change of scene also needs a copy of the effects' memories.
//! [`controller::ALIGN_HISTORY`] gives the length of the history. Most of the rest of a controller
//! holds the torques of the last 1024 ticks, which the passivity observer multiplies with the
//! turns.
//!
//! | reals | a [`Controller`] | its history of orientations | a [`CompiledScene`] |
//! |---|---|---|---|
//! | f64 | 105824 | 41088 | 40464 |
//! | f32 | 60248 | 24640 | 20496 |
#![no_std]

pub mod allocation;
pub mod controller;
mod count;
pub mod design;
#[cfg(feature = "exact")]
mod exact;
pub mod inputs;
mod linear;
pub mod motion;
pub mod outputs;
mod real;
pub mod render;
pub mod rotation;
pub mod safety;

pub use controller::Controller;
pub use design::device::{Device, MAX_JOINTS, MAX_WHEELS, WheelSpec};
pub use design::rig::{Rig, RigParts};
pub use inputs::Inputs;
pub use outputs::Outputs;
pub use real::{Mat3, Quat, Real, Vec3};
pub use render::scene::CompiledScene;
