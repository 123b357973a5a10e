//! The study `design`: its ids, the prototype's figures, the gain of more wheels, the fronts, and
//! rig files that match the measured designs.

use std::sync::OnceLock;

use hbot_config::RigConfig;
use hbot_core::design::kinematics::Posture;
use hbot_core::design::singularity::{Indices, interior_margin_over_all};
use hbot_study::{Report, Study, StudyOptions, run};

use crate::{assert_documented, assert_holds, options, value};

const WHEELS: [u32; 3] = [2, 3, 4];

/// Returns one quick run of the study and the folder with its files. All tests share it, because a
/// run takes long.
pub(crate) fn study() -> &'static (Report, tempfile::TempDir) {
    static RUN: OnceLock<(Report, tempfile::TempDir)> = OnceLock::new();
    RUN.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a folder");
        let options = StudyOptions { out: Some(folder.path().to_owned()), ..options() };
        let (report, _) = run(Study::Design, &options).expect("it can be written");
        (report, folder)
    })
}

/// Returns the rig files that the study wrote: for each its name `<wheels>w_<which>` and its
/// content.
fn rigs() -> Vec<(String, RigConfig)> {
    let entries = std::fs::read_dir(study().1.path()).expect("a folder");
    let mut all: Vec<(String, RigConfig)> = entries
        .map(|entry| entry.expect("readable").path())
        .filter(|path| path.extension().is_some_and(|e| e == "toml"))
        .map(|path| {
            let config = RigConfig::from_path(&path).unwrap_or_else(|error| panic!("{error}"));
            let stem = path.file_stem().and_then(|stem| stem.to_str()).expect("UTF-8");
            (stem.strip_prefix("design_").expect("the study's").to_owned(), config)
        })
        .collect();
    all.sort_by(|a, b| a.0.cmp(&b.0));
    all
}

#[test]
fn every_figure_is_documented_and_every_check_holds() {
    let (report, _) = study();
    assert_documented(report);
    assert_holds(report);
    assert!(report.figures().iter().all(|figure| figure.id.starts_with("design_")));
    for wheels in WHEELS {
        for figure in ["gci", "torque", "contact_force", "slip_torque", "slip_seen", "inertia"] {
            assert!(value(report, &format!("design_wheels_{wheels}_{figure}")) > 0.0);
        }
        for which in ["compromise", "conditioning", "torque", "inertia", "steering"] {
            assert!(value(report, &format!("design_best_{wheels}w_{which}_gci")) > 0.0);
        }
    }
}

/// The figures of the prototype are those of docs/internals/physics.md, sections 3, 7, 11 and 12.
/// The prototype also equals the design with two of its wheels.
#[test]
fn the_prototype_is_what_the_notes_say() {
    let (report, _) = study();
    let p = |what: &str| value(report, &format!("design_prototype_{what}"));
    // The tolerances are the digits given there.
    assert!((p("gci") - 0.646).abs() < 0.5e-3, "{}", p("gci"));
    assert!((p("conditioning_least") - 0.50).abs() < 0.5e-2);
    assert!((p("steering_speed") - 5.76).abs() < 0.5e-2 && (p("drive_speed") - 102.0 / 15.5).abs() < 1e-9);
    assert!((p("contact_force") - 10.4).abs() < 0.05 && (p("slip_torque") - 0.77).abs() < 0.5e-2);
    // The torque in the worst direction is below the smallest one about n1, n2 and n3. It is above
    // the torque of one drive alone, 0.14 R/r sin 70 deg.
    assert!(p("torque") < 0.94 && p("torque") > 0.14 * 102.0 / 15.5 * 0.93, "{}", p("torque"));
    for what in ["gci", "torque", "inertia", "contact_force"] {
        let two = value(report, &format!("design_wheels_2_{what}"));
        assert!((two / p(what) - 1.0).abs() < 1e-12, "{what}");
    }
}

#[test]
fn more_wheels_bring_what_is_claimed_at_the_price_of_inertia() {
    let (report, _) = study();
    let of = |wheels: u32, what: &str| value(report, &format!("design_wheels_{wheels}_{what}"));
    for wheels in WHEELS {
        assert_eq!(of(wheels, "residual_dof"), f64::from(2 * wheels - 3));
    }
    // Each wheel adds at most its own J_th/sin² a or J_ph (R/r)² to the sphere's inertia.
    let most = 2.7e-5 / 0.1736_f64.powi(2);
    for wheels in WHEELS {
        assert!(of(wheels, "inertia") < 3.24e-3 + f64::from(wheels) * most);
    }
}

/// The best design for a figure is at least as good in it as every other reported design, and all
/// reported designs keep their margins.
#[test]
fn the_best_are_the_best_and_keep_their_margins() {
    let (report, _) = study();
    for wheels in WHEELS {
        let of = |which: &str, what: &str| value(report, &format!("design_best_{wheels}w_{which}_{what}"));
        for which in ["compromise", "conditioning", "torque", "inertia", "steering"] {
            assert!(of("conditioning", "gci") >= of(which, "gci"));
            assert!(of("torque", "torque") >= of(which, "torque"));
            assert!(of("inertia", "inertia") <= of(which, "inertia"));
            assert!(of("steering", "steering_speed") <= of(which, "steering_speed"));
            for (margin, least) in [
                ("interior", 0.25),
                ("conditioning_least", 0.25),
                ("slip_torque", 0.75),
                ("gap_rad", 0.0),
                ("headroom_rad", 0.0),
            ] {
                assert!(of(which, margin) >= least, "{wheels} wheels, {which}: {margin}");
            }
            assert!(of(which, "steering_speed") <= 10.0 && of(which, "drive_speed") <= 10.0 + 1e-9);
        }
        // Two wheels can never be conditioned better than 0.71; three and four can.
        assert_eq!(of("conditioning", "gci") > core::f64::consts::FRAC_1_SQRT_2, wheels > 2);
    }
}

/// The device in each rig file has the figures that the study reports for that design. The figures
/// are computed again with the core's functions.
#[test]
fn rig_files_are_the_designs_that_were_measured() {
    let (report, _) = study();
    let rigs = rigs();
    assert!(rigs.len() >= 15, "{}", rigs.len());
    for (name, config) in &rigs {
        let device = &config.rig.device;
        let of = |what: &str| value(report, &format!("design_best_{name}_{what}"));
        let wheel = device.wheels()[0];
        assert!((1.0 / wheel.axis_along_roll() / of("steering_speed") - 1.0).abs() < 1e-12, "{name}");
        assert!((interior_margin_over_all(device) - of("interior")).abs() < 1e-12, "{name}");
        let mut mean = 0.0;
        let n = 2000;
        for k in 0..n {
            // Another even sequence over the torus than the study's: square roots of primes.
            let roots = [2.0_f64, 3.0, 5.0, 7.0];
            let th: Vec<f64> = device
                .wheels()
                .iter()
                .zip(roots)
                .map(|(_, root)| core::f64::consts::TAU * (f64::from(k) * root.sqrt()).fract())
                .collect();
            let index = Indices::of(Posture::new(device, &th).rows()).spectral;
            assert!(index > of("conditioning_least") - 1e-9, "{name}: {index} at {th:?}");
            mean += index / f64::from(n);
        }
        // The two means come from different samples of a smooth function.
        assert!((mean / of("gci") - 1.0).abs() < 0.01, "{name}: {mean}");
    }
}
