//! Effects that depend on time: vibrations, pulses, tracks.

use super::{Felt, askew, axis, pulse, vibration};
use crate::prelude::*;
use hbot_core::render::effects::{Pulse, Vibration, Wave};

fn along(felt: &mut Felt, q: Quat, ticks: u32) -> Vec<f64> {
    (0..ticks).map(|_| felt.at(q).dot(axis())).collect()
}

#[test]
fn a_vibration_rises_holds_dies_and_comes_again() {
    let torque = along(&mut Felt::new(Kind::Vibration(vibration(Wave::Sine))), Quat::IDENTITY, 700);
    let crest = |from: usize, to: usize| torque[from..to].iter().fold(0.0_f64, |m, t| m.max(t.abs()));
    assert!(crest(0, 10) < 0.05 && crest(20, 100) > 0.0997 && crest(20, 100) <= 0.1);
    assert!(crest(125, 150) < 0.06);
    assert_eq!(crest(152, 300), 0.0);
    // The second vibration begins at 0.3 s, to within a tick, because rounding errors of the time
    // add up.
    assert!((0..150).all(|k| (torque[k] - torque[300 + k]).abs() < 1e-9), "the second is as the first");
    for wave in [Wave::Square, Wave::Saw] {
        let torque = along(&mut Felt::new(Kind::Vibration(vibration(wave))), Quat::IDENTITY, 100);
        let mean = torque[25..100].iter().sum::<f64>() / 75.0;
        // The mean is over three whole periods. A saw of 25 samples misses its centre by half a
        // step.
        assert!(mean.abs() < 0.1 / 20.0, "{wave:?}: {mean}");
    }
}

#[test]
fn a_pulse_clicks_when_told_at_its_period_and_from_notch_to_notch() {
    let quiet = Pulse { period: 0.0, count: 0, ..pulse() };
    let clicks = |torque: &[f64]| torque.windows(2).filter(|w| w[0] == 0.0 && w[1] != 0.0).count();
    let frame = askew().reference().0 * axis();
    let run = |pulse: Pulse, rate: f64| {
        let mut felt = Felt::new(Kind::Pulse(pulse));
        let torque = (0..1001).map(|k| {
            let q = askew().reference().0 * rotation::exp(axis() * (rate * DT * f64::from(k)));
            felt.moving(q, frame * rate).dot(frame)
        });
        torque.collect::<Vec<_>>()
    };
    assert_eq!(clicks(&run(quiet, 3.0)), 0);
    let fired = run(Pulse { fire: 1, ..quiet }, 0.0);
    assert_eq!(clicks(&fired), 1);
    assert!(fired.iter().sum::<f64>().abs() < 1e-12, "its impulse is zero");
    // A sine over ten ticks is sampled every 36 degrees, which misses its crest.
    assert!(
        (fired.iter().fold(0.0_f64, |m, t| m.max(*t)) - 0.2 * (0.4 * core::f64::consts::PI).sin()).abs()
            < 1e-12
    );
    assert_eq!(clicks(&run(Pulse { period: 0.1, ..quiet }, 0.0)), 10);
    // Half a turn per second passes six of twelve notches in either direction, and each click
    // pushes in the direction of motion first.
    for rate in [core::f64::consts::PI, -core::f64::consts::PI] {
        let torque = run(Pulse { count: 12, ..quiet }, rate);
        assert_eq!(clicks(&torque), 6);
        assert!(torque.iter().find(|t| **t != 0.0).unwrap() * rate > 0.0);
    }
}

#[test]
fn a_pulse_that_is_set_clicks_in_the_controller() {
    let quiet = Pulse { period: 0.0, count: 0, target: Target::N, ..pulse() };
    let scene = |revision, fire| {
        CompiledScene::new(revision, &[effect(0, 1, Kind::Pulse(Pulse { fire, ..quiet }))]).unwrap()
    };
    let mut bench = Bench::active(rig(), scene(1, 0));
    bench.scene = scene(2, 7);
    let torque: Vec<f64> = (0..30).map(|_| bench.step().state.torque.dot(axis())).collect();
    assert!(torque.iter().any(|t| *t > 0.15) && torque.iter().any(|t| *t < -0.15), "{torque:?}");
    assert!(torque[12..].iter().all(|t| t.abs() < 1e-9));
}

fn track(path: TrackPath, figures: &[f64]) -> Felt {
    let track = Track { target: askew(), path, stiffness: 2.0, damping: 0.0, deadband: 0.0 };
    Felt::with_numbers(Kind::Track(track), figures)
}

