//! The weight of requests, and the token bucket that limits their rate.

use std::time::Duration;

use hbot_api::OpName;
use tokio::time::Instant;

/// Number of bytes of a request that do not add to its weight. Ordinary requests are shorter than
/// this.
const FREE_BYTES: usize = 256;
/// Number of bytes beyond [`FREE_BYTES`] that weigh as much as one ordinary request.
const BYTES_A_REQUEST: usize = 16;

/// Returns the weight of a request: the time that the service needs for it, in units of an ordinary
/// request. It depends on the op (`None` if it could not be read) and on the number of bytes,
/// whether they were parsed or skipped.
pub(super) fn weight(op: Option<OpName>, bytes: usize) -> u32 {
    op.map_or(1, |op| op.row().weight) + weight_of(bytes)
}

/// Returns the part of a request's weight that comes from its number of bytes.
pub(super) fn weight_of(bytes: usize) -> u32 {
    u32::try_from(bytes.saturating_sub(FREE_BYTES) / BYTES_A_REQUEST).unwrap_or(u32::MAX / 2)
}

/// A token bucket that limits the rate of requests. Its capacity is the number of tokens that it
/// gains in a tenth of a second.
pub(super) struct Bucket {
    per_s: f64,
    left: f64,
    at: Instant,
}

impl Bucket {
    pub(super) fn new(per_s: u32, now: Instant) -> Self {
        let per_s = f64::from(per_s.max(1));
        Self { per_s, left: 0.1 * per_s, at: now }
    }

    /// Charges `weight` tokens. If the bucket is overdrawn, returns the time until the debt is
    /// repaid.
    pub(super) fn take(&mut self, weight: u32, now: Instant) -> Option<Duration> {
        let gained = now.duration_since(self.at).as_secs_f64() * self.per_s;
        self.at = now;
        self.left = (self.left + gained).min(0.1 * self.per_s) - f64::from(weight);
        (self.left < 0.0).then(|| Duration::from_secs_f64(-self.left / self.per_s))
    }
}

/// Pause after each long message (a request of more than 2 KiB), as a multiple of the time that
/// reading it took. With this value, long messages of all clients together take at most a tenth of
/// the service's time.
const REST_PER_WORK: u32 = 9;

/// Limits the share of the service's time that long messages (requests of more than 2 KiB) take.
#[derive(Default)]
pub(super) struct LongMessages {
    next: Option<Instant>,
}

impl LongMessages {
    /// Returns the earliest time at which the next long message may be read, or `None` if it may be
    /// read now.
    pub(super) fn not_before(&self, now: Instant) -> Option<Instant> {
        self.next.filter(|next| *next > now)
    }

    /// Records that a long message was read from `start` to `end`, which delays the next one.
    pub(super) fn took(&mut self, start: Instant, end: Instant) {
        self.next = Some(end + REST_PER_WORK * end.duration_since(start));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tenth_of_a_second_s_worth_comes_at_once_and_the_rest_in_time() {
        let start = Instant::now();
        let (mut bucket, mut now) = (Bucket::new(1000, start), start);
        let at_once =
            |bucket: &mut Bucket, now| (0..1000).take_while(|_| bucket.take(1, now).is_none()).count();
        assert_eq!(at_once(&mut bucket, now), 100);
        for weight in [1, 1, 50, 1, 100].repeat(20) {
            now += bucket.take(weight, now).expect("the bucket is empty");
        }
        // One request overdraws the empty bucket, and twenty rounds of weight 153 follow: 3061
        // requests at 1000 per second.
        assert!(((now - start).as_secs_f64() - 3.061).abs() < 1e-6, "{:?}", now - start);
        // A long rest does not save up more than the capacity of the bucket.
        now += Duration::from_secs(60);
        assert_eq!(at_once(&mut bucket, now), 100);
    }

    #[test]
    fn bytes_weigh_too() {
        assert_eq!(weight(Some(OpName::Ping), 256), 1);
        assert_eq!(weight(Some(OpName::Ping), 2048), 113);
        assert_eq!(weight(None, 65_536), 4081, "one that is refused unread as well");
        assert_eq!(weight(Some(OpName::Info), 20), 500);
    }

    #[test]
    fn long_messages_take_a_tenth_of_the_time() {
        let start = Instant::now();
        let ms = Duration::from_millis;
        let mut long = LongMessages::default();
        assert_eq!(long.not_before(start), None);
        long.took(start, start + ms(3));
        assert_eq!(long.not_before(start + ms(29)), Some(start + ms(30)));
        assert_eq!(long.not_before(start + ms(30)), None);
    }
}
