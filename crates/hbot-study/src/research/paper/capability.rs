//! The torque that the motors can make on the sphere (table II, section IV.B).

mod nearest;

use hbot_config::RigConfig;
use hbot_core::allocation::{ContactArms, JointLimits, capability};
use hbot_core::design::kinematics::Posture;
use hbot_core::{Device, MAX_JOINTS, Vec3};

use super::torus::{self, FOUR, Motors, THREE, posture};
use crate::context::Context;
use crate::report::{Report, row};

const AXES: [Vec3; 3] = [Vec3::X, Vec3::Y, Vec3::Z];

/// A row of the paper's table II: the torques on the sphere that the paper reports, and the motor
/// torques from which it derived them (section IV.B).
struct Row {
    id: &'static str,
    name: &'static str,
    /// Torques of a steer and of a drive motor, converted to the joint by the gear ratio, N m.
    motors: [f64; 2],
    /// Torques about n1, n2 and n3 that the paper reports, N m.
    paper: [f64; 3],
}

const ROWS: [Row; 2] = [
    Row { id: "peak", name: "peak", motors: [0.93, 0.14], paper: [1.4, 0.94, 0.84] },
    Row { id: "continuous", name: "continuous", motors: [0.073, 0.023], paper: [0.11, 0.15, 0.065] },
];

/// The prototype's geometry and the friction limit of its contacts.
struct GrippedDevice {
    device: Device,
    arms: [ContactArms; 2],
    /// Largest friction force of a contact, mu N, in N.
    grip: f64,
}

impl Row {
    fn limits(&self, motors: &Motors) -> JointLimits {
        let mut peak = [0.0; MAX_JOINTS];
        for (k, driven) in motors.driven.iter().enumerate() {
            peak[k] = if *driven { self.motors[k % 2] } else { 0.0 };
        }
        JointLimits { peak, weight: [1.0; MAX_JOINTS] }
    }

    /// Returns the largest torque about each of n1, n2 and n3 that the motors can make without
    /// torque about the other two, N m. `rows` are the rows of the matrix G at the posture.
    fn alone(&self, rows: &[Vec3], motors: &Motors) -> [f64; 3] {
        let limits = self.limits(motors);
        AXES.map(|axis| capability(rows, &limits, axis))
    }

    /// Returns the factor by which three torques differ from the paper's: the largest of the ratios
    /// of a torque to the paper's value, or the reverse. It is 1 if all agree.
    fn off(&self, torques: [f64; 3]) -> f64 {
        let ratio = |k: usize| f64::max(torques[k] / self.paper[k], self.paper[k] / torques[k]);
        // A torque of zero gives an infinite ratio.
        (0..3).map(ratio).fold(1.0, f64::max)
    }

    /// Returns the absolute values of the components about n1, n2 and n3 of the torque on the
    /// sphere if all motors give their full torque, N m. Each bit of `signs` chooses the sign of
    /// one joint torque.
    fn together(&self, rows: &[Vec3], motors: &Motors, signs: u32) -> [f64; 3] {
        let limits = self.limits(motors);
        let each = |k: usize| {
            let sign = if signs >> k & 1 == 1 { -1.0 } else { 1.0 };
            rows[k] * (sign * limits.peak[k])
        };
        (0..4).map(each).sum::<Vec3>().abs().to_array()
    }
}

impl GrippedDevice {
    fn prototype() -> Self {
        let rig = RigConfig::prototype().rig;
        let device = rig.device;
        let arms = core::array::from_fn(|k| ContactArms::of(&device.wheels()[k], device.sphere_radius()));
        let grip = rig.limits.traction.map_or(f64::INFINITY, |traction| traction.mu * traction.normal_force);
        Self { device, arms, grip }
    }

