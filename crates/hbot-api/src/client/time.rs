//! The time of day that clients show with an event.

use std::time::{SystemTime, UNIX_EPOCH};

/// Returns the time of day in UTC, so that an event can be found in other logs. The date is left
/// out.
///
/// ```
/// use std::time::{Duration, UNIX_EPOCH};
///
/// let event = UNIX_EPOCH + Duration::from_millis(951_868_799_999);
/// assert_eq!(hbot_api::time_of_day(event), "23:59:59 UTC");
/// ```
#[must_use]
pub fn time_of_day(time: SystemTime) -> String {
    let s = time.duration_since(UNIX_EPOCH).unwrap_or_default().as_secs() % 86_400;
    format!("{:02}:{:02}:{:02} UTC", s / 3600, s / 60 % 60, s % 60)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn a_time_of_day_has_hours_minutes_and_seconds_of_two_digits() {
        let at = |seconds| time_of_day(UNIX_EPOCH + Duration::from_secs(seconds));
        // 2026-12-31 is day 20,818.
        let day = 20_818 * 86_400;
        assert_eq!(at(day), "00:00:00 UTC");
        assert_eq!(at(day + 3 * 3600 + 4 * 60 + 5), "03:04:05 UTC");
        assert_eq!(at(day + 86_399), "23:59:59 UTC");
        assert_eq!(at(day + 86_400), "00:00:00 UTC");
    }
}
