//! Torque constants, inertias, friction, imbalance and cogging, from a motion under known torques.
//!
//! The equation of motion is linear in all of them. It is multiplied by smooth bumps and integrated
//! over short windows, by parts, so that no acceleration is needed (`rows`). The unknowns are
//! those that leave the least of it (`solve`). Then harmonics of each rotor are looked for in
//! what is left (`cogging`).
//!
//! Forces alone show ratios only. The inertia of the sphere counts as known: that of a hollow
//! sphere of the mass in the rig file. A second motion with a known inertia that was added shows it
//! ([`Measured::with_added`]). The geometry counts as known too, so find it first
//! ([`mod@crate::identify`]).

mod cogging;
mod rows;
mod scale;
mod solve;

use std::fmt;

use hbot_core::design::rig::{Friction, Harmonic, Imperfect, MAX_HARMONICS};
use hbot_core::{MAX_JOINTS, Quat, Rig, Vec3};

use self::rows::{Grain, Rows, Term};
pub use self::scale::SphereInertia;
use self::solve::Solved;
use crate::fit::share_as_drawn;
use crate::motion::{Counts, Motion};

/// Least time of usable motion, s.
const LEAST_S: f64 = 10.0;
/// A value counts as seen if the motion leaves at most this fraction of what was expected before.
const SEEN: f64 = 0.3;

/// The joints at one moment, and the torques that act from then on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Time, s.
    pub time_s: f64,
    /// Encoder counts of the joints, with the sign of their motor controllers.
    pub counts: Counts,
    /// Commanded joint torques until the next sample, N m, in the sense of the joints.
    pub torque: [f64; MAX_JOINTS],
}

/// What the motion under known torques shows.
#[derive(Debug, Clone)]
pub struct Measured {
    /// All values that were fitted.
    pub values: Vec<MotorValue>,
    /// Friction, torque constant and cogging of each joint, for the rig file. What the motion does
    /// not show is that of an ideal joint.
    pub joints: [Imperfect; MAX_JOINTS],
    /// Inertias of the joints, kg m². What the motion does not show is that of the rig file.
    pub inertia: [f64; MAX_JOINTS],
    /// Friction of the sphere in its cage.
    pub sphere: Friction,
    /// Imbalance of the sphere in its axes, N m.
    pub imbalance: Vec3,
    /// Time by which the torques act later than commanded, s.
    pub delay_s: f64,
    /// Slip divided by rolling distance with the geometry of the rig file, root mean square.
    pub slip: f64,
    /// Time in which the sphere moved and the equation of motion held, s.
    pub used_s: f64,
    /// Part of the torque that the equation does not explain, root mean square, N m.
    pub left: f64,
    /// The torques on the sphere, root mean square, N m.
    pub torque: f64,
}

/// One value, as in the rig file and as found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotorValue {
    /// Number of the joint, or `None` for the sphere.
    pub joint: Option<usize>,
    /// The name of the value.
    pub name: MotorName,
    /// The value in the rig file.
    pub filed: f64,
    /// The value found.
    pub found: f64,
    /// Half the width of the interval that holds the truth in 95 % of the cases.
    pub interval: f64,
    /// Whether the motion shows the value.
    pub seen: bool,
}

/// The name of a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MotorName {
    /// Torque of the motor divided by the torque commanded.
    TorqueScale,
    /// Inertia of the joint, kg m².
    Inertia,
    /// Coulomb friction, N m.
    Coulomb,
    /// Viscous friction, N m s/rad.
    Viscous,
    /// Part of the motor's torque that its gear loses under load.
    Loss,
    /// Component of the imbalance along the sphere's axis 1, 2 or 3 (0 to 2), N m.
    Imbalance(usize),
    /// Amplitude of the cogging with this number of periods in a turn of the encoder, N m.
    Cogging(u32),
}

impl fmt::Display for MotorName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TorqueScale => f.write_str("torque_scale"),
            Self::Inertia => f.write_str("inertia"),
            Self::Coulomb => f.write_str("coulomb"),
            Self::Viscous => f.write_str("viscous"),
            Self::Loss => f.write_str("gear loss"),
            Self::Imbalance(k) => write!(f, "imbalance {}", k + 1),
            Self::Cogging(per_turn) => write!(f, "cogging {per_turn}/turn"),
        }
    }
}