    /// Returns the largest torque about `axis` that makes no torque about other axes and exceeds
    /// neither the torque limit of a joint nor the friction limit of a contact, N m.
    ///
    /// The joint torques are tau = s (p + x n), where p makes a torque of 1 about the axis and n
    /// makes no torque on the sphere. The load of p + x n is convex in x, so a ternary search finds
    /// its minimum. With three motors there is no n.
    fn gripping(&self, posture: &Posture, limits: &JointLimits, axis: Vec3) -> f64 {
        let rows = posture.rows();
        let driven: Vec<usize> = (0..4).filter(|&k| limits.peak[k] > 0.0).collect();
        let load = |tau: &[f64; 4]| {
            let motors = (0..4).filter(|&k| tau[k] != 0.0).map(|k| tau[k].abs() / limits.peak[k]);
            let contacts = self.arms.iter().enumerate().map(|(i, arm)| {
                let [u, v] = arm.force(tau[2 * i], tau[2 * i + 1]);
                libm::hypot(u, v) / self.grip
            });
            motors.chain(contacts).fold(0.0, f64::max)
        };
        let (p, n) = solutions(rows, &driven, axis);
        let at = |x: f64| load(&core::array::from_fn(|k| p[k] + x * n[k]));
        let slope = (0..4).map(|k| if n[k] == 0.0 { 0.0 } else { n[k].abs() / limits.peak[k] });
        let slope = slope.fold(0.0, f64::max);
        if slope == 0.0 {
            return 1.0 / at(0.0);
        }
        // Beyond these ends n alone loads a motor more than p does.
        let mut ends = [-2.0 * at(0.0) / slope, 2.0 * at(0.0) / slope];
        for _ in 0..60 {
            let [a, b] = [ends[0] + (ends[1] - ends[0]) / 3.0, ends[1] - (ends[1] - ends[0]) / 3.0];
            if at(a) < at(b) {
                ends[1] = b;
            } else {
                ends[0] = a;
            }
        }
        1.0 / at(0.5 * (ends[0] + ends[1]))
    }
}

/// Returns two sets of joint torques that are orthogonal to each other. The first makes a torque of
/// 1 about `axis`, and the second makes no torque on the sphere. If only three joints have motors,
/// the second is zero.
fn solutions(rows: &[Vec3], driven: &[usize], axis: Vec3) -> ([f64; 4], [f64; 4]) {
    let det = |a: usize, b: usize, c: usize| rows[a].dot(rows[b].cross(rows[c]));
    let mut none = [0.0; 4];
    let three = if let [a, b, c] = driven {
        [*a, *b, *c]
    } else {
        // Cramer's rule: the minors of the 3 x 4 matrix, with alternating signs.
        none = [det(1, 2, 3), -det(0, 2, 3), det(0, 1, 3), -det(0, 1, 2)];
        let largest = (0..4).max_by(|a, b| none[*a].abs().total_cmp(&none[*b].abs())).unwrap_or(0);
        let mut others = (0..4).filter(|k| *k != largest);
        core::array::from_fn(|_| others.next().unwrap_or(0))
    };
    let [a, b, c] = three.map(|k| rows[k]);
    let whole = a.dot(b.cross(c));
    let mut particular = [0.0; 4];
    for (k, minor) in three.iter().zip([b.cross(c), c.cross(a), a.cross(b)]) {
        particular[*k] = axis.dot(minor) / whole;
    }
    let square: f64 = none.iter().map(|x| x * x).sum();
    if square > 0.0 {
        let along: f64 = particular.iter().zip(&none).map(|(p, n)| p * n).sum::<f64>() / square;
        for (p, n) in particular.iter_mut().zip(&none) {
            *p -= along * n;
        }
    }
    (particular, none)
}

/// Returns the smallest value, the mean, the median and the largest value of `values`.
fn statistics(mut values: Vec<f64>) -> [f64; 4] {
    values.sort_by(f64::total_cmp);
    let count = values.len();
    let middle = 0.5 * (values[(count - 1) / 2] + values[count / 2]);
    [values[0], torus::mean(values.iter().copied()), middle, values[count - 1]]
}

const STATISTICS: [&str; 4] = ["least", "mean", "median", "largest"];

pub(super) fn study(context: &Context, report: &mut Report) {
    context.part("torque capability");
    let rig = GrippedDevice::prototype();
    introduce(report, rig.grip);
    let kept = over_torus(context, report, &rig);
    check(report, &rig);
    context.part("postures that would give table II");
    nearest::study(context, report, &rig, &kept);
}

fn introduce(report: &mut Report, grip: f64) {
    report.heading("Torque capability (table II)");
    report.say(&format!(
        "The largest torque about each axis alone (none about the others) that the motors of section IV.B can give: 0.93 N m at a steer and 0.14 N m at a drive at peak, 0.073 and 0.023 N m \
         continuously; over even cells of all steering angles, the least by search between them. *With grip*, no contact carries more than mu N = {:.0} N either, in the best distribution over the joints.",
        grip
    ));
    report.family("{limit}_torque_{axis}_{motors}_{contact}_{statistic}_nm | N m | largest torque about {axis} alone; {limit}: peak or continuous; {motors}: four_motors, three_motors; {contact}: free, or grip (no contact beyond mu N = 8 N); {statistic} over all \
         steering angles: least, mean, median, largest");
    report.family("{limit}_torque_{axis}_nm | N m | what the rig can give whatever its posture: the least with all four motors, contacts free, beside the paper's table II");
}

