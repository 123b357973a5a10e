//! Bounded queues between the window and the network threads. If a reader is too slow, the oldest
//! entries are dropped and the writer never waits.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use hbot_api::StateEvent;

use super::{Intent, News, Wake};

/// Largest number of states that are kept until the window takes them: several seconds at 1 kHz.
const MAX_SAMPLES: usize = 8192;
/// Largest number of reports from the network threads that are kept until the window takes them.
const MAX_NEWS: usize = 256;
/// Largest number of the user's requests that are kept until they are sent to the server.
const MAX_INTENTS: usize = 64;
/// Shortest time between two redraws of the window that new states cause, for about 60 frames per
/// second.
const WAKE_EVERY: Duration = Duration::from_micros(16_000);

/// Everything that has arrived from the server since the window last fetched it.
#[derive(Default)]
pub(crate) struct Delivery {
    pub(crate) samples: VecDeque<Arc<StateEvent>>,
    pub(crate) news: VecDeque<News>,
    /// Number of samples dropped because the window did not fetch them in time.
    pub(crate) lost: u64,
}

/// The queue of states and reports from the network threads to the window.
pub(crate) struct Mailbox {
    waiting: Mutex<(Delivery, Instant)>,
    wake: Wake,
}

impl Mailbox {
    pub(crate) fn new(wake: Wake) -> Self {
        Self { waiting: Mutex::new((Delivery::default(), Instant::now())), wake }
    }

    /// Moves all samples and reports from the queue to `delivery`. The old contents of `delivery`
    /// are dropped, and their memory is reused.
    pub(crate) fn take(&self, delivery: &mut Delivery) {
        delivery.samples.clear();
        delivery.news.clear();
        *delivery = std::mem::replace(&mut lock(&self.waiting).0, std::mem::take(delivery));
    }

    pub(crate) fn post(&self, news: News) {
        {
            let mut waiting = lock(&self.waiting);
            let Delivery { samples, news: queue, lost } = &mut waiting.0;
            // For values that are polled, only the newest is kept.
            let kind = std::mem::discriminant(&news);
            let is_polled = matches!(
                news,
                News::Info(_) | News::Stats(_) | News::Controllers(_) | News::Dropped(_) | News::Recording(_)
            );
            if is_polled {
                queue.retain(|other| std::mem::discriminant(other) != kind);
            }
            // The window takes all samples after all news, so those of an earlier connection would
            // count as those of this one.
            if matches!(news, News::Connected(_)) {
                samples.clear();
                *lost = 0;
            }
            if queue.len() == MAX_NEWS {
                queue.pop_front();
            }
            queue.push_back(news);
        }
        (self.wake)();
    }

    /// Posts the result of work on this computer.
    pub(crate) fn note(&self, result: anyhow::Result<String>) {
        self.post(News::Note(result.map_err(|error| format!("{error:#}"))));
    }

    pub(crate) fn sample(&self, state: StateEvent) {
        let due = {
            let mut waiting = lock(&self.waiting);
            let (delivery, woken) = &mut *waiting;
            if delivery.samples.len() == MAX_SAMPLES {
                delivery.samples.pop_front();
                delivery.lost += 1;
            }
            delivery.samples.push_back(Arc::new(state));
            let due = woken.elapsed() >= WAKE_EVERY;
            if due {
                *woken = Instant::now();
            }
            due
        };
        if due {
            (self.wake)();
        }
    }
}

/// The queue of the user's requests from the window to the thread that sends them to the server.
#[derive(Default)]
pub(crate) struct Outgoing {
    waiting: Mutex<(VecDeque<Intent>, bool)>,
}

impl Outgoing {
    /// Adds a request of the user to the queue. Removes earlier requests that it makes obsolete,
    /// such as an older value of the same parameter. If the queue is full, drops its oldest request
    /// and returns it.
    pub(crate) fn push(&self, intent: Intent) -> Option<Intent> {
        let mut waiting = lock(&self.waiting);
        let queue = &mut waiting.0;
        queue.retain(|other| !replaces(&intent, other));
        let given_up = if queue.len() == MAX_INTENTS { queue.pop_front() } else { None };
        queue.push_back(intent);
        given_up
    }

    /// Removes requests that `intent`, which goes another way, makes obsolete.
    pub(crate) fn make_way_for(&self, intent: &Intent) {
        lock(&self.waiting).0.retain(|other| !replaces(intent, other));
    }

    /// Adds a request of the user at the front of the queue, so that it is sent first. Removes
    /// requests that it makes obsolete.
    pub(crate) fn push_first(&self, intent: Intent) {
        let mut waiting = lock(&self.waiting);
        waiting.0.retain(|other| !replaces(&intent, other));
        waiting.0.push_front(intent);
    }

