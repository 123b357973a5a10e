//! Tracks: paths that repeat, the rate of every path, and which way a track pulls.

use super::{Felt, askew, axis};
use crate::prelude::*;

const STIFFNESS: f64 = 2.0;

fn track(path: TrackPath, damping: f64, figures: &[f64]) -> Felt {
    let track = Track { target: askew(), path, stiffness: STIFFNESS, damping, deadband: 0.0 };
    Felt::with_numbers(Kind::Track(track), figures)
}

/// Returns a chirp from 0.5 to 2 Hz within 1.5 s.
fn chirp(repeat: bool) -> TrackPath {
    TrackPath::Swing { axis: axis(), amplitude: 0.3, from: 0.5, to: 2.0, sweep: 1.5, repeat }
}

/// Returns points at 0, 0.5 and 1.25 s. The last one has the orientation of the first.
fn round_trip() -> Vec<f64> {
    [(0.0, Vec3::new(0.1, 0.0, -0.2)), (0.5, Vec3::new(0.3, 0.5, 0.4)), (1.25, Vec3::new(0.1, 0.0, -0.2))]
        .into_iter()
        .flat_map(|(t, v)| {
            let [w, x, y, z] = rotation::to_wxyz(rotation::exp(v));
            [t, w, x, y, z]
        })
        .collect()
}

#[test]
fn a_chirp_that_repeats_goes_back_and_forth_and_another_stays_at_its_end() {
    let base = askew().reference().0;
    for repeat in [true, false] {
        let mut felt = track(chirp(repeat), 0.0, &[]);
        let mut turns = 0.0_f64;
        for k in 0..8000 {
            let want = axis() * (STIFFNESS * 0.3 * (core::f64::consts::TAU * turns).sin());
            let torque = felt.at(base);
            // The tolerance is far above 8000 roundings of the phase, and far below a tick of it.
            assert!((torque - want).length() < 1e-9, "repeat {repeat}, tick {k}: {torque} against {want}");
            // The mean frequency of a tick is that in its middle, in sweeps of 1.5 s.
            let sweeps = (f64::from(k) + 0.5) * DT / 1.5;
            let part = if repeat { 1.0 - (sweeps.rem_euclid(2.0) - 1.0).abs() } else { sweeps.min(1.0) };
            turns += (0.5 + 1.5 * part) * DT;
        }
    }
}

#[test]
fn a_path_that_repeats_is_the_same_every_time_round() {
    let base = askew().reference().0;
    for rest in [true, false] {
        let mut felt = track(TrackPath::Points { rest, repeat: true }, 0.0, &round_trip());
        let torque: Vec<Vec3> = (0..5000).map(|_| felt.at(base)).collect();
        for k in 0..3750 {
            // The tolerance is the rounding of the time, times the rate of the path.
            let off = (torque[k + 1250] - torque[k]).length();
            assert!(off < 1e-9, "rest {rest}: off by {off} after tick {k}");
        }
        assert!((torque[500] - torque[0]).length() > 0.5, "it moves: {} to {}", torque[0], torque[500]);
    }
}

/// The damper of a track acts relative to the rate of its path. That rate is the change of its
/// place, which another track without a damper shows.
#[test]
fn a_sphere_that_goes_along_with_any_track_feels_nothing() {
    let base = askew().reference().0;
    let sine =
        TrackPath::Swing { axis: axis(), amplitude: 0.3, from: 1.5, to: 1.5, sweep: 0.0, repeat: false };
    for (path, points) in [
        (sine, vec![]),
        (chirp(true), vec![]),
        (TrackPath::Points { rest: true, repeat: true }, round_trip()),
        (TrackPath::Points { rest: false, repeat: false }, round_trip()),
    ] {
        let mut still = track(path, 0.0, &points);
        let places: Vec<Quat> =
            (0..2000).map(|_| rotation::exp(still.at(base) * (1.0 / STIFFNESS)) * base).collect();
        let mut felt = track(path, 0.5, &points);
        felt.at(places[0]);
        let mut fastest = 0.0_f64;
        for k in 1..1999 {
            let omega = rotation::difference(places[k + 1], places[k - 1]) * (0.5 / DT);
            let torque = felt.moving(places[k], omega);
            fastest = fastest.max(omega.length());
            // At a point the rate of a record jumps.
            if points.iter().step_by(5).any(|t| (k as f64 * DT - t).abs() < 1.5 * DT) {
                continue;
            }
            // The error of the differences is a sixth of the square of a tick times the third
            // derivative of the path, at most 600 rad/s³ here. Where the chirp turns back, its
            // second derivative jumps by 4 rad/s². There a quarter of a tick times this is added.
            assert!(torque.length() < 1e-3, "{path:?} at tick {k}: {torque}");
        }
        assert!(fastest > 1.0, "{path:?}: at most {fastest} rad/s");
    }
}

/// A track pulls the shorter way wherever it pulled before. At exactly a half turn it keeps its
/// side.
#[test]
fn a_track_pulls_the_shorter_way_and_keeps_its_side_at_exactly_a_half_turn() {
    use core::f64::consts::{PI, TAU};
    let path =
        TrackPath::Swing { axis: Vec3::X, amplitude: 0.0, from: 1.0, to: 1.0, sweep: 0.0, repeat: false };
    let track = Track { target: Target::N, path, stiffness: STIFFNESS, damping: 0.0, deadband: 0.0 };
    for side in [1.0, -1.0] {
        let mut felt = Felt::new(Kind::Track(track));
        for (turn, want) in [(3.0, 3.0), (PI, PI), (3.2, 3.2 - TAU), (1.0, 1.0), (-1.0, -1.0), (3.0, 3.0)] {
            let q = if turn == PI {
                rotation::from_parts(0.0, Vec3::X)
            } else {
                rotation::exp(Vec3::X * (side * turn))
            };
            let torque = felt.at(q);
            let pull = Vec3::X * (-side * STIFFNESS * want);
            assert!((torque - pull).length() < 1e-12, "side {side}, turn {turn}: {torque}");
        }
    }
}
