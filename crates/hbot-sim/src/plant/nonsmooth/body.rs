//! One step's problem: masses, momenta, and what stands between the speeds and free motion.

use hbot_core::device::{Device, MAX_JOINTS, MAX_WHEELS, Wheel};
use hbot_core::kinematics::ContactFrame;
use hbot_core::{Vec3, rotation};

use super::super::weights::Module;
use super::law::{Element, Law, Row};
use super::solver::StepProblem;
use super::{JointTorques, MAX_SPEEDS, Motor, PlantState, Vector};
use crate::phenomena::{Phenomena, dry_friction, largest_grip, largest_pivoting_torque};

/// A loss of a gear off by less than this part of what stops its motor is as good as right.
const SMALL_LOSS: f64 = 1.0e-9;

/// The inertia of a joint that has none, as a part of the sphere's: a thousandth of a real one. Much less costs the
/// solver digits.
const LEAST_MASS: f64 = 1.0e-6;

/// What holds during one step.
pub(super) struct Instant {
    frames: [ContactFrame; MAX_WHEELS],
    /// Distance of each contact from O, m.
    radius: [f64; MAX_WHEELS],
    /// Rows of G: what a wheel that does not slip does.
    pub(super) rows: [[Vec3; 2]; MAX_WHEELS],
}

/// What acts during one step, where the speeds at its end are thought to be `guess`.
pub(super) struct Given<'a> {
    pub(super) h: f64,
    pub(super) tau: &'a JointTorques,
    /// Of the torques on the sphere, N m s.
    pub(super) impulse: Vec3,
    /// What stands in the sphere's mass for torques that fall with its speed, kg m².
    pub(super) implicit: f64,
    /// The modules' torques are those over the way that this makes.
    pub(super) guess: &'a Vector,
    /// With the stiffness against the step that makes a guess of no speeds one that never gives energy.
    pub(super) bounded: bool,
}

/// What moves, and how fast its joints do.
#[derive(Debug, Clone)]
pub(super) struct Body {
    pub(super) device: Device,
    pub(super) phenomena: Phenomena,
    /// I_s and what is held to the sphere, kg m².
    pub(super) inertia: f64,
    pub(super) modules: Option<[Module; MAX_WHEELS]>,
    /// Rates of the joints, at the wheel's side of a gear, rad/s.
    pub(super) rates: [f64; MAX_JOINTS],
    pub(super) motors: [Motor; MAX_WHEELS],
    /// The axis that the sphere is held to turn about, a unit vector in N.
    pub(super) hinge: Option<Vec3>,
}

impl Body {
    pub(super) fn wheels(&self) -> usize {
        self.device.wheels().len()
    }

    /// Where the rates of a joint stand among the speeds; `None` where they follow from the sphere's.
    pub(super) fn joint_at(&self, wheel: usize, k: usize) -> Option<usize> {
        self.phenomena.slip.map(|_| 3 + 2 * wheel + k)
    }

    /// Where the rate of a drive's motor stands, behind a gear with play.
    pub(super) fn motor_at(&self, wheel: usize) -> Option<usize> {
        let first = if self.phenomena.slip.is_some() { 3 + 2 * self.wheels() } else { 3 };
        self.phenomena.gear.map(|_| first + wheel)
    }

    /// How many speeds there are.
    fn size(&self) -> usize {
        let joints = if self.phenomena.slip.is_some() { 2 } else { 0 };
        let motors = if self.phenomena.gear.is_some() { 1 } else { 0 };
        3 + self.wheels() * (joints + motors)
    }

    /// Inertias of a wheel's two joints, without the motor behind a gear: steer, coupling, drive, kg m².
    pub(super) fn wheel_mass(&self, wheel: &Wheel) -> [f64; 3] {
        let spec = wheel.spec();
        let coupling = spec.axial_inertia * wheel.axis_along_axle();
        let least = self.least_mass();
        let share = self.phenomena.gear.map_or(0.0, |gear| gear.rotor_share);
        let drive = spec.drive_inertia - share * free_inertia(wheel);
        [spec.steer_inertia.max(least), coupling, drive.max(least)]
    }

