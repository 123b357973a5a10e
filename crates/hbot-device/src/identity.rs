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
    /// Temperature from which on the joint gets no torque, in degrees Celsius. Its reading then has
    /// the flag `OVERTEMPERATURE`. It is infinite if [`Joints::drive`](crate::Joints::drive) or the
    /// motor driver limits the heat. If you do not measure the temperature, write
    /// `f32::INFINITY`; 0 means always too hot.
    pub max_temperature: f32,
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
    /// more than [`MAX_JOINTS`], if a joint has 0 counts per turn, if a peak torque is negative or
    /// NaN, or if a largest temperature is NaN. In a constant, an `unwrap` of the result makes this
    /// an error of the compiler.
    ///
    /// ```
    /// use hbot_device::{Identity, Joint};
    ///
    /// const STEER: Joint = Joint { counts_per_turn: 16384, peak: 0.93, max_temperature: 80.0 };
    /// const IDENTITY: Identity = Identity::new("my rig 1.0", &[STEER]).unwrap();
    /// ```
    #[must_use]
    pub const fn new(firmware: &'static str, joints: &[Joint]) -> Option<Self> {
        let count = joints.len();
        if firmware.len() > MAX_FIRMWARE_BYTES || count == 0 || count > MAX_JOINTS {
            return None;
        }
        let mut all = [Joint { counts_per_turn: 0, peak: 0.0, max_temperature: 0.0 }; MAX_JOINTS];
        // A `for` loop is not possible in a constant function.
        let mut j = 0;
        while j < count {
            let joint = joints[j];
            if joint.counts_per_turn == 0 || !(joint.peak >= 0.0) || joint.max_temperature.is_nan() {
                return None;
            }
            all[j] = joint;
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

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: Joint = Joint { counts_per_turn: 1, peak: 0.0, max_temperature: 80.0 };

    #[test]
    fn the_limits_of_the_protocol_are_legal() {
        assert_eq!(
            Identity::new("0123456789abcdef0123456789abcdef", &[GOOD]).map(|it| it.joints().len()),
            Some(1)
        );
        assert_eq!(Identity::new("", &[GOOD; 16]).map(|it| it.joints().len()), Some(16));
        let unlimited = Joint { peak: f32::INFINITY, max_temperature: f32::INFINITY, ..GOOD };
        assert!(Identity::new("", &[unlimited]).is_some());
    }

    #[test]
    fn what_the_protocol_cannot_say_is_refused() {
        assert_eq!(Identity::new("0123456789abcdef0123456789abcdef!", &[GOOD]), None);
        assert_eq!(Identity::new("", &[]), None);
        assert_eq!(Identity::new("", &[GOOD; 17]), None);
        for bad in [
            Joint { counts_per_turn: 0, ..GOOD },
            Joint { peak: -0.1, ..GOOD },
            Joint { peak: f32::NAN, ..GOOD },
            Joint { max_temperature: f32::NAN, ..GOOD },
        ] {
            assert_eq!(Identity::new("", &[GOOD, bad]), None, "{bad:?}");
        }
    }
}
