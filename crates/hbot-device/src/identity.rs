//! What the host must know about a motor controller before it commands torque.

use hbot_link::{Description, JointDescription, MAX_FIRMWARE_BYTES, MAX_JOINTS, PROTOCOL_VERSION};

/// The constant properties of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// Encoder counts in one turn of the encoder, before the gear; 1 or more.
    pub counts_per_turn: u32,
    /// Largest torque at the joint, after the gear, N m; 0 or more. A greater commanded torque is
    /// limited to it. It is infinite if only [`Joints::drive`](crate::Joints::drive) limits the
    /// torque.
    pub peak: f32,
}

/// The name of the firmware, and its joints in the order of the rig file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Identity {
    firmware: &'static str,
    joints: [Joint; MAX_JOINTS],
    count: usize,
}

impl Identity {
    /// Creates an identity. `firmware` is the name and version of the firmware, for people to read.
    ///
    /// Returns `None` if `firmware` is longer than [`MAX_FIRMWARE_BYTES`], if there is no joint or
    /// more than [`MAX_JOINTS`], if a joint has 0 counts per turn, or if a peak torque is negative
    /// or NaN. In a constant, an `unwrap` of the result makes this an error of the compiler.
    ///
    /// ```
    /// use hbot_device::{Identity, Joint};
    ///
    /// const STEER: Joint = Joint { counts_per_turn: 16384, peak: 0.93 };
    /// const DRIVE: Joint = Joint { counts_per_turn: 16384, peak: 0.14 };
    /// const IDENTITY: Identity = Identity::new("my rig 1.0", &[STEER, DRIVE]).unwrap();
    /// ```
    #[must_use]
    pub const fn new(firmware: &'static str, joints: &[Joint]) -> Option<Self> {
        let count = joints.len();
        if firmware.len() > MAX_FIRMWARE_BYTES || count == 0 || count > MAX_JOINTS {
            return None;
        }
        let mut all = [Joint { counts_per_turn: 0, peak: 0.0 }; MAX_JOINTS];
        // A `for` loop is not possible in a constant function.
        let mut j = 0;
        while j < count {
            if joints[j].counts_per_turn == 0 || !(joints[j].peak >= 0.0) {
                return None;
            }
            all[j] = joints[j];
            j += 1;
        }
        Some(Self { firmware, joints: all, count })
    }

    /// Returns the joints.
    #[must_use]
    pub fn joints(&self) -> &[Joint] {
        &self.joints[..self.count]
    }

    pub(crate) fn description(&self) -> Description {
        let describe = |joint: &Joint| JointDescription { counts_per_turn: joint.counts_per_turn };
        let mut description = Description { protocol: PROTOCOL_VERSION, ..Description::default() };
        // Both fit: `new` has checked the length of the name and the number of joints.
        let _ = description.firmware.push_str(self.firmware);
        description.joints.extend(self.joints().iter().map(describe));
        description
    }
}