/// The reason why a motion shows nothing.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MotorRefusal {
    /// The sphere hardly moved.
    #[error(
        "the sphere moves for {used_s:.1} s only, at least {LEAST_S:.0} s are needed: is it held, or is there too little torque?"
    )]
    Still {
        /// Time in which the sphere moved, s.
        used_s: f64,
    },
    /// The geometry of the rig file does not explain the motion.
    #[error(
        "the joints contradict each other by {:.1} % of their motion: find the geometry first (`hbot rig identify` with recordings), or a \
         wheel slips",
        100.0 * .slip
    )]
    Geometry {
        /// Slip divided by rolling distance.
        slip: f64,
    },
    /// The equation of motion does not hold.
    #[error(
        "the motion is not that of this rig under these torques: {:.0} % of the torque is unexplained. A hand holds the sphere, a wheel \
         slips, or the geometry is wrong (`hbot rig identify` with recordings finds it)",
        100.0 * .part
    )]
    Unexplained {
        /// Part of the torque that is unexplained.
        part: f64,
    },
    /// An added inertia does not show.
    #[error(
        "the motors seem weaker by {:.1} % with the added inertia: too little to show the sphere's own. Add more (half of the sphere's \
         shows it well), and give the rig file that was measured without it",
        100.0 * .weaker
    )]
    Added {
        /// Part by which the motors seem weaker.
        weaker: f64,
    },
    /// The unknowns cannot be told apart.
    #[error("the motion does not tell the unknowns apart: let it run longer")]
    Singular,
}

/// Largest part of its torque that a gear loses. A gear that loses more locks itself.
const MOST_LOSS: f64 = 0.5;
/// Largest slip divided by rolling distance. A cone that is wrong by half a degree makes 1 to 2 %.
const MOST_SLIP: f64 = 0.03;
/// Largest part of the torque that may be unexplained.
const MOST_LEFT: f64 = 0.3;

/// Finds what the motion `samples` of `rig` under known torques shows. The sphere has the
/// orientation `from` at the first sample.
///
/// # Errors
/// Fails if the sphere hardly moved, or if the motion is not that of the rig.
pub fn measure(rig: &Rig, from: Quat, samples: &[Sample]) -> Result<Measured, MotorRefusal> {
    let slip = slip(rig, samples);
    if slip > MOST_SLIP {
        return Err(MotorRefusal::Geometry { slip });
    }
    let mut rows = Rows::new(rig, from, samples, Grain::USUAL);
    if rows.used_s() < LEAST_S {
        return Err(MotorRefusal::Still { used_s: rows.used_s() });
    }
    let mut solved = Solved::new(&rows).ok_or(MotorRefusal::Singular)?;
    while let Some((joint, per_turn)) = cogging::strongest(&rows, &solved) {
        rows.add_cogging(joint, per_turn);
        solved = Solved::new(&rows).ok_or(MotorRefusal::Singular)?;
    }
    if solved.left > MOST_LEFT * rows.torque {
        return Err(MotorRefusal::Unexplained { part: solved.left / rows.torque });
    }
    let mut other = Rows::new(rig, from, samples, Grain::OTHER);
    for term in &rows.terms[other.terms.len()..] {
        if let Term::Sine(joint, per_turn) = *term {
            other.add_cogging(joint, per_turn);
        }
    }
    solved.doubt(&Solved::new(&other).ok_or(MotorRefusal::Singular)?);
    Ok(told(rig, slip, &rows, &solved))
}

/// Returns slip divided by rolling distance with the geometry of the rig file.
fn slip(rig: &Rig, samples: &[Sample]) -> f64 {
    let Some([first, .., last]) = samples.get(..) else { return 0.0 };
    let period_s = (last.time_s - first.time_s) / (samples.len() - 1) as f64;
    let counts: Vec<Counts> = samples.iter().map(|sample| sample.counts).collect();
    share_as_drawn(rig, &Motion::new(rig, &[counts], period_s))
}

