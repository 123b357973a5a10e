//! Detents: where they hold the dial, and the torque needed to leave them. Magnets: how they pull.

use super::{Felt, askew, axis, detents};
use crate::prelude::*;

fn felt(detents: Detents, positions: &[f64]) -> Felt {
    Felt::with_numbers(Kind::Detents(detents), positions)
}

/// Returns the orientation of the dial at the angle `psi`, with its axis tilted by `tilt`, rad.
fn turned(psi: f64, tilt: Vec3) -> Quat {
    askew().reference().0 * rotation::exp(tilt) * rotation::exp(axis() * psi)
}

/// Releases a sphere without inertia. It turns in proportion to the torque.
fn settle(felt: &mut Felt, mut q: Quat, load: Vec3, steps: usize) -> Quat {
    for _ in 0..steps {
        let torque = felt.at(q) + load;
        // A tenth of the notch's own rate, pi A/w.
        q = rotation::renormalized(rotation::exp(torque * 0.06) * q);
    }
    q
}

#[test]
fn a_dial_rests_at_its_notches_to_a_microradian() {
    let mut rng = Rng(20);
    for (dial, positions) in [(detents(12, 0.0), vec![]), (detents(0, 0.0), vec![-0.9, -0.4, 0.1, 0.3])] {
        for _ in 0..300 {
            // On a dial with 0.524 rad from notch to notch, there is no torque from 0.2 to 0.324
            // rad.
            let at = if positions.is_empty() {
                core::f64::consts::TAU / 12.0 * rng.below(12) as f64
            } else {
                positions[rng.below(positions.len() as u64) as usize]
            };
            let start = at + rng.between(-0.09, 0.09);
            let mut felt = felt(dial, &positions);
            let q = settle(&mut felt, turned(start, Vec3::ZERO), Vec3::ZERO, 600);
            let off = rotation::angle_between(q, turned(at, Vec3::ZERO));
            assert!(off < 1e-6, "{off:e} rad from the notch at {at}");
        }
    }
}

#[test]
fn a_dial_steps_over_at_its_strength() {
    let dial = detents(12, 0.0);
    let along = askew().reference().0 * axis();
    let mut felt = felt(dial, &[]);
    let mut q = turned(0.0, Vec3::ZERO);
    let mut load = 0.9 * dial.strength;
    while rotation::angle_between(q, turned(0.0, Vec3::ZERO)) < 0.3 {
        load += 1e-4 * dial.strength;
        assert!(load < 1.1 * dial.strength, "it never left");
        q = settle(&mut felt, q, along * load, 200);
    }
    println!("detents: steps over at {:.4} of the strength", load / dial.strength);
    assert!((load / dial.strength - 1.0).abs() < 0.01, "{load} N m");
}

fn along(dial: Detents, positions: &[f64], psi: f64) -> f64 {
    let mut felt = felt(dial, positions);
    // The dial approaches `psi` in steps small enough for counting turns.
    let steps = (psi.abs() / 0.5).ceil();
    let mut torque = felt.at(turned(0.0, Vec3::ZERO));
    for k in 1..=steps as u32 {
        torque = felt.at(turned(psi * f64::from(k) / steps, Vec3::ZERO));
    }
    torque.dot(askew().reference().0 * axis())
}

#[test]
fn ends_are_one_sided_walls_or_open() {
    let positions = [-1.0, 0.0, 9.0];
    let closed = detents(0, 0.0);
    let open = Detents { end_stiffness: 0.0, ..closed };
    // Exactly at the edge, and on both sides of it.
    for (psi, want) in [(9.0, 0.0), (9.25, -0.5), (-1.0, 0.0), (-1.5, 1.0), (9.0 - 0.1, 0.1), (-0.9, -0.1)] {
        let torque = along(closed, &positions, psi);
        assert!((torque - want).abs() < 1e-12, "at {psi}: {torque}");
    }
    for (psi, want) in [(9.1, -0.1), (9.3, 0.0), (-1.1, 0.1), (30.0, 0.0), (-1.2, 0.0)] {
        let torque = along(open, &positions, psi);
        assert!((torque - want).abs() < 1e-12, "at {psi}: {torque}");
    }
}

#[test]
fn a_dial_counts_its_turns() {
    let positions = [0.0, 13.0];
    let torque = along(detents(0, 0.0), &positions, 12.9);
    assert!((torque - 0.1).abs() < 1e-12, "in its third turn: {torque}");
    let torque = along(detents(0, 0.0), &positions, -12.9);
    assert!((torque - 25.8).abs() < 1e-9, "against the wall of the first: {torque}");
}

#[test]
fn notches_nearer_to_each_other_than_two_widths_meet_half_way() {
    let positions = [-0.3, -0.1, 0.5, 0.8];
    let dial = detents(0, 0.0);
    for pair in positions.windows(2) {
        let gap = pair[1] - pair[0];
        let reach = dial.width.min(0.5 * gap);
        // Half way between its centre and its rim a notch pulls with its strength.
        for (psi, want) in [
            (pair[0] + 0.5 * reach, -dial.strength),
            (pair[0] + 0.5 * gap, 0.0),
            (pair[1] - 0.5 * reach, dial.strength),
        ] {
            let torque = along(dial, &positions, psi);
            assert!((torque - want).abs() < 1e-12, "at {psi}: {torque}, not {want}");
        }
    }
}

#[test]
fn a_magnet_pulls_straight_to_its_target_and_hardest_at_its_width() {
    let magnet = Magnet { target: askew(), strength: 0.2, width: 0.3 };
    let base = askew().reference().0;
    let mut felt = Felt::new(Kind::Magnet(magnet));
    let mut rng = Rng(21);
    assert!(felt.at(base).length() < 1e-14);
    for _ in 0..50 {
        let away = rotation::exp(rng.vector(3.0)) * Vec3::X;
        let (mut most, mut hardest_at) = (0.0, 0.0);
        for k in 1..300 {
            let angle = 0.01 * f64::from(k);
            let torque = felt.at(rotation::exp(away * angle) * base);
            let pull = -torque.dot(away);
            assert!((torque + away * pull).length() < 1e-14, "aside at {angle}: {torque}");
            assert!(pull > 0.0 && pull <= magnet.strength, "{pull} N m at {angle}");
            // Little is left at three times the width.
            assert!(angle < 0.9 || pull < 0.1 * magnet.strength, "{pull} N m at {angle}");
            if pull > most {
                (most, hardest_at) = (pull, angle);
            }
        }
        // The cosine of half of the angle takes 1 % of the torque, and moves its maximum by less
        // than 0.01 rad.
        assert!(most > 0.98 * magnet.strength, "at most {most} N m");
        assert!((hardest_at - magnet.width).abs() < 0.021, "hardest at {hardest_at}");
    }
}
