//! Singularities (section III, figures 2 and 3): margins over all steer angles, and the designs
//! that have no singularity.

use core::f64::consts::{FRAC_PI_2, PI};

use hbot_config::RigConfig;
use hbot_core::design::singularity::{boundary_determinant, interior_margin, interior_margin_over_all};
use hbot_core::{Device, Vec3, WheelSpec};
use hbot_plot::{Map, Pen, Sketch, maps};

use super::frames::wheel_at;
use super::nested;
use super::torus::{self, CHOICES, FOUR, MOTORS, Motors, THREE, posture};
use crate::context::Context;
use crate::report::{Report, row};
use crate::rng::Rng;

/// Number of cells along each side of a map over the two steer angles.
const CELLS: usize = 60;
/// Spectral indices below which a posture counts as nearly singular, in per cent.
const BELOW: [u32; 3] = [5, 10, 20];

pub(super) fn study(context: &Context, report: &mut Report) {
    context.part("singularities over all steering angles");
    let device = RigConfig::prototype().rig.device;
    report.heading("Singularities (section III)");
    let boundary = boundary_determinant(&device, &device.wheels()[0]);
    let sine = device.wheels()[0].axis_along_roll();
    report.family("boundary_determinant_m2 | m² | det H of a wheel of the prototype, r R sin(cone) cos(toe)");
    report
        .family("boundary_margin | 1 | sin(cone) cos(toe): what of det H is the design's, 0 where singular");
    report.figure("boundary_determinant_m2".to_owned(), boundary);
    report.figure("boundary_margin".to_owned(), sine);
    report.say(&format!(
        "**Boundary** (eq. 15): det H = {boundary:.3e} m² at either wheel, sin(cone) cos(toe) = {sine:.4}; the same in every posture, so it is a matter of the design alone, as the paper says. \
         **Interior** (eq. 16): Z loses rank where the contact points lie on one line through the centre; the paper says that the contact frames must be equal, but headings do not matter. \
         **Actuation**: the paper does not ask whether G keeps its rank with the joints that have motors. With four it does; with its three (steer 1, drive 1, steer 2) det G_3 = \
         (R/r) c3_1 . c2_2 / ((l1.c2)(l2.c2)), which is zero on curves of the torus.",
    ));
    margins(report, &device);
    conditions(context, report);
    draw(report, &device);
    nested::study(context, report)
}

/// Reports two margins to singularity over all steer angles, as figures and maps: the interior
/// margin and the actuation margin.
fn margins(report: &mut Report, device: &Device) {
    let interior = torus::least(CELLS, |th| interior_margin(&posture(device, th)));
    let closed = interior_margin_over_all(device);
    report.family("interior_margin_least | 1 | least sigma_min(Z)/R over all steering angles, by search");
    report.family("actuation_least_{motors} | 1 | least spectral index of the driven rows of G over all steering angles");
    report.family("actuation_below_{percent}pct_{motors}_fraction | 1 | part of the torus where that index is below {percent} percent");
    report.say(&format!("In the ids, {MOTORS}."));
    report.figure("interior_margin_least".to_owned(), interior.1);
    // The search stops at 1e-9 of a cell, and where the minimum is flat that is 1e-18 in value.
    report.check(
        "the least interior margin by search is the closed form's, to 1e-9",
        format!("{:.6} and {closed:.6}", interior.1),
        (interior.1 - closed).abs() < 1.0e-9,
    );
    let (least, weak) = actuation(report, device);
    report.check(
        "with all four motors the prototype is never singular: the least spectral index is 0.50 to 0.51",
        format!("{:.4}", least[0]),
        (0.50..0.51).contains(&least[0]),
    );
    // The zero is found to 1e-9 of a cell, times the slope.
    let most = least[1..].iter().copied().fold(0.0, f64::max);
    report.check(
        "with any three motors it is singular somewhere: the least spectral index is below 1e-6",
        format!("{most:.1e}"),
        most < 1.0e-6,
    );
    report.compare(
        "singularity-free workspace (III, IV.A)",
        "claimed",
        format!("with four motors: interior margin at least {:.3}, spectral index at least {:.3}; with the paper's three: 0", interior.1, least[0]),
        format!(
            "The paper looks at Z and H alone. With the three motors that it gives torques of the rig cannot make every torque where c3_1 . c2_2 = 0; on {:.0} % of the torus its spectral index is \
             below 0.1. The claim needs all four motors.",
            100.0 * weak
        ),
    );
    draw_maps(report, device);
}

