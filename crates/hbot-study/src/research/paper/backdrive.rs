//! Table II, back-driveability: the torque about an axis at which the sphere begins to turn.

use core::f64::consts::TAU;

use hbot_config::RigConfig;
use hbot_core::design::kinematics::Posture;
use hbot_core::{Device, Vec3};
use hbot_plot::{Lines, Series, short};
use hbot_sim::phenomena::{CageFriction, Gear, JointFriction, Phenomena, Pivoting, Slip};
use hbot_sim::plant::{Dynamics, Method, PlantState};

use crate::context::Context;
use crate::report::{Report, head, row};
use crate::threads;

/// Number of postures in a full run. Over these postures, each wheel takes this many equally spaced
/// steer angles. Friction is a sum over the wheels, so its mean does not depend on how their angles
/// are paired.
const GRID: u32 = 144;
/// Number of postures if the study is run with `--quick`.
const COARSE: u32 = 55;
/// Number of angle steps by which the second wheel advances for each angle step of the first, from
/// posture to posture. It has no common factor with either number of postures, so the second wheel
/// takes each angle exactly once.
const SKEW: u32 = 89;
/// Increase of the applied torque per simulation step, N m. With steps of [`STEP_S`], the torque
/// rises by 20 mN m/s.
const RAMP: f64 = 2.0e-5;
/// Duration of a simulation step, s.
const STEP_S: f64 = 1.0e-3;
/// Angular speed above which the sphere counts as moving, rad/s. When the sphere breaks loose, its
/// speed after one step is 3e-6 rad/s.
const MOVES: f64 = 1.0e-6;
/// Torque at which the simulation stops raising the torque, N m. The sphere starts to turn about
/// every axis at a smaller one.
const NEVER: f64 = 0.2;
/// Largest allowed relative difference between the mean measured back-drive torque and the torque
/// that friction predicts. One step of the rising torque is 0.5 % of the measured torque.
const WITHIN: f64 = 0.005;
/// Largest allowed difference between the mean measured back-drive torque and the rounded value in
/// the physics notes, mN m.
const NOTES_WITHIN: f64 = 0.15;

/// The three axes, and two published back-drive torques about each in mN m: first the one in the
/// paper (table II), then the one in the physics notes (physics.md, section 8).
const AXES: [(&str, Vec3, f64, f64); 3] =
    [("n1", Vec3::X, 5.0, 4.2), ("n2", Vec3::Y, 4.0, 5.0), ("n3", Vec3::Z, 4.0, 4.1)];

/// Returns the steer angles of both wheels at posture number `k`, rad. There are `grid` postures.
fn posture(k: u32, grid: u32) -> [f64; 2] {
    let at = |k: u32| TAU * (f64::from(k % grid) + 0.5) / f64::from(grid);
    [at(k), at(SKEW * k)]
}

/// Returns the torque about `axis` at which the sphere begins to turn, N m. In this simulation, the
/// sphere can turn about no other axis.
fn ramp(device: &Device, phenomena: &Phenomena, steer: [f64; 2], axis: Vec3) -> f64 {
    let mut state = PlantState::default();
    state.steer[..2].copy_from_slice(&steer);
    let dynamics = Dynamics::new(device, phenomena, Method::Rk4, &state);
    let mut dynamics = dynamics.unwrap_or_else(|error| unreachable!("the prototype is a plant: {error}"));
    let held = dynamics.set_hinge(Some(axis));
    debug_assert!(held, "friction makes a plant that can be held");
    let mut torque = 0.0;
    while state.omega.dot(axis) < MOVES && torque < NEVER {
        torque += RAMP;
        dynamics.step(&mut state, 0.0, STEP_S, &[0.0; 16], axis * torque, None);
    }
    torque - 0.5 * RAMP
}

/// Returns the torque about `axis` with which the friction of cage and joints resists a turn, N m.
/// The sphere can turn about no other axis, so the powers of all friction torques simply add up.
fn predicted(device: &Device, steer: [f64; 2], axis: Vec3) -> f64 {
    let posture = Posture::new(device, &steer);
    let joints: f64 = posture.rows()[..device.joints()].iter().map(|g| g.dot(axis).abs()).sum();
    CageFriction::default().torque + JointFriction::default().coulomb * joints
}

