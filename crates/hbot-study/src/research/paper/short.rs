//! What the study `paper` found, in short.

use hbot_plot::short;

use crate::report::Report;

/// Adds the conclusions to the report.
pub(super) fn conclude(report: &mut Report) {
    let value = |id: &str| report.value(id);
    let about = |id: &dyn Fn(&str) -> String, scale: f64, decimals: usize| {
        ["n1", "n2", "n3"].map(|axis| format!("{:.decimals$}", scale * value(&id(axis)))).join(", ")
    };
    let singular = format!(
        "With all four motors the prototype is never singular: its spectral index is at least {:.2}. With the paper's three it is below 0.1 on {:.0} % of all postures.",
        value("actuation_least_four_motors"),
        100.0 * value("actuation_below_10pct_three_motors_fraction")
    );
    let gci = format!(
        "The paper's GCI of 0.41 is that of three motors by the spectral norm, {:.3}, not by the Frobenius norm that it states, {:.2}. Four motors have {:.3}.",
        value("gci_three_motors_spectral_torus"),
        value("gci_three_motors_frobenius_torus"),
        value("gci_four_motors_spectral_torus")
    );
    let torque = format!(
        "In every posture the prototype makes {} N m about n1, n2, n3 at peak. No posture meets both rows of the paper's table II.",
        about(&|axis| format!("peak_torque_{axis}_nm"), 1.0, 2)
    );
    let fitted = format!(
        "Two results are fits, and prove nothing: friction is chosen so that back-driving takes about what the paper says ({} mN m, the paper 5, 4, 4), and K_O t = {:.1} so that the errors of V.D have the paper's mean.",
        about(&|axis| format!("backdrive_{axis}_nm"), 1.0e3, 1),
        value("ik_product_printed")
    );
    let bandwidth = format!(
        "The paper's bandwidth of 5.5 Hz is a choice of gains; here {} Hz with K_O 50 1/s. A torque constant 5 % low makes a spring of 4 N m/rad about n1 {} % soft, as in table III.",
        short(value("bandwidth_hz")),
        short(-value("stiffness_n1_4_effect_torque_scale_percent"))
    );
    report.in_short("margins", [singular, gci, torque, bandwidth, fitted]);
}
