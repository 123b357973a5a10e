//! The joint motion that no turn of the sphere explains, and its derivatives.
//!
//! Without slip the joints of all wheels move by G w if the sphere turns by w
//! (docs/internals/physics.md, section 2). The rest of their motion, after the best turn w, is the
//! *residual*. It is measured in standard deviations of the rounding of a count, so that a coarse
//! steer encoder does not outweigh a fine drive encoder. Therefore the best turn here is not that
//! of the control law, which minimises the slip in m/s.
//!
//! The residual is a projection: e = (1 - G (GᵀG)⁻¹ Gᵀ) z with the scaled joint motion z. That
//! makes the sum of squares of e that of total least squares: the rounding does not pull the
//! parameters to one side, as it would in a regression on measured steer angles.

use hbot_core::design::kinematics::{ContactFrame, Posture};
use hbot_core::{Device, MAX_JOINTS, MAX_WHEELS, Mat3, Rig, Vec3};

use crate::motion::Step;
use crate::parameter::OF_WHEEL;

/// A wheel whose parameters are those of a guess.
#[derive(Debug, Clone, Copy)]
struct Wheel {
    /// The frame at the joint angle zero: its third column is the steer axis.
    frame: Mat3,
    /// Maps a small change of the three angles of the frame's turn to the turn that it causes, in
    /// the frame.
    turned: Mat3,
    sin_cone: f64,
    cos_cone: f64,
    sin_toe: f64,
    cos_toe: f64,
    /// Radius of the wheel divided by that of the sphere.
    ratio: f64,
    disc: [f64; 2],
    /// Turns of the steer encoder for one turn of the joint.
    gear: f64,
}

/// The geometry of a rig for one guess of all unknowns.
#[derive(Debug, Clone)]
pub struct Model {
    wheels: Vec<Wheel>,
    /// Offset of the sphere's centre divided by the sphere's radius.
    centre: Vec3,
    /// One over the standard deviation of the rounding of each joint.
    scale: [f64; MAX_JOINTS],
    sphere_radius: f64,
}

/// The residual of one step.
#[derive(Debug, Clone)]
pub struct Residual {
    /// Residual of each joint, in standard deviations of the rounding of a count.
    pub value: [f64; MAX_JOINTS],
    /// Turn of the sphere that explains the step best, as a rotation vector in frame N, rad.
    pub turn: Vec3,
    /// Derivative of `value` by each unknown. Empty if it was not asked for.
    pub by: Vec<[f64; MAX_JOINTS]>,
    /// Slip of each wheel along its axle and its rolling direction, m.
    pub slip: [[f64; 2]; MAX_WHEELS],
    /// Distance that each wheel rolls, m.
    pub rolled: [f64; MAX_WHEELS],
}

impl Residual {
    /// Creates a residual with room for the derivatives by `unknowns` unknowns, 0 if they are not
    /// wanted.
    #[must_use]
    pub fn new(unknowns: usize) -> Self {
        Self {
            value: [0.0; MAX_JOINTS],
            turn: Vec3::ZERO,
            by: vec![[0.0; MAX_JOINTS]; unknowns],
            slip: [[0.0; 2]; MAX_WHEELS],
            rolled: [0.0; MAX_WHEELS],
        }
    }
}

