//! Output of a design as a rig file.

use std::fmt::Write as _;

use super::margins::grip;
use super::space::{DEGREE, Design, MODULE_MASS, Parts};
use super::torus::Measures;

/// Torque limit in the rig file, as a fraction of the torque that motors and contacts can give.
const RESERVE: f64 = 0.95;

/// Returns the torque limit for the rig file of a design, N m, rounded down to 0.01 N m. Motors and
/// contacts can give this torque in every direction.
pub(super) fn torque_limit(parts: &Parts, measures: &Measures) -> f64 {
    let most = measures.torque.min(measures.slips_from(grip(parts)));
    (RESERVE * most * 100.0).floor() / 100.0
}

/// Returns the text of a rig file for a design. Dimensions and inertias are those of the design,
/// and everything else is as in `rigs/prototype.toml`.
pub(super) fn text(parts: &Parts, name: &str, design: &Design, measures: &Measures) -> String {
    let mut out = String::new();
    let degrees = |x: f64| x / DEGREE;
    let _ = write!(
        out,
        "# A design found by `hbot-study design`: {} wheels evenly about n3, axes {:.1} degrees from -n3, cone {:.1}, toe {:.1} degrees, wheels of\n\
         # {:.1} mm. Sphere, motors, gears and encoders are the prototype's (rigs/prototype.toml). Nobody has built it.\n\
         # Mean spectral index {:.3}; peak torque in any direction {:.2} N m, before slip {:.2} N m; apparent inertia up to {:.2e} kg m².\n\n\
         name = \"{name}\"\n\n\
         [sphere]\nradius = {} # m\nmass = {} # kg\n",
        design.wheels,
        degrees(design.tilt),
        degrees(design.cone),
        degrees(design.toe),
        1.0e3 * design.radius,
        measures.gci,
        measures.torque,
        measures.slips_from(grip(parts)),
        measures.inertia,
        parts.sphere_radius(),
        parts.rig.device.sphere_mass(),
    );
    for k in 0..design.wheels {
        wheel(&mut out, parts, design, k);
    }
    let limits = &parts.rig.limits;
    let _ = write!(
        out,
        "\n[limits]\n\
         torque = {} # N m; {RESERVE} of what motors and contacts give in the worst direction at the worst posture\n\
         torque_rate = {} # N m/s\nspeed = {} # rad/s\nslip = {} # m/s\n",
        torque_limit(parts, measures),
        limits.torque_rate,
        limits.speed,
        limits.slip,
    );
    if let Some(traction) = limits.traction {
        let _ = writeln!(
            out,
            "traction = {{ mu = {}, normal_force = {} }} # N, on each wheel",
            traction.mu, traction.normal_force
        );
    }
    out
}

fn wheel(out: &mut String, parts: &Parts, design: &Design, k: usize) {
    // A tiny value from rounding would only confuse the reader, so it becomes zero.
    let [x, y, z] = design.axis(k).to_array().map(|v| if v.abs() < 1.0e-15 { 0.0 } else { v });
    let name = char::from(b'A' + k as u8);
    let _ = write!(
        out,
        "\n[[wheel]]\nname = \"{name}\"\naxis = [{x:?}, {y:?}, {z:?}]\ncone = {} # rad\ntoe = {} # rad\nradius = {} # m\n",
        design.cone, design.toe, design.radius
    );
    let inertias = [
        (
            parts.steer_inertia(design),
            format!("the rotor and {:.0} g of module on its arm", 1.0e3 * MODULE_MASS),
        ),
        (parts.drive_inertia(design), "the rotor through its gear, and the wheel".to_owned()),
    ];
    for (i, (what, (inertia, why))) in ["steer", "drive"].iter().zip(inertias).enumerate() {
        let joint = &parts.rig.joints[i];
        let zero = if i == 0 { "zero = \"assume\"\n" } else { "" };
        let _ = write!(
            out,
            "\n[wheel.{what}]\ncontroller = {}\ncounts_per_turn = {}\ngear = {}\n{zero}inertia = {inertia:.6e} # kg m², {why}\n\
             peak = {} # N m\ncontinuous = {} # N m\n",
            2 * k + i,
            joint.counts_per_turn,
            joint.gear,
            joint.peak,
            joint.continuous,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::super::search::measure;
    use super::super::torus::SEARCH;
    use super::*;
    use hbot_config::RigConfig;

    /// A rig file, when it is read again, describes the design from which it was written.
    #[test]
    fn a_file_says_what_was_measured() {
        let parts = Parts::prototype();
        let design = Design { wheels: 4, cone: 0.2, toe: 0.05, tilt: 0.95, radius: 0.0141 };
        let measures = measure(&parts, &design, SEARCH).expect("legal");
        let text = text(&parts, "Four wheels", &design, &measures);
        let config = RigConfig::from_toml(&text, "x.toml").unwrap_or_else(|mistakes| panic!("{mistakes}"));
        let device = parts.device(&design).expect("legal");
        for (read, made) in config.rig.device.wheels().iter().zip(device.wheels()) {
            let (read, made) = (read.spec(), made.spec());
            assert!((read.axis - made.axis).length() < 1e-15);
            assert_eq!((read.cone, read.toe, read.radius), (made.cone, made.toe, made.radius));
            // The tolerance is the number of digits in the file.
            assert!((read.steer_inertia / made.steer_inertia - 1.0).abs() < 1e-6);
            assert!((read.drive_inertia / made.drive_inertia - 1.0).abs() < 1e-6);
        }
        for (read, given) in config.rig.joints[..8].iter().zip(parts.rig.joints[..4].iter().cycle()) {
            assert_eq!(read, given);
        }
        let limits = &config.rig.limits;
        assert!(limits.torque > 0.0 && limits.torque < measures.torque.min(measures.slips_from(8.0)));
        assert_eq!(hbot_core::design::rig::Limits { torque: 0.9, ..*limits }, parts.rig.limits);
    }
}
