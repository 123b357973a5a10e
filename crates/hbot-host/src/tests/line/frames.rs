//! Tests of disturbed frames: cut in pieces, damaged, late, duplicated, out of order. Also tests
//! several lines as one rig.

use super::*;
use crate::rig::layout::JointPlace;

/// Returns the prototype rig in the mode `active`, on one simulated line. The test disturbs this
/// line through the returned [`Fake`].
fn one_line() -> (TickBench, Fake) {
    let fake = Fake::new(4);
    let mut bench = bench(&RigConfig::prototype(), vec![fake.clone()], &Layout::single(0..4));
    bench.active();
    (bench, fake)
}

#[test]
fn short_frames_and_damaged_ones_are_counted_and_ride_through() {
    let (mut bench, fake) = one_line();
    for damage in [
        (|frame: &mut Vec<u8>| frame[7] ^= 0x10) as fn(&mut Vec<u8>),
        // Bytes are lost: in the middle, then before the delimiter, then all except the first byte
        // and the delimiter.
        |frame| drop(frame.drain(4..9)),
        |frame| drop(frame.drain(frame.len() - 4..frame.len() - 1)),
        |frame| drop(frame.drain(1..frame.len() - 1)),
        // A device that is not a motor controller.
        |frame| *frame = b"login: \0".to_vec(),
    ] {
        let before = bench.ticks(100).counters.corrupt_frames;
        fake.with(|far| far.answers.iter_mut().for_each(damage));
        let hit = bench.tick();
        assert_eq!((hit.counters.corrupt_frames, hit.state.fresh), (before + 1, false));
        let after = bench.tick();
        assert!(after.state.fresh && after.state.mode == Mode::Active);
    }
}

#[test]
fn half_of_all_frames_damaged_is_a_fault_of_its_own_name() {
    let (mut bench, fake) = one_line();
    let mut ticks = 0;
    let state = loop {
        if ticks % 2 == 0 {
            fake.with(|far| far.answers.iter_mut().for_each(|frame| frame[5] ^= 1));
        }
        let state = bench.tick().state;
        ticks += 1;
        if state.mode == Mode::Fault {
            break state;
        }
    };
    assert_eq!(state.cause, Some(Cause::LinkCorrupt));
    // Each damaged frame counts 1, and every 20 ticks forgive one. Reaching 10 takes 22 ticks.
    assert!(ticks <= 23, "{ticks}");
    assert!(!fake.with(|far| far.heard.last().expect("commands").enable), "zero torque in the same tick");
}

#[test]
fn answers_to_commands_never_sent_and_from_other_controllers_are_counted() {
    let (mut bench, fake) = one_line();
    let before = bench.tick().counters.foreign_frames;
    let tick = bench.tick as u32;
    fake.with(|far| {
        far.answers.push(answer(tick + 1000, ControllerFlags::ENABLED, 4, None));
        far.answers.push(answer(tick, ControllerFlags::ENABLED, 4, None));
        far.answers.push(answer(tick - 1, ControllerFlags::ENABLED, 3, None));
    });
    let hit = bench.tick();
    assert_eq!(hit.counters.foreign_frames, before + 3);
    // Their readings were ignored. Otherwise the next answer would count as older than one to a
    // future tick.
    assert!(bench.tick().state.fresh);
}

#[test]
fn a_line_that_was_gone_is_a_fault_even_where_its_controllers_do_not_complain() {
    for rebooted in [false, true] {
        let (mut bench, fake) = one_line();
        assert!(bench.tick().state.fresh);
        fake.with(|far| far.renewed = Some(Renewed { rebooted }));
        let state = bench.tick().state;
        let cause = if rebooted { Cause::ControllerFault } else { Cause::LinkLost };
        assert_eq!((state.mode, state.cause), (Mode::Fault, Some(cause)));
        assert!(!fake.with(|far| far.heard.last().expect("a command").enable));
        bench.order(Order::Reset);
        let back = if rebooted { Mode::Unreferenced } else { Mode::Idle };
        assert_eq!(bench.tick().state.mode, back);
    }
}

/// Returns the prototype rig in the mode `active`, with wheel A on one simulated line and wheel B
/// on another. The joints of wheel B are in the opposite order on their line.
fn two_lines() -> (TickBench, [Fake; 2]) {
    let fakes = [Fake::new(2), Fake::new(2)];
    let place = |bus, at| JointPlace { bus, at, id: at as u8 };
    let places = vec![place(0, 0), place(0, 1), place(1, 1), place(1, 0)];
    let layout = Layout { places, ..Layout::single([]) };
    let mut bench = bench(&RigConfig::prototype(), fakes.to_vec(), &layout);
    bench.active();
    (bench, fakes)
}

