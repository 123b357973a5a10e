//! What requests weigh, and a token bucket that bounds their rate.

use std::time::Duration;

use hbot_api::OpName;
use tokio::time::Instant;

/// Bytes of a request that weigh nothing: ordinary ones have fewer.
const FREE_BYTES: usize = 256;
/// Bytes beyond these that weigh as much as an ordinary request.
const BYTES_A_REQUEST: usize = 16;

/// The time of the hub that a request takes, in ordinary requests: by its op (`None` if it could not be read) and by its bytes, read
/// or skipped.
pub(super) fn weight(op: Option<OpName>, bytes: usize) -> u32 {
    op.map_or(1, |op| op.row().weight) + weight_of(bytes)
}

/// The part of it that bytes make up.
pub(super) fn weight_of(bytes: usize) -> u32 {
    u32::try_from(bytes.saturating_sub(FREE_BYTES) / BYTES_A_REQUEST).unwrap_or(u32::MAX / 2)
}

/// Bounds the rate of requests: a bucket of a tenth of a second's worth.
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

    /// Takes `weight` out. Returns how long it takes until as much has come in if the bucket was overdrawn.
    pub(super) fn take(&mut self, weight: u32, now: Instant) -> Option<Duration> {
        let gained = now.duration_since(self.at).as_secs_f64() * self.per_s;
        self.at = now;
        self.left = (self.left + gained).min(0.1 * self.per_s) - f64::from(weight);
        (self.left < 0.0).then(|| Duration::from_secs_f64(-self.left / self.per_s))
    }
}

/// The share of the service's time that long messages may take, all clients together: after one that took a time, none is read
/// for nine times as long.
const REST_PER_WORK: u32 = 9;

/// When the next long message may be read.
#[derive(Default)]
pub(super) struct LongMessages {
    next: Option<Instant>,
}

impl LongMessages {
    /// The time before which none may be read, if it is not now.
    pub(super) fn not_before(&self, now: Instant) -> Option<Instant> {
        self.next.filter(|next| *next > now)
    }

    /// Notes that one has been read from `start` to `end`.
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
        // The one that found it empty, and twenty times 153.
        assert!(((now - start).as_secs_f64() - 3.061).abs() < 1e-6, "{:?}", now - start);
        // However long it rests, no more than that is saved up.
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
