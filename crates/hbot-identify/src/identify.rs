//! From the motion of the joints to the values of the rig file, or to the reason why there are
//! none.

use std::fmt;

use hbot_core::design::device::WheelSpec;
use hbot_core::{Device, Mat3, Rig, Vec3};

use crate::fit::{Begin, Fitted, Free, fit};
use crate::model::frame_at_zero;
use crate::motion::Motion;
use crate::parameter::{ANGLE, CENTRE, OF_WHEEL, Quantity, RADIUS, ZERO, all};
use crate::recording::Recorded;

/// Least time during which the sphere must move to find the geometry, s.
const LEAST_S: f64 = 10.0;
/// Least time during which the sphere must move to find the zeros, s.
const LEAST_ZEROS_S: f64 = 1.0;
/// Largest ratio of slip to rolling that bearings, rubber and encoders cause if the geometry is
/// right.
const ORDINARY: f64 = 0.01;
/// Largest ratio of slip to rolling of a geometry that counts as right without being fitted.
const EXPLAINED: f64 = 1.0e-3;
/// Largest fraction of windows that fit to no geometry.
const MOST_LEFT_OUT: f64 = 0.5;
/// A parameter that is further from the drawing than so many usual deviations is no tolerance of
/// manufacture.
const MISBUILT: f64 = 6.0;
/// Largest error of a steering zero that can be found, rad.
const FAR_ZERO: f64 = 0.3;
/// A parameter counts as seen if the motion leaves at most this fraction of its usual deviation.
const SEEN: f64 = 0.3;
/// What the orientation drifts about each axis in a turn of one radian after an identification,
/// rad. Ten turns, 63 rad, drift by at most 5.2 mrad in the study `identify`, whose worst rigs have
/// half a degree of play; 4 mrad about each axis are 7 mrad in all.
const DRIFT: f64 = 5.0e-4;
/// An axis about which the sphere turned by less than this fraction of the most counts as missing.
const LITTLE: f64 = 0.2;

/// What to find.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum What {
    /// Axes, cones, toes, radii and steering zeros.
    Geometry,
    /// The steering zeros alone. The rest of the rig file counts as right.
    Zeros,
}

/// The geometry that a motion shows.
#[derive(Debug, Clone)]
pub struct Identified {
    /// What was found: the zeros alone if the motion is too short for the geometry.
    pub what: What,
    /// The wheels for the rig file, with inertias as drawn.
    pub wheels: Vec<WheelSpec>,
    /// Difference of each wheel's `zero_offset` from that of the rig file, rad.
    pub zeros: Vec<f64>,
    /// All parameters, in the order of the wheels.
    pub values: Vec<Value>,
    /// Slip divided by rolling distance as drawn and as found, root mean square.
    pub share: [f64; 2],
    /// Fraction of the windows that fit to no geometry and were left out.
    pub left_out: f64,
    /// How much the sphere has turned about n1, n2 and n3 in all, rad.
    pub turned: Vec3,
    /// Time during which the sphere moved, s.
    pub moving_s: f64,
}

/// One parameter, as drawn and as found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Value {
    /// Index of the wheel, or `None` for the sphere.
    pub wheel: Option<usize>,
    /// The parameter.
    pub name: Name,
    /// Its value in the rig file.
    pub drawn: f64,
    /// The value that was found. What the motion does not show stays near the drawing.
    pub found: f64,
    /// Half the width of the interval that holds the truth in 95 % of the cases.
    pub interval: f64,
    /// Whether the motion shows the parameter. The three turns of the whole frame, which no count
    /// can show, count as known.
    pub seen: bool,
}

/// The name of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Name {
    /// Component of the unit steering axis along n1, n2 or n3 (0 to 2).
    Axis(usize),
    /// Cone angle, rad.
    Cone,
    /// Toe angle, rad.
    Toe,
    /// Radius, m.
    Radius,
    /// Zero offset of the steer joint relative to that of the rig file, rad.
    Zero,
    /// Offset of the sphere's centre along n1, n2 or n3 (0 to 2), m. No rig file has it.
    Centre(usize),
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Axis(k) => write!(f, "axis n{}", k + 1),
            Self::Cone => f.write_str("cone"),
            Self::Toe => f.write_str("toe"),
            Self::Radius => f.write_str("radius"),
            Self::Zero => f.write_str("zero"),
            Self::Centre(k) => write!(f, "centre n{}", k + 1),
        }
    }
}

