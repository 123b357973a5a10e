//! `hbot rig check --drawing`: a drawing of a rig with its sphere, wheels, cones and contact
//! frames.

use hbot_config::RigConfig;
use hbot_core::design::kinematics::{ContactFrame, Posture};
use hbot_core::{Device, MAX_WHEELS, Vec3};
use hbot_plot::{Pen, Sketch};

/// Corners of a circle that stands for a wheel.
const CORNERS: u32 = 48;

/// Returns the drawing of a rig with all steer angles at zero as SVG: from the side, and from below
/// the sphere.
pub(super) fn svg(config: &RigConfig) -> String {
    let device = &config.rig.device;
    let millimetres = |metres: f64| (1.0e5 * metres).round() / 100.0;
    let side = format!(
        "{}: sphere of radius R = {} mm, from the side",
        config.name,
        millimetres(device.sphere_radius())
    );
    let mut below = "from below; a cone is the angle from a steering axis l to its contact".to_owned();
    if let Some(traction) = config.rig.limits.traction {
        below = format!("{below}; N = {} N", traction.normal_force);
    }
    let mut panels = [Sketch::new(side, -70.0, 8.0), Sketch::new(below, -70.0, -62.0)];
    let posture = Posture::new(device, &[0.0; MAX_WHEELS][..device.wheels().len()]);
    for (k, sketch) in panels.iter_mut().enumerate() {
        for (axis, name) in [(Vec3::X, "n1"), (Vec3::Y, "n2"), (Vec3::Z, "n3")] {
            sketch.named(Vec3::ZERO, axis * 1.25, name, Pen::Thin);
        }
        for (i, frame) in posture.frames().iter().enumerate() {
            wheel(sketch, device, config, (i, frame), k == 1);
        }
    }
    Sketch::panels(&panels)
}

/// Draws wheel `i` at its contact. With `details`, names its sizes and its contact frame.
fn wheel(
    sketch: &mut Sketch,
    device: &Device,
    config: &RigConfig,
    (i, frame): (usize, &ContactFrame),
    details: bool,
) {
    let spec = device.wheels()[i].spec();
    let (colour, number) = (Pen::Strong(i), i + 1);
    let axis = spec.axis.normalize();
    let ratio = spec.radius / device.sphere_radius();
    sketch.named(Vec3::ZERO, axis * 1.55, &format!("l{number}"), Pen::Strong(6));
    sketch.circle(axis, spec.cone, Pen::Thin);
    // The wheel stands on its contact, in the plane of the normal and the rolling direction.
    let centre = frame.c3 * (1.0 + ratio);
    let rim = |k: u32| {
        let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / f64::from(CORNERS)).sin_cos();
        centre + (frame.c3 * cos + frame.c2 * sin) * ratio
    };
    sketch.line((0..=CORNERS).map(rim).collect(), colour);
    sketch.dot(frame.c3, i);
    // The angle of the cone, from the steering axis to the contact.
    let arc = |k: u32| axis.lerp(frame.c3, f64::from(k) / 8.0).normalize() * 1.02;
    sketch.line((0..=8).map(arc).collect(), colour);
    let name = &config.wheels[i];
    if !details {
        return;
    }
    let toe = if spec.toe == 0.0 { String::new() } else { format!(", toe {:.1} deg", spec.toe.to_degrees()) };
    let words = format!(
        "{name}: cone {:.1} deg{toe}, r = {} mm",
        spec.cone.to_degrees(),
        (1.0e5 * spec.radius).round() / 100.0
    );
    sketch.label(axis * 1.55, 30, &words, i);
    for (direction, part, length) in [(frame.c1, "c1", 0.32), (frame.c2, "c2", 0.32)] {
        sketch.named(frame.c3, frame.c3 + direction * length, part, colour);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drawing_names_the_sizes_of_every_wheel() {
        let config = RigConfig::prototype();
        let svg = svg(&config);
        for words in
            ["R = 102 mm", "A: cone 10.0 deg, r = 15.5 mm", "B: cone 10.0 deg", "n3", "l2", "c1", "N = 10 N"]
        {
            assert!(svg.contains(words), "{words}");
        }
        assert!(svg.starts_with("<svg") && !svg.contains("toe"));
    }
}
