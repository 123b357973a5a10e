//! Rigs that are not as drawn, what their encoders count, and how a geometry is judged.

use core::f64::consts::TAU;

use hbot_core::design::device::WheelSpec;
use hbot_core::{Device, MAX_JOINTS, Quat, Rig};
use hbot_identify::Recorded;
use hbot_identify::compare::Geometry;
use hbot_identify::identify::{Identified, Name};
use hbot_identify::motion::Counts;
use hbot_sim::wander::{Built, Wander};

use crate::rng::Rng;

/// Time between two readings, s.
const H: f64 = 1.0e-3;

/// The errors of encoders and gears.
#[derive(Debug, Clone, Copy)]
pub(super) struct Encoders {
    /// Width of the play in the drives, rad of the joint. The encoder is on the motor's side.
    play: f64,
    /// Amplitude of the error that repeats with each turn of an encoder, rad of the encoder.
    disc: f64,
    /// Part of its path that each wheel loses (standard deviation), another one each second.
    creep: f64,
    /// Path by which one of the wheels slips each minute, m.
    slip: f64,
}

impl Encoders {
    /// Encoders that only round to counts.
    pub(super) const IDEAL: Self = Self { play: 0.0, disc: 0.0, creep: 0.0, slip: 0.0 };
    /// Half a degree of play, and discs 5 micrometres off centre.
    pub(super) const REAL: Self =
        Self { play: 0.5 * core::f64::consts::PI / 180.0, disc: 5.0e-4, ..Self::IDEAL };

    /// The same with wheels that slip by 0.1 mm, and that lose the part `creep` of their path.
    pub(super) const fn slipping(creep: f64) -> Self {
        Self { creep, slip: 1.0e-4, ..Self::REAL }
    }
}

/// Returns what the encoders of `built` count while a hand turns the sphere, and the sphere's
/// orientations.
pub(super) fn counts(
    rig: &Rig,
    built: &Built,
    wander: &Wander,
    seconds: f64,
    encoders: Encoders,
    seed: u64,
) -> (Vec<Counts>, Vec<Quat>) {
    read(rig, built, wander, seconds, encoders, seed).unzip()
}

/// Returns the same, reading by reading.
pub(super) fn read<'a>(
    rig: &'a Rig,
    built: &'a Built,
    wander: &'a Wander,
    seconds: f64,
    encoders: Encoders,
    seed: u64,
) -> impl Iterator<Item = (Counts, Quat)> + 'a {
    let joints = rig.device.joints();
    let mut rng = Rng(seed);
    let phases: [f64; MAX_JOINTS] = core::array::from_fn(|_| TAU * rng.unit());
    let mut motor = [0.0_f64; MAX_JOINTS];
    let (mut before, mut lost, mut creep) =
        ([0.0_f64; MAX_JOINTS], [0.0_f64; MAX_JOINTS], [0.0_f64; MAX_JOINTS]);
    let moments = wander.course(&built.device, H).take((seconds / H) as usize);
    moments.zip(0_u64..).map(move |(moment, k)| {
        if encoders.creep > 0.0 && k.is_multiple_of(1000) {
            // Of the standard deviation 1.
            creep.fill_with(|| encoders.creep * rng.between(-1.0, 1.0) * 3.0_f64.sqrt());
            if k.is_multiple_of(60_000) {
                let wheel = (rng.unit() * (joints / 2) as f64) as usize;
                lost[2 * wheel + 1] += encoders.slip / built.device.wheels()[wheel].spec().radius;
            }
        }
        let mut counts = [0; MAX_JOINTS];
        for j in 0..joints {
            let mut angle = moment.angles[j];
            if j % 2 == 0 {
                angle -= built.zeros[j / 2];
            } else {
                lost[j] += creep[j] * (angle - before[j]);
                before[j] = angle;
                angle -= lost[j];
                // The wheel takes the motor along when the play is used up.
                motor[j] = motor[j].clamp(angle - 0.5 * encoders.play, angle + 0.5 * encoders.play);
                angle = motor[j];
            }
            let gear = rig.joints[j].gear;
            angle += encoders.disc / gear * libm::sin(angle * gear + phases[j]);
            // A counter wraps.
            counts[j] = libm::floor(angle / rig.joints[j].radians_per_count()) as i64 as i32;
        }
        (counts, moment.q)
    })
}

/// Returns a recording with one part.
pub(super) fn recorded(counts: Vec<Counts>) -> [Recorded; 1] {
    [Recorded { parts: vec![counts], period_s: H, pushed_s: 0.0, simulated: true }]
}

/// Returns the geometry of `rig` with other wheels and zeros.
pub(super) fn geometry(rig: &Rig, wheels: &[WheelSpec], zeros: &[f64]) -> Geometry {
    let drawn = &rig.device;
    let device = Device::new(drawn.sphere_radius(), drawn.sphere_mass(), wheels);
    let device = device.unwrap_or_else(|error| unreachable!("near the drawing: {error}"));
    Geometry { device, zeros: zeros.to_vec() }
}

/// Returns the true geometry. Counts are rounded down, so half a count belongs to the zeros.
pub(super) fn truth(rig: &Rig, built: &Built) -> Geometry {
    let half = |(i, zero): (usize, &f64)| zero + 0.5 * rig.joints[2 * i].radians_per_count();
    Geometry { device: built.device, zeros: built.zeros.iter().enumerate().map(half).collect() }
}

/// Returns the number of intervals of a result, and of those that hold the truth.
pub(super) fn intervals(found: &Identified, built: &Built) -> (usize, usize) {
    let truth = |name: Name, wheel: usize| {
        let spec = built.device.wheels()[wheel].spec();
        Some(match name {
            Name::Cone => spec.cone,
            Name::Toe => spec.toe,
            Name::Radius => spec.radius,
            Name::Axis(k) => spec.axis[k],
            Name::Zero => built.zeros[wheel],
            Name::Centre(_) => return None,
        })
    };
    let mut counted = (0, 0);
    for value in &found.values {
        if let Some(truth) = value.wheel.and_then(|wheel| truth(value.name, wheel)) {
            counted.0 += 1;
            counted.1 += usize::from((value.found - truth).abs() <= value.interval);
        }
    }
    counted
}
