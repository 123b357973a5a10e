//! Other possible readings of the global indices: other wheels, other Jacobians, equation 1 taken
//! literally.

use hbot_config::RigConfig;
use hbot_core::design::singularity::Indices;
use hbot_core::{Device, Mat3, Vec3, WheelSpec};
use hbot_plot::{Lines, Series, short};

use super::indices::{IndexedDevice, Known, Local, PAPER_GCI, PAPER_GMI, START};
use super::torus::{self, FOUR, THREE, mean, posture};
use super::{literal, so3};
use crate::context::Context;
use crate::report::{Report, row};

/// Wheel radii for which the indices are computed, in micrometres.
const RADII: [u32; 7] = [10_000, 12_000, 14_000, 15_500, 17_000, 20_000, 25_000];

/// Returns the prototype's device with `change` applied to each wheel.
fn changed(change: impl Fn(WheelSpec) -> WheelSpec) -> Device {
    let device = RigConfig::prototype().rig.device;
    let specs: Vec<WheelSpec> = device.wheels().iter().map(|wheel| change(*wheel.spec())).collect();
    let made = Device::new(device.sphere_radius(), device.sphere_mass(), &specs);
    made.unwrap_or_else(|error| unreachable!("radius and inertia make nothing singular: {error}"))
}

/// Reports how much the mean conditioning index (GCI) depends on the wheel radius, which the paper
/// does not give. Returns a sentence about this for the report.
pub(super) fn radius(context: &Context, report: &mut Report) -> String {
    context.part("indices against the wheel radius");
    report.family(
        "gci_{motors}_spectral_{workspace}_r_{radius}um | 1 | the same with wheels of {radius} micrometres",
    );
    let choices = [THREE, FOUR];
    let level = if context.quick { 1 } else { 3 };
    let samples: Vec<_> = so3::uniform(level).map(|q| (q, 1.0)).collect();
    let mut series: Vec<Series> = Vec::new();
    for (colour, motors) in choices.iter().enumerate() {
        for (name, open) in [("SO(3)", false), ("torus", true)] {
            let name = format!("{}, {name}", if motors.id == THREE.id { "three motors" } else { "all four" });
            series.push(Series::new(name, Vec::new(), colour).open(open));
        }
    }
    for radius in RADII {
        let r = f64::from(radius) * 1.0e-6;
        let rig = IndexedDevice::new(changed(|wheel| WheelSpec { radius: r, ..wheel }));
        let over = [rig.over_turns(&samples, START, &choices), rig.over_torus(64, &choices)];
        for (k, motors) in choices.iter().enumerate() {
            for (w, workspace) in ["so3", "torus"].iter().enumerate() {
                let value = over[w][k].spectral;
                report.figure(format!("gci_{}_spectral_{workspace}_r_{radius}um", motors.id), value);
                series[2 * k + w].points.push((1.0e3 * r, value));
            }
        }
    }
    // For three motors over SO(3): the two radii whose GCIs enclose the paper's.
    let points = &series[0].points;
    let above = points.iter().position(|(_, value)| *value > PAPER_GCI).unwrap_or(1).max(1);
    let [(r0, v0), (r1, v1)] = [points[above - 1], points[above]];
    report.say(
        "GCI against the wheel radius, which the paper does not give (table II implies 15.3 +- 0.5 mm):",
    );
    report.lines(
        "gci_radius",
        "GCI (spectral) against the wheel radius, over SO(3) the paper's way and over the torus",
        Lines::new("GCI against the wheel radius", "wheel radius r, mm", "GCI, spectral", series),
    );
    format!("with wheels of {} mm the paper's way gives {v0:.3}, with {} mm {v1:.3}", short(r0), short(r1))
}