/// The reason why a motion shows no geometry.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// The motors pushed nearly all the time.
    #[error(
        "the motors push in {pushed_s:.1} s of {all_s:.1} s: record with motors off (`hbot disable`) and turn the sphere by hand"
    )]
    Pushes {
        /// Time during which motors pushed, s.
        pushed_s: f64,
        /// Time of the recording, s.
        all_s: f64,
    },
    /// The sphere hardly moved.
    #[error("the sphere moves for {moving_s:.1} s only: turn it for at least {least_s:.0} s, about all axes")]
    Short {
        /// Time during which the sphere moved, s.
        moving_s: f64,
        /// The least time, s.
        least_s: f64,
    },
    /// The loops of two recordings had different periods.
    #[error("recordings of {} and {} ticks a second: give only those of one rate together", hertz(.0[0]), hertz(.0[1]))]
    Rates([f64; 2]),
    /// Some joints stood still while others moved.
    #[error("{} stood still while others moved: its wheel does not touch the sphere, or its encoder is dead", listed(.joints))]
    Still {
        /// The numbers of the joints, from 0.
        joints: Vec<usize>,
    },
    /// No geometry explains the motion.
    #[error(
        "the joints contradict each other whatever the geometry: slip of {:.1} % of the rolling (usual: less than {:.1} %), and {:.0} % \
         of the time fits not at all. A wheel slips or lifts, or the rig file is that of another rig (wrong signs: `hbot rig calibrate`)",
        100.0 * .share, 100.0 * ORDINARY, 100.0 * .left_out
    )]
    Contradiction {
        /// Slip divided by rolling distance: median over the windows.
        share: f64,
        /// Fraction of the windows that do not fit.
        left_out: f64,
    },
    /// The geometry is far from that of the rig file.
    #[error(
        "{name} of wheel[{wheel}] would be {found:.4} instead of {drawn:.4}, which is no tolerance: the rig file is that of another rig, \
         or a wheel slips or lifts"
    )]
    OtherRig {
        /// Index of the wheel.
        wheel: usize,
        /// The parameter.
        name: Name,
        /// Its value in the rig file.
        drawn: f64,
        /// The value that would explain the motion.
        found: f64,
    },
    /// A steering zero is too far off.
    #[error(
        "the steering zero of wheel[{wheel}] is off by {off:+.2} rad: correct it first with `hbot rig calibrate --write`"
    )]
    FarZero {
        /// Index of the wheel.
        wheel: usize,
        /// Error of the zero, rad.
        off: f64,
    },
    /// The values that explain the motion are no legal geometry.
    #[error("what explains the motion is no legal rig: {0}")]
    Illegal(String),
}

fn hertz(period_s: f64) -> f64 {
    (1.0 / period_s).round()
}

fn listed(joints: &[usize]) -> String {
    let name =
        |j: &usize| format!("wheel[{}].{}", j / 2, if j.is_multiple_of(2) { "steer" } else { "drive" });
    joints.iter().map(name).collect::<Vec<_>>().join(", ")
}

