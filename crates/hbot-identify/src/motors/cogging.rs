//! Looks for harmonics of the rotors in what the other unknowns leave of the equation of motion.

use hbot_core::design::rig::MAX_HARMONICS;

use super::rows::{Rows, Term};
use super::solve::Solved;

/// Largest number of periods in a turn of the encoder that is looked for.
const MOST_PER_TURN: u32 = 128;
/// Largest number of periods in a turn of the joint. Behind a gear, more of them pass too fast.
const MOST_PER_JOINT_TURN: f64 = 256.0;
/// A harmonic counts if it lowers the sum of squares by this many times the usual square. By chance
/// the best of a thousand lowers it by 14.
const CLEAR: f64 = 40.0;
/// A harmonic counts if its amplitude is at least this fraction of the continuous torque.
const LEAST: f64 = 1.0e-3;

/// Returns the joint and the periods in a turn of its encoder of the harmonic that lowers the sum
/// of squares most. Returns `None` if no further harmonic is clear.
pub(super) fn strongest(rows: &Rows<'_>, solved: &Solved) -> Option<(usize, u32)> {
    let mut best: Option<(f64, usize, u32)> = None;
    for j in 0..rows.joints() {
        let known = |term: &&Term| matches!(term, Term::Sine(of, _) if *of == j);
        let joint = &rows.rig.joints[j];
        // The rig file has the harmonics of an encoder with a whole gear.
        if !(joint.peak > 0.0)
            || joint.gear.fract() != 0.0
            || rows.terms.iter().filter(known).count() >= MAX_HARMONICS
        {
            continue;
        }
        let most = MOST_PER_TURN.min((MOST_PER_JOINT_TURN / joint.gear) as u32);
        for per_turn in 1..=most {
            if rows.terms.contains(&Term::Sine(j, per_turn)) {
                continue;
            }
            let (gain, amplitude) = gain(rows, solved, j, per_turn);
            let clear = gain > CLEAR && amplitude > LEAST * joint.continuous;
            if clear && best.is_none_or(|(most, ..)| gain > most) {
                best = Some((gain, j, per_turn));
            }
        }
    }
    best.map(|(_, joint, per_turn)| (joint, per_turn))
}

/// Returns by how many usual squares a harmonic lowers the sum of squares, and its amplitude, N m.
/// The other unknowns stay as they are.
fn gain(rows: &Rows<'_>, solved: &Solved, joint: usize, per_turn: u32) -> (f64, f64) {
    let (sine, cosine) =
        (rows.column(Term::Sine(joint, per_turn)), rows.column(Term::Cosine(joint, per_turn)));
    let (mut ss, mut sc, mut cc, mut sr, mut cr) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (r, left) in solved.residual.iter().enumerate() {
        let weight = solved.weights[r / 3];
        let (s, c) = (sine[r], cosine[r]);
        ss += weight * s * s;
        sc += weight * s * c;
        cc += weight * c * c;
        sr += weight * s * left;
        cr += weight * c * left;
    }
    let determinant = ss * cc - sc * sc;
    if !(determinant > 1.0e-9 * ss * cc) {
        return (0.0, 0.0);
    }
    let (a, b) = ((cc * sr - sc * cr) / determinant, (ss * cr - sc * sr) / determinant);
    ((a * sr + b * cr) / (solved.scale * solved.scale), a.hypot(b))
}
