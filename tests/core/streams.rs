//! A client's torque stream: it adds to the scene, ends if it is not renewed, and ends with its
//! client.

use crate::prelude::*;
use crate::shaping::{ROUNDING, WOUND};

#[test]
fn a_stream_adds_to_the_scene_and_ends_in_20_ms_once_it_is_not_renewed() {
    let mut bench = Bench::active(rig(), spring_scene(1, 2.0, WOUND));
    let scene = bench.step().state.torque;
    let extra = Vec3::new(0.0, 0.1, -0.05);
    bench.command(stream(extra, 30));
    for k in 1..30 {
        let torque = bench.step().state.torque;
        assert!((torque - scene - extra).length() < ROUNDING, "tick {k} of 30: {torque}");
    }
    for k in 1..=25 {
        let state = bench.step().state;
        let left = (1.0 - f64::from(k) / 20.0).max(0.0);
        assert!((state.torque - scene - extra * left).length() < 1e-12, "{k} ticks after: {}", state.torque);
        assert_eq!(state.mode, Mode::Active, "no fault");
    }
}

#[test]
fn a_stream_that_is_renewed_in_its_ramp_is_back_at_once() {
    let mut bench = Bench::active(rig(), CompiledScene::empty());
    let torque = Vec3::X * 0.1;
    bench.command(stream(torque, 1));
    assert!((bench.run(10).state.torque - torque * 0.5).length() < 1e-12);
    assert!((bench.command(stream(torque, 5)).state.torque - torque).length() < ROUNDING);
}

#[test]
fn a_client_that_is_gone_takes_its_stream_with_it_unless_the_rig_keeps_it() {
    for (policy, after_10_ms) in
        [(OnClientLost::Ramp, 0.5), (OnClientLost::Keep, 1.0), (OnClientLost::Fault, 0.0)]
    {
        let mut bench = Bench::active(rig(), CompiledScene::empty());
        bench.command(stream(Vec3::X * 0.1, 500));
        bench.command(Command::ClientLost(policy));
        let state = bench.run(10).state;
        assert!((state.torque.x - 0.1 * after_10_ms).abs() < 1e-12, "{policy:?}: {}", state.torque);
        assert_eq!(state.mode == Mode::Fault, policy == OnClientLost::Fault);
    }
}

#[test]
fn stream_messages_name_themselves_and_are_refused_when_too_old() {
    let mut bench = Bench::active(rig(), CompiledScene::empty());
    let aged = |bench: &Bench, age: u64| Command::Stream {
        torque: Vec3::X * 0.1,
        valid_ticks: 5,
        stamp: Stamp { seq: Some(age), tick: Some(bench.tick - age) },
    };
    let client = bench.command(aged(&bench, 50)).state.client.unwrap();
    assert_eq!((client.seq, client.age_ticks), (Some(50), 50));
    assert_eq!(bench.step().state.client.unwrap().age_ticks, 51);
    let late = bench.command(aged(&bench, 51));
    assert_eq!(late.reply(), Reply::Refused(Refusal::TooOld { age_ticks: 51 }));
    assert_eq!(late.state.client.unwrap().seq, Some(50), "nothing changed");
    // The age of a stream that names no tick counts from its arrival.
    bench.command(stream(Vec3::ZERO, 5));
    assert_eq!(bench.run(3).state.client.unwrap().age_ticks, 3);
    // A stream from the future would count as fresh until that tick, so it is refused. One from the
    // present tick has age zero.
    let ahead = |tick| Command::Stream {
        torque: Vec3::ZERO,
        valid_ticks: 1,
        stamp: Stamp { seq: Some(7), tick: Some(tick) },
    };
    let outputs = bench.command(ahead(bench.tick));
    assert_eq!(outputs.reply(), Reply::Done);
    for (tick, ticks) in [(bench.tick + 1, 1), (u64::MAX, u64::MAX - bench.tick - 1)] {
        let outputs = bench.command(ahead(tick));
        let ticks = if tick == u64::MAX { ticks } else { 1 };
        assert_eq!(outputs.reply(), Reply::Refused(Refusal::Ahead { ticks }));
    }
}