    /// Inertia of a drive's motor behind its gear, in the joint's measure, kg m²: a share of what the coupling of the joints
    /// leaves free, so that the rest is an inertia that a wheel can have.
    pub(super) fn motor_mass(&self, wheel: &Wheel) -> f64 {
        self.phenomena
            .gear
            .map_or(0.0, |gear| (gear.rotor_share * free_inertia(wheel)).max(self.least_mass()))
    }

    /// A device may have joints without inertia, which nothing but the no-slip condition moves. Where they stand by
    /// themselves they get some of their own.
    fn least_mass(&self) -> f64 {
        let apart = self.phenomena.slip.is_some() || self.phenomena.gear.is_some();
        if apart { LEAST_MASS * self.device.sphere_inertia() } else { 0.0 }
    }

    /// The geometry at `ahead` seconds after `state`, by the rates as they are.
    pub(super) fn instant(&self, state: &PlantState, ahead: f64) -> Instant {
        let mut now = Instant {
            frames: [ContactFrame::default(); MAX_WHEELS],
            radius: [self.device.sphere_radius(); MAX_WHEELS],
            rows: [[Vec3::ZERO; 2]; MAX_WHEELS],
        };
        let offset = self.phenomena.eccentric.map(|eccentric| {
            rotation::exp(state.omega * ahead) * (state.q * Vec3::from_array(eccentric.offset))
        });
        for (i, wheel) in self.device.wheels().iter().enumerate() {
            let frame = ContactFrame::at(wheel, state.steer[i] + ahead * self.rates[2 * i]);
            if let Some(offset) = offset {
                now.radius[i] += offset.dot(frame.c3);
            }
            let steer = frame.c2 / wheel.axis_along_roll();
            let drive = (steer * wheel.axis_along_axle() - frame.c1) * (now.radius[i] / wheel.spec().radius);
            now.frames[i] = frame;
            now.rows[i] = [steer, drive];
        }
        now
    }

    /// All speeds as they are.
    pub(super) fn speeds(&self, state: &PlantState) -> Vector {
        let mut speeds = [0.0; MAX_SPEEDS];
        speeds[..3].copy_from_slice(&state.omega.to_array());
        for i in 0..self.wheels() {
            for k in 0..2 {
                if let Some(at) = self.joint_at(i, k) {
                    speeds[at] = self.rates[2 * i + k];
                }
            }
            if let Some(at) = self.motor_at(i) {
                speeds[at] = self.motors[i].rate;
            }
        }
        speeds
    }

    /// The rate of a joint (at the wheel's side of a gear) as a combination of the speeds.
    fn joint_row(&self, now: &Instant, wheel: usize, k: usize) -> Row {
        match self.joint_at(wheel, k) {
            Some(at) => Row::EMPTY.and(at, 1.0),
            None => on_sphere(now.rows[wheel][k]),
        }
    }

    /// The rate of what a joint's motor, encoder and friction sit on.
    fn driven_row(&self, now: &Instant, wheel: usize, k: usize) -> Row {
        match self.motor_at(wheel).filter(|_| k == 1) {
            Some(at) => Row::EMPTY.and(at, 1.0),
            None => self.joint_row(now, wheel, k),
        }
    }

    /// Slip of a contact along its c1 and c2, wheel minus sphere, m/s: H zd + Z w.
    pub(super) fn slip_rows(&self, now: &Instant, i: usize) -> [Row; 2] {
        let (wheel, frame, radius) = (&self.device.wheels()[i], &now.frames[i], now.radius[i]);
        let (Some(steer), Some(drive)) = (self.joint_at(i, 0), self.joint_at(i, 1)) else {
            return [Row::EMPTY; 2];
        };
        [
            on_sphere(frame.c2 * -radius).and(steer, radius * wheel.axis_along_roll()),
            on_sphere(frame.c1 * radius)
                .and(steer, -radius * wheel.axis_along_axle())
                .and(drive, wheel.spec().radius),
        ]
    }

