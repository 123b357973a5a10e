//! The study `accuracy`: its ids, the orders of its methods, and errors of the size given in
//! docs/internals/physics.md.

use hbot_config::RigConfig;
use hbot_host::commission::expectation;
use hbot_study::Study;

use crate::tables::ACCURACY;
use crate::{assert_documented, assert_holds, measure, value};

const PATHS: [&str; 3] = ["straight", "quadratic", "cubic"];

/// Returns ids of figures on which other programs and pages rely.
fn promised() -> Vec<String> {
    let rates = [500, 1000, 2000, 4000, 8000];
    let mut ids = Vec::new();
    for method in ["euler", "midpoint", "magnus4"] {
        for width in ["f64", "f32"] {
            ids.extend(PATHS.map(|path| format!("odometry_{method}_{path}_{width}_ns")));
            for hz in rates {
                ids.push(format!("odometry_segments_{method}_{width}_{hz}hz_drift_rad"));
                for motion in ["gentle", "brisk", "violent"] {
                    let id = |path| format!("odometry_{motion}_{method}_{path}_{width}_{hz}hz_drift_rad");
                    ids.extend(PATHS.map(id));
                }
            }
        }
    }
    for method in ["semi_implicit_euler", "midpoint", "rk4", "rkmk4"] {
        for step_us in [4000, 1000, 250, 50] {
            ids.push(format!("plant_{method}_{step_us}us_error_rad"));
            ids.push(format!("plant_{method}_{step_us}us_ms_per_s"));
        }
    }
    for step_us in [1000, 250, 50] {
        ids.push(format!("plant_nonsmooth_{step_us}us_error_rad"));
        ids.push(format!("plant_nonsmooth_{step_us}us_ms_per_s"));
    }
    for preset in ["fast", "balanced", "exact"] {
        ids.extend(["ns", "error_rad", "max_hz"].map(|what| format!("tick_{preset}_{what}")));
    }
    ids
}

/// The study reports every figure on which others rely, and all its checks hold. Among the checks,
/// the order of every method is within 0.1 of theory.
#[test]
fn every_figure_that_was_promised_is_there_and_every_check_holds() {
    let report = measure(Study::Accuracy);
    assert_documented(&report);
    assert_holds(&report);
    for id in promised() {
        assert!(value(&report, &id) >= 0.0);
    }
    let orders = report.checks().iter().filter(|check| check.what.contains("order within")).count();
    // Three methods at constant rates; three methods on three paths in each of three motions,
    // except the best method on the best path of the gentle motion, which is at the floor; four
    // methods of the plant; one of the plant that slips.
    assert_eq!(orders, 3 + 27 - 1 + 4 + 1, "orders that were told");

    // docs/internals/physics.md, section 4: medians over the turns of a full run. A quick run has a
    // tenth of the turns, hence the factor of 2.
    for (method, drift) in [("euler", 1.9e-3), ("midpoint", 2.0e-6), ("magnus4", 3.2e-12)] {
        let measured = value(&report, &format!("odometry_segments_{method}_f64_1000hz_drift_rad"));
        assert!(measured / drift < 2.0 && drift / measured < 2.0, "{method}: {measured:e} against {drift:e}");
    }
    // On a straight path a better method gains nothing, and on a curved one it does. Quantisation
    // costs more than either.
    let brisk = |choice: &str| value(&report, &format!("odometry_brisk_{choice}_1000hz_drift_rad"));
    assert!(brisk("magnus4_straight_f64") > 0.5 * brisk("midpoint_straight_f64"));
    assert!(brisk("magnus4_quadratic_f64") < 0.1 * brisk("magnus4_straight_f64"));
    assert!(brisk("magnus4_cubic_f64") < 0.1 * brisk("magnus4_quadratic_f64"));
    assert!(brisk("magnus4_straight_counts") > brisk("magnus4_straight_f64"));

    // The best error of the task, and the error of the methods of order 4 at 1 ms, which is far
    // below what a loop needs.
    assert!(value(&report, "plant_rk4_50us_error_rad") < 1e-12);
    assert!(value(&report, "plant_rk4_1000us_error_rad") < 1e-7);
    // The server's error at start is that of the whole tick, computed in another way: there the
    // scene's torque moves nothing. Both are the largest errors over 10 s. The error of the counts
    // depends on where the motion begins, so they agree within a factor of 2.
    let (whole, told) =
        (value(&report, "tick_balanced_error_rad"), expectation::of(&RigConfig::prototype().rig).error);
    assert!(told < 2.0 * whole && whole < 2.0 * told, "{told:e} against {whole:e}");
    // The report that the pages quote has the sections, tables and families of figures that this
    // study writes.
    assert_eq!(outline(&report.markdown()), outline(ACCURACY));
}

/// Returns the lines of a report that do not change between runs: its title, headings, table
/// headers, and the meanings of ids.
fn outline(report: &str) -> Vec<&str> {
    let lines: Vec<&str> = report.lines().collect();
    let fixed = |(k, line): (usize, &&str)| {
        let head = lines.get(k + 1).is_some_and(|next| next.starts_with("|---"));
        line.starts_with('#') || head || line.starts_with("| `")
    };
    lines.iter().enumerate().filter(|(k, line)| fixed((*k, line))).map(|(_, line)| *line).collect()
}
