//! Tests of the bridge between loop and service: orders with their tickets, emergency stops,
//! scenes, and wake-ups. The tests of hbot-server show which samples wake the service.

use std::os::fd::OwnedFd;

use hbot_config::RigConfig;
use hbot_core::CompiledScene;
use hbot_core::inputs::Command;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{OFlags, fcntl_getfl};

use crate::rig::layout::Layout;
use crate::run_loop::bridge::{Busy, bridge};
use crate::run_loop::sample::Sample;
use crate::tests::scripted::ScriptedBus;
use crate::tests::tick_bench::{TickBench, default_scene};

#[test]
fn orders_arrive_in_their_order_under_their_tickets_and_256_wait_at_most() {
    let (mut inner, mut outer) = bridge().expect("a bridge");
    assert!(inner.take_order().is_none());
    for k in 0..256_u64 {
        let command = if k % 2 == 0 { Command::Enable } else { Command::Disable };
        assert_eq!(outer.order(command), Ok(1 + k));
    }
    assert_eq!(outer.order(Command::Reset), Err(Busy));
    for k in 0..256_u64 {
        let order = inner.take_order().expect("it waits");
        let command = if k % 2 == 0 { Command::Enable } else { Command::Disable };
        assert_eq!((order.ticket, order.command), (1 + k, command));
    }
    assert!(inner.take_order().is_none());
    // An order that found no place has used up no ticket.
    assert_eq!(outer.order(Command::Reset), Ok(257));
    assert_eq!(inner.take_order().map(|order| order.ticket), Some(257));
}

#[test]
fn an_emergency_stop_passes_by_the_orders_and_is_taken_once() {
    let (mut inner, mut outer) = bridge().expect("a bridge");
    assert!(!inner.take_estop());
    assert_eq!(outer.order(Command::Estop), Ok(1));
    assert!(inner.take_estop() && !inner.take_estop(), "once");
    // The order in the ring is for the answer alone.
    assert_eq!(inner.take_order().map(|order| (order.ticket, order.command)), Some((1, Command::Confirm)));
    while outer.order(Command::Enable).is_ok() {}
    assert_eq!(outer.order(Command::Estop), Err(Busy), "there is no room for an answer");
    assert!(inner.take_estop(), "it stops all the same");
    // From another thread, and by a signal, which the service learns of.
    let stop = outer.emergency_stop();
    stop.stop();
    assert!(inner.take_estop() && !outer.take_signalled());
    stop.stop_by_signal();
    assert!(inner.take_estop() && outer.take_signalled());
    assert!(!inner.take_estop() && !outer.take_signalled(), "once");
}

#[test]
fn the_loop_takes_the_newest_of_at_most_four_scenes_and_gives_the_others_back() {
    let scene = |revision| Box::new(CompiledScene::new(revision, &[]).expect("an empty scene"));
    let (mut inner, mut outer) = bridge().expect("a bridge");
    let mut running = scene(0);
    inner.adopt_scene(&mut running);
    assert_eq!(running.revision(), 0, "none waits");
    // In many rounds, so that scenes that were not given back would fill the way back.
    for round in 0..20 {
        for k in 1..=4 {
            assert!(outer.can_install());
            assert_eq!(outer.install(scene(4 * round + k)), Ok(()));
        }
        assert!(!outer.can_install());
        assert_eq!(outer.install(scene(1000)), Err(Busy));
        inner.adopt_scene(&mut running);
        assert_eq!(running.revision(), 4 * round + 4);
        inner.adopt_scene(&mut running);
        assert_eq!(running.revision(), 4 * round + 4, "none is newer");
    }
}

#[test]
fn the_service_learns_of_the_end_when_it_has_taken_all_samples() {
    let (inner, mut outer) = bridge().expect("a bridge");
    assert!(!outer.is_over() && !outer.has_samples() && outer.try_sample().is_none());
    assert_eq!(outer.tick(), 0);
    drop(inner);
    assert!(outer.is_over());
}

/// The loop frees no memory: scenes that it has taken and no longer renders are freed by the
/// service.
#[test]
fn scenes_are_freed_by_the_service_and_never_by_the_loop() {
    let scene = |revision| Box::new(CompiledScene::new(revision, &[]).expect("an empty scene"));
    let (mut inner, mut outer) = bridge().expect("a bridge");
    let mut running = scene(0);
    for round in 0..3 {
        for k in 1..=4 {
            assert_eq!(outer.install(scene(4 * round + k)), Ok(()));
        }
        let taken = allocation_counter::measure(|| inner.adopt_scene(&mut running));
        assert_eq!((taken.count_total, taken.count_current), (0, 0), "round {round}");
        let freed = allocation_counter::measure(|| assert!(outer.can_install()));
        assert_eq!((freed.count_total, freed.count_current), (0, -4), "round {round}");
    }
}

fn sample() -> Sample {
    let (rig, layout) = (RigConfig::prototype(), Layout::single(0..4));
    TickBench::new(&rig, vec![Box::new(ScriptedBus::default())], &layout, default_scene()).tick()
}

fn readable(descriptor: &OwnedFd) -> bool {
    let mut asked = [PollFd::new(descriptor, PollFlags::IN)];
    let now = Timespec { tv_sec: 0, tv_nsec: 0 };
    poll(&mut asked, Some(&now)).expect("it can be polled") == 1
}

#[test]
fn a_wake_up_lasts_until_it_is_cleared_and_clearing_never_waits() {
    let (mut inner, mut outer) = bridge().expect("a bridge");
    let wakeup = outer.wakeup();
    let descriptor = wakeup.descriptor().expect("a descriptor");
    let flags = fcntl_getfl(&descriptor).expect("its flags");
    assert!(flags.contains(OFlags::NONBLOCK), "clearing without a wake-up would take for ever");
    wakeup.clear();
    let sample = sample();
    assert!(inner.publish(sample) && !readable(&descriptor), "it is not set");
    wakeup.arm(true);
    assert!(!readable(&descriptor), "samples that already wait do not ring");
    for _ in 0..2 {
        assert!(inner.publish(sample) && readable(&descriptor));
    }
    wakeup.clear();
    assert!(!readable(&descriptor));
    assert!(inner.publish(sample) && !readable(&descriptor), "it has not been set again");
    drop(inner);
    assert!(readable(&descriptor), "the end of the loop");
    let left = std::iter::from_fn(|| outer.try_sample()).count();
    assert!(left == 4 && outer.is_over(), "{left} samples");
}
