//! Knocks: their wave, their energy, and that there is one for each impact and none without.

use super::{Felt, askew, axis, detents, end_stop, snaps};
use crate::prelude::*;
use hbot_core::render::around::Swing;
use hbot_core::render::effects::{Knock, Knocking};

/// The largest energy of a knock, J, and the largest speed that it grows with, rad/s
/// (docs/effects.md).
const MOST_ENERGY: f64 = 0.01;
const FASTEST: f64 = 5.0;

const WOOD: Knock = Knock { amplitude: 0.02, frequency: 100.0, decay: 0.0125 };

/// Returns the dial of all effects in these tests at the angle `psi`, rad.
fn turned(psi: f64) -> Quat {
    askew().reference().0 * rotation::exp(axis() * psi)
}

fn along() -> Vec3 {
    askew().reference().0 * axis()
}

/// Returns walls that stop the twist at 0.5 rad on either side, without a torque of their own.
fn walls() -> EndStop {
    EndStop { cone: None, twist: Some([-0.5, 0.5]), stiffness: 0.0, ..end_stop(0.0) }
}

fn knocking(knock: Knock) -> Felt {
    Felt::new(Kind::KnockingEndStop(Knocking { law: walls(), knock }))
}

fn felt(felt: &mut Felt, way: impl IntoIterator<Item = (f64, f64)>) -> Vec<f64> {
    way.into_iter().map(|(psi, rate)| felt.moving(turned(psi), along() * rate).dot(along())).collect()
}

/// Returns how many knocks begin in `torque`, N m: times at which it becomes other than zero.
fn starts(torque: &[f64]) -> usize {
    torque.windows(2).filter(|pair| pair[0] == 0.0 && pair[1] != 0.0).count()
}

fn at_rate(from: f64, rate: f64, ticks: u32) -> impl Iterator<Item = (f64, f64)> {
    (0..ticks).map(move |k| (from + rate * DT * f64::from(k), rate))
}

#[test]
fn the_wave_is_that_of_the_formula_up_to_the_fastest_impact() {
    for (rate, speed) in [(2.0, 2.0), (-2.0, 2.0), (0.1, 0.1), (8.0, FASTEST), (-80.0, FASTEST)] {
        let side = f64::signum(rate);
        let torque = felt(&mut knocking(WOOD), at_rate(0.499 * side, rate, 150));
        let first = torque.iter().position(|t| *t != 0.0).expect("a knock") - 1;
        for (k, torque) in torque[first..].iter().enumerate() {
            let t = DT * k as f64;
            let wave = (-t / WOOD.decay).exp() * (core::f64::consts::TAU * WOOD.frequency * t).sin();
            // The knock lasts eight decay times. Its end can move by a tick by rounding.
            let want = if t < 8.0 * WOOD.decay - 1e-9 { -side * WOOD.amplitude * speed * wave } else { 0.0 };
            // The tolerance is the rounding of the time and of the sine.
            assert!((torque - want).abs() < 1e-12, "{rate} rad/s, {t} s: {torque} {want}");
        }
    }
}

#[test]
fn a_knock_ends_with_the_wall_s_torque_and_is_added_to_it() {
    let law = EndStop { stiffness: 3.0, damping: 0.1, ..walls() };
    let way = || at_rate(0.45, 2.0, 100);
    let plain = felt(&mut Felt::new(Kind::EndStop(law)), way());
    let alone = felt(&mut knocking(WOOD), way());
    let both = felt(&mut Felt::new(Kind::KnockingEndStop(Knocking { law, knock: WOOD })), way());
    assert!(starts(&alone) == 1);
    for k in 0..both.len() {
        // The sum is rounded once.
        assert!((both[k] - plain[k] - alone[k]).abs() < 1e-15, "tick {k}");
    }
}