    /// Puts the laws of this step in place; impulses go on from those of the last step, `share` times as large.
    pub(super) fn lay_out(
        &self,
        elements: &mut Vec<Element>,
        share: f64,
        state: &PlantState,
        now: &Instant,
        speeds: &Vector,
        h: f64,
    ) {
        let known = elements.len();
        let mut count = 0;
        let mut put = |law: Law, dimension: usize, rows: [Row; 3]| {
            if count < known {
                let element = &mut elements[count];
                element.impulse = element.impulse.map(|p| p * share);
                (element.law, element.rows) = (law, rows);
            } else {
                elements.push(Element { law, dimension, rows, impulse: [0.0; 3] });
            }
            count += 1;
        };
        if let Some(axis) = self.hinge {
            // Two directions in which nothing turns, whatever it takes.
            let across = axis.any_orthonormal_pair();
            put(
                Law::Friction { limit: f64::INFINITY },
                2,
                [on_sphere(across.0), on_sphere(across.1), Row::EMPTY],
            );
        }
        if let Some(cage) = self.phenomena.cage_friction {
            let rows = [0, 1, 2].map(|k| Row::EMPTY.and(k, 1.0));
            put(Law::Friction { limit: h * cage.torque }, 3, rows);
        }
        for i in 0..self.wheels() {
            let wheel = &self.device.wheels()[i];
            if let Some(slip) = self.phenomena.slip {
                let [along, across] = self.slip_rows(now, i);
                put(Law::Friction { limit: h * largest_grip(&slip) }, 2, [along, across, Row::EMPTY]);
            }
            if let Some(pivoting) = self.phenomena.pivoting {
                let row = self.spin_row(now, i, wheel.spec().cone);
                put(
                    Law::Friction { limit: h * largest_pivoting_torque(&pivoting) },
                    1,
                    [row, Row::EMPTY, Row::EMPTY],
                );
            }
            for k in 0..2 {
                let geared = self.motor_at(i).is_some() && k == 1;
                if self.phenomena.joint_friction.is_some() || geared {
                    let row = self.driven_row(now, i, k);
                    let rate = row.dot(speeds);
                    let mut limit =
                        self.phenomena.joint_friction.map_or(0.0, |friction| dry_friction(&friction, rate));
                    if geared {
                        limit += self.motors[i].loss;
                    }
                    put(Law::Friction { limit: h * limit }, 1, [row, Row::EMPTY, Row::EMPTY]);
                }
            }
            if let (Some(gear), Some(motor)) = (self.phenomena.gear, self.motor_at(i)) {
                let behind = self.motors[i].angle - state.drive[i];
                let half = 0.5 * gear.backlash;
                // What rounding of the angles leaves to either side is neither a way to go nor a reason to be thrown back.
                let rounding = 16.0 * f64::EPSILON * (1.0 + state.drive[i].abs());
                let room = |way: f64| if way > rounding { way / h } else { 0.0 };
                let law = Law::Gap { low: -room(half + behind), high: room(half - behind) };
                let row = match self.joint_at(i, 1) {
                    Some(at) => Row::EMPTY.and(motor, 1.0).and(at, -1.0),
                    None => on_sphere(-now.rows[i][1]).and(motor, 1.0),
                };
                put(law, 1, [row, Row::EMPTY, Row::EMPTY]);
            }
        }
    }

    /// The spin of a contact about its normal, wheel minus sphere, rad/s: (dth/dt) cos a - w.c3.
    fn spin_row(&self, now: &Instant, i: usize, cone: f64) -> Row {
        let normal = now.frames[i].c3;
        match self.joint_at(i, 0) {
            Some(at) => on_sphere(-normal).and(at, libm::cos(cone)),
            None => on_sphere(now.rows[i][0] * libm::cos(cone) - normal),
        }
    }