#[test]
fn a_swing_goes_as_its_sine_and_a_chirp_s_phase_is_the_integral_of_its_frequency() {
    let base = askew().reference().0;
    let swing =
        |from, to, sweep, repeat| TrackPath::Swing { axis: axis(), amplitude: 0.3, from, to, sweep, repeat };
    let phase = |t: f64| 0.5 * t + 0.5 * (2.0 - 0.5) * t * t / 4.0;
    let mut sine = track(swing(0.5, 0.5, 0.0, false), &[]);
    let mut chirp = track(swing(0.5, 2.0, 4.0, false), &[]);
    for k in 0..4000 {
        let t = f64::from(k) * DT;
        for (felt, phase) in [(&mut sine, 0.5 * t), (&mut chirp, phase(t))] {
            let want = axis() * (2.0 * 0.3 * (core::f64::consts::TAU * phase).sin());
            let torque = felt.at(base);
            // The tolerance is the sum of 4000 roundings of the phase.
            assert!((torque - want).length() < 1e-11, "at {t} s: {torque} against {want}");
        }
    }
}

#[test]
fn way_points_are_met_at_their_times_at_rest_and_a_record_at_its_rates() {
    let base = askew().reference().0;
    let turns = [Vec3::ZERO, Vec3::new(0.3, 0.1, 0.0), Vec3::new(-0.2, 0.4, 0.5)];
    let points: Vec<f64> = turns
        .iter()
        .zip([0.0, 0.5, 1.25])
        .flat_map(|(v, t)| {
            let [w, x, y, z] = rotation::to_wxyz(rotation::exp(*v));
            [t, w, x, y, z]
        })
        .collect();
    for rest in [true, false] {
        let mut felt = track(TrackPath::Points { rest, repeat: false }, &points);
        let mut places = Vec::new();
        for _ in 0..1500 {
            // At 2 N m/rad, half of the torque is the turn to the reference.
            places.push(rotation::exp(felt.at(base) * 0.5) * base);
        }
        for (turn, tick) in [(0, 0), (1, 500), (2, 1250), (2, 1499)] {
            let off = rotation::angle_between(places[tick], rotation::exp(turns[turn]) * base);
            assert!(off < 1e-9, "rest {rest}: {off} rad off at tick {tick}");
        }
        let rate = |k: usize| rotation::angle_between(places[k + 1], places[k]) / DT;
        if rest {
            assert!(rate(0) < 1e-3 && rate(499) < 1e-3 && rate(500) < 1e-3 && rate(1248) < 1e-3);
            // The peak rate of the path of least jerk is 15/8 of the mean.
            assert!((rate(250) - 1.875 * turns[1].length() / 0.5).abs() < 1e-3);
        } else {
            assert!((rate(100) - turns[1].length() / 0.5).abs() < 1e-9);
        }
    }
}

/// In a scene the figures of several effects are stored one after another.
#[test]
fn each_effect_finds_its_own_figures() {
    let figures = [0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.25];
    let still = |start| {
        let path = TrackPath::Points { rest: false, repeat: false };
        let kind =
            Kind::Track(Track { target: Target::N, path, stiffness: 1.0, damping: 0.0, deadband: 0.0 });
        Effect { numbers: Span { start, len: 5 }, ..effect(start as u8, 1, kind) }
    };
    let scene = CompiledScene::with_numbers(1, &[still(0), still(5)], &figures).unwrap();
    assert_eq!(scene.numbers(scene.effects()[1].numbers), &figures[5..10]);
    assert!(CompiledScene::with_numbers(1, &[still(7)], &figures).is_err());
    assert!(CompiledScene::with_numbers(1, &[], &[0.0; 5000]).is_err());
    // Only the second effect has its reference half a turn away.
    let rig = altered(&rig(), |rig| rig.limits.enable_max_angle = std::f64::consts::PI);
    let torque = Bench::active(rig, scene).step().state.torque;
    assert!(torque.length() > 1.0, "{torque}");
}

/// Returns the value at `t` of the line through `knots`, which are times (s) and values.
fn polyline(knots: &[(f64, f64)], t: f64) -> f64 {
    let piece = knots.windows(2).find(|pair| pair[0].0 <= t && t < pair[1].0);
    piece.map_or(knots[knots.len() - 1].1, |pair| {
        let [(from, low), (to, high)] = [pair[0], pair[1]];
        low + (high - low) * (t - from) / (to - from)
    })
}