/// Whatever the sphere does at up to the fastest speed, a knock gives no more than its limit, also
/// the strongest and longest one.
#[test]
fn the_energy_of_a_knock_is_bounded() {
    let mut most: f64 = 0.0;
    for frequency in [5.0, 18.0, 100.0, 300.0] {
        for decay in [0.001, 0.0125, 0.1] {
            for speed in [0.5, 2.0, FASTEST] {
                let knock = Knock { amplitude: 0.2, frequency, decay };
                let mut felt = knocking(knock);
                let (mut psi, mut given, mut torque, mut sounded) = (0.49, 0.0, 0.0, false);
                for _ in 0..2000 {
                    // After the impact the sphere always turns with the torque, so that it gives as
                    // much energy as possible.
                    let rate = if torque == 0.0 { speed } else { speed * f64::signum(torque) };
                    given += torque * rate * DT;
                    psi += rate * DT;
                    torque = felt.moving(turned(psi), along() * rate).dot(along());
                    most = most.max(given);
                    // The tolerance is rounding.
                    assert!(given < MOST_ENERGY + 1e-12, "{knock:?}, {speed} rad/s: {given} J");
                    sounded |= torque != 0.0;
                    if sounded && torque == 0.0 {
                        break;
                    }
                }
            }
        }
    }
    // The limit is reached, so the test tests it.
    assert!(most > 0.9 * MOST_ENERGY, "{most}");
}

#[test]
fn without_an_impact_there_is_no_knock() {
    let cases: Vec<(&str, Vec<(f64, f64)>)> = vec![
        ("within the range", (0..1000).map(|k| (0.49 * (0.02 * f64::from(k)).sin(), 9.8)).collect()),
        ("begins in a wall", at_rate(0.6, 1.0, 100).collect()),
        ("touches a wall at rest", [(0.4, 0.0)].into_iter().chain((0..50).map(|_| (0.55, 0.0))).collect()),
        ("on the way out", [(0.4, 0.0)].into_iter().chain(at_rate(0.55, -1.0, 50)).collect()),
    ];
    for (name, way) in cases {
        let torque = felt(&mut knocking(WOOD), way);
        assert!(torque.iter().all(|t| *t == 0.0), "{name}");
    }
}

#[test]
fn there_is_one_knock_for_each_impact() {
    // A sphere that trembles by 1.5 mrad at the edge has not left the wall.
    let tremble = |k: u32| (0.5 + 1.5e-3 * (0.7 * f64::from(k)).sin(), (0.7 * f64::from(k)).cos());
    assert_eq!(starts(&felt(&mut knocking(WOOD), (0..2000).map(tremble))), 1);
    // One that leaves it by 5 mrad and comes back meets it again, but not before the knock ends.
    let bounces = |period: f64| {
        let phase = core::f64::consts::TAU / period;
        let at = move |k: u32| (0.5 + 5e-3 * (phase * f64::from(k)).sin(), (phase * f64::from(k)).cos());
        starts(&felt(&mut knocking(WOOD), (0..2000).map(at)))
    };
    assert_eq!(bounces(200.0), 10);
    let often = bounces(20.0);
    assert!((10..=20).contains(&often), "{often}: not more than one in 100 ms");
    // From wall to wall: each of the two is met in turn.
    let swing = |k: u32| {
        let phase = core::f64::consts::TAU / 500.0 * f64::from(k);
        (0.6 * phase.sin(), 7.5 * phase.cos())
    };
    assert_eq!(starts(&felt(&mut knocking(WOOD), (0..2000).map(swing))), 8);
}

#[test]
fn notches_and_orientations_knock_when_the_sphere_falls_in() {
    // A frequency at which no tick falls on a zero of the sine.
    let knock = Knock { decay: 0.004, frequency: 90.0, ..WOOD };
    let dial = Detents { strength: 0.0, ..detents(12, 0.0) };
    let half_a_turn = || at_rate(-0.05, core::f64::consts::PI, 1000);
    let mut round = Felt::new(Kind::KnockingDetents(Knocking { law: dial, knock }));
    assert_eq!(starts(&felt(&mut round, half_a_turn())), 6);
    // Positions, with walls at both ends.
    let law = Detents { count: 0, strength: 0.0, end_stiffness: 1e-9, ..dial };
    let law = Kind::KnockingDetents(Knocking { law, knock });
    let mut own = Felt::with_numbers(law, &[-0.4, 0.0, 0.6]);
    let torque = felt(&mut own, at_rate(-0.25, 2.0, 500));
    // The walls' own torque is below 1e-9 N m.
    let torque: Vec<f64> = torque.into_iter().map(|t| if t.abs() < 1e-9 { 0.0 } else { t }).collect();
    assert_eq!(starts(&torque), 3, "two notches and the wall");
    let law = Snaps { strength: 0.0, width: 0.3, ..snaps(SnapSet::Cube, &[]) };
    let law = Snaps {
        target: Target::new(turned(0.0), hbot_core::render::effects::Anchor::Absolute).unwrap(),
        ..law
    };
    let mut cube = Felt::new(Kind::KnockingSnaps(Knocking { law, knock }));
    let to = |k: u32| turned(0.0) * rotation::exp(Vec3::X * (0.003 * f64::from(k)));
    let rate = turned(0.0) * Vec3::X * 3.0;
    let torque: Vec<f64> = (0..1000).map(|k| cube.moving(to(k), rate).dot(turned(0.0) * Vec3::X)).collect();
    // It begins in one, and 3 rad has one more well at a quarter turn and begins to enter none at
    // a half.
    assert_eq!(starts(&torque), 2);
}