#[test]
fn several_lines_are_one_rig() {
    let (mut bench, fakes) = two_lines();
    let torque = hbot_core::Vec3::new(0.05, 0.02, 0.01);
    bench.order(Order::Stream { torque, valid_ticks: 100, stamp: Default::default() });
    let state = bench.ticks(5).state;
    let heard = |port: usize| fakes[port].with(|far| far.heard.last().expect("a command").clone());
    let (a, b) = (heard(0), heard(1));
    assert!(a.enable && b.enable && a.sequence == b.sequence);
    let sent = [a.torque[0], a.torque[1], b.torque[1], b.torque[0]];
    assert_eq!(sent, std::array::from_fn(|j| state.joint_torque[j] as f32));
    assert!(sent.iter().all(|t| *t != 0.0), "{sent:?}");
    // Counts 0 and 1 of each line, in the order of the rig. Drive joints have a gear of 17.
    let count = std::f64::consts::TAU / 16384.0;
    let angles: [f64; 4] = std::array::from_fn(|j| state.angle[j]);
    for (angle, expected) in angles.into_iter().zip([0.0, count / 17.0, count, 0.0]) {
        assert!((angle - expected).abs() < 1e-12, "{angles:?}");
    }
}

#[test]
fn a_line_that_falls_silent_stops_all_of_them() {
    let (mut bench, fakes) = two_lines();
    fakes[1].with(|far| far.silent = true);
    let timeout = RigConfig::prototype().link.timeout_ticks;
    // One answer was already on its way.
    assert_eq!(bench.ticks(timeout + 1).state.mode, Mode::Active);
    assert_eq!(bench.tick().state.cause, Some(Cause::LinkLost));
    for fake in &fakes {
        assert!(!fake.with(|far| far.heard.last().expect("a command").enable));
    }
}

#[test]
fn other_controllers_on_a_line_that_stays_are_a_fault_for_as_long_as_they_are_there() {
    let rig = RigConfig::prototype();
    let description = |protocol: u16, joints: usize, turn: u32| {
        let mut description = Description { protocol, ..Description::default() };
        for joint in &rig.rig.joints[..joints] {
            let counts_per_turn = joint.counts_per_turn + turn;
            description.joints.push(JointDescription { counts_per_turn }).expect("a place");
        }
        let mut frame = [0; MAX_FEEDBACK_FRAME];
        let n = encode(&FromController::Description(description), &mut frame).expect("it fits");
        frame[..n].to_vec()
    };
    // Another firmware, fewer joints, or other encoders, exchanged while the port stays open.
    for other in [description(PROTOCOL_VERSION + 1, 4, 0), description(1, 3, 0), description(1, 4, 4)] {
        let (mut bench, fake) = one_line();
        fake.with(|far| far.answers.push(other));
        let state = bench.tick().state;
        assert_eq!((state.mode, state.cause), (Mode::Fault, Some(Cause::ControllerFault)));
        assert!(!fake.with(|far| far.heard.last().expect("a command").enable));
        bench.ticks(300);
        assert_eq!(bench.order(Order::Reset).state.mode, Mode::Fault, "they are there still");
        assert!(fake.with(|far| far.asked) >= 2, "they are asked again and again");
        fake.with(|far| far.answers.push(description(1, 4, 0)));
        bench.tick();
        // Their zeros are unknown, even though they match the rig file again.
        assert_eq!(bench.order(Order::Reset).state.mode, Mode::Unreferenced);
    }
    let (mut bench, fake) = one_line();
    fake.with(|far| far.answers.push(description(1, 4, 0)));
    assert_eq!(bench.tick().state.mode, Mode::Active, "the same as ever");
}