/// Returns the mean, the smallest and the largest of `values`.
fn spread(values: &[f64]) -> [f64; 3] {
    let (low, high) =
        values.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(*v), high.max(*v)));
    [values.iter().sum::<f64>() / values.len() as f64, low, high]
}

/// The back-drive torque about one axis: published, predicted and measured.
struct Found {
    name: &'static str,
    /// Back-drive torque that the paper reports, mN m.
    paper: f64,
    /// Back-drive torque that the physics notes give, mN m.
    notes: f64,
    /// Mean, smallest and largest measured torque over all postures, N m. Only joints and cage have
    /// friction.
    plain: [f64; 3],
    /// Mean predicted torque over all postures, N m. Only joints and cage have friction.
    expected: f64,
    /// Mean measured torque over all postures if the rig also has pivoting friction, slip and
    /// gears, N m.
    all: f64,
}

pub(crate) fn study(context: &Context, report: &mut Report) {
    context.part("back-driving");
    let device = RigConfig::prototype().rig.device;
    let grid = if context.quick { COARSE } else { GRID };
    introduce(report, grid);
    let found = measured(&device, grid);
    tell(report, &found, &nearest(&device));
    draw(report, &device);
    check(report, &found);
    let ours: Vec<String> = found.iter().map(|of| milli(of.plain[0])).collect();
    report.compare(
        "back-drive torque about n1, n2, n3 (table II)",
        "5, 4, 4 mN m",
        format!("{} mN m", ours.join(", ")),
        "a fit: the paper gives no friction, and ours was chosen so that these torques come out about right. It proves nothing but that such friction is possible. Means over all headings, over which n1 and n3 must be equal by symmetry; the paper names no heading and rounds to 1 mN m",
    );
}

fn introduce(report: &mut Report, grid: u32) {
    report.heading("Back-driveability (table II)");
    report.say(&format!(
        "The paper measured the least torque that visibly turns the sphere about n1, n2 and n3. Here each axis is held as a hinge, as a hand does it, and a torque about it \
         grows by {} mN m/s until the sphere turns; joints have Coulomb friction of 0.2 mN m, the cage of 2 mN m (docs/internals/physics.md, section 8). The paper gives neither; both are a fit: they were chosen so that the torques come near the paper's. \
         The mean is over {grid} pairs of steering angles, even over a turn of each wheel. Prediction: about a hinge n the cage holds 2 mN m and each joint 0.2 mN m times |g.n|, g its row of G. \
         Beside it the same with what else may hold a real sphere: contacts that resist pivoting and may slip, gears with losses.",
        short(1.0e3 * RAMP / STEP_S)
    ));
    report.family("backdrive_{axis}_nm | N m | torque from which the sphere turns about an axis, held as a hinge: mean over the steering angles, joint and cage friction; `predicted`, `least` and `most` of the pairs of steering angles that were tried, which are no bounds over all; `paper`");
    report.family("backdrive_{axis}_all_nm | N m | the same with pivoting friction, contacts that may slip and geared drives as well");
}

fn measured(device: &Device, grid: u32) -> Vec<Found> {
    let friction = Phenomena {
        joint_friction: Some(JointFriction::default()),
        cage_friction: Some(CageFriction::default()),
        ..Phenomena::default()
    };
    let all = Phenomena {
        pivoting: Some(Pivoting::default()),
        slip: Some(Slip::default()),
        gear: Some(Gear::default()),
        ..friction
    };
    let steers: Vec<[f64; 2]> = (0..grid).map(|k| posture(k, grid)).collect();
    let mut found = Vec::new();
    for (name, axis, paper, notes) in AXES {
        let of = |phenomena: &Phenomena| {
            let torques = threads::map(&steers, |steer| ramp(device, phenomena, *steer, axis));
            spread(&torques)
        };
        let expected =
            steers.iter().map(|steer| predicted(device, *steer, axis)).sum::<f64>() / f64::from(grid);
        let ([all, ..], plain) = (of(&all), of(&friction));
        found.push(Found { name, paper, notes, plain, expected, all });
    }
    found
}

/// Formats a torque (N m) in mN m, for a table.
fn milli(torque: f64) -> String {
    format!("{:.2}", 1.0e3 * torque)
}

