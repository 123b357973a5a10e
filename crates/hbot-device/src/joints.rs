//! What a builder writes: reading the joints, and driving them.

use hbot_link::JointReading;

/// The joints of a rig, as far as the motor controller's hardware is concerned. Write the first two
/// functions for your hardware. The third is for hardware that can detect its own faults.
///
/// The functions must return soon: the answer to the host waits for them. They are called in the
/// context in which [`Device::poll`](crate::Device::poll) and
/// [`Device::receive`](crate::Device::receive) are called.
pub trait Joints {
    /// Samples all joints, as close to one instant as possible. `readings` has one element for each
    /// joint, in the order of the [`Identity`](crate::Identity); all its fields are 0 before the
    /// call. Leave a field at 0 if you do not measure it.
    ///
    /// The device adds the flags `OVERCURRENT` and `OVERTEMPERATURE` if the limits of
    /// [`Joint`](crate::Joint) are reached.
    fn read(&mut self, readings: &mut [JointReading]);

    /// Applies `torque`, with one element for each joint, N m after the gear. A positive torque
    /// turns a joint towards greater counts. Each element is finite and within the joint's peak.
    /// Hold the torques until the next call.
    ///
    /// If `on` is false, all torques are 0 and the joints must be free of torque. Switch the power
    /// stage off if it can be switched.
    ///
    /// The device limits torques to [`Joint::peak`](crate::Joint::peak), and gives none to a joint
    /// that has reached [`Joint::max_temperature`](crate::Joint::max_temperature). If a motor can
    /// draw too much current or become too hot all the same, limit both here.
    fn drive(&mut self, torque: &[f32], on: bool);

    /// Returns the present condition of the hardware. It is called often, at least once for each
    /// [`poll`](crate::Device::poll). The default is [`Condition::Ready`].
    fn condition(&mut self) -> Condition {
        Condition::Ready
    }
}

/// Whether the hardware can apply torques.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Condition {
    /// The motors give the torques of [`Joints::drive`] while `on` is true.
    Ready,
    /// The power stage gives no torque, although nothing is broken. It is still starting, or its
    /// supply is switched off. The device does not report `ENABLED`. A host faults after 20 ms of
    /// this while it commands torque.
    NotReady,
    /// A driver, the supply, an encoder or the temperature has a fault. The device switches the
    /// joints off and reports `FAULT` until another condition is returned and the host has sent a
    /// command with `enable` false.
    Fault,
}