#[test]
fn a_vibration_is_its_wave_times_its_envelope_and_one_that_ends_stays_silent() {
    const FREQUENCY: f64 = 37.0;
    let turn = core::f64::consts::TAU;
    for wave in [Wave::Sine, Wave::Square, Wave::Saw] {
        // No tick is at the end of `hold`, where a vibration without release drops at once.
        for (attack, hold, release) in [
            (0.02, 0.0995, 0.05),
            (0.02, 0.0995, 0.0),
            (0.0, 0.0995, 0.05),
            (0.03, 0.0, 0.05),
            (0.0, 0.0, 0.0),
        ] {
            let mut knots = vec![(0.0, 0.0), (attack, 1.0)];
            if hold > 0.0 {
                knots.extend([(hold, 1.0), (hold + release, 0.0)]);
            }
            let vibration =
                Vibration { frequency: FREQUENCY, attack, hold, release, repeat: 0.0, ..vibration(wave) };
            let torque = along(&mut Felt::new(Kind::Vibration(vibration)), Quat::IDENTITY, 400);
            for (k, torque) in torque.into_iter().enumerate() {
                let t = k as f64 * DT;
                // Within these 400 ticks only the first is on a border between two half periods.
                let phase = (FREQUENCY * t).fract();
                let sine = (turn * phase).sin();
                let shape = match wave {
                    Wave::Sine => sine,
                    Wave::Square => 1.0_f64.copysign(sine),
                    Wave::Saw => 2.0 * (phase - phase.round()),
                };
                let want = 0.1 * polyline(&knots, t) * shape;
                // The tolerance is 400 roundings of the phase, times the steepest slope of a wave.
                assert!((torque - want).abs() < 1e-12, "{vibration:?} at {t} s: {torque}, not {want}");
            }
        }
    }
}

/// At these frequencies the phase is exact, and a tick lies exactly on the border between the two
/// half periods.
#[test]
fn a_square_wave_of_an_even_number_of_ticks_has_no_mean() {
    for (frequency, ticks) in [(500.0, 2), (250.0, 4), (125.0, 8), (62.5, 16)] {
        let square = Vibration { frequency, attack: 0.0, hold: 0.0, repeat: 0.0, ..vibration(Wave::Square) };
        let torque = along(&mut Felt::new(Kind::Vibration(square)), Quat::IDENTITY, 10 * ticks);
        for period in torque.chunks(ticks as usize) {
            assert!(period[0] > 0.09 && period.iter().sum::<f64>().abs() < 1e-12, "{frequency}: {period:?}");
        }
    }
}

/// Turns the sphere like a dial at `rate` rad/s for two seconds, with its axis swung away by
/// `swing` rad. Returns the first torque of each click.
fn clicked(count: u16, swing: f64, rate: f64) -> Vec<f64> {
    let base = askew().reference().0;
    let tilted = base * rotation::exp(axis().any_orthonormal_vector() * swing);
    let mut felt = Felt::new(Kind::Pulse(Pulse { period: 0.0, count, ..pulse() }));
    let torque: Vec<f64> = (0..2000)
        .map(|k| {
            let q = tilted * rotation::exp(axis() * (rate * DT * f64::from(k)));
            felt.moving(q, tilted * axis() * rate).dot(base * axis())
        })
        .collect();
    torque.windows(2).filter(|pair| pair[0] == 0.0 && pair[1] != 0.0).map(|pair| pair[1]).collect()
}

/// From one of two notches to the other is half a turn. Only the rate tells the direction.
#[test]
fn each_click_of_a_dial_pushes_first_in_the_direction_of_its_motion() {
    for count in [1, 2, 3, 4, 5, 12] {
        for rate in [4.0, -4.0] {
            let clicks = clicked(count, 0.0, rate);
            // The dial turns by 8 rad. The first border is half a step from the notch at zero.
            let borders = (8.0 * f64::from(count) / core::f64::consts::TAU + 0.5).floor();
            assert_eq!(clicks.len(), borders as usize, "{count} notches at {rate} rad/s");
            assert!(clicks.iter().all(|first| first * rate > 0.0), "{count} at {rate} rad/s: {clicks:?}");
        }
    }
}

/// Beyond a swing of 120 degrees a dial fades, and its notches with it.
#[test]
fn a_dial_that_has_swung_far_away_does_not_click() {
    for (swing, clicks) in [(0.0, 12), (1.0, 12), (2.0, 12), (2.2, 0), (2.6, 0)] {
        for rate in [3.1, -3.1] {
            assert_eq!(clicked(12, swing, rate).len(), clicks, "swing {swing} at {rate} rad/s");
        }
    }
}
