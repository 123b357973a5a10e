//! docs/paper.md, and the back-drive torques of docs/internals/plant.md, against
//! docs/paper/report.md.

use super::{cell, check, filled, left_over, numbers, rounded};

const PAGE: &str = include_str!("../../../../../docs/paper.md");
const PLANT: &str = include_str!("../../../../../docs/internals/plant.md");
const REPORT: &str = include_str!("../../../../../docs/paper/report.md");

const THREE: &str = "no drive 2 (the paper's three)";
const AXES: [&str; 3] = ["n1", "n2", "n3"];

/// Returns a figure from a table of the report, rounded to the given number of decimals.
fn figure(section: &str, row: &[&str], column: &str, decimals: usize) -> String {
    rounded(&cell(REPORT, section, row, column), 1.0, decimals)
}

fn geometry() -> Vec<String> {
    let singular = |motors: &str, column: &str, decimals| {
        figure("Singularities (section III)", &[motors], column, decimals)
    };
    let least = |contacts: &str, axis: &str, decimals| {
        figure("Torque capability (table II)", &[contacts, "peak", axis], "least", decimals)
    };
    let (free, grip) = ("all four, free", "all four, with grip");
    let index = |column: &str, decimals| {
        figure("Conditioning and dynamic manipulability (section V)", &[THREE], column, decimals)
    };
    let torques = [
        (free, "n1", 1),
        (free, "n2", 1),
        (free, "n3", 1),
        (grip, "n1", 2),
        (grip, "n2", 2),
        (grip, "n3", 2),
    ];
    let moved = REPORT.split("Leaving it out moves GCI by -").nth(1).expect("the weight's effect on GCI");
    vec![
        filled("its spectral index is at least {}", &[singular("all four", "least spectral index", 2)]),
        filled("and below 0.1 on {} % of it", &[singular(THREE, "below 0.1 on", 0)]),
        filled(
            "it makes {}, {} and {} N m about n1, n2 and n3 at peak; contacts with a traction limit of 8 N hold {}, {} and {} N m",
            &torques.map(|(contacts, axis, decimals)| least(contacts, axis, decimals)),
        ),
        filled(
            "the best one is wrong by a factor of {}",
            &[figure(
                "Torque capability (table II)",
                &["three motors, each axis alone"],
                "best for both rows in one posture",
                2,
            )],
        ),
        filled(
            "{} over the torus, {} the paper's way",
            &[
                index("GCI spectral, torus", 3),
                rounded(
                    &cell(
                        REPORT,
                        "Conditioning and dynamic manipulability (section V)",
                        &["over SO(3) the paper's way, as above"],
                        "GCI spectral",
                    ),
                    1.0,
                    2,
                ),
            ],
        ),
        filled("The Frobenius norm that the paper states gives {}", &[index("GCI Frobenius, torus", 2)]),
        filled(
            "without sin theta they move GCI by {}",
            &[rounded(moved.trim_end_matches('.').split(".\n").next().unwrap_or_default(), 1.0, 2)],
        ),
        filled("three motors give {}", &[index("GMI, torus", 2)]),
    ]
}

fn simulated() -> Vec<String> {
    let bandwidth = "Position bandwidth (fig. 5, fig. 6, table II)";
    let backdrive = |axis: &str| figure("Back-driveability (table II)", &[axis], "measured, mN m", 1);
    let gain = |loops: &str| figure(bandwidth, &[loops], "K_O for 5.5 Hz (linear loop), 1/s", 0);
    let quick = |amplitude: &str, decimals| figure(bandwidth, &[amplitude], "K_O 100 1/s", decimals);
    let chirp =
        |row: &str, column: &str, decimals| figure("Following a chirp (fig. 7)", &[row], column, decimals);
    let slope = check(REPORT, "the ideal rig renders every stiffness within 0.1 % by the geodesic law");
    let left = check(REPORT, "a better gain leaves less than 1e-3 rad about each axis");
    let soft = figure(
        "Rendered stiffness (fig. 8, table III)",
        &["torque constant 5 % low"],
        "n1, 4: error, % (R²)",
        1,
    );
    vec![
        filled("torques are {}, {} and {} mN m about n1, n2 and n3", &AXES.map(backdrive)),
        filled(
            "a bandwidth of 5, 10, 20 or 40 Hz, then K_O of {}, {}, {} and {} 1/s give it",
            &["5", "10", "20", "40"].map(gain),
        ),
        filled(
            "at a gain with which swings of 0.01 rad reach {} Hz, swings of 0.3 rad reach {} Hz",
            &[quick("0.01", 0), quick("0.3", 1)],
        ),
        filled(
            "With K_O t = {} they are the paper's",
            &[figure(
                "Inverse-kinematics control (V.D, fig. 6)",
                &["as eq. 23 gives it"],
                "RMS at the end: K_O t",
                0,
            )],
        ),
        filled("at a better gain they are {} rad", &[format!("{:.0e}", super::number(&left))]),
        filled(
            "tracks to {} % RMS at the joints and {} % by camera",
            &[chirp("all together", "at the joints, %", 2), chirp("all together", "by camera, %", 2)],
        ),
        filled("({} % at 3 N)", &[chirp("wheels pressed on with 3 N", "by camera, %", 0)]),
        filled("ideal slopes are within {} % of what was asked", &[super::number(&slope).to_string()]),
        filled("makes each of them {} % too soft", &[soft.trim_start_matches('-').to_owned()]),
    ]
}

/// Texts in docs/paper.md with numbers that the report does not compute: figures of the paper, and
/// limits that the study chooses.
const OF_THE_PAPER: [&str; 5] = [
    "GCI 0.41 is nearest",
    "No reading of GMI that was tried gives 0.5",
    "5.5 Hz is a choice of gains",
    "Large swings are limited by the torque limit of 0.9 N m",
    "paper's scatter (R² of 0.98 to 0.99)",
];

#[test]
fn every_figure_of_the_page_is_the_reports() {
    let said = geometry().into_iter().chain(simulated()).chain(OF_THE_PAPER.map(str::to_owned));
    let left = left_over("docs/paper.md", PAGE, said);
    assert_eq!(numbers(&left), [""; 0], "docs/paper.md quotes what this test does not look up");
}

#[test]
fn the_simulator_s_back_drive_torques_are_the_reports() {
    let of =
        |column: &str| AXES.map(|axis| figure("Back-driveability (table II)", &[axis], column, 2)).join(", ");
    let said = format!(
        "{} mN m. The friction of cage and joints predicts {} mN m; the paper has 5, 4, 4 mN m",
        of("measured, mN m"),
        of("predicted")
    );
    assert!(PLANT.contains(&said), "docs/internals/plant.md should say: {said}");
}