/// Finds the geometry of the rig `rig`, as drawn, in recordings of the same rig. Calls `progress`
/// with the number of the present step of the fit and the largest number of steps.
///
/// If the motion is too short to show a geometry, but that of `rig` explains it, only the steering
/// zeros are found.
///
/// # Errors
/// Fails if the recordings show no geometry: too short, no motion, motors that push, or joints that
/// contradict each other.
pub fn identify(
    rig: &Rig,
    recordings: &[Recorded],
    what: What,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Identified, Refusal> {
    let parts: Vec<_> = recordings.iter().flat_map(|it| it.parts.iter().cloned()).collect();
    let period_s = recordings.first().map_or(1.0e-3, |it| it.period_s);
    if let Some(other) = recordings.iter().find(|it| it.period_s != period_s) {
        return Err(Refusal::Rates([period_s, other.period_s]));
    }
    let motion = Motion::new(rig, &parts, period_s);
    let least_s = if what == What::Zeros { LEAST_ZEROS_S } else { LEAST_S };
    let pushed_s: f64 = recordings.iter().map(|it| it.pushed_s).sum();
    let free_s: f64 = recordings.iter().map(Recorded::seconds).sum();
    if pushed_s > 0.0 && free_s < least_s {
        return Err(Refusal::Pushes { pushed_s, all_s: pushed_s + free_s });
    }
    let step_s = motion.step_s * motion.hop() as f64;
    let moving_s = motion.moving().iter().filter(|moving| **moving).count() as f64 * step_s;
    if what == What::Geometry && moving_s < least_s && moving_s >= LEAST_ZEROS_S {
        // The geometry counts as right if it explains the motion.
        let zeros = identify(rig, recordings, What::Zeros, progress).ok();
        let explained = zeros.filter(|found| found.share[1] < EXPLAINED);
        return explained.ok_or(Refusal::Short { moving_s, least_s });
    }
    if moving_s < least_s {
        return Err(Refusal::Short { moving_s, least_s });
    }
    let joints = motion.still();
    if !joints.is_empty() {
        return Err(Refusal::Still { joints });
    }
    let impossible = || Refusal::Illegal("the fit does not converge".to_owned());
    let free = if what == What::Zeros { Free::Zeros } else { Free::Geometry };
    let begin = Begin { from: None, zero: ZERO };
    let mut fitted = fit(rig, &motion, free, begin, progress).ok_or_else(impossible)?;
    check(rig, &fitted)?;
    if what == What::Geometry && (0..rig.device.wheels().len()).all(|i| set_well(&fitted, i)) {
        // Zeros that were set well say how the whole frame is turned, as the axes do.
        let begin = Begin { from: Some(&fitted.unknowns), zero: ANGLE };
        fitted = fit(rig, &motion, free, begin, progress).ok_or_else(impossible)?;
    }
    let found = Built::new(rig, &fitted.unknowns)?;
    let mut values = values(rig, &fitted, &found, what)?;
    // The centre is no guess only if everything else is seen.
    if what == What::Geometry && values.iter().all(|value| value.seen) {
        values.extend(centre(rig, &motion, &fitted, progress));
    }
    let drawn = crate::fit::share_as_drawn(rig, &motion);
    Ok(Identified {
        what,
        wheels: found.wheels,
        zeros: found.zeros,
        values,
        share: [drawn, fitted.share],
        left_out: fitted.left_out,
        turned: fitted.turned,
        moving_s,
    })
}

impl Identified {
    /// Returns what the orientation drifts about each axis in a turn of one radian with the
    /// geometry that was found (standard deviation), rad. `None` if the motion did not show all of
    /// it.
    #[must_use]
    pub fn drift(&self) -> Option<f64> {
        (self.what == What::Geometry && self.missing().is_empty()).then_some(DRIFT)
    }

    /// Returns the axes n1, n2, n3 (0 to 2) about which the sphere must turn as well, because
    /// parameters were not seen and it hardly turned about them. Returns none if all parameters
    /// were seen. If it turned about all axes, returns all of them: it did not turn enough.
    #[must_use]
    pub fn missing(&self) -> Vec<usize> {
        if self.what == What::Zeros
            || self.values.iter().all(|value| value.seen || matches!(value.name, Name::Centre(_)))
        {
            return Vec::new();
        }
        let most = self.turned.max_element();
        let little: Vec<usize> = (0..3).filter(|k| self.turned[*k] < LITTLE * most).collect();
        if little.is_empty() { vec![0, 1, 2] } else { little }
    }
}

/// Checks that a fit explains the motion with a geometry that is near the drawing.
fn check(rig: &Rig, fitted: &Fitted) -> Result<(), Refusal> {
    let wheels = rig.device.wheels();
    let (share, left_out) = (fitted.median_share, fitted.left_out);
    if share > ORDINARY || left_out > MOST_LEFT_OUT {
        return Err(Refusal::Contradiction { share, left_out });
    }
    for (i, wheel) in wheels.iter().enumerate() {
        let of = &fitted.unknowns[OF_WHEEL * i..OF_WHEEL * (i + 1)];
        let spec = wheel.spec();
        let other = |name, drawn: f64, found| Refusal::OtherRig { wheel: i, name, drawn, found };
        if of[2].abs() > FAR_ZERO {
            return Err(Refusal::FarZero { wheel: i, off: of[2] });
        }
        if of[3].abs() > MISBUILT * ANGLE {
            return Err(other(Name::Cone, spec.cone, spec.cone + of[3]));
        }
        if of[4].abs() > MISBUILT * ANGLE {
            return Err(other(Name::Toe, spec.toe, spec.toe + of[4]));
        }
        if of[5].abs() > MISBUILT * RADIUS {
            return Err(other(Name::Radius, spec.radius, spec.radius * of[5].exp()));
        }
        if of[0].hypot(of[1]) > MISBUILT * ANGLE {
            let axis = (frame_at_zero(&rig.device, i) * turned(&of[..3])).col(2);
            let far = (0..3).max_by(|a, b| {
                let off = |k: usize| (axis[k] - spec.axis[k]).abs();
                off(*a).total_cmp(&off(*b))
            });
            let k = far.unwrap_or(0);
            return Err(other(Name::Axis(k), spec.axis[k], axis[k]));
        }
    }
    Ok(())
}

/// Returns whether the zero of a wheel is within usual tolerances of the drawing.
fn set_well(fitted: &Fitted, wheel: usize) -> bool {
    fitted.unknowns[OF_WHEEL * wheel + 2].abs() < 4.0 * ANGLE
}

fn turned(of: &[f64]) -> Mat3 {
    let turn = Vec3::new(of[0], of[1], of[2]);
    let q = hbot_core::rotation::exp(turn);
    Mat3::from_quat(q)
}

/// Returns the zero that a rig file has for a wheel with the unknowns `of`, relative to the drawn
/// one, rad: the turn of the wheel about its axis, from where the tilted axis alone has it.
pub(crate) fn twist(device: &Device, wheel: usize, of: &[f64]) -> f64 {
    let frame = frame_at_zero(device, wheel) * turned(&of[..3]);
    let mut specs: Vec<WheelSpec> = device.wheels().iter().map(|wheel| *wheel.spec()).collect();
    specs[wheel].axis = frame.col(2);
    let Ok(tilted) = Device::new(device.sphere_radius(), device.sphere_mass(), &specs) else { return of[2] };
    let turn = frame_at_zero(&tilted, wheel).transpose() * frame;
    turn.col(0).y.atan2(turn.col(0).x) - drawn_zeros(device)[wheel]
}

/// The wheels that unknowns stand for.
struct Built {
    wheels: Vec<WheelSpec>,
    zeros: Vec<f64>,
}

impl Built {
    fn new(rig: &Rig, unknowns: &[f64]) -> Result<Self, Refusal> {
        let device = &rig.device;
        let mut frames = Vec::new();
        let wheels: Vec<WheelSpec> = device
            .wheels()
            .iter()
            .enumerate()
            .map(|(i, wheel)| {
                let of = &unknowns[OF_WHEEL * i..OF_WHEEL * (i + 1)];
                let frame = frame_at_zero(device, i) * turned(&of[..3]);
                let spec = *wheel.spec();
                frames.push(frame);
                WheelSpec {
                    axis: frame.col(2),
                    cone: spec.cone + of[3],
                    toe: spec.toe + of[4],
                    radius: spec.radius * of[5].exp(),
                    ..spec
                }
            })
            .collect();
        let built = Device::new(device.sphere_radius(), device.sphere_mass(), &wheels)
            .map_err(|error| Refusal::Illegal(error.to_string()))?;
        let zeros = frames
            .iter()
            .enumerate()
            .map(|(i, frame)| {
                // The frame of a rig file at the joint angle zero. The wheel stands turned from it.
                let turn = frame_at_zero(&built, i).transpose() * *frame;
                turn.col(0).y.atan2(turn.col(0).x)
            })
            .collect::<Vec<f64>>();
        // The zeros of the drawn wheels are turned too, by the part of a count.
        let drawn = drawn_zeros(device);
        let zeros = zeros.iter().zip(&drawn).map(|(zero, drawn)| zero - drawn).collect();
        Ok(Self { wheels, zeros })
    }

    /// Returns the values of a wheel in the order of [`NAMES`].
    fn of(&self, i: usize) -> [f64; 7] {
        let WheelSpec { axis, cone, toe, radius, .. } = self.wheels[i];
        [axis.x, axis.y, axis.z, cone, toe, radius, self.zeros[i]]
    }
}

/// Returns the turn of each wheel at the joint angle zero from where a device without steering
/// zeros has it, rad.
fn drawn_zeros(device: &Device) -> Vec<f64> {
    let specs: Vec<WheelSpec> = device.wheels().iter().map(|wheel| *wheel.spec()).collect();
    let Ok(plain) = Device::new(device.sphere_radius(), device.sphere_mass(), &specs) else {
        return vec![0.0; specs.len()];
    };
    (0..specs.len())
        .map(|i| {
            let turn = frame_at_zero(&plain, i).transpose() * frame_at_zero(device, i);
            turn.col(0).y.atan2(turn.col(0).x)
        })
        .collect()
}

/// The parameters of a wheel, in the order of a table.
const NAMES: [Name; 7] =
    [Name::Axis(0), Name::Axis(1), Name::Axis(2), Name::Cone, Name::Toe, Name::Radius, Name::Zero];

/// Returns drawn and found values of all wheels, with intervals.
fn values(rig: &Rig, fitted: &Fitted, found: &Built, what: What) -> Result<Vec<Value>, Refusal> {
    const H: f64 = 1.0e-6;
    let drawn = Built::new(rig, &vec![0.0; fitted.unknowns.len()])?;
    let mut values = Vec::new();
    for i in 0..rig.device.wheels().len() {
        // How the values depend on the unknowns of the wheel.
        let mut by = Vec::new();
        for k in OF_WHEEL * i..OF_WHEEL * (i + 1) {
            let mut other = fitted.unknowns.clone();
            other[k] += H;
            let (other, here) = (Built::new(rig, &other)?.of(i), found.of(i));
            by.push((k, std::array::from_fn::<f64, 7, _>(|v| (other[v] - here[v]) / H)));
        }
        let relative = &fitted.relative[OF_WHEEL * i..OF_WHEEL * (i + 1)];
        let known = |k: usize, usual: f64| relative[k] > 0.0 && relative[k] < SEEN * usual;
        for (v, name) in NAMES.into_iter().enumerate() {
            if what == What::Zeros && name != Name::Zero {
                continue;
            }
            let variance: f64 = by
                .iter()
                .flat_map(|a| by.iter().map(move |b| (a, b)))
                .map(|((a, da), (b, db))| da[v] * db[v] * fitted.covariance[*a][*b])
                .sum();
            let seen = match name {
                Name::Axis(_) => known(0, ANGLE) && known(1, ANGLE),
                Name::Zero => known(2, ANGLE),
                Name::Cone => known(3, ANGLE),
                Name::Toe => known(4, ANGLE),
                Name::Radius => known(5, RADIUS),
                Name::Centre(_) => false,
            };
            let interval = fitted.quantile * variance.max(0.0).sqrt();
            let (drawn, found) = (drawn.of(i)[v], found.of(i)[v]);
            values.push(Value { wheel: Some(i), name, drawn, found, interval, seen });
        }
    }
    Ok(values)
}

/// Returns the offset of the sphere's centre. A rig file has no such key, and the loop computes
/// without it, so the other parameters are those that fit best without it.
fn centre(
    rig: &Rig,
    motion: &Motion,
    without: &Fitted,
    progress: &mut dyn FnMut(usize, usize),
) -> Vec<Value> {
    let free = Free::GeometryAndCentre;
    let begin = Begin { from: Some(&without.unknowns), zero: ZERO };
    let Some(fitted) = fit(rig, motion, free, begin, progress) else { return Vec::new() };
    all(rig.device.wheels().len())
        .enumerate()
        .filter_map(|(k, (wheel, quantity))| {
            let Quantity::Centre(axis) = quantity else { return None };
            let interval = fitted.quantile * fitted.covariance[k][k].max(0.0).sqrt();
            let seen = fitted.relative[k] < SEEN * CENTRE;
            Some(Value {
                wheel,
                name: Name::Centre(axis),
                drawn: 0.0,
                found: fitted.unknowns[k],
                interval,
                seen,
            })
        })
        .collect()
}

// A zero that is as far off as can be found is still within what the fit expects.
const _: () = assert!(FAR_ZERO <= 3.0 * ZERO + 1.0e-9);
