//! The designs of two wheels that need no fourth motor: the nested-circles condition (physics
//! notes, section 3).

use core::f64::consts::{PI, TAU};

use hbot_config::RigConfig;
use hbot_core::{Device, Vec3, WheelSpec};

use super::literal::{frame, least_rotation};
use super::torus::{self, THREE, posture};
use crate::context::Context;
use crate::report::{Report, head, row};
use crate::rng::Rng;
use crate::threads;

/// Smallest distance of a tested design from the limit of the nested-circles condition, rad. Closer
/// to the limit, a scan of the steer angles cannot decide whether the design is singular.
const BORDER: f64 = 0.03;

/// A design with two wheels without toe: their cone angles, and the angle between their steering
/// axes, rad.
#[derive(Debug, Clone, Copy)]
struct Design {
    cones: [f64; 2],
    between: f64,
}

impl Design {
    /// Returns the margin of the nested-circles condition for one drive (wheel 1) and two steers,
    /// rad: a_2 - a_1 - min(g, pi - g). The condition holds if the margin is positive.
    fn nested(&self) -> f64 {
        self.cones[1] - self.cones[0] - self.between.min(PI - self.between)
    }

    fn specs(&self) -> [WheelSpec; 2] {
        let (sin, cos) = libm::sincos(self.between);
        let own = *RigConfig::prototype().rig.device.wheels()[0].spec();
        let wheel = |axis, cone| WheelSpec { axis, cone, ..own };
        [wheel(Vec3::Z, self.cones[0]), wheel(Vec3::new(sin, 0.0, cos), self.cones[1])]
    }

    /// Returns whether the scalar product of c3 of wheel 1 and an axis of wheel 2 changes its sign
    /// anywhere over all steer angles. `column` chooses the axis: 0 for c1, 1 for c2. A change of
    /// sign means that the design has a singularity.
    fn changes_sign(&self, column: usize, cells: usize) -> bool {
        let frames = self.specs().map(|spec| {
            let first = least_rotation(spec.axis);
            let at = move |k: usize| frame(&spec, first, TAU * k as f64 / cells as f64);
            (0..cells).map(at).collect::<Vec<_>>()
        });
        let one: Vec<Vec3> = frames[0].iter().map(|c| c.z_axis).collect();
        let two = frames[1].iter().map(|c| if column == 0 { c.x_axis } else { c.y_axis });
        let mut seen = [false; 2];
        for v in two {
            for u in &one {
                seen[usize::from(u.dot(v) < 0.0)] = true;
            }
        }
        seen == [true; 2]
    }
}

pub(super) fn study(context: &Context, report: &mut Report) {
    context.part("designs for three motors");
    families(report);
    let (count, cells) = if context.quick { (300, 60) } else { (2000, 120) };
    let (designs, found) = tried(count, cells);
    let free = found.iter().filter(|free| free[0]).count();
    let disagree = found.iter().zip(&designs).filter(|(free, design)| free[0] != (design.nested() > 0.0));
    let disagree = disagree.count();
    let two_drives = found.iter().filter(|free| free[1]).count();
    let figures =
        [("checked", count), ("free", free), ("disagree", disagree), ("two_drives_free", two_drives)];
    for (what, value) in figures {
        report.figure(format!("nested_designs_{what}"), value as f64);
    }
    let least = example();
    report.figure("nested_example_least_index".to_owned(), least);
    report.say(&format!(
        "Can three motors do? For one drive (wheel 1) and two steers without toe, exactly where the contact circles, or one and the other's opposite, are nested with wheel 1 inside: cone 2 > cone 1 + min(g, \
         180 deg - g), g between the axes. Checked on {count} random designs, those within {BORDER} rad of the border left out, by the signs of c3_1 . c2_2 on a torus of {cells} by {cells} postures. \
         Two drives and one steer always meet a singularity: c1 of wheel 2 goes round a great circle, which every plane through the centre meets."
    ));
    report.table(&[
        head("designs | never singular, one drive and two steers | against the condition | never singular, two drives and one steer"),
        row(figures.map(|(_, value)| value.to_string())),
    ]);
    report.say(&format!(
        "The prototype (cones of 10 deg, axes 90 deg apart) does not fulfil it. Cones of 10 and 45 deg on axes 15 deg apart do: with three motors their spectral index is never below {least:.3}."
    ));
    report.check(
        "the nested-circles condition tells every random design right, and some of them are free of singularities",
        format!("{disagree} wrong, {free} free of {count}"),
        disagree == 0 && free > 0,
    );
    report.check(
        "two drives and one steer always meet a singularity",
        format!("{two_drives} of {count} do not"),
        two_drives == 0,
    );
    report.check(
        "the design with nested circles that is named has an index above 0.05 in every posture",
        format!("{least:.3}"),
        least > 0.05,
    );
}

fn families(report: &mut Report) {
    report.family("nested_designs_{what} | 1 | random designs of two wheels without toe on a fine torus: checked (how many), free (how many are never singular with one drive and two steers), disagree (with the \
         nested-circles condition), two_drives_free (never singular with two drives and one steer)");
    report.family("nested_example_least_index | 1 | least spectral index, one drive and two steers, of the design that is named");
}

/// Returns `count` random designs, each at some distance from the limit of the nested-circles
/// condition. Each has two flags, which say whether the design is never singular: first with one
/// drive and two steers, then with two drives and one steer.
fn tried(count: usize, cells: usize) -> (Vec<Design>, Vec<[bool; 2]>) {
    let mut rng = Rng(44);
    let mut designs = Vec::new();
    while designs.len() < count {
        let cones = [rng.between(0.05, 1.5), rng.between(0.05, 1.5)];
        let design = Design { cones, between: rng.between(0.02, PI - 0.02) };
        if design.nested().abs() > BORDER {
            designs.push(design);
        }
    }
    let each = |design: &Design| [1, 0].map(|column| !design.changes_sign(column, cells));
    let found = threads::map(&designs, each);
    (designs, found)
}

/// Returns the smallest spectral index over all postures of an example design that needs no fourth
/// motor. Its cone angles are 10 and 45 degrees, and its steering axes are 15 degrees apart.
fn example() -> f64 {
    let example = Design { cones: [10.0_f64, 45.0].map(f64::to_radians), between: 15.0_f64.to_radians() };
    let device = RigConfig::prototype().rig.device;
    let made = Device::new(device.sphere_radius(), device.sphere_mass(), &example.specs());
    let made = made.unwrap_or_else(|error| unreachable!("nested circles never meet: {error}"));
    torus::least(72, |th| THREE.indices(&posture(&made, th)).spectral).1
}
