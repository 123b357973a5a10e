//! Builds the problem of one step for the solver: masses, momenta, and the laws of friction, slip
//! and play.

use hbot_core::design::device::{Device, MAX_JOINTS, MAX_WHEELS, Wheel};
use hbot_core::design::kinematics::ContactFrame;
use hbot_core::{Vec3, rotation};

use super::super::weights::Module;
use super::compliance::{Bent, Springs};
use super::law::{Element, Law, Row};
use super::solver::StepProblem;
use super::{Frictions, JointTorques, MAX_SPEEDS, Motor, PlantState, Vector};
use crate::phenomena::{Phenomena, dry_friction, largest_grip, largest_pivoting_torque};

/// Error of a gear's friction loss that is ignored, as a fraction of the torque that would stop the
/// gear's motor in one step.
const SMALL_LOSS: f64 = 1.0e-9;

/// Inertia that a joint without inertia gets in the solver, as a fraction of the sphere's inertia.
/// It is a thousandth of a real joint's inertia. With a much smaller value, the solver would lose
/// digits.
const LEAST_MASS: f64 = 1.0e-6;

/// The geometry of all contacts at the middle of a step. It is held constant during the step.
pub(super) struct Instant {
    frames: [ContactFrame; MAX_WHEELS],
    /// Distance of each contact from the centre O of rotation, m.
    radius: [f64; MAX_WHEELS],
    /// Rows of the matrix G (steer, drive) of each wheel. They give the joint rates from the
    /// sphere's angular velocity, for a wheel that does not slip.
    pub(super) rows: [[Vec3; 2]; MAX_WHEELS],
}

/// The torques and impulses that act on the plant during one step, and a guess of the speeds at the
/// end of the step.
pub(super) struct Given<'a> {
    pub(super) h: f64,
    pub(super) tau: &'a JointTorques,
    /// Angular impulse of the torques on the sphere over the step, N m s.
    pub(super) impulse: Vec3,
    /// Inertia that is added to the sphere's inertia for this step, kg m². It represents torques
    /// that fall as the sphere's speed rises, such as damping.
    pub(super) implicit: f64,
    /// Guess of the speeds at the end of the step. The torques of the wheel modules are averaged
    /// over the motion that results from these speeds.
    pub(super) guess: &'a Vector,
    /// Whether to add a stiffness that prevents the step from adding energy. This is needed if
    /// `guess` is zero and not yet the result of an earlier solution.
    pub(super) bounded: bool,
}

/// The moving parts of a plant that can stick, slip or have play: sphere, wheels and motors, with
/// the rates of the joints and motors.
#[derive(Debug, Clone)]
pub(super) struct Body {
    pub(super) device: Device,
    pub(super) phenomena: Phenomena,
    /// Friction of each joint and of the sphere, which is added to that of the phenomena.
    pub(super) frictions: Option<Frictions>,
    /// Inertia of the sphere (I_s) and of anything attached to it, such as a hand, kg m².
    pub(super) inertia: f64,
    pub(super) modules: Option<[Module; MAX_WHEELS]>,
    /// Joint rates, measured at the wheel's side of a gear, rad/s.
    pub(super) rates: [f64; MAX_JOINTS],
    pub(super) motors: [Motor; MAX_WHEELS],
    /// The only axis about which the sphere can turn, as a unit vector in frame N. `None` if the
    /// sphere can turn about any axis.
    pub(super) hinge: Option<Vec3>,
    /// How far contacts and cage have given way. Zero without the phenomenon compliance.
    pub(super) bent: Bent,
}

impl Body {
    pub(super) fn wheels(&self) -> usize {
        self.device.wheels().len()
    }

    /// Returns the index of a joint's rate in the solver's vector of speeds (`k` is 0 for steer, 1
    /// for drive). Returns `None` if the wheels can neither slip nor give way, because the sphere's
    /// rate then determines the joint's rate.
    pub(super) fn joint_at(&self, wheel: usize, k: usize) -> Option<usize> {
        self.has_free_joints().then_some(3 + 2 * wheel + k)
    }

    /// Returns the index of the rate of a drive's motor in the solver's vector of speeds. Returns
    /// `None` if the gears have no play, because the motor then turns with its joint.
    pub(super) fn motor_at(&self, wheel: usize) -> Option<usize> {
        let first = if self.has_free_joints() { 3 + 2 * self.wheels() } else { 3 };
        self.phenomena.gear.map(|_| first + wheel)
    }

    /// Returns whether the joints can move separately from the sphere.
    fn has_free_joints(&self) -> bool {
        self.phenomena.slip.is_some() || self.phenomena.compliance.is_some()
    }

