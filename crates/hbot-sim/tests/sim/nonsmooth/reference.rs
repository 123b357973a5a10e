//! An independent reference for the nonsmooth plant: the equations of motion of the physics notes,
//! sections 1, 2, 5 and 8, written a second time.
//!
//! Every set-valued law is regularised, and a stiff method integrates the equations (backward
//! differentiation of order 1 to 5). Friction is -limit s / sqrt(|s|² + v²), so a sticking part
//! creeps at v times the load's share of the limit. The flanks of a gear are hard dampers that
//! never pull. The tests show both errors by varying v and the damping.

use differential_equations::ivp::IVP;
use differential_equations::linalg::Matrix;
use differential_equations::methods::BackwardDifferentiationFormula;
use differential_equations::ode::ODE;
use hbot_sim::hand::Grip;
use hbot_sim::phenomena::{largest_grip, largest_pivoting_torque};

use super::dual::{Dual, Triple, constant, cross, dot, fixed, plus, solved, times, turned};

use crate::prelude::*;

/// Number of variables of the equations: orientation, angular velocity, and for each of two wheels
/// the angles th and ph, their rates, and the motor's angle and rate.
const SIZE: usize = 7 + 2 * 6;
type Numbers = [f64; SIZE];

const GRAVITY: f64 = 9.80665;

/// Joint torques and a torque on the sphere, as functions of time, and optionally a hand that holds
/// the sphere.
#[derive(Clone, Copy)]
pub(super) struct Input {
    pub(super) tau: fn(f64) -> [f64; 4],
    pub(super) external: fn(f64) -> [f64; 3],
    pub(super) grip: Option<Grip>,
}

/// How closely the smooth laws of the reference approach the set-valued laws of friction and play.
#[derive(Clone, Copy)]
pub(super) struct Sharpness {
    /// Regularisation speed v of joints, cage and pivoting, rad/s. For the slip of contacts, the
    /// speed is this number times 0.01 m.
    pub(super) rate: f64,
    /// Damping of a gear's flanks when they touch, N m s/rad.
    pub(super) flank: f64,
    /// Relative and absolute error that the integrator allows.
    pub(super) tolerance: f64,
}

/// The independent equations of motion of a device with its phenomena and its inputs.
pub(super) struct Reference<'a> {
    pub(super) device: &'a Device,
    pub(super) phenomena: &'a Phenomena,
    pub(super) input: Input,
    pub(super) sharpness: Sharpness,
}

/// Axes and distance of the contact of one wheel with the sphere.
struct Contact {
    axis: Triple,
    c1: Triple,
    c2: Triple,
    c3: Triple,
    /// Distance of the contact from the centre O of rotation, R + d.c3, m.
    radius: Dual,
}

/// Returns the vector v turned by the smallest rotation that takes the axis n3 to `l`.
fn a0(l: [f64; 3], v: Triple) -> Triple {
    let axis = fixed([-l[1], l[0], 0.0]);
    let turn = cross(axis, v);
    plus(plus(v, turn), times(cross(axis, turn), constant(1.0 / (1.0 + l[2]))))
}