/// Returns the values of a solution.
fn told(rig: &Rig, slip: f64, rows: &Rows<'_>, solved: &Solved) -> Measured {
    let mut measured = Measured {
        values: Vec::new(),
        joints: [Imperfect::default(); MAX_JOINTS],
        inertia: std::array::from_fn(|j| rows::filed_inertia(rig, j)),
        sphere: Friction::default(),
        imbalance: Vec3::ZERO,
        delay_s: 0.0,
        slip,
        used_s: rows.used_s(),
        left: solved.left,
        torque: rows.torque,
    };
    let mut harmonics = [0; MAX_JOINTS];
    for (k, term) in rows.terms.iter().enumerate() {
        let (found, deviation) = (solved.found[k], solved.covariance[k][k].max(0.0).sqrt());
        let half = solved.quantile[k] * deviation;
        let seen = deviation < SEEN * term.usual(rig);
        let value = |joint, name, filed| MotorValue { joint, name, filed, found, interval: half, seen };
        let known = rig.compensation.unwrap_or_default();
        let filed = |j: usize| known.joints[j];
        match *term {
            Term::Scale(j) => {
                measured.values.push(value(Some(j), MotorName::TorqueScale, filed(j).torque_scale));
                if seen {
                    measured.joints[j].torque_scale = found;
                }
            }
            Term::Inertia(j) => {
                measured.values.push(value(Some(j), MotorName::Inertia, term.expected(rig)));
                if seen && found > 0.0 {
                    measured.inertia[j] = found;
                }
            }
            Term::Coulomb(j) => {
                measured.values.push(value(Some(j), MotorName::Coulomb, filed(j).friction.coulomb));
                measured.joints[j].friction.coulomb = surely(found, half);
            }
            Term::Viscous(j) => {
                measured.values.push(value(Some(j), MotorName::Viscous, filed(j).friction.viscous));
                measured.joints[j].friction.viscous = surely(found, half);
            }
            Term::Loss(j) => {
                measured.values.push(value(Some(j), MotorName::Loss, filed(j).gear_loss));
                measured.joints[j].gear_loss = surely(found, half).min(MOST_LOSS);
            }
            Term::CageCoulomb => {
                measured.values.push(value(None, MotorName::Coulomb, known.sphere.coulomb));
                measured.sphere.coulomb = surely(found, half);
            }
            Term::CageViscous => {
                measured.values.push(value(None, MotorName::Viscous, known.sphere.viscous));
                measured.sphere.viscous = surely(found, half);
            }
            Term::Imbalance(axis) => {
                measured.values.push(value(None, MotorName::Imbalance(axis), known.imbalance[axis]));
                if found.abs() > half {
                    measured.imbalance[axis] = found;
                }
            }
            Term::Delay => measured.delay_s = found,
            Term::Sine(j, per_turn) => {
                // The cosine follows the sine.
                let other = solved.found[k + 1];
                let amplitude = found.hypot(other);
                let of = |a: usize, b: usize| solved.covariance[a][b];
                let (s, c) = (found / amplitude, other / amplitude);
                let variance = s * s * of(k, k) + 2.0 * s * c * of(k, k + 1) + c * c * of(k + 1, k + 1);
                let interval = solved.quantile[k].max(solved.quantile[k + 1]) * variance.max(0.0).sqrt();
                let name = MotorName::Cogging(per_turn);
                let same = |it: &&Harmonic| it.per_turn == per_turn;
                let filed = filed(j).cogging.iter().find(same).map_or(0.0, |it| it.amplitude);
                measured.values.push(MotorValue {
                    joint: Some(j),
                    name,
                    filed,
                    found: amplitude,
                    interval,
                    seen: true,
                });
                if harmonics[j] < MAX_HARMONICS {
                    let phase = other.atan2(found);
                    measured.joints[j].cogging[harmonics[j]] = Harmonic { per_turn, amplitude, phase };
                    harmonics[j] += 1;
                }
            }
            Term::Cosine(..) => {}
        }
    }
    measured
}

/// Returns a friction that the motion surely shows (by one and a half intervals), else 0. Friction
/// that is not there must not be fed forward.
fn surely(found: f64, interval: f64) -> f64 {
    if found > 1.5 * interval { found } else { 0.0 }
}