/// Reports how well each choice of motors can turn the sphere. Returns the smallest spectral index
/// of each choice. Also returns the share of all postures at which the paper's three motors have an
/// index below 0.1.
fn actuation(report: &mut Report, device: &Device) -> (Vec<f64>, f64) {
    let mut table =
        vec![row(["motors", "least spectral index", "below 0.05 on", "below 0.1 on", "below 0.2 on"])];
    let mut least = Vec::new();
    let mut weak = 0.0;
    for motors in CHOICES {
        let found = torus::least(CELLS, |th| motors.indices(&posture(device, th)).spectral).1;
        report.figure(format!("actuation_least_{}", motors.id), found);
        let all = torus::over(256, |th| motors.indices(&posture(device, th)).spectral);
        let mut cells = row([motors.name, &format!("{found:.3}")]);
        for percent in BELOW {
            let below = all.iter().filter(|index| **index < f64::from(percent) / 100.0).count();
            let part = below as f64 / all.len() as f64;
            report.figure(format!("actuation_below_{percent}pct_{}_fraction", motors.id), part);
            cells.push(format!("{:.1} % of the torus", 100.0 * part));
            if motors == THREE && percent == 10 {
                weak = part;
            }
        }
        table.push(cells);
        least.push(found);
    }
    report.table(&table);
    (least, weak)
}

/// Plots the margins to singularity as maps over all steer angles of the two wheels.
fn draw_maps(report: &mut Report, device: &Device) {
    let map = |title: &str, value: &(dyn Fn([f64; 2]) -> f64 + Sync), range, lines| Map {
        title: title.to_owned(),
        x: "steering angle 1, deg".to_owned(),
        y: "steering angle 2, deg".to_owned(),
        span: 0.0..360.0,
        values: torus::over(CELLS, value),
        range,
        lines,
    };
    let index = |motors: Motors| move |th| motors.indices(&posture(device, th)).spectral;
    report.plot(
        "margins",
        "The prototype over all steering angles: the interior margin sigma_min(Z)/R and the spectral index of G with all four motors; neither comes to zero. The boundary margin is the same \
         everywhere",
        maps(&[
            map("Interior margin sigma_min(Z)/R", &|th| interior_margin(&posture(device, th)), 0.0..1.0, Vec::new()),
            map("Spectral index, all four motors", &index(FOUR), 0.0..1.0, Vec::new()),
        ]),
    );
    // The other two choices mirror these two, as the prototype is symmetric in its wheels.
    let three: Vec<Map> = [THREE, CHOICES[3]]
        .iter()
        .map(|motors| {
            let lines = zeros(|th| motors.determinant(&posture(device, th)));
            map(&format!("Spectral index, three motors: {}", motors.name), &index(*motors), 0.0..0.8, lines)
        })
        .collect();
    report.plot(
        "actuation",
        "The spectral index with three motors, the paper's and without steer 2; on the red curves det G_3 is zero and some torque cannot be made. Without drive 1 and without steer 1 the maps are these mirrored",
        maps(&three),
    );
}

/// Returns the lines on which a function of the two steer angles is zero, as short pieces in
/// degrees, to draw them in a map. They are found by marching squares with linear interpolation in
/// each cell.
fn zeros(value: impl Fn([f64; 2]) -> f64) -> Vec<[(f64, f64); 2]> {
    let at = |k: usize| core::f64::consts::TAU * k as f64 / CELLS as f64;
    let values: Vec<f64> =
        (0..=CELLS).flat_map(|j| (0..=CELLS).map(move |i| [at(i), at(j)])).map(value).collect();
    let mut lines = Vec::new();
    for j in 0..CELLS {
        for i in 0..CELLS {
            let corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
            let mut crossings = Vec::new();
            for k in 0..4 {
                let (a, b) = (corners[k], corners[(k + 1) % 4]);
                let [u, v] = [a, b].map(|(i, j)| values[j * (CELLS + 1) + i]);
                if (u < 0.0) != (v < 0.0) {
                    let part = u / (u - v);
                    let mixed = |a: usize, b: usize| (at(a) + part * (at(b) - at(a))).to_degrees();
                    crossings.push((mixed(a.0, b.0), mixed(a.1, b.1)));
                }
            }
            lines.extend(crossings.chunks_exact(2).map(|pair| [pair[0], pair[1]]));
        }
    }
    lines
}

/// Checks that the analytic conditions for singularities agree with numerical ones, for random
/// designs with toe in random postures.
fn conditions(context: &Context, report: &mut Report) {
    let mut rng = Rng(33);
    let mut worst = [0.0_f64; 2];
    for _ in 0..if context.quick { 300 } else { 3000 } {
        let mut wheel = || WheelSpec {
            axis: Vec3::from_array(rng.direction()),
            cone: rng.between(0.1, 1.4),
            toe: rng.between(-0.6, 0.6),
            radius: rng.between(0.01, 0.05),
            ..WheelSpec::default()
        };
        let specs = [wheel(), wheel()];
        let Ok(device) = Device::new(0.1, 0.5, &specs) else { continue };
        let posture = posture(&device, [rng.between(-PI, PI), rng.between(-PI, PI)]);
        let [a, b] = [posture.frames()[0], posture.frames()[1]];
        let analytic = libm::sqrt(1.0 - a.c3.dot(b.c3).abs());
        worst[0] = worst[0].max((analytic - interior_margin(&posture)).abs());
        let arms = device.wheels()[0].axis_along_roll() * device.wheels()[1].axis_along_roll();
        let ratio = device.sphere_radius() / specs[0].radius;
        let analytic = ratio * a.c3.dot(b.c2) / arms;
        let size: f64 = THREE.rows(&posture, |rows| rows.iter().map(|row| row.length()).product());
        worst[1] = worst[1].max((analytic - THREE.determinant(&posture)).abs() / size);
    }
    report.family("singularity_{condition}_worst_error | 1 | analytic condition against the numbers on random designs: interior (sqrt(1 - abs(cos g)) against sigma_min(Z)/R), actuation (det G_3, relative to the product of the rows' lengths)");
    report.figure("singularity_interior_worst_error".to_owned(), worst[0]);
    report.figure("singularity_actuation_worst_error".to_owned(), worst[1]);
    // The root of a difference loses half of the digits if the contacts nearly meet.
    report.check(
        "on random designs the interior margin is sqrt(1 - abs(cos g)), g between the contact points, whatever the headings (to 1e-8)",
        format!("{:.1e}", worst[0]),
        worst[0] < 1.0e-8,
    );
    report.check(
        "on random designs det G_3 of steer 1, drive 1, steer 2 is (R/r) c3_1 . c2_2 / ((l1.c2)(l2.c2)) (to 1e-13 of its terms)",
        format!("{:.1e}", worst[1]),
        worst[1] < 1.0e-13,
    );
}

