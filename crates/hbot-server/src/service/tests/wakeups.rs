//! Tests of wake-ups: the loop wakes the service at every sample if a client is subscribed, and
//! otherwise only at notable samples.

use hbot_core::outputs::Reply;

use super::*;
use crate::service::wakeups::Wakeups;
use hbot_host::run_loop::bridge::{LoopEnd, ServiceEnd};
use hbot_host::run_loop::sample::{Answer, Sample};

/// Returns both ends of a bridge and its notification of new samples. One sample has been published
/// and taken.
fn ends() -> (LoopEnd, ServiceEnd, Wakeups) {
    let (mut inner, mut outer) = bridge().unwrap();
    assert!(inner.publish(crate::still::still(0)));
    assert!(outer.try_sample().is_some());
    let wakeups = Wakeups::of(outer.wakeup()).unwrap();
    (inner, outer, wakeups)
}

async fn wakes(wakeups: &Wakeups) -> bool {
    // The event is written before this call, so a short time-out suffices.
    tokio::time::timeout(Duration::from_millis(20), wakeups.wait()).await.is_ok()
}

#[tokio::test]
async fn every_sample_wakes_the_service_where_it_is_asked_for_and_once() {
    let (mut inner, outer, wakeups) = ends();
    wakeups.arm(true);
    inner.publish(crate::still::still(1));
    assert!(wakes(&wakeups).await);
    assert_eq!(outer.tick(), 1);
    inner.publish(crate::still::still(2));
    assert!(!wakes(&wakeups).await, "it has not been armed again");
    wakeups.arm(true);
    drop(inner);
    assert!(wakes(&wakeups).await && !outer.is_over(), "two samples are left");
}

#[tokio::test]
async fn only_what_is_notable_wakes_the_service_otherwise() {
    type Change = (&'static str, fn(&mut Sample));
    let changes: [Change; 4] = [
        ("mode", |sample| sample.state.mode = hbot_core::safety::mode::Mode::Estop),
        ("cause", |sample| sample.state.cause = Some(hbot_core::safety::mode::Cause::Slip)),
        ("scene", |sample| sample.scene = 1),
        ("answer", |sample| sample.answers[7] = Some(Answer { ticket: 1, reply: Reply::Done })),
    ];
    for (what, change) in changes {
        let (mut inner, outer, wakeups) = ends();
        wakeups.arm(false);
        for tick in 1..60 {
            inner.publish(crate::still::still(tick));
        }
        assert!(!wakes(&wakeups).await && outer.has_samples());
        let mut other = crate::still::still(60);
        change(&mut other);
        inner.publish(other);
        assert!(wakes(&wakeups).await, "{what}");
    }
}

#[tokio::test]
async fn many_samples_wake_the_service_before_they_find_no_place() {
    let (mut inner, mut outer, wakeups) = ends();
    for round in 0..100 {
        wakeups.arm(false);
        for tick in 1..=64 {
            assert!(inner.publish(crate::still::still(tick)));
        }
        assert!(wakes(&wakeups).await, "{round}");
        while outer.try_sample().is_some() {}
    }
}

#[test]
fn what_is_asked_for_is_of_now_though_nobody_watches() {
    let bench =
        TestService::start(TestOptions { breath: Duration::from_millis(1), ..TestOptions::default() });
    let mut client = bench.client("c");
    for _ in 0..20 {
        // Some ticks in which nobody asks: looking for a condition would wake the service.
        std::thread::sleep(Duration::from_millis(11));
        // Ticks are counted from 0.
        let tick = client.ping(Value::Null).unwrap().tick;
        let counted = client.stats().unwrap().ticks;
        assert!(counted > tick, "{counted} ticks counted, the last was {tick}");
    }
    assert_eq!(bench.finish().dropped_samples, 0);
}
