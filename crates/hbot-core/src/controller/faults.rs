//! The fault conditions of a tick.

use super::Controller;
use crate::inputs::{Inputs, JointReadings};
use crate::motion::joints::Joints;
use crate::real::Real;
use crate::safety::heat::Heat;
use crate::safety::mode::{Cause, Mode};

/// Lateness of a tick above which the rig goes to fault, ns.
pub const LATE_FAULT_NS: u64 = 20_000_000;
/// Number of skipped ticks in a row at which the rig goes to fault.
pub const SKIPPED_FAULT: u64 = 10;
/// Number of damaged frames at which the link counts as corrupt. Every [`CORRUPT_FORGIVEN_TICKS`]
/// ticks the count falls by one. So 1 % of damaged frames is tolerated and 50 % is not.
pub const CORRUPT_FAULT: Real = 10.0;
/// Number of ticks after which the count of damaged frames falls by one. See [`CORRUPT_FAULT`].
pub const CORRUPT_FORGIVEN_TICKS: Real = 20.0;
/// Number of missing readings above which the link counts as lost, in multiples of `timeout_ticks`.
/// Each reading that arrives lowers the count by [`MISSED_FORGIVEN`]. So a link can lose four
/// readings of five for any time, but 19 of 20 only for a short time.
pub const MISSED_FAULT: u64 = 5;
/// Number by which each reading that arrives lowers the count of missing readings. See
/// [`MISSED_FAULT`].
pub const MISSED_FORGIVEN: u64 = 4;
/// Longest time for which motors may be on after a command to switch off, or off after a command to
/// switch on, s. A power stage takes some milliseconds to switch.
pub const DISOBEDIENCE_S: Real = 0.02;

/// Counts the readings that are missing on a link, to detect that the link is lost.
#[derive(Debug, Clone, Copy, Default)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Silence {
    /// Ticks since the last reading.
    ticks: u64,
    /// Number of missing readings, less [`MISSED_FORGIVEN`] for each reading that has arrived;
    /// never below 0.
    owed: u64,
}

impl Silence {
    /// Advances the count of missing readings by `elapsed` ticks. `news` is true if a reading
    /// arrived at the end of this time. `timeout_ticks` is the rig's limit on ticks without a
    /// reading.
    #[inline]
    pub(super) fn advance(&mut self, elapsed: u64, news: bool, timeout_ticks: u32) {
        // Skipped ticks asked for no reading, so only one is missing.
        let missed = u64::from(!news && elapsed > 0);
        self.ticks = if news { 0 } else { self.ticks.saturating_add(elapsed) };
        let forgiven = if news { MISSED_FORGIVEN } else { 0 };
        self.owed = (self.owed.saturating_add(missed))
            .saturating_sub(forgiven)
            .min(2 * MISSED_FAULT * u64::from(timeout_ticks));
    }

    /// Returns true if enough readings are missing for the link to count as lost.
    #[inline]
    fn too_long(&self, timeout_ticks: u32) -> bool {
        self.ticks > u64::from(timeout_ticks) || self.owed > MISSED_FAULT * u64::from(timeout_ticks)
    }
}

impl Controller {
    /// Counts two kinds of events that become a fault only if they are frequent: damaged frames,
    /// and ticks in which motors were on or off contrary to the command. `elapsed` is the number of
    /// ticks since the last call.
    #[inline]
    pub(super) fn count_complaints(&mut self, inputs: &Inputs, elapsed: u64) {
        if self.corrupt > 0.0 || inputs.corrupt_frames > 0 {
            self.corrupt = (self.corrupt - elapsed as Real / CORRUPT_FORGIVEN_TICKS).max(0.0)
                + Real::from(inputs.corrupt_frames);
            self.corrupt = self.corrupt.min(2.0 * CORRUPT_FAULT);
        }
        match &inputs.feedback {
            Some(feedback) if feedback.complaints.disobeyed => {
                self.disobeyed_ticks = self.disobeyed_ticks.saturating_add(elapsed);
            }
            Some(_) => self.disobeyed_ticks = 0,
            None => {}
        }
    }