impl Model {
    /// Creates the geometry of `rig` changed by `unknowns`, in the order of
    /// [`parameter::all`](crate::parameter::all). `rounding` is the standard deviation of the
    /// rounding of each joint's angle, rad.
    #[must_use]
    pub fn new(rig: &Rig, unknowns: &[f64], rounding: &[f64; MAX_JOINTS]) -> Self {
        let device = &rig.device;
        let wheels = device.wheels().iter().enumerate().map(|(i, wheel)| {
            let of = &unknowns[OF_WHEEL * i..OF_WHEEL * (i + 1)];
            let turn = Vec3::new(of[0], of[1], of[2]);
            let spec = wheel.spec();
            let (sin_cone, cos_cone) = (spec.cone + of[3]).sin_cos();
            let (sin_toe, cos_toe) = (spec.toe + of[4]).sin_cos();
            Wheel {
                frame: frame_at_zero(device, i) * exp(turn),
                turned: right_jacobian(turn),
                sin_cone,
                cos_cone,
                sin_toe,
                cos_toe,
                ratio: spec.radius / device.sphere_radius() * of[5].exp(),
                disc: [of[6], of[7]],
                gear: rig.joints[2 * i].gear,
            }
        });
        let wheels: Vec<Wheel> = wheels.collect();
        let centre = &unknowns[OF_WHEEL * wheels.len()..];
        let mut scale = [0.0; MAX_JOINTS];
        for (scale, rounding) in scale.iter_mut().zip(rounding).take(device.joints()) {
            *scale = 1.0 / rounding;
        }
        let sphere_radius = device.sphere_radius();
        let centre = Vec3::new(centre[0], centre[1], centre[2]) / sphere_radius;
        Self { wheels, centre, scale, sphere_radius }
    }

    /// Computes the residual of `step` into `out`, with its derivatives if `out` has room for them.
    pub fn residual(&self, step: Step<'_>, out: &mut Residual) {
        let mut here = Here::default();
        let joints = 2 * self.wheels.len();
        let mut normal = [[0.0; 3]; 3];
        for (i, wheel) in self.wheels.iter().enumerate() {
            self.place(wheel, i, step, &mut here);
        }
        let mut right = Vec3::ZERO;
        for j in 0..joints {
            let row = here.rows[j];
            right += row * here.moved[j];
            for (a, normal) in normal.iter_mut().enumerate() {
                for (b, value) in normal.iter_mut().enumerate() {
                    *value += row[a] * row[b];
                }
            }
        }
        let inverse = Mat3::from_cols_array_2d(&normal).inverse();
        let turn = inverse * right;
        out.turn = turn;
        for j in 0..joints {
            out.value[j] = here.moved[j] - here.rows[j].dot(turn);
        }
        self.slips(&here, out);
        if !out.by.is_empty() {
            self.derivatives(&here, inverse, out);
        }
    }

    /// Computes the contact frame, the rows of G and the true joint motion of wheel `i` in `step`.
    fn place(&self, wheel: &Wheel, i: usize, step: Step<'_>, here: &mut Here) {
        let [begin, end] = step.ends;
        let mid = 0.5 * (begin[2 * i] + end[2 * i]);
        let disc = |angle: f64| {
            let (sin, cos) = (angle * wheel.gear).sin_cos();
            Vec2 { cos: cos / wheel.gear, sin: sin / wheel.gear }
        };
        let (at, first, last) = (disc(mid), disc(begin[2 * i]), disc(end[2 * i]));
        here.disc[i] = at;
        here.disc_moved[i] = Vec2 { cos: last.cos - first.cos, sin: last.sin - first.sin };
        let error = |of: Vec2| wheel.disc[0] * of.cos + wheel.disc[1] * of.sin;
        let (sin, cos) = (mid - error(at)).sin_cos();
        let turn = |x: f64, y: f64, z: f64| wheel.frame * Vec3::new(cos * x - sin * y, sin * x + cos * y, z);
        let Wheel { sin_cone: sa, cos_cone: ca, sin_toe: sb, cos_toe: cb, ratio, .. } = *wheel;
        let (c1, c2, c3) = (turn(cb, ca * sb, sa * sb), turn(-sb, ca * cb, sa * cb), turn(0.0, -sa, ca));
        let steers = 1.0 / (sa * cb);
        let reach = 1.0 / (1.0 + self.centre.dot(c3));
        let drive = (c2 * (sb / cb) - c1) / ratio;
        here.frames[i] = [c1, c2, c3];
        here.node[i] = turn(1.0, 0.0, 0.0);
        here.reach[i] = reach;
        here.rows[2 * i] = c2 * (steers * reach * self.scale[2 * i]);
        here.rows[2 * i + 1] = drive * self.scale[2 * i + 1];
        let steered = end[2 * i] - begin[2 * i] - error(here.disc_moved[i]);
        here.moved[2 * i] = steered * self.scale[2 * i];
        here.moved[2 * i + 1] = (end[2 * i + 1] - begin[2 * i + 1]) * self.scale[2 * i + 1];
    }