impl Reference<'_> {
    /// Integrates the motion for `seconds` from `state`, and returns its end. At `state` the wheels
    /// roll without slip.
    pub(super) fn advance(&self, state: &PlantState, seconds: f64) -> End {
        let mut y = [0.0; SIZE];
        y[..4].copy_from_slice(&[state.q.w, state.q.x, state.q.y, state.q.z]);
        y[4..7].copy_from_slice(&state.omega.to_array());
        for i in 0..2 {
            (y[7 + 6 * i], y[8 + 6 * i]) = (state.steer[i], state.drive[i]);
        }
        let lifted = y.map(constant);
        for i in 0..2 {
            let rates = self.rolling(i, &self.contact(&lifted, i));
            let [steer, drive] = rates.map(|row| dot(row, [lifted[4], lifted[5], lifted[6]]).value);
            y[7 + 6 * i + 2..7 + 6 * i + 6].copy_from_slice(&[steer, drive, state.drive[i], drive]);
        }
        let tolerance = self.sharpness.tolerance;
        let method = BackwardDifferentiationFormula::adaptive()
            .h0(1.0e-6)
            .rtol(tolerance)
            .atol(tolerance)
            .max_steps(300_000);
        let solution = IVP::ode(self, 0.0, seconds, y).method(method).solve().expect("the reference fails");
        let y = solution.y.last().expect("no end");
        let norm = y[..4].iter().map(|x| x * x).sum::<f64>().sqrt();
        End {
            q: Quat::from_xyzw(y[1] / norm, y[2] / norm, y[3] / norm, y[0] / norm),
            joints: [y[7], y[8], y[13], y[14]],
            motors: [y[11], y[17]],
        }
    }

    fn contact(&self, y: &[Dual; SIZE], i: usize) -> Contact {
        let spec = self.device.wheels()[i].spec();
        let l = spec.axis.normalize().to_array();
        let (sin, cos) = (y[7 + 6 * i].sin(), y[7 + 6 * i].cos());
        let (sa, ca) = spec.cone.sin_cos();
        let (sb, cb) = spec.toe.sin_cos();
        let column = |v: [f64; 3]| {
            let rotated = [cos * v[0] - sin * v[1], sin * v[0] + cos * v[1], constant(v[2])];
            a0(l, rotated)
        };
        let c3 = column([0.0, -sa, ca]);
        let radius = constant(self.device.sphere_radius()) + dot(self.offset(y), c3);
        Contact {
            axis: fixed(l),
            c1: column([cb, sb * ca, sb * sa]),
            c2: column([-sb, cb * ca, cb * sa]),
            c3,
            radius,
        }
    }

    /// Returns the vector from the centre O of rotation to the sphere's centre, in frame N, m.
    fn offset(&self, y: &[Dual; SIZE]) -> Triple {
        let d = self.phenomena.eccentric.map_or([0.0; 3], |e| e.offset);
        turned([y[0], y[1], y[2], y[3]], fixed(d))
    }

    /// Returns the rows of the matrix G (steer, drive) of a wheel that rolls without slip, from H
    /// zd + Z w = 0.
    fn rolling(&self, i: usize, at: &Contact) -> [Triple; 2] {
        let r = self.device.wheels()[i].spec().radius;
        let steer = at.c2.map(|c| c / dot(at.axis, at.c2));
        let lc1 = dot(at.axis, at.c1);
        let drive = core::array::from_fn(|k| at.radius * (lc1 * steer[k] - at.c1[k]) * (1.0 / r));
        [steer, drive]
    }

    /// Returns the regularised friction -limit u / sqrt(|u|² + v²) at the velocity `u`. `scale`
    /// converts the regularisation speed v to the unit of `u`.
    fn friction<const N: usize>(&self, limit: Dual, u: [Dual; N], scale: f64) -> [Dual; N] {
        let v = self.sharpness.rate * scale;
        let size = u.iter().fold(constant(v * v), |sum, u| sum + *u * *u).sqrt();
        u.map(|u| -(limit * u / size))
    }

    /// Returns the viscous and dry friction torque of a joint at `rate`. `more` is added to the
    /// limit of the dry part, for the losses of a gear.
    fn joint_friction(&self, rate: Dual, more: Dual) -> Dual {
        let Some(f) = self.phenomena.joint_friction else { return self.friction(more, [rate], 1.0)[0] };
        let x = rate * (1.0 / f.stribeck_rate);
        let peak = (f.breakaway - f.coulomb).max(0.0);
        let limit = constant(f.coulomb) + (-(x * x)).exp() * peak + more;
        self.friction(limit, [rate], 1.0)[0] - rate * f.viscous
    }

    /// Returns the torque that a gear's flanks give to the wheel.
    ///
    /// The flanks are hard dampers, so that they do not bounce, with springs that undo the
    /// penetration within a millisecond. Their torque rises over a millionth of a radian, because a
    /// jump would stop the integrator.
    fn flanks(&self, behind: Dual, rate: Dual) -> Dual {
        let Some(gear) = self.phenomena.gear else { return Dual::default() };
        let c = self.sharpness.flank;
        let half = constant(0.5 * gear.backlash);
        let push = |deep: Dual, closing: Dual| {
            if deep.value > 0.0 {
                ((deep * 1000.0 + closing) * c).max_zero() * (deep / (deep + constant(1e-6)))
            } else {
                Dual::default()
            }
        };
        push(behind - half, rate) - push(-behind - half, -rate)
    }

    fn flow(&self, t: f64, y: &[Dual; SIZE]) -> [Dual; SIZE] {
        let p = self.phenomena;
        let (q, w) = ([y[0], y[1], y[2], y[3]], [y[4], y[5], y[6]]);
        let e = [q[1], q[2], q[3]];
        let mut out = [Dual::default(); SIZE];
        out[0] = -(dot(e, w)) * 0.5;
        let turn = plus(times(w, q[0]), cross(w, e));
        out[1..4].copy_from_slice(&turn.map(|x| x * 0.5));

        let mut on_sphere = fixed((self.input.external)(t));
        if let Some(cage) = p.cage_friction {
            on_sphere = plus(on_sphere, self.friction(constant(cage.torque), w, 1.0));
        }
        let offset = self.offset(y);
        let weight = fixed([0.0, 0.0, -self.device.sphere_mass() * GRAVITY]);
        if p.eccentric.is_some() {
            on_sphere = plus(on_sphere, cross(offset, weight));
        }
        let mut inertia = self.device.sphere_inertia();
        if let Some(grip) = &self.input.grip {
            on_sphere = plus(on_sphere, hand(grip, t, q, w));
            inertia += grip.hand().inertia;
        }
        let tau = (self.input.tau)(t);
        let mut apparent: [Triple; 3] =
            core::array::from_fn(|k| core::array::from_fn(|j| constant(if j == k { inertia } else { 0.0 })));
        for i in 0..2 {
            let (spec, base) = (self.device.wheels()[i].spec(), 7 + 6 * i);
            let at = self.contact(y, i);
            let rows = self.rolling(i, &at);
            let (steer, drive) = match p.slip {
                Some(_) => (y[base + 2], y[base + 3]),
                None => (dot(rows[0], w), dot(rows[1], w)),
            };
            let jc = spec.axial_inertia * spec.cone.sin() * spec.toe.sin();
            // The inertia that the coupling of the joints needs stays with the wheel.
            let free = spec.drive_inertia - jc * jc / spec.steer_inertia;
            let behind_gear = p.gear.map_or(0.0, |gear| gear.rotor_share) * free;
            let (jt, jp) = (spec.steer_inertia, spec.drive_inertia - behind_gear);

            let mut at_steer = constant(tau[2 * i]) + self.joint_friction(steer, Dual::default());
            let mut at_drive = constant(tau[2 * i + 1]);
            if let Some(modules) = p.wheel_modules {
                let lift = cross(at.axis, at.c3)[2] * (self.device.sphere_radius() + spec.radius);
                at_steer = at_steer - lift * (modules.mass * GRAVITY);
            }
            if let Some(pivoting) = p.pivoting {
                let spin = steer * spec.cone.cos() - dot(w, at.c3);
                let [torque] = self.friction(constant(largest_pivoting_torque(&pivoting)), [spin], 1.0);
                at_steer = at_steer + torque * spec.cone.cos();
                on_sphere = plus(on_sphere, times(at.c3, -torque));
            }
            if let Some(gear) = p.gear {
                let (angle, rate) = (y[base + 4], y[base + 5]);
                let passed = self.flanks(angle - y[base + 1], rate - drive);
                let driving = passed.value * rate.value >= 0.0;
                let lost = if driving { 1.0 / gear.efficiency - 1.0 } else { 1.0 - gear.efficiency };
                let friction = self.joint_friction(rate, passed.abs() * lost);
                out[base + 4] = rate;
                out[base + 5] = (at_drive + friction - passed) * (1.0 / behind_gear);
                at_drive = passed;
            } else {
                at_drive = at_drive + self.joint_friction(drive, Dual::default());
            }
            (out[base], out[base + 1]) = (steer, drive);
            if let Some(slip) = p.slip {
                // s = H zd + Z w, with F on the wheel.
                let (lc1, lc2) = (dot(at.axis, at.c1), dot(at.axis, at.c2));
                let s = [
                    at.radius * lc2 * steer - at.radius * dot(at.c2, w),
                    -(at.radius * lc1 * steer) + drive * spec.radius + at.radius * dot(at.c1, w),
                ];
                let f = self.friction(constant(largest_grip(&slip)), s, 0.01);
                let (a, b) =
                    (at_steer + at.radius * (lc2 * f[0] - lc1 * f[1]), at_drive + f[1] * spec.radius);
                let det = 1.0 / (jt * jp - jc * jc);
                out[base + 2] = (a * jp - b * jc) * det;
                out[base + 3] = (b * jt - a * jc) * det;
                on_sphere = plus(on_sphere, times(at.c1, at.radius * f[1]));
                on_sphere = plus(on_sphere, times(at.c2, -(at.radius * f[0])));
            } else {
                // Time derivatives of the rows: steering turns them about l, and the contact's
                // distance changes.
                let away = dot(cross(w, offset), at.c3) + dot(offset, cross(at.axis, at.c3)) * steer;
                let bend = |row: Triple| dot(cross(at.axis, row), w) * steer;
                let steer_bend = bend(rows[0]);
                let drive_bend = bend(rows[1]) + away / at.radius * drive;
                let a = at_steer - steer_bend * jt - drive_bend * jc;
                let b = at_drive - steer_bend * jc - drive_bend * jp;
                on_sphere = plus(on_sphere, plus(times(rows[0], a), times(rows[1], b)));
                for k in 0..3 {
                    for j in 0..3 {
                        let mixed = rows[0][k] * rows[1][j] + rows[1][k] * rows[0][j];
                        apparent[k][j] = apparent[k][j]
                            + rows[0][k] * rows[0][j] * jt
                            + rows[1][k] * rows[1][j] * jp
                            + mixed * jc;
                    }
                }
            }
        }
        out[4..7].copy_from_slice(&solved(apparent, on_sphere));
        out
    }
}