/// Reports the torques that the prototype can make over all postures: with four and with three
/// motors, and with and without a friction limit of the contacts. Returns two sets of torques about
/// n1, n2 and n3 for each row of table II, both without the friction limit: the smallest over all
/// postures with four motors, and the medians with three.
fn over_torus(context: &Context, report: &mut Report, rig: &GrippedDevice) -> [[[f64; 3]; 2]; 2] {
    let cells = if context.quick { 48 } else { 120 };
    let mut table =
        vec![row(["motors, contacts", "torque", "axis", "paper", "least", "mean", "median", "largest, N m"])];
    let mut kept = [[[0.0; 3]; 2]; 2];
    for motors in [FOUR, THREE] {
        for (contact, grip) in [("free", false), ("grip", true)] {
            for (number, limit) in ROWS.iter().enumerate() {
                let limits = limit.limits(&motors);
                let about = |th, axis| {
                    let posture = posture(&rig.device, th);
                    if grip {
                        rig.gripping(&posture, &limits, axis)
                    } else {
                        capability(posture.rows(), &limits, axis)
                    }
                };
                let all = torus::over(cells, |th| AXES.map(|axis| about(th, axis)));
                for axis in 0..3 {
                    let mut found = statistics(all.iter().map(|torques| torques[axis]).collect());
                    // A search between the cells finds a smaller minimum.
                    found[0] = torus::least(48, |th| about(th, AXES[axis])).1;
                    if !grip {
                        kept[number][usize::from(motors == THREE)][axis] =
                            found[if motors == THREE { 2 } else { 0 }];
                    }
                    table.push(tell(report, &motors, contact, limit, axis, found));
                }
            }
        }
    }
    report.table(&table);
    kept
}

/// Reports statistics, over all postures, of the torque that the motors can make about one axis.
/// Returns the row of the table for this axis. `contact` is `grip` if friction limits the contact
/// forces, otherwise `free`.
fn tell(
    report: &mut Report,
    motors: &Motors,
    contact: &str,
    limit: &Row,
    axis: usize,
    found: [f64; 4],
) -> Vec<String> {
    let name = format!("n{}", axis + 1);
    for (statistic, value) in STATISTICS.iter().zip(found) {
        let id = format!("{}_torque_{name}_{}_{contact}_{statistic}_nm", limit.id, motors.id);
        report.figure(id, value);
    }
    let grip = contact == "grip";
    if *motors == FOUR && !grip {
        let id = format!("{}_torque_{name}_nm", limit.id);
        report.figure(id, found[0]).note("paper", limit.paper[axis]);
    }
    let contact = if grip { "with grip" } else { "free" };
    let mut cells = row([&format!("{}, {contact}", motors.name), limit.name, &name]);
    cells.push(limit.paper[axis].to_string());
    cells.extend(found.map(|value| format!("{value:.3}")));
    cells
}

/// Checks that two functions compute the same largest torques if the friction of the contacts sets
/// no limit: [`GrippedDevice::gripping`] and the core's [`capability`].
fn check(report: &mut Report, rig: &GrippedDevice) {
    let loose = GrippedDevice {
        grip: f64::INFINITY,
        ..GrippedDevice { device: rig.device, arms: rig.arms, grip: 0.0 }
    };
    let mut worst: f64 = 0.0;
    for th in torus::over(12, |th| th) {
        let posture = posture(&rig.device, th);
        for motors in [FOUR, THREE] {
            let limits = ROWS[0].limits(&motors);
            for axis in AXES {
                let facets = capability(posture.rows(), &limits, axis);
                worst = worst.max((loose.gripping(&posture, &limits, axis) / facets - 1.0).abs());
            }
        }
    }
    // After 60 steps the ternary search has 3e-11 of the interval left. The rest is rounding near
    // singular postures.
    report.check(
        "the controller's capability (facets) and a search over joint torques agree to 1e-8",
        format!("{worst:.1e}"),
        worst < 1.0e-8,
    );
}
