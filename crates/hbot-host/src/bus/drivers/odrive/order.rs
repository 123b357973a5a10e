//! Whether the motors of a line are commanded on, and how long an axis may take to obey.

use super::proof::EXPIRED_MS;
use crate::bus::Expected;

/// Longest time that an axis may take to switch its motor off after the command, ms.
const OFF_MS: u32 = 20;
/// Longest time that an axis may take to reach closed loop after the command, ms.
pub(super) const ON_MS: u32 = 300;
/// Time for which an expired watchdog is not reported as a complaint, ms. It begins with the first
/// command on a line and with each clearing of errors.
const EXCUSED_MS: u32 = 100;
/// Time between two attempts to clear the errors of an axis or to set its position, ms. An attempt
/// is repeated because its command can be lost.
const AGAIN_MS: u32 = 100;
/// Time between two commands to enter closed loop, ms. The driver repeats the command until the
/// axis obeys.
const ON_AGAIN_MS: u32 = 10;
/// Time between two questions, ms. Each question asks one axis for one value. A question without an
/// answer after this time counts as lost.
const ASK_MS: u32 = 50;
/// Time between two questions, ms, while the round trip to an axis is in doubt.
const ASK_SOON_MS: u32 = 5;

/// The times of this file in ticks of the loop.
#[derive(Debug, Clone, Copy)]
pub(super) struct Times {
    pub(super) off: u32,
    pub(super) on: u32,
    pub(super) excused: u32,
    pub(super) again: u32,
    pub(super) on_again: u32,
    /// Time after the last message within which a watchdog must have expired.
    pub(super) expired: u32,
    pub(super) ask: u32,
    pub(super) ask_soon: u32,
}

impl Times {
    pub(super) fn new(expected: &Expected) -> Self {
        Self {
            off: expected.ticks(OFF_MS),
            on: expected.ticks(ON_MS),
            excused: expected.ticks(EXCUSED_MS),
            again: expected.ticks(AGAIN_MS),
            on_again: expected.ticks(ON_AGAIN_MS),
            expired: expected.ticks(EXPIRED_MS as u32),
            ask: expected.ticks(ASK_MS),
            ask_soon: expected.ticks(ASK_SOON_MS),
        }
    }
}

/// Whether the motors are commanded on or off, and since which tick.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Order {
    /// True if the motors are commanded on.
    pub(super) on: bool,
    /// The tick at which the motors were commanded on or off.
    pub(super) since: u32,
}

impl Order {
    /// Returns the number of ticks from the moment when the motors were commanded on or off to
    /// `tick`.
    pub(super) fn age(self, tick: u32) -> u32 {
        tick.wrapping_sub(self.since)
    }
}