    /// Computes the slip and the rolling distance of each wheel.
    fn slips(&self, here: &Here, out: &mut Residual) {
        for (i, wheel) in self.wheels.iter().enumerate() {
            let [steer, drive] = [2 * i, 2 * i + 1].map(|j| out.value[j] / self.scale[j]);
            let rolled = here.moved[2 * i + 1] / self.scale[2 * i + 1];
            let (r, big) = (wheel.ratio * self.sphere_radius, self.sphere_radius / here.reach[i]);
            out.slip[i] = [
                big * wheel.sin_cone * wheel.cos_toe * steer,
                r * drive - big * wheel.sin_cone * wheel.sin_toe * steer,
            ];
            out.rolled[i] = (r * rolled).abs();
        }
    }

    /// Computes the derivatives of the residual by all unknowns.
    fn derivatives(&self, here: &Here, inverse: Mat3, out: &mut Residual) {
        let wheels = self.wheels.len();
        let mut centre = [[Vec3::ZERO; MAX_JOINTS]; 3];
        for (i, wheel) in self.wheels.iter().enumerate() {
            let [c1, _, c3] = here.frames[i];
            let rows = [here.rows[2 * i], here.rows[2 * i + 1]];
            let reach = here.reach[i];
            // A turn of the wheel by `about` changes its rows, and with an offset sphere also how
            // far the contact is from the centre.
            let turned = |about: Vec3| {
                let less = reach * self.centre.dot(about.cross(c3));
                [about.cross(rows[0]) - rows[0] * less, about.cross(rows[1])]
            };
            let axis = wheel.frame.col(2);
            let tan = wheel.sin_toe / wheel.cos_toe;
            let mut put = |k: usize, rows: [Vec3; 2], moved: f64| {
                here.put(i, rows, moved, inverse, out, OF_WHEEL * i + k);
            };
            for k in 0..3 {
                put(k, turned(wheel.frame * wheel.turned.col(k)), 0.0);
            }
            let [steer, drive] = turned(here.node[i]);
            put(3, [steer - rows[0] * (wheel.cos_cone / wheel.sin_cone), drive], 0.0);
            let steers = reach * self.scale[2 * i] / (wheel.sin_cone * wheel.cos_toe);
            put(4, [rows[0] * tan - c1 * steers, rows[1] * tan], 0.0);
            put(5, [Vec3::ZERO, -rows[1]], 0.0);
            let by_angle = turned(axis);
            let (at, moved) = (here.disc[i], here.disc_moved[i]);
            for (k, (at, moved)) in [(6, (at.cos, moved.cos)), (7, (at.sin, moved.sin))] {
                put(k, by_angle.map(|row| row * -at), -moved * self.scale[2 * i]);
            }
            for (k, centre) in centre.iter_mut().enumerate() {
                centre[2 * i] = rows[0] * (-reach * c3[k] / self.sphere_radius);
            }
        }
        for (k, change) in centre.iter().enumerate() {
            here.put_all(wheels, change, inverse, out, OF_WHEEL * wheels + k);
        }
    }
}

#[derive(Debug, Clone, Copy, Default)]
struct Vec2 {
    cos: f64,
    sin: f64,
}

