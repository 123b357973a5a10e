//! Which posture the paper may have mapped its motors' torques at (table II).

use hbot_core::Vec3;

use super::{GrippedDevice, ROWS};
use crate::context::Context;
use crate::report::{Report, head};
use crate::research::paper::literal;
use crate::research::paper::torus::{self, FOUR, Motors, THREE, posture};

/// Searches for the postures at which the torques on the sphere are nearest to table II of the
/// paper. The paper says that motor torques are "mapped to the end-effector"; the search is done
/// for several meanings of this.
///
/// `found` holds two sets of torques for each row of the table, over all postures: the smallest
/// with four motors, and the medians with three.
pub(super) fn study(context: &Context, report: &mut Report, rig: &GrippedDevice, found: &[[[f64; 3]; 2]; 2]) {
    let cells = if context.quick { 90 } else { 360 };
    report.family("table2_{rows}_{mapping}_off | 1 | the factor by which the best posture misses table II; {rows}: peak, continuous, both (one posture for both); {mapping}: three_alone, four_alone (the largest torque about each axis \
         alone), three_together (all motors at full torque, best signs), literal_three_alone (with eq. 1 to the letter)");
    let mut table = vec![head(
        "mapping | best for the peak row | best for the continuous row | best for both rows in one posture",
    )];
    let mut known = [0.0; 3];
    for (id, name, best) in nearest(rig, cells) {
        let mut cells = vec![name.to_owned()];
        for (what, (th, value)) in ["peak", "continuous", "both"].iter().zip(best) {
            report.figure(format!("table2_{what}_{id}_off"), value);
            let [a, b] = th.map(|th| th.to_degrees().rem_euclid(360.0));
            cells.push(format!("{value:.3} at ({a:.0}, {b:.0}) deg"));
        }
        table.push(cells);
        if id == "three_alone" {
            known = best.map(|(_, value)| value);
        }
    }
    report.say(
        "Which posture did the paper map its motors' torques at? A search over all postures for the least factor by which the torques about n1, n2 and n3 miss its rows (1 would be a match):",
    );
    report.table(&table);
    report.check(
        "the posture that is nearest to both rows of table II misses them by a factor of 1.4 to 1.5 (three motors, each axis alone; known: 1.46)",
        format!("{:.3}", known[2]),
        (1.4..1.5).contains(&known[2]),
    );
    compare(report, found, known);
}

/// The search results for one mapping from motor torques to torques on the sphere: its id, its
/// name, and three postures. They are the posture nearest to the paper's peak torques, to its
/// continuous torques, and to both. Each has the factor by which its torques differ from the
/// paper's.
type Nearest = (&'static str, &'static str, [([f64; 2], f64); 3]);

/// Returns, for each mapping from motor torques to torques on the sphere, the postures at which
/// these torques are nearest to table II. The search begins on a grid with `cells` values of each
/// steer angle.
fn nearest(rig: &GrippedDevice, cells: usize) -> [Nearest; 4] {
    let ours = |th: [f64; 2]| posture(&rig.device, th).rows().to_vec();
    let printed = |th: [f64; 2]| literal::rows(&rig.device, th).to_vec();
    let alone = |motors: Motors| {
        move |rows: &[Vec3]| core::array::from_fn(|k: usize| ROWS[k].off(ROWS[k].alone(rows, &motors)))
    };
    let together = |rows: &[Vec3]| {
        let best = |k: usize| (0..8).map(move |s| ROWS[k].off(ROWS[k].together(rows, &THREE, s)));
        core::array::from_fn(|k: usize| best(k).fold(f64::INFINITY, f64::min))
    };
    type Off<'a> = &'a (dyn Fn(&[Vec3]) -> [f64; 2] + Sync);
    type Rows<'a> = &'a (dyn Fn([f64; 2]) -> Vec<Vec3> + Sync);
    let (three, four) = (alone(THREE), alone(FOUR));
    let mappings: [(&'static str, &'static str, Rows<'_>, Off<'_>); 4] = [
        ("three_alone", "three motors, each axis alone", &ours, &three),
        ("four_alone", "all four, each axis alone", &ours, &four),
        ("three_together", "three motors at full torque, components of the sum", &ours, &together),
        ("literal_three_alone", "eq. 1 to the letter, three motors, each axis alone", &printed, &three),
    ];
    mappings.map(|(id, name, rows, off)| {
        let best = [
            torus::least(cells, |th| off(&rows(th))[0]),
            torus::least(cells, |th| off(&rows(th))[1]),
            torus::least(cells, |th| off(&rows(th)).into_iter().fold(1.0, f64::max)),
        ];
        (id, name, best)
    })
}

/// Adds the rows of table II to the comparison with the paper. `found` holds the torques over all
/// postures. `known` holds the factors by which the nearest posture differs from the row of peak
/// torques, from the row of continuous torques, and from both.
fn compare(report: &mut Report, found: &[[[f64; 3]; 2]; 2], known: [f64; 3]) {
    for (k, limit) in ROWS.iter().enumerate() {
        let paper = limit.paper.map(|torque| torque.to_string()).join(", ");
        let listed = |torques: [f64; 3]| torques.map(|torque| format!("{torque:.2}")).join(", ");
        let ours = format!(
            "{} N m whatever the posture, all four motors; {} in the median, the paper's three",
            listed(found[k][0]),
            listed(found[k][1])
        );
        let why = if k == 0 {
            format!(
                "The paper names no posture and no wheel radius. With three motors each row is met in a different posture (to factors of {:.3} and {:.3}), both in none (best {:.2}). About n2 its \
                 figures are the drive's own: 0.94/0.14 and 0.15/0.023 imply R/r of 6.7 and 6.5. About n1 and n3 the steers act as well, with a leverage of up to 1/sin(cone) = 5.8, so those hang on the \
                 posture most.",
                known[0], known[1], known[2]
            )
        } else {
            "As above. From peak to continuous a steer loses a factor of 13 and a drive one of 6, so the two rows name different postures.".to_owned()
        };
        let what = format!("{} torque about n1, n2, n3 (table II)", limit.name);
        report.compare(&what, format!("{paper} N m"), ours, why);
    }
}