    /// Friction of the gears under load, at their motors' sides: what makes the other side get `efficiency` of the power.
    /// It depends on the very impulse that it takes from, so it is found by sweeps: this one brings each limit nearer to
    /// what the last solution's impulses would have, and says whether all were within `tolerance` of that.
    pub(super) fn mesh(&mut self, elements: &mut [Element], speeds: &Vector, h: f64, tolerance: f64) -> bool {
        let Some(gear) = self.phenomena.gear else { return true };
        let mut stands = true;
        let mut at = 0;
        for i in 0..self.wheels() {
            while !matches!(elements[at].law, Law::Gap { .. }) {
                at += 1;
            }
            let Some(rate) = self.motor_at(i).map(|at| speeds[at]) else { continue };
            let passed = elements[at].impulse[0] / h;
            let share =
                if passed * rate >= 0.0 { 1.0 / gear.efficiency - 1.0 } else { 1.0 - gear.efficiency };
            let mass = self.motor_mass(&self.device.wheels()[i]);
            let (motor, wanted) = (&mut self.motors[i], share * passed.abs());
            let off = wanted - motor.loss;
            // What would stop the motor within a step, to the digits that matter.
            let small = SMALL_LOSS * mass * motor.rate.abs().max(rate.abs()) / h;
            // The friction of a geared drive stands before its gap. A motor that it holds with either limit is held.
            let friction = &mut elements[at - 1];
            let Law::Friction { limit } = &mut friction.law else { continue };
            let held = friction.impulse[0].abs() < limit.min(*limit + h * off);
            stands &= held || off.abs() <= tolerance * wanted.max(motor.loss) + small;
            // What is passed on falls by no more than the loss grows: from below, this never goes too far.
            let change = off / (1.0 + share);
            motor.loss += change;
            *limit = (*limit + h * change).max(0.0);
            at += 1;
        }
        stands
    }

    /// Masses and momenta of this step.
    pub(super) fn assemble(
        &self,
        problem: &mut StepProblem,
        state: &PlantState,
        now: &Instant,
        given: &Given<'_>,
    ) {
        let Given { h, tau, impulse, implicit, guess, bounded } = *given;
        let n = self.size();
        problem.n = n;
        for row in &mut problem.mass[..n] {
            *row = [0.0; MAX_SPEEDS];
        }
        problem.momentum = [0.0; MAX_SPEEDS];
        for k in 0..3 {
            problem.mass[k][k] = self.inertia + implicit;
            problem.momentum[k] = self.inertia * state.omega[k] + impulse[k];
        }
        let viscous = h * self.phenomena.joint_friction.map_or(0.0, |friction| friction.viscous);
        for (i, wheel) in self.device.wheels().iter().enumerate() {
            let [steer_mass, coupling, drive_mass] = self.wheel_mass(wheel);
            let (steer, drive) = (self.rates[2 * i], self.rates[2 * i + 1]);
            let joints = [self.joint_row(now, i, 0), self.joint_row(now, i, 1)];
            problem.weigh(&joints[0], &joints[0], steer_mass + viscous);
            problem.weigh(&joints[1], &joints[1], drive_mass);
            if coupling != 0.0 {
                problem.weigh(&joints[0], &joints[1], coupling);
                problem.weigh(&joints[1], &joints[0], coupling);
            }
            let mut steer_torque = tau[2 * i];
            if let Some(modules) = &self.modules {
                let delta = h * joints[0].dot(guess);
                steer_torque += modules[i].torque_over(state.steer[i], delta);
                if bounded {
                    problem.weigh(&joints[0], &joints[0], 0.5 * h * h * modules[i].curvature());
                }
            }
            problem.push(&joints[0], steer_mass * steer + coupling * drive + h * steer_torque);
            let driven = self.driven_row(now, i, 1);
            problem.weigh(&driven, &driven, viscous);
            problem.push(&joints[1], coupling * steer + drive_mass * drive);
            problem.push(&driven, h * tau[2 * i + 1]);
            if let Some(at) = self.motor_at(i) {
                let mass = self.motor_mass(wheel);
                problem.mass[at][at] += mass;
                problem.momentum[at] += mass * self.motors[i].rate;
            }
        }
    }
}

/// What the coupling of a wheel's joints leaves of the drive's inertia to be anywhere else, kg m².
fn free_inertia(wheel: &Wheel) -> f64 {
    let spec = wheel.spec();
    let coupling = spec.axial_inertia * wheel.axis_along_axle();
    spec.drive_inertia - if coupling == 0.0 { 0.0 } else { coupling * coupling / spec.steer_inertia }
}

/// A component of the sphere's angular velocity.
fn on_sphere(v: Vec3) -> Row {
    Row::EMPTY.and(0, v.x).and(1, v.y).and(2, v.z)
}