    /// Returns the index of the first component of the velocity of the sphere's centre in the
    /// solver's vector of speeds. Returns `None` if the cage does not give way.
    pub(super) fn centre_at(&self) -> Option<usize> {
        self.phenomena.compliance.map(|_| self.size() - 3)
    }

    /// Returns the number of speeds for which the solver solves: those of the sphere, those of
    /// joints and motors that can move separately, and those of the sphere's centre.
    fn size(&self) -> usize {
        let joints = if self.has_free_joints() { 2 } else { 0 };
        let motors = if self.phenomena.gear.is_some() { 1 } else { 0 };
        let centre = if self.phenomena.compliance.is_some() { 3 } else { 0 };
        3 + self.wheels() * (joints + motors) + centre
    }

    /// Returns the inertias of a wheel's joints, kg m²: steer, coupling of steer and drive, drive.
    /// If a gear with play separates a motor from its wheel, the motor's inertia is not included.
    pub(super) fn wheel_mass(&self, wheel: &Wheel) -> [f64; 3] {
        let spec = wheel.spec();
        let coupling = spec.axial_inertia * wheel.axis_along_axle();
        let least = self.least_mass();
        let share = self.phenomena.gear.map_or(0.0, |gear| gear.rotor_share);
        let drive = spec.drive_inertia - share * free_inertia(wheel);
        [spec.steer_inertia.max(least), coupling, drive.max(least)]
    }

    /// Returns the inertia of the motor behind a drive's gear, scaled to the joint, kg m².
    ///
    /// It is a share of that part of the drive inertia that the coupling of steer and drive does
    /// not need. The inertia that remains for the wheel therefore stays physically possible.
    pub(super) fn motor_mass(&self, wheel: &Wheel) -> f64 {
        self.phenomena
            .gear
            .map_or(0.0, |gear| (gear.rotor_share * free_inertia(wheel)).max(self.least_mass()))
    }

    /// Returns the smallest inertia that a joint must have in the solver, kg m². A device can have
    /// joints without inertia, because without slip the sphere determines their motion. With slip
    /// or play they can move separately, so they need some inertia.
    fn least_mass(&self) -> f64 {
        let apart = self.has_free_joints() || self.phenomena.gear.is_some();
        if apart { LEAST_MASS * self.device.sphere_inertia() } else { 0.0 }
    }

    /// Returns the geometry of the contacts at a time `ahead` seconds after `state`, assuming that
    /// the present rates do not change.
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

