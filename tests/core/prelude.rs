//! What most modules of these tests use.

pub use crate::bench::{
    Bench, DT, FirstReply, TORQUE_RATE, active, altered, effect, encoders, rig, spring, spring_scene, stream,
};

pub use hbot_core::design::device::MAX_JOINTS;
pub use hbot_core::design::kinematics::Posture;
pub use hbot_core::design::rig::{LeadTime, PassivityLimit, RateEstimate, Rig, Traction, Zero};
pub use hbot_core::inputs::{Command, Complaints, Inputs, JointReadings, OnClientLost, Stamp};
pub use hbot_core::outputs::{Outputs, Refusal, Reply, State};
pub use hbot_core::render::Renderer;
pub use hbot_core::render::effects::{
    Anchor, Constant, Damper, Detents, Effect, EndStop, Frame, Freedom, Kind, Magnet, SnapSet, Snaps, Span,
    Spring, SpringLaw, Target, Texture, Track, TrackPath,
};

pub use hbot_core::safety::mode::{Cause, Mode};
pub use hbot_core::{CompiledScene, Controller, Device, Mat3, Quat, Vec3, WheelSpec, rotation};
pub use hbot_testing::rng::Rng;