/// Reports the indices for other interpretations of equations 1 and 17 to 22 of the paper.
pub(super) fn study(context: &Context, report: &mut Report, rig: &IndexedDevice, known: &Known) {
    context.part("other readings of the indices");
    let cells = if context.quick { 64 } else { 192 };
    let normal = |value: &(dyn Fn([f64; 2]) -> f64 + Sync)| {
        let most = -torus::least(48, |th| -value(th)).1;
        mean(torus::over(cells, value)) / most
    };
    let det = |rig: &IndexedDevice, th| THREE.determinant(&posture(&rig.device, th)).abs();
    let scaled = |by: f64| {
        let change = |wheel: WheelSpec| WheelSpec {
            steer_inertia: by * wheel.steer_inertia,
            drive_inertia: by * wheel.drive_inertia,
            ..wheel
        };
        let rig = IndexedDevice::new(changed(change));
        normal(&|th| det(&rig, th) / rig.inertia(th))
    };
    let letter = |th| literal::rows(&rig.device, th);
    let index =
        |norm: fn(&Indices) -> f64| mean(torus::over(cells, |th| norm(&Indices::of(&letter(th)[..3]))));
    let literal_gci = [index(|indices| indices.spectral), index(|indices| indices.frobenius)];
    let literal_gmi = normal(&|th| {
        let rows = letter(th);
        rows[0].dot(rows[1].cross(rows[2])).abs() / inertia_of(&rig.device, &rows)
    });
    let both = |local: &Local| Some([local.spectral, local.frobenius]);
    let printed = (both(&known.printed), known.printed.dynamic / known.most[1]);
    let [torus, so3] = known.three.each_ref().map(|local| (both(local), local.dynamic / known.most[1]));
    let [sphere, space] = [normal(&|th| det(rig, th)), normal(&|th| det(rig, th).powi(3) / rig.inertia(th))];
    let all = [
        ("", "over the torus, as above", torus),
        ("", "over SO(3) the paper's way, as above", so3),
        ("printed_grid", "the same over the paper's equal steps, without the weight", printed),
        ("literal", "eq. 1 to the letter, torus", (Some(literal_gci), literal_gmi)),
        ("sphere_alone", "eq. 20 with the sphere's inertia alone, torus", (None, sphere)),
        ("joint_space", "eq. 20 with J = G_3 and the inertia as seen at the joints, torus", (None, space)),
        ("inertia_low", "joint inertias 3 times smaller, torus", (None, scaled(1.0 / 3.0))),
        ("inertia_high", "joint inertias 3 times larger, torus", (None, scaled(3.0))),
    ];
    tell(report, &all, literal_gci[0]);
}

/// The indices under one interpretation of the paper's definitions: its id, its name, the global
/// conditioning index by the spectral and by the Frobenius norm (if defined), and the global
/// manipulability index. The id is empty if another section reports these values.
type Reading = (&'static str, &'static str, (Option<[f64; 2]>, f64));

fn tell(report: &mut Report, all: &[Reading], literal_gci: f64) {
    report.family("gci_reading_{reading}_{norm} | 1 | GCI of the three motors by another reading: printed_grid (the paper's equal steps without a weight), literal (eq. 1 to the letter, torus)");
    report.family("gmi_reading_{reading} | 1 | GMI of the three motors by another reading: printed_grid and literal as above; over the torus sphere_alone (no joint inertia), joint_space (J = G_3 with the inertia seen at the joints), \
         inertia_low and inertia_high (joint inertias 3 times smaller and larger)");
    let mut table = vec![row(["three motors", "GCI spectral", "GCI Frobenius", "GMI"])];
    for &(id, name, (gci, gmi)) in all {
        let mut cells = vec![name.to_owned()];
        match gci {
            Some(values) => cells.extend(values.map(|value| format!("{value:.3}"))),
            None => cells.extend([String::new(), String::new()]),
        }
        cells.push(format!("{gmi:.3}"));
        table.push(cells);
        if id.is_empty() {
            continue;
        }
        for (norm, value) in ["spectral", "frobenius"].iter().zip(gci.into_iter().flatten()) {
            report.figure(format!("gci_reading_{id}_{norm}"), value).note("paper", PAPER_GCI);
        }
        report.figure(format!("gmi_reading_{id}"), gmi).note("paper", PAPER_GMI);
    }
    report.say(&format!(
        "What the paper's 0.41 and 0.5 could have been besides. With eq. 1 to the letter GCI would be {:.2}, so the paper did not compute with it as printed. For GMI, the forward Jacobian with the inertia \
         as seen at the joints gives ours again, and with the inertia as seen at the sphere has no largest value.",
        literal_gci
    ));
    report.table(&table);
}

/// Returns the determinant of the apparent inertia I_s I + Gᵀ J_q G, (kg m²)³. `rows` are the rows
/// of G, which need not be those of the device.
fn inertia_of(device: &Device, rows: &[Vec3; 4]) -> f64 {
    let mut inertia = Mat3::from_diagonal(Vec3::splat(device.sphere_inertia()));
    for (k, g) in rows.iter().enumerate() {
        let spec = device.wheels()[k / 2].spec();
        let joint = if k % 2 == 0 { spec.steer_inertia } else { spec.drive_inertia };
        inertia += Mat3::from_cols(*g * g.x, *g * g.y, *g * g.z) * joint;
    }
    Mat3::determinant(&inertia)
}