/// A sphere at rest is judged as without knocks: places, stiffness and damping have the same bits.
#[test]
fn a_knock_changes_nothing_that_a_scene_is_judged_by() {
    let swing = Swing { axes: Mat3::IDENTITY, turn: [1e-3; 3], speed: 0.1 };
    let pairs = [
        (Kind::EndStop(end_stop(0.05)), Kind::KnockingEndStop(Knocking { law: end_stop(0.05), knock: WOOD })),
        (
            Kind::Detents(detents(12, 0.02)),
            Kind::KnockingDetents(Knocking { law: detents(12, 0.02), knock: WOOD }),
        ),
        (
            Kind::Snaps(snaps(SnapSet::Cube, &[])),
            Kind::KnockingSnaps(Knocking { law: snaps(SnapSet::Cube, &[]), knock: WOOD }),
        ),
    ];
    for (plain, knocking) in pairs {
        let seen = [plain, knocking].map(|kind| {
            let scene = CompiledScene::new(1, &[effect(0, 1, kind)]).unwrap();
            let mut seen = Vec::new();
            scene.places(Quat::IDENTITY, |place| {
                let linear = scene.around(0, &place, Quat::IDENTITY, &swing);
                seen.push((place.spot, place.q, place.deeper, linear.stiffness, linear.damping));
            });
            (seen, scene.turned(axis(), Quat::IDENTITY, Quat::IDENTITY, 1.0, 360))
        });
        assert!(!seen[0].0.is_empty() && seen[0] == seen[1], "{plain:?}");
    }
}

/// The observer of the energy counts a knock as energy that was given out, tick by tick.
#[test]
fn the_observer_sees_the_energy_of_a_knock() {
    let law = EndStop { target: Target::N, axis: axis(), ..walls() };
    let strong = Knock { amplitude: 0.2, frequency: 10.0, decay: 0.05 };
    let scene = |kind| CompiledScene::new(1, &[effect(0, 1, kind)]).unwrap();
    let run = |kind| {
        let mut bench = Bench::active(rig(), scene(kind));
        let start = bench.step().state.energy;
        // Against the knock, which first pushes back.
        (0..400)
            .map(|k| bench.turn(axis() * if k < 251 { 2.0 } else { -2.0 }).state.energy - start)
            .fold(0.0, f64::max)
    };
    assert_eq!(run(Kind::EndStop(law)), 0.0);
    let given = run(Kind::KnockingEndStop(Knocking { law, knock: strong }));
    // The observer sees the torque that was held, which is two ticks later than the law's.
    assert!(given > 0.3 * MOST_ENERGY && given < 1.3 * MOST_ENERGY, "{given} J");
}

/// An effect that is given a knock while it runs, or loses it, keeps its count of turns.
#[test]
fn a_knock_that_is_set_keeps_the_turns() {
    let law = EndStop { target: Target::N, axis: axis(), twist: Some([-20.0, 20.0]), ..walls() };
    let scene = |revision, kind| CompiledScene::new(revision, &[effect(0, 1, kind)]).unwrap();
    let stiff = EndStop { stiffness: 1.0, ..law };
    let mut bench = Bench::active(rig(), scene(1, Kind::EndStop(stiff)));
    // Two and a half turns. Without its memory the wall would be at another angle.
    for _ in 0..6000 {
        bench.turn(axis() * 2.5);
    }
    let narrow = EndStop { twist: Some([14.0, 16.0]), ..stiff };
    let knocking = |law| Kind::KnockingEndStop(Knocking { law, knock: WOOD });
    for (revision, kind) in [(2, knocking(narrow)), (3, Kind::EndStop(narrow)), (4, knocking(narrow))] {
        bench.scene = scene(revision, kind);
        for _ in 0..200 {
            let torque = bench.step().state.torque;
            assert!(torque.length() < 1e-9, "revision {revision}: {torque}");
        }
    }
}