/// Returns the torque of a hand on the sphere: the damper plus the spring, which is 2 K times the
/// scalar and the vector part of q_d q⁻¹.
fn hand(grip: &Grip, t: f64, q: [Dual; 4], w: Triple) -> Triple {
    let (target, hand) = (grip.target(t), grip.hand());
    let (d, e) = (fixed([target.q.x, target.q.y, target.q.z]), [q[1], q[2], q[3]]);
    let scalar = q[0] * target.q.w + dot(d, e);
    let error = plus(plus(times(d, q[0]), times(e, constant(-target.q.w))), cross(e, d));
    let spring = times(error, scalar * (2.0 * hand.stiffness));
    let relative = plus(fixed(target.omega.to_array()), w.map(|w| -w));
    plus(spring, times(relative, constant(hand.damping)))
}

impl ODE<f64, Numbers> for Reference<'_> {
    fn diff(&self, t: f64, y: &Numbers, out: &mut Numbers) {
        *out = self.flow(t, &y.map(constant)).map(|x| x.value);
    }

    fn jacobian(&self, t: f64, y: &Numbers, j: &mut Matrix<f64>) {
        for column in 0..SIZE {
            let mut lifted = y.map(constant);
            lifted[column].slope = 1.0;
            for (row, x) in self.flow(t, &lifted).iter().enumerate() {
                j[(row, column)] = x.slope;
            }
        }
    }
}

/// The sphere's orientation and the angles of joints and motors at the end of a motion.
#[derive(Debug, Clone, Copy)]
pub(super) struct End {
    pub(super) q: Quat,
    /// Steer angle th and drive angle ph of each wheel, rad.
    pub(super) joints: [f64; 4],
    /// Angles of the drive motors, rad.
    pub(super) motors: [f64; 2],
}
