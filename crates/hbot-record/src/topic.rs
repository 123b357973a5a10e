//! The topics of a recording.

/// A topic of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Topic {
    /// All fields of the TCP message `state`.
    State,
    /// Angles, rates and torques of the joints.
    Joints,
    /// Orientations of the sphere and of its reference.
    Transforms,
    /// Torque on the sphere and at the joints.
    Torque,
    /// Torque that another scene would have made, in a recording made by a replay with `--scene`.
    OtherTorque,
    /// Events of the TCP API.
    Event,
    /// Scenes that the rig has rendered.
    Scene,
    /// Inputs, outputs, compiled scenes and states of the control law, bit for bit.
    Exact,
}

impl Topic {
    /// All topics.
    pub const ALL: [Self; 8] = [
        Self::State,
        Self::Joints,
        Self::Transforms,
        Self::Torque,
        Self::OtherTorque,
        Self::Event,
        Self::Scene,
        Self::Exact,
    ];

    /// The topics that a running server can show to viewers.
    pub const LIVE: [Self; 6] =
        [Self::State, Self::Joints, Self::Transforms, Self::Torque, Self::Event, Self::Scene];

    /// Returns the name of the topic in a recording.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::State => "/hbot/state",
            Self::Joints => "/hbot/joints",
            Self::Transforms => "/tf",
            Self::Torque => "/hbot/torque",
            Self::OtherTorque => "/hbot/torque/other",
            Self::Event => "/hbot/event",
            Self::Scene => "/hbot/scene",
            Self::Exact => "/hbot/exact",
        }
    }

    /// Returns the name of the topic's messages, as in `proto/`.
    #[must_use]
    pub const fn schema(self) -> &'static str {
        match self {
            Self::State => "hbot.State",
            Self::Joints => "foxglove.JointState",
            Self::Transforms => "foxglove.FrameTransforms",
            Self::Torque | Self::OtherTorque => "hbot.Torque",
            Self::Event => "foxglove.Log",
            Self::Scene => "hbot.Scene",
            Self::Exact => "hbot.Exact",
        }
    }
}
