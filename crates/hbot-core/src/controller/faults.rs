//! The fault conditions of a tick.

use super::Controller;
use crate::heat::Heat;
use crate::inputs::{Complaints, Inputs, JointFeedback};
use crate::joints::Joints;
use crate::mode::{Cause, Mode};
use crate::real::Real;

/// A tick later than this is a fault, ns.
pub const LATE_FAULT_NS: u64 = 20_000_000;
/// This many skipped ticks in a row are a fault.
pub const SKIPPED_FAULT: u64 = 10;
/// Damaged frames that a link may owe before it is a fault; one is forgiven every
/// [`CORRUPT_FORGIVEN_TICKS`] ticks, so that 1 % of noise rides through and 50 % does not.
pub const CORRUPT_FAULT: Real = 10.0;
/// See [`CORRUPT_FAULT`].
pub const CORRUPT_FORGIVEN_TICKS: Real = 20.0;
/// Missing readings that a link may owe before it is a fault, in multiples of `timeout_ticks`; each
/// reading forgives [`MISSED_FORGIVEN`] ticks without one. So a link may lose four readings of five
/// for ever, and 19 of 20 for a short time only.
pub const MISSED_FAULT: u64 = 5;
/// See [`MISSED_FAULT`].
pub const MISSED_FORGIVEN: u64 = 4;
/// The longest time for which motors may be on though they were switched off, or off though they were
/// switched on, s: a power stage takes some milliseconds to wake.
pub const DISOBEDIENCE_S: Real = 0.02;

/// How much of the link's readings is missing.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Silence {
    /// Ticks since the last reading.
    ticks: u64,
    /// Ticks without a reading that were not forgiven.
    owed: u64,
}

impl Silence {
    /// Counts `elapsed` ticks, at the end of which there was a reading (`news`) or not.
    #[inline]
    pub(super) fn advance(&mut self, elapsed: u64, news: bool, timeout_ticks: u32) {
        // Ticks that were skipped asked for no reading.
        let missed = u64::from(!news && elapsed > 0);
        self.ticks = if news { 0 } else { self.ticks.saturating_add(elapsed) };
        let forgiven = if news { MISSED_FORGIVEN } else { 0 };
        self.owed = (self.owed.saturating_add(missed))
            .saturating_sub(forgiven)
            .min(2 * MISSED_FAULT * u64::from(timeout_ticks));
    }

    /// Whether that is a lost link.
    #[inline]
    fn too_long(&self, timeout_ticks: u32) -> bool {
        self.ticks > u64::from(timeout_ticks) || self.owed > MISSED_FAULT * u64::from(timeout_ticks)
    }
}

impl Controller {
    /// Counts what becomes a fault by its number over the last `elapsed` ticks: damaged frames, and ticks in which
    /// motors were on or off against the command.
    #[inline]
    pub(super) fn count_complaints(&mut self, inputs: &Inputs, elapsed: u64) {
        self.corrupt = (self.corrupt - elapsed as Real / CORRUPT_FORGIVEN_TICKS).max(0.0)
            + Real::from(inputs.corrupt_frames);
        self.corrupt = self.corrupt.min(2.0 * CORRUPT_FAULT);
        match inputs.feedback.map(|feedback| feedback.complaints) {
            Some(Complaints { disobeyed: true, .. }) => {
                self.disobeyed_ticks = self.disobeyed_ticks.saturating_add(elapsed);
            }
            Some(_) => self.disobeyed_ticks = 0,
            None => {}
        }
    }

    /// The fault condition of this tick, the gravest first. `feedback`: whether there was news, or what
    /// is wrong with it.
    #[inline]
    pub(super) fn fault_condition(
        &self,
        inputs: &Inputs,
        elapsed: u64,
        feedback: Result<bool, Cause>,
    ) -> Option<Cause> {
        let complaints = inputs.feedback.map(|f| f.complaints).unwrap_or_default();
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
        self.motion_fault(powered)
    }

    /// What the rates or the counts say of the motion. Without power only if it is the fault to be
    /// reset: a person may spin a dead sphere.
    #[inline]
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

    /// Whether readings are missing for too long, or the newest one answers too old a command.
    ///
    /// The newest reading that there can be answers the last command that was sent, `elapsed` ticks
    /// ago. What counts is how many ticks of commands lie between, and one for the line if the
    /// reading has arrived in this very tick: it is then `timeout_ticks` old at most.
    #[inline]
    fn link_is_lost(&self, tick: u64, elapsed: u64, news: bool) -> bool {
        let timeout_ticks = self.rig.timing.timeout_ticks;
        let sent = tick.wrapping_sub(elapsed) as u32;
        let behind = self.joints.answered().map_or(0, |answered| sent.wrapping_sub(answered) as i32);
        // No tick is far enough ahead to wrap, and one of the past is behind nothing.
        let behind = i64::from(behind.max(0)) + i64::from(news);
        behind > i64::from(timeout_ticks) || self.silence.too_long(timeout_ticks)
    }

    /// Whether motors have been on or off against the command for too long.
    #[inline]
    fn disobeyed(&self) -> bool {
        self.disobeyed_ticks > 0 && self.disobeyed_ticks as Real * self.rig.timing.period_s() > DISOBEDIENCE_S
    }

    /// Ends homing, and with it the mode `unreferenced`, if all steering zeros are known.
    #[inline]
    pub(super) fn home(&mut self, feedback: Option<&JointFeedback>) {
        if self.homed || self.machine.mode != Mode::Unreferenced {
            return;
        }
        if feedback.is_some_and(|feedback| Joints::zeros_known(&self.rig, feedback, !self.rebooted)) {
            self.homed = true;
            self.machine.end_homing();
        }
    }
}