/// The geometry in the middle of a step.
#[derive(Debug, Clone, Default)]
struct Here {
    frames: [[Vec3; 3]; MAX_WHEELS],
    /// The axis about which the cone angle turns the contact frame.
    node: [Vec3; MAX_WHEELS],
    /// The sphere's radius divided by the distance of the contact from the point where the steer
    /// axes meet.
    reach: [f64; MAX_WHEELS],
    /// Rows of G, each divided by the rounding of its joint.
    rows: [Vec3; MAX_JOINTS],
    /// Joint motion, divided by the rounding.
    moved: [f64; MAX_JOINTS],
    disc: [Vec2; MAX_WHEELS],
    disc_moved: [Vec2; MAX_WHEELS],
}

impl Here {
    /// Stores the derivative of the residual by unknown `unknown`, which changes the rows of wheel
    /// `i` by `rows` and its steer motion by `moved`.
    fn put(&self, i: usize, rows: [Vec3; 2], moved: f64, inverse: Mat3, out: &mut Residual, unknown: usize) {
        let joints = [2 * i, 2 * i + 1];
        // The change of the residual if the turn stays.
        let direct = [moved - rows[0].dot(out.turn), -rows[1].dot(out.turn)];
        let mut right = Vec3::ZERO;
        for ((j, row), direct) in joints.into_iter().zip(rows).zip(direct) {
            right += row * out.value[j] + self.rows[j] * direct;
        }
        self.spread(inverse * right, joints.into_iter().zip(direct), out, unknown);
    }

    /// Stores the derivative of the residual by unknown `unknown`, which changes the rows of all
    /// wheels by `rows`.
    fn put_all(
        &self,
        wheels: usize,
        rows: &[Vec3; MAX_JOINTS],
        inverse: Mat3,
        out: &mut Residual,
        unknown: usize,
    ) {
        let direct: [f64; MAX_JOINTS] = core::array::from_fn(|j| -rows[j].dot(out.turn));
        let right = (0..2 * wheels)
            .fold(Vec3::ZERO, |sum, j| sum + rows[j] * out.value[j] + self.rows[j] * direct[j]);
        self.spread(inverse * right, direct.into_iter().enumerate().take(2 * wheels), out, unknown);
    }

    /// Stores the direct change of the residual, and that which the change `turn` of the turn
    /// causes.
    fn spread(
        &self,
        turn: Vec3,
        direct: impl Iterator<Item = (usize, f64)>,
        out: &mut Residual,
        unknown: usize,
    ) {
        let by = &mut out.by[unknown];
        for (by, row) in by.iter_mut().zip(&self.rows) {
            *by = -row.dot(turn);
        }
        for (j, direct) in direct {
            by[j] += direct;
        }
    }
}

/// Returns the frame of wheel number `i` of a device at the joint angle zero: the contact frame
/// before cone and toe turn it. Its third column is the steer axis.
#[must_use]
pub fn frame_at_zero(device: &Device, i: usize) -> Mat3 {
    let wheel = &device.wheels()[i];
    let ContactFrame { c1, c2, c3 } = Posture::new(device, &[0.0; MAX_WHEELS]).frames()[i];
    let (sa, ca) = wheel.spec().cone.sin_cos();
    let (sb, cb) = wheel.spec().toe.sin_cos();
    // The columns of Rx(a) Rz(b), as in hbot-core.
    let columns = Mat3::from_cols(
        Vec3::new(cb, ca * sb, sa * sb),
        Vec3::new(-sb, ca * cb, sa * cb),
        Vec3::new(0.0, -sa, ca),
    );
    Mat3::from_cols(c1, c2, c3) * columns.transpose()
}

fn skew(v: Vec3) -> Mat3 {
    Mat3::from_cols(Vec3::new(0.0, v.z, -v.y), Vec3::new(-v.z, 0.0, v.x), Vec3::new(v.y, -v.x, 0.0))
}

/// Returns the rotation by the rotation vector `v`, rad.
fn exp(v: Vec3) -> Mat3 {
    let (k, angle) = (skew(v), v.length());
    let (one, two) = if angle < 1.0e-6 {
        (1.0, 0.5)
    } else {
        (angle.sin() / angle, (1.0 - angle.cos()) / (angle * angle))
    };
    Mat3::IDENTITY + k * one + k * k * two
}