    /// Returns the most serious fault condition of this tick, if any. `feedback` is `Ok(true)` if
    /// there was a new reading, and an error if the reading was invalid.
    #[inline(always)]
    pub(super) fn fault_condition(
        &self,
        inputs: &Inputs,
        elapsed: u64,
        feedback: Result<bool, Cause>,
    ) -> Option<Cause> {
        let complaints = inputs.feedback.as_ref().map(|feedback| feedback.complaints).unwrap_or_default();
        let powered = self.powered();
        if inputs.rebooted || complaints.fault || self.disobeyed() {
            return Some(Cause::ControllerFault);
        }
        if complaints.overcurrent || (powered && self.burst.is_some_and(|burst| burst.over())) {
            return Some(Cause::Overtorque);
        }
        if complaints.overtemperature || self.heat.as_ref().is_some_and(Heat::too_hot) {
            return Some(Cause::Thermal);
        }
        if complaints.not_finite {
            return Some(Cause::NonFinite);
        }
        if feedback.is_err() {
            return feedback.err();
        }
        if self.link_is_lost(inputs.tick, elapsed, feedback == Ok(true)) || (complaints.watchdog && powered) {
            return Some(Cause::LinkLost);
        }
        if self.corrupt >= CORRUPT_FAULT {
            return Some(Cause::LinkCorrupt);
        }
        if inputs.lateness_ns > LATE_FAULT_NS || elapsed > SKIPPED_FAULT {
            return Some(Cause::Deadline);
        }
        if self.client_lost {
            return Some(Cause::ClientLost);
        }
        self.motion_fault(powered).or_else(|| self.unanswered(feedback))
    }

    /// Returns the fault of the last tick if a reading showed it and none has come in this tick. So
    /// a reset that arrives in a tick without a reading does not find the cause gone.
    #[inline(always)]
    fn unanswered(&self, feedback: Result<bool, Cause>) -> Option<Cause> {
        self.machine.present.filter(|cause| {
            use Cause::{ControllerFault, ImplausibleFeedback, NonFinite, Overtorque, Thermal};
            feedback != Ok(true)
                && matches!(cause, ControllerFault | Overtorque | Thermal | NonFinite | ImplausibleFeedback)
        })
    }

    /// Returns the fault that the measured motion shows, such as excessive speed or slip. With
    /// motors off, it returns only the fault that the rig is already in, because a person may then
    /// spin the sphere by hand.
    #[inline(always)]
    fn motion_fault(&self, powered: bool) -> Option<Cause> {
        let judged = |cause| powered || self.machine.cause == Some(cause);
        let by_counts = self.joints.watch.verdict();
        let limits = &self.rig.limits;
        if judged(Cause::Overspeed)
            && (by_counts == Some(Cause::Overspeed)
                || self.joints.omega.length_squared() > limits.speed * limits.speed)
        {
            return Some(Cause::Overspeed);
        }
        if judged(Cause::Slip) && (by_counts == Some(Cause::Slip) || self.joints.slip > limits.slip) {
            return Some(Cause::Slip);
        }
        by_counts.filter(|cause| judged(*cause))
    }

    /// Returns true if readings are missing for too long, or if the newest reading answers a
    /// command that is too old.
    ///
    /// The newest possible reading answers the last command, which was sent `elapsed` ticks ago.
    /// The age of the newest reading is the number of ticks from the command that it answers to the
    /// last command. If it arrived in this tick, one tick is added for its time on the line. So a
    /// reading is at most `timeout_ticks` old.
    #[inline]
    fn link_is_lost(&self, tick: u64, elapsed: u64, news: bool) -> bool {
        let timeout_ticks = self.rig.timing.timeout_ticks;
        let sent = tick.wrapping_sub(elapsed) as u32;
        let behind = self.joints.answered().map_or(0, |answered| sent.wrapping_sub(answered) as i32);
        // No tick is so far ahead that the difference wraps. A negative difference counts as zero.
        let behind = i64::from(behind.max(0)) + i64::from(news);
        behind > i64::from(timeout_ticks) || self.silence.too_long(timeout_ticks)
    }

    /// Returns true if motors have been on or off contrary to the command for longer than
    /// [`DISOBEDIENCE_S`].
    #[inline]
    fn disobeyed(&self) -> bool {
        self.disobeyed_ticks > 0 && self.disobeyed_ticks as Real * self.rig.timing.period_s() > DISOBEDIENCE_S
    }

    /// Ends homing, and with it the mode `unreferenced`, if the zeros of all steer joints are
    /// known.
    #[inline]
    pub(super) fn home(&mut self, feedback: Option<&JointReadings>) {
        if self.homed || self.machine.mode != Mode::Unreferenced {
            return;
        }
        if feedback.is_some_and(|feedback| Joints::zeros_known(&self.rig, feedback, !self.rebooted)) {
            self.homed = true;
            self.machine.end_homing();
        }
    }
}