    pub(crate) fn pop(&self) -> Option<Intent> {
        lock(&self.waiting).0.pop_front()
    }

    /// Records that the window has been closed, so that the network threads end.
    pub(crate) fn close(&self) {
        lock(&self.waiting).1 = true;
    }

    pub(crate) fn is_closed(&self) -> bool {
        lock(&self.waiting).1
    }
}

/// Returns whether an earlier request of the user becomes obsolete when a later one follows.
fn replaces(later: &Intent, earlier: &Intent) -> bool {
    match (later, earlier) {
        (Intent::Set { effect, key, .. }, Intent::Set { effect: e, key: k, .. }) => effect == e && key == k,
        (Intent::Samples(_), Intent::Samples(_))
        | (Intent::Hand(_), Intent::Hand(_))
        | (Intent::Connect(_), Intent::Connect(_)) => true,
        // A new scene makes requests for the old one obsolete.
        (Intent::Load { .. }, Intent::Load { .. } | Intent::Set { .. }) => true,
        // A stop makes earlier requests to enable and to reset obsolete. The server cannot see that
        // they are older: they come over another connection.
        (Intent::Stop, Intent::Reset) => true,
        (Intent::Stop | Intent::Disable, Intent::Enable | Intent::Recover) => true,
        _ => later == earlier,
    }
}

/// Locks a queue, even if a thread has panicked while it held the lock. The queue is always in a
/// valid state.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hbot_api::StatsOk;
    use serde_json::json;

    fn set(key: &str, value: f64) -> Intent {
        Intent::Set { effect: "spring".into(), key: key.into(), value: json!(value) }
    }

    #[test]
    fn only_the_newest_value_of_a_parameter_waits() {
        let out = Outgoing::default();
        for k in 0..1000 {
            assert_eq!(out.push(set("stiffness", f64::from(k))), None);
        }
        out.push(set("damping", 0.1));
        assert_eq!(out.pop(), Some(set("stiffness", 999.0)));
        assert_eq!(out.pop(), Some(set("damping", 0.1)));
        assert_eq!(out.pop(), None);
    }

    #[test]
    fn a_stop_takes_a_waiting_enable_and_a_waiting_reset_away() {
        let out = Outgoing::default();
        out.push(Intent::Enable);
        out.push(Intent::Disable);
        assert_eq!(out.pop(), Some(Intent::Disable));
        assert_eq!(out.pop(), None);
        for order in [Intent::Enable, Intent::Reset, Intent::Recover] {
            out.push(order);
            // As a stop over the stop line does.
            out.make_way_for(&Intent::Stop);
            assert_eq!(out.pop(), None);
        }
    }

    #[test]
    fn states_of_an_earlier_connection_are_not_delivered_after_a_new_one() {
        let mailbox = Mailbox::new(Arc::new(|| {}));
        mailbox.sample(StateEvent { tick: 9000, ..StateEvent::default() });
        mailbox.post(News::Connected(crate::model::tests::hello(9)));
        mailbox.sample(StateEvent { tick: 1, ..StateEvent::default() });
        let mut delivery = Delivery::default();
        mailbox.take(&mut delivery);
        let ticks: Vec<u64> = delivery.samples.iter().map(|sample| sample.tick).collect();
        assert_eq!((ticks, delivery.news.len()), (vec![1], 1));
    }

    #[test]
    fn wishes_are_bounded_and_the_oldest_is_told() {
        let out = Outgoing::default();
        for k in 0..MAX_INTENTS {
            assert_eq!(out.push(set(&k.to_string(), 0.0)), None);
        }
        assert_eq!(out.push(set("one more", 0.0)), Some(set("0", 0.0)));
    }

    #[test]
    fn samples_and_news_are_bounded_where_the_window_sleeps() {
        let mailbox = Mailbox::new(Arc::new(|| {}));
        for tick in 0..2 * MAX_SAMPLES as u64 {
            mailbox.sample(StateEvent { tick, ..StateEvent::default() });
            mailbox.post(News::Note(Ok(tick.to_string())));
            mailbox.post(News::Stats(Box::new(StatsOk { ticks: tick, ..StatsOk::default() })));
        }
        let mut delivery = Delivery::default();
        mailbox.take(&mut delivery);
        assert_eq!(delivery.samples.len(), MAX_SAMPLES);
        assert_eq!(delivery.lost, MAX_SAMPLES as u64);
        assert_eq!(delivery.samples.back().map(|s| s.tick), Some(2 * MAX_SAMPLES as u64 - 1));
        assert_eq!(delivery.news.len(), MAX_NEWS);
        let stats = delivery.news.iter().filter(|n| matches!(n, News::Stats(_))).count();
        assert_eq!(stats, 1, "of what is polled the newest alone");
    }
}