/// Returns the matrix that maps a small change of the rotation vector `v` to the turn that follows
/// `exp(v)`, in its frame.
fn right_jacobian(v: Vec3) -> Mat3 {
    let (k, angle) = (skew(v), v.length());
    let (one, two) = if angle < 1.0e-4 {
        (0.5, 1.0 / 6.0)
    } else {
        ((1.0 - angle.cos()) / (angle * angle), (angle - angle.sin()) / angle.powi(3))
    };
    Mat3::IDENTITY - k * one + k * k * two
}

#[cfg(test)]
mod tests {
    use hbot_config::RigConfig;

    use super::*;

    /// Each derivative is that of central differences, also away from the drawing and with a
    /// residual that is not small.
    #[test]
    fn derivatives_are_those_of_central_differences() {
        for file in ["prototype", "three_wheels", "four_wheels"] {
            let path = format!("{}/../../rigs/{file}.toml", env!("CARGO_MANIFEST_DIR"));
            let rig = RigConfig::from_path(path.as_ref()).expect("legal").rig;
            let joints = rig.device.joints();
            let n = crate::parameter::count(joints / 2);
            let mut random = oorandom::Rand64::new(7);
            let mut next = |size: f64| size * (2.0 * random.rand_float() - 1.0);
            let at: Vec<f64> =
                crate::parameter::all(joints / 2).map(|(_, it)| next(2.0 * it.usual())).collect();
            let begin: Vec<f64> = (0..joints).map(|_| next(3.0)).collect();
            let end: Vec<f64> = begin.iter().map(|angle| angle + next(0.02)).collect();
            let step = Step { ends: [&begin, &end] };
            let mut rounding = [0.0; MAX_JOINTS];
            rounding.iter_mut().enumerate().for_each(|(j, it)| *it = 1.0e-3 / (1 + j % 2) as f64);
            let value = |at: &[f64]| {
                let mut out = Residual::new(0);
                Model::new(&rig, at, &rounding).residual(step, &mut out);
                out.value
            };
            let mut out = Residual::new(n);
            Model::new(&rig, &at, &rounding).residual(step, &mut out);
            for k in 0..n {
                let h = 1.0e-6;
                let moved = |by: f64| {
                    let mut other = at.clone();
                    other[k] += by;
                    value(&other)
                };
                let (up, down) = (moved(h), moved(-h));
                for j in 0..joints {
                    let found = (up[j] - down[j]) / (2.0 * h);
                    // Central differences err by h² times a third derivative, and by rounding.
                    let off = (found - out.by[k][j]).abs();
                    assert!(
                        off < 1e-6 * (1.0 + found.abs()),
                        "{file}, unknown {k}, joint {j}: {found}, {off:e}"
                    );
                }
            }
        }
    }

    /// The frames and rows at the drawing are those of the control law.
    #[test]
    fn a_motion_without_slip_leaves_no_residual() {
        let rig = RigConfig::prototype().rig;
        let th = [0.4, -1.3];
        let rates = Posture::new(&rig.device, &th).inverse(Vec3::new(0.3, -0.5, 0.8));
        let h = 1.0e-6;
        let ends = |sign: f64| -> Vec<f64> {
            (0..4).map(|j| if j % 2 == 0 { th[j / 2] } else { 0.0 } + sign * 0.5 * h * rates[j]).collect()
        };
        let (begin, end) = (ends(-1.0), ends(1.0));
        let mut out = Residual::new(0);
        let model = Model::new(&rig, &[0.0; 19], &[1.0; MAX_JOINTS]);
        model.residual(Step { ends: [&begin, &end] }, &mut out);
        // Rounding of the angles.
        assert!(out.value.iter().all(|e| e.abs() < 1e-15), "{:?}", out.value);
        assert!((out.turn / h - Vec3::new(0.3, -0.5, 0.8)).length() < 1e-8, "{}", out.turn / h);
    }
}
