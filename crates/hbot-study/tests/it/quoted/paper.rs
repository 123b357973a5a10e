//! The back-drive torques of docs/internals/plant.md against docs/paper/report.md.

use super::{cell, rounded};

const PLANT: &str = include_str!("../../../../../docs/internals/plant.md");
const REPORT: &str = include_str!("../../../../../docs/paper/report.md");

#[test]
fn the_simulator_s_back_drive_torques_are_the_reports() {
    let of = |column: &str| {
        ["n1", "n2", "n3"]
            .map(|axis| rounded(&cell(REPORT, "Back-driveability (table II)", &[axis], column), 1.0, 2))
            .join(", ")
    };
    let said = format!(
        "{} mN m. The friction of cage and joints predicts {} mN m; the paper has 5, 4, 4 mN m",
        of("measured, mN m"),
        of("predicted")
    );
    assert!(PLANT.contains(&said), "docs/internals/plant.md should say: {said}");
}
