//! Tests the effect of line and service events in every mode. It repeats the table of
//! `tests/core/states.rs`, through the engine.

use hbot_core::design::rig::Zero;

use super::*;
use crate::run_loop::engine::TickTime;

const MODES: [Mode; 6] =
    [Mode::Unreferenced, Mode::Idle, Mode::Enabling, Mode::Active, Mode::Fault, Mode::Estop];

/// Returns a simulated rig in `mode` on one line. For the mode `fault`, a motor controller has
/// reported a fault that is already over.
fn bench_in(mode: Mode) -> (TickBench, Fake) {
    let mut rig = RigConfig::prototype();
    if mode == Mode::Unreferenced {
        let index = |joint: &mut hbot_core::design::rig::Joint| joint.zero = Zero::Index;
        rig.rig = rig.rig.with(|parts| parts.joints.iter_mut().for_each(index)).expect("legal");
    }
    let fake = Fake::new(4);
    let mut bench = bench(&rig, vec![fake.clone()], &Layout::single(0..4));
    bench.ticks(5);
    match mode {
        Mode::Unreferenced | Mode::Idle => {}
        Mode::Enabling => _ = bench.order(Order::Enable),
        Mode::Active => bench.active(),
        Mode::Fault => {
            fake.with(|far| far.flags = ControllerFlags::FAULT);
            bench.ticks(3);
            fake.with(|far| far.flags = ControllerFlags::default());
            bench.ticks(3);
        }
        Mode::Estop => _ = bench.order(Order::Estop),
    }
    assert_eq!(bench.tick().state.mode, mode);
    (bench, fake)
}

fn off(fake: &Fake) -> bool {
    fake.with(|far| {
        far.heard.last().is_some_and(|command| !command.enable && command.torque.iter().all(|t| *t == 0.0))
    })
}

#[test]
fn an_estop_by_signal_ends_in_estop_from_every_mode_whatever_waits_in_the_ring() {
    for from in MODES {
        let (mut bench, fake) = bench_in(from);
        while bench.end.order(Order::Enable).is_ok() {}
        // The ring has no room for the stop, but it is obeyed nevertheless.
        assert!(bench.end.order(Order::Estop).is_err());
        let state = bench.tick().state;
        assert_eq!((state.mode, state.cause), (Mode::Estop, None), "from {from:?}");
        assert!(off(&fake), "from {from:?}");
    }
}

#[test]
fn a_port_that_is_lost_is_a_fault_from_every_mode_and_its_return_changes_nothing() {
    for from in MODES {
        let (mut bench, fake) = bench_in(from);
        fake.with(|far| far.silent = true);
        let lost = bench.ticks(25).state;
        let cause = if from == Mode::Fault { Cause::ControllerFault } else { Cause::LinkLost };
        assert_eq!((lost.mode, lost.cause), (Mode::Fault, Some(cause)), "from {from:?}");
        assert!(off(&fake), "from {from:?}");
        fake.with(|far| (far.silent, far.renewed) = (false, Some(Renewed { rebooted: false })));
        let back = bench.ticks(50);
        assert_eq!((back.state.mode, back.state.cause), (Mode::Fault, Some(cause)), "from {from:?}");
        assert!(off(&fake) && back.counters.reopened == 1, "from {from:?}");
        let to = if from == Mode::Unreferenced { from } else { Mode::Idle };
        assert_eq!(bench.order(Order::Reset).state.mode, to, "from {from:?}");
    }
}

#[test]
fn controllers_that_lost_power_are_a_fault_from_every_mode_and_their_zeros_are_gone() {
    for from in MODES {
        // The loss is reported either by the controllers, or by the thread that reopened the port.
        for told in [false, true] {
            let (mut bench, fake) = bench_in(from);
            if told {
                fake.with(|far| far.renewed = Some(Renewed { rebooted: true }));
            } else {
                fake.with(|far| far.flags = ControllerFlags::UNDESCRIBED);
            }
            let state = bench.ticks(3).state;
            let place = format!("from {from:?}, told {told}");
            assert_eq!((state.mode, state.cause), (Mode::Fault, Some(Cause::ControllerFault)), "{place}");
            assert!(off(&fake), "{place}");
            fake.with(|far| far.flags = ControllerFlags::default());
            bench.ticks(3);
            // The zero `assume` is accepted only once.
            assert_eq!(bench.order(Order::Reset).state.mode, Mode::Unreferenced, "{place}");
            assert_eq!(bench.order(Order::Enable).state.mode, Mode::Unreferenced, "{place}");
        }
    }
}

#[test]
fn a_tick_left_out_or_late_is_a_fault_from_every_mode() {
    for from in MODES {
        for (lateness_ns, skipped) in [(20_000_001, 0), (0, 10)] {
            let (mut bench, fake) = bench_in(from);
            bench.tick += skipped;
            let moment = TickTime { lateness_ns, late: true, skipped, ..on_time(bench.tick) };
            bench.engine.tick(&moment);
            let state = bench.end.try_sample().expect("a sample").state;
            let cause = if from == Mode::Fault { Cause::ControllerFault } else { Cause::Deadline };
            assert_eq!((state.mode, state.cause), (Mode::Fault, Some(cause)), "from {from:?}");
            assert!(off(&fake), "from {from:?}");
        }
    }
}

#[test]
fn a_stop_that_is_confirmed_later_does_not_undo_a_reset() {
    let (mut bench, fake) = bench_in(Mode::Active);
    // The bytes of an `estop` set the flag. Its answer comes through the ring some ticks later.
    bench.end.emergency_stop().stop();
    assert_eq!(bench.tick().state.mode, Mode::Estop);
    assert!(off(&fake));
    let confirmed = bench.end.order(hbot_core::inputs::Command::Confirm).expect("a place");
    let sample = bench.order(Order::Reset);
    assert_eq!(sample.state.mode, Mode::Idle, "one estop stops once");
    assert_eq!(sample.answers[0].map(|answer| answer.ticket), Some(confirmed), "and is answered");
}

#[test]
fn an_order_that_is_an_emergency_stop_is_answered_in_the_tick_that_stops_or_after_it() {
    let (mut bench, _) = bench_in(Mode::Active);
    let ticket = bench.end.order(Order::Estop).expect("a place");
    let sample = bench.tick();
    assert_eq!(
        (sample.state.mode, sample.answers[0].map(|answer| answer.ticket)),
        (Mode::Estop, Some(ticket))
    );
}
