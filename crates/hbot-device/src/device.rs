//! The motor controller's side of the conversation.

use hbot_link::{
    Command, ControllerFlags, Decoder, Feedback, FromController, JointFlags, MAX_JOINTS, ToController,
};

use crate::watchdog::Watchdog;
use crate::{Answer, Condition, Identity, Joints};

/// The joint flags that the protocol names. All other bits are sent as 0.
const NAMED_FLAGS: u16 =
    JointFlags::INDEX_SEEN.union(JointFlags::OVERCURRENT).union(JointFlags::OVERTEMPERATURE).bits();

/// A motor controller as the host sees it. It does everything that `docs/link.md` requires of
/// firmware, on top of the builder's [`Joints`].
///
/// It has no clock. All functions that take `now_us` take the time in microseconds of any clock
/// that runs freely and wraps at 32 bits. Time must not go back from one call to the next: this
/// would count as a very long time and expire the watchdog.
#[derive(Clone, Debug)]
pub struct Device {
    identity: Identity,
    decoder: Decoder<ToController>,
    watchdog: Watchdog,
    /// True if the host has had the description since boot.
    described: bool,
    /// True from the beginning of a fault until its cause is gone and the host has sent a command
    /// with `enable` false.
    faulty: bool,
    /// True if the last call of [`Joints::drive`] was with `on`.
    on: bool,
    /// The joints that were too hot at the last reading, as a set of bits. They get no torque.
    hot: u16,
    refused: u32,
}

impl Device {
    /// Creates a device that has just booted, and switches its joints off.
    pub fn boot(identity: Identity, now_us: u32, joints: &mut impl Joints) -> Self {
        let mut device = Self {
            identity,
            decoder: Decoder::new(),
            watchdog: Watchdog::new(now_us),
            described: false,
            faulty: false,
            on: false,
            hot: 0,
            refused: 0,
        };
        device.switch_off(joints);
        device
    }

    /// Checks the watchdog and the [condition](Joints::condition) of the hardware, and switches the
    /// joints off if one of them requires it.
    ///
    /// Call it every millisecond or more often, **also while no bytes arrive**: without this call
    /// the joints keep their torque when the host falls silent.
    pub fn poll(&mut self, now_us: u32, joints: &mut impl Joints) {
        self.watchdog.pass(now_us);
        self.check(joints);
    }

    /// Takes a byte that has arrived from the host. Returns an answer to send if the byte completes
    /// a frame that must be answered. The joints are driven and read during this call.
    ///
    /// `now_us` must be the time of the call: a command is valid for its watchdog time from then
    /// on. So do not let bytes wait in a buffer.
    pub fn receive(&mut self, now_us: u32, byte: u8, joints: &mut impl Joints) -> Option<Answer> {
        match self.decoder.push(byte)? {
            Ok(ToController::Describe) => self.describe(),
            Ok(ToController::Command(command)) => self.command(now_us, &command, joints),
            Err(_) => {
                self.refused = self.refused.wrapping_add(1);
                None
            }
        }
    }

    /// Switches the joints off until the host has sent a command with `enable` false. The host sees
    /// an expired watchdog. Call it before the firmware stops serving the line.
    pub fn stop(&mut self, joints: &mut impl Joints) {
        self.watchdog.expire();
        self.switch_off(joints);
    }

    /// Returns the time from `now_us` until the watchdog expires, µs. Returns `None` if it is not
    /// running. A processor that sleeps must wake up and call [`poll`](Self::poll) by then.
    #[must_use]
    pub const fn watchdog_us(&self, now_us: u32) -> Option<u32> {
        self.watchdog.left_us(now_us)
    }

    /// Returns whether the joints are switched on.
    #[must_use]
    pub const fn is_on(&self) -> bool {
        self.on
    }

    /// Returns the number of frames since boot that were refused because they were damaged. It
    /// wraps at 32 bits. A number that grows means a bad line.
    #[must_use]
    pub const fn refused(&self) -> u32 {
        self.refused
    }

    fn describe(&mut self) -> Option<Answer> {
        self.described = true;
        Answer::new(&FromController::Description(self.identity.description()))
    }