/// Adds figures, a table and text about back-driving to the report.
fn tell(report: &mut Report, found: &[Found], nearest: &Nearest) {
    let mut table = vec![head(
        "axis | measured, mN m | predicted | least and most of the pairs | with pivoting, slip, gears | notes | paper",
    )];
    for Found { name, paper, notes, plain: [mean, least, most], expected, all } in found {
        report
            .figure(format!("backdrive_{name}_nm"), *mean)
            .note("predicted", *expected)
            .note("least", *least)
            .note("most", *most)
            .note("paper", 1.0e-3 * paper);
        report.figure(format!("backdrive_{name}_all_nm"), *all);
        table.push(row([
            *name,
            &milli(*mean),
            &milli(*expected),
            &format!("{} to {}", milli(*least), milli(*most)),
            &milli(*all),
            &short(*notes),
            &short(*paper),
        ]));
    }
    report.table(&table);
    report.say(&format!(
        "The size agrees because friction was chosen for it; the order does not: the paper's hardest axis is n1, ours is n2. Over all headings n1 and n3 must be equal, whatever the friction of joints and an even cage: a quarter turn about n2 takes the two wheels into one another. \
         So the paper's difference between n1 and n3 is one of a heading, of its cage, or of rounding to 1 mN m. Headings do shift the three against one another, but none has all of 5, 4, 4 to rounding with these figures: the nearest, th = ({1:.2}, {2:.2}) rad, has {3:.2}, {4:.2}, {5:.2} mN m, off by {0:.2} at worst. \
         Pivoting friction of 0.5 mN m at each contact adds about as much as all joints do: a device with it has less friction elsewhere, or a smaller patch.",
        nearest.off, nearest.steer[0], nearest.steer[1], nearest.torque[0], nearest.torque[1], nearest.torque[2]
    ));
}

fn draw(report: &mut Report, device: &Device) {
    let along = |k: usize, name: &str| {
        let at = |i: u32| {
            let th = TAU * f64::from(i) / 72.0;
            (th, 1.0e3 * predicted(device, [th, th], AXES[k].1))
        };
        Series::new(name.to_owned(), (0..=72).map(at).collect(), k)
    };
    report.lines(
        "backdrive",
        "Back-drive torque over the steering angle, both wheels at the same one: friction of cage and joints",
        Lines::new(
            "Back-drive torque and the heading of the wheels",
            "steering angle of both wheels, rad",
            "torque, mN m",
            vec![along(0, "about n1, and n3 alike"), along(1, "about n2")],
        ),
    );
}

fn check(report: &mut Report, found: &[Found]) {
    let worst = |of: &dyn Fn(&Found) -> f64| found.iter().map(|axis| of(axis).abs()).fold(0.0, f64::max);
    let off = worst(&|axis| axis.plain[0] / axis.expected - 1.0);
    let off_notes = worst(&|axis| 1.0e3 * axis.plain[0] - axis.notes);
    report.check(
        format!("back-drive torques are those of cage and joints within {WITHIN}"),
        format!("{off:.4} at worst"),
        off <= WITHIN,
    );
    report.check(
        format!(
            "back-drive torques are those of this project's own notes (docs/internals/physics.md), 4.2, 5.0, 4.1 mN m, within {NOTES_WITHIN} mN m; the paper's are not tested"
        ),
        format!("{off_notes:.3} mN m at worst"),
        off_notes <= NOTES_WITHIN,
    );
}

/// The posture at which the back-drive torques about all three axes are closest to the paper's
/// values.
struct Nearest {
    steer: [f64; 2],
    /// Back-drive torques about the three axes at this posture, mN m.
    torque: [f64; 3],
    /// Largest difference between one of these three torques and the paper's value, mN m.
    off: f64,
}

fn nearest(device: &Device) -> Nearest {
    let mut best = Nearest { steer: [0.0; 2], torque: [0.0; 3], off: f64::INFINITY };
    for i in 0..90 {
        for j in 0..90 {
            let steer = [i, j].map(|k| TAU * f64::from(k) / 90.0);
            let torque = AXES.map(|(_, axis, ..)| 1.0e3 * predicted(device, steer, axis));
            let off = (0..3).map(|k| (torque[k] - AXES[k].2).abs()).fold(0.0, f64::max);
            if off < best.off {
                best = Nearest { steer, torque, off };
            }
        }
    }
    best
}
