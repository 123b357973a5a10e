//! `accuracy`: its ids, its orders, and that errors are of the size that docs/physics.md gives.

use hbot_study::Study;

use crate::{assert_documented, assert_holds, measure, value};

/// Others read these ids.
fn promised() -> Vec<String> {
    let rates = [500, 1000, 2000, 4000, 8000];
    let mut ids = Vec::new();
    for method in ["euler", "midpoint", "magnus4"] {
        for width in ["f64", "f32"] {
            ids.push(format!("odometry_{method}_straight_{width}_ns"));
            for hz in rates {
                ids.push(format!("odometry_segments_{method}_{width}_{hz}hz_drift_rad"));
                for motion in ["gentle", "brisk", "violent"] {
                    ids.push(format!("odometry_{motion}_{method}_straight_{width}_{hz}hz_drift_rad"));
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
    for preset in ["fast", "balanced", "exact"] {
        ids.extend(["ns", "error_rad", "max_hz"].map(|what| format!("tick_{preset}_{what}")));
    }
    ids
}

/// The orders of all methods are among its checks, within 0.1 of theory.
#[test]
fn every_figure_that_was_promised_is_there_and_every_check_holds() {
    let report = measure(Study::Accuracy);
    assert_documented(&report);
    assert_holds(&report);
    for id in promised() {
        assert!(value(&report, &id) >= 0.0);
    }
    let orders = report.checks().iter().filter(|check| check.what.contains("order within")).count();
    // Three methods at constant rates, three in each of three motions, four of the plant.
    assert!(orders >= 3 + 9 + 4, "{orders} orders were told");

    // docs/physics.md, section 4, medians of brisk turns in 0.6 s at 1 kHz: other turns, so within a factor of 3.
    for (method, drift) in [("euler", 2.5e-3), ("midpoint", 2.4e-6), ("magnus4", 4e-12)] {
        let measured = value(&report, &format!("odometry_segments_{method}_f64_1000hz_drift_rad"));
        assert!(measured / drift < 3.0 && drift / measured < 3.0, "{method}: {measured:e} against {drift:e}");
    }
    // On a straight path a better method buys nothing, and quantising costs more than either.
    let brisk = |method: &str, width: &str| {
        value(&report, &format!("odometry_brisk_{method}_straight_{width}_1000hz_drift_rad"))
    };
    assert!(brisk("magnus4", "f64") > 0.5 * brisk("midpoint", "f64"));
    assert!(
        value(&report, "odometry_brisk_magnus4_straight_counts_1000hz_drift_rad") > brisk("magnus4", "f64")
    );
    // The task's best error, and its order-4 methods at 1 ms, far below what a loop needs.
    assert!(value(&report, "plant_rk4_50us_error_rad") < 1e-12);
    assert!(value(&report, "plant_rk4_1000us_error_rad") < 1e-7);
}