#[test]
fn a_supply_that_was_off_and_on_again_gives_no_torque_until_somebody_enables_it() {
    let (mut bench, fake) = one_line();
    fake.with(|far| far.unsupplied = true);
    // 20 ms, plus one tick for each direction on the line.
    let state = bench.ticks(23).state;
    assert_eq!((state.mode, state.cause), (Mode::Fault, Some(Cause::ControllerFault)));
    fake.with(|far| far.unsupplied = false);
    let state = bench.ticks(100).state;
    assert_eq!((state.mode, state.torque.length()), (Mode::Fault, 0.0));
    assert!(fake.with(|far| far.heard.last().is_some_and(|command| !command.enable)));
    assert_eq!(bench.order(Order::Reset).state.mode, Mode::Idle);
    assert_eq!(bench.order(Order::Enable).state.mode, Mode::Enabling);
    assert_eq!(bench.ticks(600).state.mode, Mode::Active);
}

#[test]
fn temperatures_and_currents_that_cannot_be_are_faults() {
    for (warmth, cause) in [
        ([f32::NAN, 0.0], Cause::NonFinite),
        ([f32::INFINITY, 0.0], Cause::Thermal),
        ([500.0, 0.0], Cause::Thermal),
        ([25.0, f32::NAN], Cause::NonFinite),
        ([25.0, 1e30], Cause::Overtorque),
        ([25.0, f32::NEG_INFINITY], Cause::Overtorque),
    ] {
        let (mut bench, fake) = one_line();
        fake.with(|far| far.warmth = Some(warmth));
        assert_eq!(bench.ticks(3).state.cause, Some(cause), "{warmth:?}");
        fake.with(|far| far.warmth = Some([100.0, -30.0]));
        bench.ticks(3);
        assert_eq!(bench.order(Order::Reset).state.mode, Mode::Idle, "{warmth:?}");
    }
}

#[test]
fn the_age_of_a_reading_is_right_or_absent() {
    let mut rig = RigConfig::prototype();
    rig.rig = rig.rig.with(|parts| parts.timing.timeout_ticks = 1000).expect("legal");
    let fake = Fake::new(4);
    let mut bench = bench(&rig, vec![fake.clone()], &Layout::single(0..4));
    bench.ticks(5);
    for late in [1, 63, 64, 65, 500, 999] {
        // No newer answer arrives for a while, so that the answer to an older command is the newest
        // one.
        fake.with(|far| far.silent = true);
        let asked = std::time::Instant::now();
        bench.ticks(late);
        let sequence = bench.tick as u32 - late;
        // The command was sent before the next one came.
        let after = fake.with(|far| {
            far.answers.clear();
            far.answers.push(answer(sequence, ControllerFlags::empty(), 4, None));
            let next = far.heard.iter().position(|command| command.sequence == sequence + 1);
            next.map(|at| far.heard_at[at].elapsed().as_nanos() as u64)
        });
        let sample = bench.tick();
        let age = sample.timing.age_ns.expect("an age");
        let most = u64::try_from(asked.elapsed().as_nanos()).expect("not that long");
        assert!(sample.state.fresh && age <= most, "{late} ticks: {age} of {most} ns");
        assert!(after.is_none_or(|after| age >= after), "{late} ticks: {age} ns, {after:?} after the next");
        assert_eq!(after.is_some(), late > 1);
        fake.with(|far| far.silent = false);
        bench.ticks(5);
    }
    // No command with this number was sent: the age must be absent rather than wrong.
    bench.tick += 5000;
    fake.with(|far| far.answers.clear());
    let sequence = bench.tick as u32 - 900;
    fake.with(|far| far.answers.push(answer(sequence, ControllerFlags::empty(), 4, None)));
    assert_eq!(bench.tick().timing.age_ns, None);
}

#[test]
fn a_rig_that_was_stopped_before_it_was_ready_does_not_enable_itself() {
    for (orders, mode) in [
        (&[][..], Mode::Active),
        (&[Order::Reset], Mode::Active),
        (&[Order::Disable], Mode::Idle),
        (&[Order::Estop, Order::Reset], Mode::Idle),
    ] {
        let mut rig = RigConfig::prototype();
        let index =
            |joint: &mut hbot_core::design::rig::Joint| joint.zero = hbot_core::design::rig::Zero::Index;
        rig.rig = rig.rig.with(|parts| parts.joints.iter_mut().for_each(index)).expect("legal");
        let fake = Fake::new(4);
        let mut bench = bench(&rig, vec![fake.clone()], &Layout::single(0..4));
        bench.engine = bench.engine.enabling(true);
        assert_eq!(bench.ticks(5).state.mode, Mode::Unreferenced);
        for order in orders {
            bench.order(*order);
        }
        fake.with(|far| far.index_seen = true);
        assert_eq!(bench.ticks(600).state.mode, mode, "{orders:?}");
    }
}
