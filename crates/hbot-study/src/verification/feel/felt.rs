//! Stiffness and damping that a hand feels: the torque on the sphere compared with its turn, at the
//! frequency of the hand's motion.

use core::f64::consts::TAU;

use hbot_config::{RigConfig, SceneFile};
use hbot_core::{Vec3, rotation};
use hbot_sim::phenomena::{Hand, Phenomena};

use crate::whole::Whole;

/// Frequencies at which the hand's target moves about n1, n2 and n3, relative to the hand's rate
/// (`hbot_sim::hand`).
const RATIOS: [f64; 3] = [1.0, core::f64::consts::FRAC_1_SQRT_2, 0.618_033_988_749_894_9];
/// Time from the start to the measurement, s: the soft start, the hand's fade-in and what they
/// excite.
const SETTLE_S: f64 = 2.0;
/// Least duration of a measurement, s, and its least number of periods of the fastest axis.
const LEAST_S: f64 = 3.0;
const LEAST_PERIODS: f64 = 6.0;

/// What a hand feels about one axis at one frequency.
#[derive(Debug, Clone, Copy)]
pub(super) struct Impedance {
    /// Stiffness, N m/rad: the part of the torque against the turn, divided by the turn.
    pub(super) stiffness: f64,
    /// Damping, N m s/rad: the part of the torque against the rate, divided by the rate.
    pub(super) damping: f64,
    /// Frequency, Hz.
    pub(super) frequency: f64,
}

/// The result of one measurement.
#[derive(Debug, Clone, Copy)]
pub(super) struct Felt {
    /// What is felt about n1, n2 and n3.
    pub(super) axes: [Impedance; 3],
    /// Fraction of the ticks in which the passivity controller adds damping.
    pub(super) share: f64,
}

/// Lets `hand` move the sphere in the scene and measures stiffness and damping by lock-in.
///
/// The hand's target moves about each axis at a frequency of its own. Torque and turn about an axis
/// are multiplied with a sine and a cosine of this frequency and with Hann's window. A torque acts
/// from its tick to the next, so the turn is that in the middle of the two.
pub(super) fn felt(config: &RigConfig, scene: &SceneFile, hand: Hand) -> Felt {
    let phenomena = Phenomena { hand: Some(hand), ..Phenomena::default() };
    let mut whole = Whole::new(config, scene.clone(), phenomena);
    whole.run(SETTLE_S);
    let ticks = whole.ticks(LEAST_S.max(LEAST_PERIODS / hand.rate));
    let (mut turns, mut torques) = ([[0.0; 2]; 3], [[0.0; 2]; 3]);
    let mut damped = 0_u32;
    for tick in 0..ticks {
        let before = whole.rig().state().q;
        let state = whole.step(None).state;
        let after = whole.rig().state().q;
        let turn = (rotation::log(before) + rotation::log(after)) * 0.5;
        let window = 1.0 - (TAU * f64::from(tick) / f64::from(ticks)).cos();
        for axis in 0..3 {
            let angle = TAU * hand.rate * RATIOS[axis] * f64::from(tick) * whole.period();
            for (k, wave) in [angle.cos(), -angle.sin()].into_iter().enumerate() {
                turns[axis][k] += window * wave * turn[axis];
                torques[axis][k] += window * wave * state.torque[axis];
            }
        }
        damped += u32::from(state.damping > 0.0);
    }
    let axes = core::array::from_fn(|axis| {
        let frequency = hand.rate * RATIOS[axis];
        let ([xr, xi], [tr, ti]) = (turns[axis], torques[axis]);
        let size = xr * xr + xi * xi;
        let (re, im) = ((tr * xr + ti * xi) / size, (ti * xr - tr * xi) / size);
        Impedance { stiffness: -re, damping: -im / (TAU * frequency), frequency }
    });
    Felt { axes, share: f64::from(damped) / f64::from(ticks) }
}

/// What a free sphere does after a tap, with and without the passivity controller.
#[derive(Debug, Clone, Copy)]
pub(super) struct Free {
    /// Largest angle between the orientations of the two runs at the same time, rad.
    pub(super) apart: f64,
    /// Largest angle between the orientation and that before the tap, rad.
    pub(super) reach: f64,
}

/// Duration of the observation after a tap, s.
const FREE_S: f64 = 2.0;
/// Angular velocity after a tap, rad/s in N.
const TAP: Vec3 = Vec3::new(1.2, -0.96, 1.28);

/// Taps a free sphere in the scene, with each of two rigs, and compares the motions.
pub(super) fn free(configs: [&RigConfig; 2], scene: &SceneFile) -> Free {
    let mut both = configs.map(|config| {
        let mut whole = Whole::new(config, scene.clone(), Phenomena::default());
        whole.run(SETTLE_S);
        whole.tap(TAP);
        whole
    });
    let (mut apart, mut reach) = (0.0_f64, 0.0_f64);
    let start = both[0].rig().state().q;
    for _ in 0..both[0].ticks(FREE_S) {
        for whole in &mut both {
            whole.step(None);
        }
        let [a, b] = [0, 1].map(|k| both[k].rig().state().q);
        apart = apart.max(rotation::difference(a, b).length());
        reach = reach.max(rotation::difference(a, start).length());
    }
    Free { apart, reach }
}