/// Returns two steer angles at which the device is singular if it has only the paper's three
/// motors, rad. The first angle is fixed, and the second is found by bisection.
fn singular(device: &Device) -> [f64; 2] {
    // c3_1 . c2_2 = 0, found along th_2 by section between signs.
    let th_1 = 0.4;
    let det = |th_2: f64| THREE.determinant(&posture(device, [th_1, th_2]));
    let mut ends = [FRAC_PI_2, 3.0 * FRAC_PI_2];
    let rising = det(ends[0]) < 0.0;
    for _ in 0..60 {
        let middle = 0.5 * (ends[0] + ends[1]);
        ends[usize::from((det(middle) < 0.0) != rising)] = middle;
    }
    [th_1, ends[0]]
}

/// Draws singular configurations: those of the paper's figures 2 and 3, and one that arises with
/// three motors.
fn draw(report: &mut Report, device: &Device) {
    let view = |title: &str| Sketch::new(title, -78.0, -20.0);
    let (left, right) = (Vec3::new(-1.0, 0.0, -1.0).normalize(), Vec3::new(1.0, 0.0, -1.0).normalize());
    let mut boundary = view("Boundary: steering axis along the axle");
    let contact = Vec3::new(0.0, -0.6, -0.8);
    boundary.named(Vec3::ZERO, Vec3::X * 1.4, "l", Pen::Strong(6));
    wheel_at(&mut boundary, device, 0, contact, Vec3::X, 0);
    boundary.named(contact, contact + Vec3::X * 0.6, "c1", Pen::Strong(0));
    // At an interior singularity both steering axes are at the cone angle from a common line.
    let interior = |title: &str, sides: [f64; 2]| {
        let mut sketch = view(title);
        let cone = 0.6;
        for (k, side) in sides.into_iter().enumerate() {
            let contact = right * side;
            let lean = if k == 0 { cone } else { -cone };
            let axis = super::literal::about(Vec3::Y, lean) * contact;
            sketch.named(Vec3::ZERO, axis * 1.5, &format!("l{}", k + 1), Pen::Strong(k));
            sketch.circle(axis, cone, Pen::Strong(k));
            sketch.dot(contact, k);
        }
        sketch.line(vec![right * -1.25, right * 1.25], Pen::Thin);
        sketch
    };
    let together = interior("Interior: contact points in one place", [1.0, 1.0]);
    let opposite = interior("Interior: contact points opposite", [1.0, -1.0]);
    let mut actuation = view("Actuation, three motors: c3 of wheel 1 across c2 of wheel 2");
    let th = singular(device);
    let found = posture(device, th);
    let index = THREE.indices(&found).spectral;
    for (k, (frame, axis)) in found.frames().iter().zip([right, left]).enumerate() {
        actuation.named(Vec3::ZERO, axis * 1.55, &format!("l{}", k + 1), Pen::Strong(6));
        wheel_at(&mut actuation, device, k, frame.c3, frame.c1, k);
    }
    let [a, b] = [found.frames()[0], found.frames()[1]];
    actuation.named(a.c3, a.c3 * 1.6, "c3", Pen::Strong(0));
    actuation.named(b.c3, b.c3 + b.c2 * 0.6, "c2", Pen::Strong(1));
    report.check(
        "the three-motor posture that is drawn is singular (index below 1e-12)",
        format!("{index:.1e} at ({:.1}, {:.1}) deg", th[0].to_degrees(), th[1].to_degrees()),
        index < 1.0e-12,
    );
    report.plot(
        "singular",
        "Singular configurations: steering axis along the axle (the paper's figure 2), contact points together or opposite (figure 3; the circles are where each contact point can be), and the \
         prototype with three motors where it cannot make a torque about one axis: wheel 1 makes no torque about its c3, and the steer of wheel 2 none but about its c2",
        Sketch::panels(&[boundary, together, opposite, actuation]),
    );
}
