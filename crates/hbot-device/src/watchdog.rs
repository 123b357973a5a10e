//! The watchdog, and the clock by which it expires.

/// Switches the torque off if no valid command follows in time.
///
/// It counts the remaining time down. So the clock can wrap at any time, and only the time between
/// two calls must be shorter than the clock's range of 71 minutes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Watchdog {
    /// Time of the last call, µs.
    last_us: u32,
    /// Remaining time of the last valid command, µs. `None` before the first command.
    left_us: Option<u32>,
    expired: bool,
}

impl Watchdog {
    pub(crate) const fn new(now_us: u32) -> Self {
        Self { last_us: now_us, left_us: None, expired: false }
    }

    /// Lets time pass until `now_us`. A clock that goes back by any time counts as a very long time
    /// that has passed, so the watchdog expires.
    pub(crate) fn pass(&mut self, now_us: u32) {
        let passed = now_us.wrapping_sub(self.last_us);
        self.last_us = now_us;
        if let Some(left) = &mut self.left_us {
            *left = left.saturating_sub(passed);
            self.expired |= *left == 0;
        }
    }

    /// Restarts the watchdog: from now on a valid command counts for `watchdog_ms`. An expired
    /// watchdog stays expired.
    pub(crate) fn restart(&mut self, watchdog_ms: u16) {
        self.left_us = Some(u32::from(watchdog_ms) * 1000);
        self.expired |= watchdog_ms == 0;
    }

    pub(crate) const fn expire(&mut self) {
        self.expired = true;
    }

    pub(crate) fn clear(&mut self) {
        self.expired = false;
    }

    pub(crate) const fn has_expired(&self) -> bool {
        self.expired
    }

    /// Returns the time from `now_us` until the watchdog expires, µs. Returns `None` if it has
    /// expired, or before the first command.
    pub(crate) const fn left_us(&self, now_us: u32) -> Option<u32> {
        match self.left_us {
            Some(left) if !self.expired => Some(left.saturating_sub(now_us.wrapping_sub(self.last_us))),
            _ => None,
        }
    }
}