    /// Carries out a command and returns the answer. An invalid command changes nothing and has no
    /// answer.
    fn command(&mut self, now_us: u32, command: &Command, joints: &mut impl Joints) -> Option<Answer> {
        let finite = command.torque.iter().all(|torque| torque.is_finite());
        if !finite || command.torque.len() != self.identity.joints().len() {
            return None;
        }
        self.watchdog.pass(now_us);
        self.check(joints);
        if !command.enable {
            self.watchdog.clear();
            // If the cause is still there, the next check sets it again before the answer.
            self.faulty = false;
        }
        self.watchdog.restart(command.watchdog_ms);
        let limited = self.drive(command, joints);
        let condition = self.check(joints);
        let flags = self.flags(condition);
        let mut feedback = Feedback { sequence: command.sequence, flags, ..Feedback::default() };
        let hot_before = self.hot;
        self.read(&mut feedback, limited, joints);
        if self.on && self.hot & !hot_before != 0 {
            // Without this, a joint found too hot would keep its torque until the next command.
            self.drive(command, joints);
        }
        Answer::new(&FromController::Feedback(feedback))
    }

    /// Drives the joints as commanded, or switches them off if they must not be driven. Returns the
    /// joints whose commanded torque is beyond their peak, as a set of bits.
    fn drive(&mut self, command: &Command, joints: &mut impl Joints) -> u16 {
        self.on = command.enable && self.may_drive();
        let mut torque = [0.0; MAX_JOINTS];
        let mut limited = 0;
        for (j, (asked, joint)) in command.torque.iter().zip(self.identity.joints()).enumerate() {
            let given = asked.max(-joint.peak).min(joint.peak);
            limited |= u16::from(given != *asked) << j;
            if self.on && self.hot >> j & 1 == 0 {
                torque[j] = given;
            }
        }
        joints.drive(&torque[..command.torque.len()], self.on);
        if command.enable { limited } else { 0 }
    }

    /// Asks the hardware for its condition and returns it. Switches the joints off if they are on
    /// and must not be driven any more.
    fn check(&mut self, joints: &mut impl Joints) -> Condition {
        let condition = joints.condition();
        self.faulty |= condition == Condition::Fault;
        if self.on && !self.may_drive() {
            self.switch_off(joints);
        }
        condition
    }

    const fn may_drive(&self) -> bool {
        self.described && !self.watchdog.has_expired() && !self.faulty
    }

    fn switch_off(&mut self, joints: &mut impl Joints) {
        self.on = false;
        joints.drive(&[0.0; MAX_JOINTS][..self.identity.joints().len()], false);
    }

    fn flags(&self, condition: Condition) -> ControllerFlags {
        let mut flags = ControllerFlags::empty();
        flags.set(ControllerFlags::ENABLED, self.on && condition == Condition::Ready);
        flags.set(ControllerFlags::WATCHDOG_EXPIRED, self.watchdog.has_expired());
        flags.set(ControllerFlags::FAULT, self.faulty);
        flags.set(ControllerFlags::UNDESCRIBED, !self.described);
        flags
    }

    /// Samples all joints into `feedback`. `limited` is the result of [`drive`](Self::drive).
    fn read(&mut self, feedback: &mut Feedback, limited: u16, joints: &mut impl Joints) {
        // It fits: there are at most MAX_JOINTS joints.
        let _ = feedback.joints.resize_default(self.identity.joints().len());
        joints.read(&mut feedback.joints);
        self.hot = 0;
        for (j, (reading, joint)) in feedback.joints.iter_mut().zip(self.identity.joints()).enumerate() {
            let mut flags = JointFlags::from_bits(reading.flags.bits() & NAMED_FLAGS);
            if limited >> j & 1 != 0 {
                flags |= JointFlags::OVERCURRENT;
            }
            // A temperature that is not a number counts as too hot.
            if !(reading.temperature < joint.max_temperature) {
                flags |= JointFlags::OVERTEMPERATURE;
                self.hot |= 1 << j;
            }
            reading.flags = flags;
        }
    }
}
