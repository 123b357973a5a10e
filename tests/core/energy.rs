//! The passivity observer: the energy delivered, computed with the torque that was actually held
//! (physics notes, section 9).

use crate::prelude::*;

/// Moves the sphere along a closed path in `ticks` ticks. Returns the sum of the squared turns of
/// the ticks, rad².
fn cycle(bench: &mut Bench, ticks: u32) -> f64 {
    let angle = |k: u32| core::f64::consts::TAU * f64::from(k) / f64::from(ticks);
    let place = |k: u32| {
        let (s, c) = angle(k).sin_cos();
        rotation::exp(Vec3::new(0.2 * s, 0.15 * (1.0 - c), 0.0))
    };
    let mut squares = 0.0;
    for k in 0..ticks {
        let step = rotation::difference(place(k + 1), place(k));
        squares += step.length_squared();
        bench.turn(step / DT);
    }
    bench.sphere.omega = Vec3::ZERO;
    squares
}

/// Mean delay of the torque, ticks. A reading is a tick old when its torque begins, and the torque
/// is then held for a tick. On average the spring's torque is therefore 1.5 ticks late. If each
/// tick turns by delta, the spring delivers K (1/2 + 1) delta² too much per tick.
const LATE: f64 = 1.5;

#[test]
fn around_a_cycle_a_spring_gives_out_only_what_its_delay_costs() {
    const STIFFNESS: f64 = 2.0;
    let mut leaks = [0.0; 2];
    for (leak, ticks) in leaks.iter_mut().zip([1000, 2000]) {
        let mut bench = Bench::active(rig(), spring_scene(1, STIFFNESS, Vec3::ZERO));
        let before = bench.step().state.energy;
        let squares = cycle(&mut bench, ticks);
        *leak = bench.run(3).state.energy - before;
        // The rest comes from encoder counts, which do not add up: 0.4 mrad of steering, 1e-4 rad
        // of the sphere, at 0.5 N m.
        let want = LATE * STIFFNESS * squares;
        assert!((*leak - want).abs() < 0.05 * want, "{leak} J, expected {want} J");
        assert!(*leak > 0.0, "a leak is never a gain");
    }
    // The leak is of order 1: with twice as many ticks per cycle, half of it is left.
    assert!((leaks[0] / leaks[1] - 2.0).abs() < 0.1, "{leaks:?}");
}

#[test]
fn what_a_spring_stores_is_booked_as_taken_in() {
    const STIFFNESS: f64 = 2.0;
    let mut bench = Bench::active(rig(), spring_scene(1, STIFFNESS, Vec3::ZERO));
    let before = bench.step().state.energy;
    for _ in 0..200 {
        bench.turn(Vec3::Y * 2.0);
    }
    bench.sphere.omega = Vec3::ZERO;
    let booked = before - bench.run(2).state.energy;
    let (angle, step) = (200.0 * 2.0 * DT, 2.0 * DT);
    let want = 0.5 * STIFFNESS * angle * angle - LATE * STIFFNESS * 200.0 * step * step;
    // The tolerance is encoder counts: 1e-4 rad out of 0.4 rad.
    assert!((booked - want).abs() < 1e-3 * want, "{booked} J, expected {want} J");
}

#[test]
fn a_damper_takes_energy_and_never_gives_it_back() {
    const DAMPING: f64 = 0.05;
    let damper = Kind::Damper(Damper::new(Mat3::from_diagonal(Vec3::splat(DAMPING))).unwrap());
    let scene = CompiledScene::new(1, &[effect(0, 1, damper)]).unwrap();
    let mut bench = Bench::active(rig(), scene);
    let before = bench.step().state.energy;
    let squares = cycle(&mut bench, 1000) / DT;
    let taken = before - bench.run(3).state.energy;
    // D w² integrated over time. A tick of delay shifts it by a thousandth of the cycle.
    assert!((taken - DAMPING * squares).abs() < 0.02 * DAMPING * squares, "{taken} J");
}

/// A command that has not arrived yet does not turn the sphere.
#[test]
fn on_a_slow_line_the_torque_that_was_held_is_the_one_that_counts() {
    let mut bench = Bench::active(rig(), spring_scene(1, 2.0, Vec3::ZERO));
    let before = bench.step().state.energy;
    // Commands take four ticks to arrive. Each is answered with a reading of that moment, in time
    // for the next tick.
    let mut commands = std::collections::VecDeque::from([Vec3::ZERO; 4].map(|torque| (bench.sent(), torque)));
    let (mut truth, mut reading) = (0.0, None);
    for k in 0..400 {
        let outputs = bench.step_with(|inputs| inputs.feedback = reading);
        commands.push_back((bench.sent(), outputs.state.torque));
        let (sequence, held) = commands.pop_front().unwrap();
        reading = Some(JointReadings { sequence, ..bench.feedback() });
        let omega = if k < 390 { Vec3::new(3.0 * (0.1 * f64::from(k)).sin(), 1.0, 0.0) } else { Vec3::ZERO };
        truth += held.dot(omega * DT);
        bench.sphere.turn(omega, DT);
    }
    let booked = bench.deaf().state.energy - before;
    // The tolerance is the noise of encoder counts: 1e-4 rad at up to 1 N m.
    assert!((booked - truth).abs() < 1e-4, "{booked} J booked, {truth} J given out");
    assert!(truth.abs() > 0.01, "{truth}");
}

#[test]
fn over_skipped_ticks_the_last_torque_is_the_one_that_was_held() {
    for (command, torque) in [(Command::Estop, 0.0), (Command::Enable, 0.6)] {
        let mut bench = Bench::active(rig(), spring_scene(1, 2.0, Vec3::Y * 0.3));
        // After the estop there is no torque, but there still was 64 ticks earlier.
        bench.command(command);
        for _ in 0..5 {
            let before = bench.step().state;
            assert!((before.torque.y - torque).abs() < 0.05);
            let reading = bench.feedback();
            bench.tick += 5;
            let turn = Vec3::Y * 0.002;
            bench.sphere.turn(turn / (6.0 * DT), 6.0 * DT);
            bench.step_with(|inputs| inputs.feedback = Some(reading));
            let given = bench.step().state.energy - before.energy;
            // Encoder counts: 1e-4 rad.
            assert!((given - torque * 0.002).abs() < 6e-5 + 0.05 * 0.002, "{given} J at {torque} N m");
            assert!(torque != 0.0 || given == 0.0, "{given} J of nothing");
        }
    }
}