    /// Returns the present speeds as the solver's vector: those of the sphere, then those of joints
    /// and motors that can move separately.
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
        if let Some(at) = self.centre_at() {
            speeds[at..at + 3].copy_from_slice(&self.bent.velocity.to_array());
        }
        speeds
    }

    /// Returns a linear combination of the solver's speeds: the rate of a joint, on the wheel's
    /// side of its gear.
    fn joint_row(&self, now: &Instant, wheel: usize, k: usize) -> Row {
        match self.joint_at(wheel, k) {
            Some(at) => Row::EMPTY.and(at, 1.0),
            None => on_sphere(now.rows[wheel][k]),
        }
    }

    /// Returns a linear combination of the solver's speeds: the rate of the shaft on which a
    /// joint's motor, encoder and friction act. With play in the gear, this is the motor's shaft.
    fn driven_row(&self, now: &Instant, wheel: usize, k: usize) -> Row {
        match self.motor_at(wheel).filter(|_| k == 1) {
            Some(at) => Row::EMPTY.and(at, 1.0),
            None => self.joint_row(now, wheel, k),
        }
    }

    /// Returns two linear combinations of the solver's speeds: the components of the slip velocity
    /// H zd + Z w of contact `i`, wheel minus sphere, in m/s. The first is along the wheel's axle
    /// (c1), the second along its rolling direction (c2).
    pub(super) fn slip_rows(&self, now: &Instant, i: usize) -> [Row; 2] {
        let (wheel, frame, radius) = (&self.device.wheels()[i], &now.frames[i], now.radius[i]);
        let (Some(steer), Some(drive)) = (self.joint_at(i, 0), self.joint_at(i, 1)) else {
            return [Row::EMPTY; 2];
        };
        let rows = [
            on_sphere(frame.c2 * -radius).and(steer, radius * wheel.axis_along_roll()),
            on_sphere(frame.c1 * radius)
                .and(steer, -radius * wheel.axis_along_axle())
                .and(drive, wheel.spec().radius),
        ];
        let Some(at) = self.centre_at() else { return rows };
        // The surface moves with the centre too.
        let [along, across] = rows;
        let with = |row: Row, v: Vec3| row.and(at, -v.x).and(at + 1, -v.y).and(at + 2, -v.z);
        [with(along, frame.c1), with(across, frame.c2)]
    }

    /// Writes the laws of friction, slip and play for this step to `elements`. The impulses of the
    /// previous step, multiplied by `share`, are the solver's start values.
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
            // Two directions across the axis in which friction of infinite limit prevents any turn.
            let across = axis.any_orthonormal_pair();
            put(
                Law::Friction { limit: f64::INFINITY },
                2,
                [on_sphere(across.0), on_sphere(across.1), Row::EMPTY],
            );
        }
        let cage = self.phenomena.cage_friction.map_or(0.0, |cage| cage.torque)
            + self.frictions.map_or(0.0, |frictions| frictions.sphere.coulomb);
        if self.phenomena.cage_friction.is_some() || cage > 0.0 {
            let rows = [0, 1, 2].map(|k| Row::EMPTY.and(k, 1.0));
            put(Law::Friction { limit: h * cage }, 3, rows);
        }
        for i in 0..self.wheels() {
            let wheel = &self.device.wheels()[i];
            if let Some(slip) = self.phenomena.slip {
                let [along, across] = self.slip_rows(now, i);
                let grip = largest_grip(&slip);
                let law = match self.springs(h) {
                    None => Law::Friction { limit: h * grip },
                    Some(springs) => {
                        self.bent.law(&springs, i, [along.dot(speeds), across.dot(speeds)], grip)
                    }
                };
                put(law, 2, [along, across, Row::EMPTY]);
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
                if self.phenomena.joint_friction.is_some() || self.frictions.is_some() || geared {
                    let row = self.driven_row(now, i, k);
                    let rate = row.dot(speeds);
                    let mut limit =
                        self.phenomena.joint_friction.map_or(0.0, |friction| dry_friction(&friction, rate));
                    limit += self.frictions.map_or(0.0, |frictions| frictions.joints[2 * i + k].coulomb);
                    if geared {
                        limit += self.motors[i].loss;
                    }
                    put(Law::Friction { limit: h * limit }, 1, [row, Row::EMPTY, Row::EMPTY]);
                }
            }
            if let (Some(gear), Some(motor)) = (self.phenomena.gear, self.motor_at(i)) {
                let behind = self.motors[i].angle - state.drive[i];
                let half = 0.5 * gear.backlash;
                // A distance within the rounding of the angles counts as no room. It neither allows
                // motion nor pushes the gear back.
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

    /// Returns a linear combination of the solver's speeds: the spin of contact `i` about its
    /// normal c3, wheel minus sphere, in rad/s. It is (dth/dt) cos a - w.c3, where a is the cone
    /// angle `cone`.
    fn spin_row(&self, now: &Instant, i: usize, cone: f64) -> Row {
        let normal = now.frames[i].c3;
        match self.joint_at(i, 0) {
            Some(at) => on_sphere(-normal).and(at, libm::cos(cone)),
            None => on_sphere(now.rows[i][0] * libm::cos(cone) - normal),
        }
    }

    /// Updates the friction loss of each gear under load, as a torque on the motor's side. It is
    /// the loss with which a gear passes on the share `efficiency` of the power.
    ///
    /// The loss depends on the impulse that the gear passes on, and this impulse depends on the
    /// loss. The two are therefore computed in turn: each call moves the friction limits closer to
    /// those that follow from the last solution. Returns whether all limits were already within
    /// `tolerance`.
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
            // A negligible part of the torque that would stop the motor within a step.
            let small = SMALL_LOSS * mass * motor.rate.abs().max(rate.abs()) / h;
            // The friction of a geared drive is the element before its gap. If both limits hold the
            // motor, the loss need not be exact.
            let friction = &mut elements[at - 1];
            let Law::Friction { limit } = &mut friction.law else { continue };
            let held = friction.impulse[0].abs() < limit.min(*limit + h * off);
            stands &= held || off.abs() <= tolerance * wanted.max(motor.loss) + small;
            // The torque passed on falls by at most the growth of the loss. From below, this update
            // cannot overshoot.
            let change = off / (1.0 + share);
            motor.loss += change;
            *limit = (*limit + h * change).max(0.0);
            at += 1;
        }
        stands
    }

    /// Writes the mass matrix and the momentum of this step to `problem`.
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
            let viscous = self.frictions.map_or(0.0, |frictions| frictions.sphere.viscous);
            problem.mass[k][k] = self.inertia + implicit + h * viscous;
            problem.momentum[k] = self.inertia * state.omega[k] + impulse[k];
        }
        let viscous = |j: usize| {
            let all = self.phenomena.joint_friction.map_or(0.0, |friction| friction.viscous);
            h * (all + self.frictions.map_or(0.0, |frictions| frictions.joints[j].viscous))
        };
        for (i, wheel) in self.device.wheels().iter().enumerate() {
            let [steer_mass, coupling, drive_mass] = self.wheel_mass(wheel);
            let (steer, drive) = (self.rates[2 * i], self.rates[2 * i + 1]);
            let joints = [self.joint_row(now, i, 0), self.joint_row(now, i, 1)];
            problem.weigh(&joints[0], &joints[0], steer_mass + viscous(2 * i));
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
            problem.weigh(&driven, &driven, viscous(2 * i + 1));
            problem.push(&joints[1], coupling * steer + drive_mass * drive);
            problem.push(&driven, h * tau[2 * i + 1]);
            if let Some(at) = self.motor_at(i) {
                let mass = self.motor_mass(wheel);
                problem.mass[at][at] += mass;
                problem.momentum[at] += mass * self.motors[i].rate;
            }
        }
        if let (Some(springs), Some(at)) = (self.springs(h), self.centre_at()) {
            problem.springs = true;
            self.bent.hold_centre(problem, &springs, self.device.sphere_mass(), at);
            if self.phenomena.slip.is_none() {
                let before = self.speeds(state);
                for i in 0..self.wheels() {
                    self.bent.hold(problem, &springs, i, &self.slip_rows(now, i), &before);
                }
            }
        }
    }

    /// Returns whether angles advance at the mean of the speeds before and after a step, instead of
    /// the speeds after it.
    ///
    /// Then springs of contacts have no numerical damping, and a torque acts neither early nor
    /// late. The flanks of a gear need the speeds after the step, so that they never pass each
    /// other.
    pub(super) fn has_mean_angles(&self) -> bool {
        self.phenomena.compliance.is_some() && self.phenomena.gear.is_none()
    }

    /// Returns the springs of contacts and cage in a step of `h` seconds, if there are any.
    fn springs(&self, h: f64) -> Option<Springs> {
        let late = if self.has_mean_angles() { 0.5 } else { 1.0 };
        self.phenomena.compliance.map(|parts| Springs { parts, late, h })
    }

    /// Stores the speeds of the sphere in `state`, and those of the joints.
    pub(super) fn store_rates(&mut self, state: &mut PlantState, now: &Instant, speeds: &Vector) {
        state.omega = Vec3::from_slice(&speeds[..3]);
        for i in 0..self.wheels() {
            for k in 0..2 {
                self.rates[2 * i + k] = match self.joint_at(i, k) {
                    Some(at) => speeds[at],
                    None => now.rows[i][k].dot(state.omega),
                };
            }
        }
    }

    /// Advances the stretches of all parts that give way over a step of `h` seconds from the speeds
    /// `before` to the speeds `after`. `elements` are the laws of the step with their impulses.
    pub(super) fn bend(
        &mut self,
        elements: &[Element],
        now: &Instant,
        [before, after]: [&Vector; 2],
        h: f64,
    ) {
        let (Some(springs), Some(at)) = (self.springs(h), self.centre_at()) else { return };
        let mut slid = elements.iter().filter(|element| matches!(element.law, Law::Elastic { .. }));
        for i in 0..self.wheels() {
            let mixed = |row: Row| springs.mixed(row.dot(before), row.dot(after));
            self.bent.stretch(&springs, i, self.slip_rows(now, i).map(mixed), slid.next());
        }
        self.bent.move_centre(&springs, Vec3::from_slice(&after[at..at + 3]));
    }
}

/// Returns the part of a wheel's drive inertia that can be moved to its motor, J_ph - J_c² / J_th,
/// kg m². The rest must stay at the wheel because of the coupling J_c of steer and drive.
fn free_inertia(wheel: &Wheel) -> f64 {
    let spec = wheel.spec();
    let coupling = spec.axial_inertia * wheel.axis_along_axle();
    spec.drive_inertia - if coupling == 0.0 { 0.0 } else { coupling * coupling / spec.steer_inertia }
}

/// Returns a linear combination of the solver's speeds: the component of the sphere's angular
/// velocity along `v`.
fn on_sphere(v: Vec3) -> Row {
    Row::EMPTY.and(0, v.x).and(1, v.y).and(2, v.z)
}
