//! Identifies rigs that differ from their drawing, from exact motions whose angles are rounded to
//! counts.

use hbot_config::RigConfig;
use hbot_core::design::rig::OdometryMethod;
use hbot_core::{Device, MAX_JOINTS, Quat, Rig, Vec3};
use hbot_identify::compare::Geometry;
use hbot_identify::identify::{Identified, Name};
use hbot_identify::motion::Counts;
use hbot_identify::{Recorded, Refusal, What, identify};
use hbot_sim::wander::{Built, Wander};

const H: f64 = 1e-3;
/// Speed of the hand about each axis, rad/s.
const SPEED: f64 = 1.0;

fn rig(file: &str) -> Rig {
    let path = format!("{}/../../rigs/{file}.toml", env!("CARGO_MANIFEST_DIR"));
    RigConfig::from_path(path.as_ref()).expect("legal").rig
}

/// What encoders count while a hand turns the sphere for `seconds`, and the sphere's orientations.
fn turned(rig: &Rig, built: &Built, wander: &Wander, seconds: f64) -> (Vec<Counts>, Vec<Quat>) {
    let count = |angles: &[f64; MAX_JOINTS]| {
        std::array::from_fn(|j| {
            let zero = if j % 2 == 0 { built.zeros.get(j / 2).copied().unwrap_or(0.0) } else { 0.0 };
            ((angles[j] - zero) / rig.joints[j].radians_per_count()).floor() as i32
        })
    };
    let moments = wander.course(&built.device, H).take((seconds / H) as usize);
    moments.map(|moment| (count(&moment.angles), moment.q)).unzip()
}

fn recorded(counts: Vec<Counts>) -> [Recorded; 1] {
    [Recorded { parts: vec![counts], period_s: H, pushed_s: 0.0 }]
}

fn found_in(rig: &Rig, counts: Vec<Counts>) -> Result<Identified, Refusal> {
    identify(rig, &recorded(counts), What::Geometry, &mut |_, _| ())
}

fn geometry(rig: &Rig, found: &Identified) -> Geometry {
    let drawn = &rig.device;
    let device = Device::new(drawn.sphere_radius(), drawn.sphere_mass(), &found.wheels).expect("legal");
    Geometry { device, zeros: found.zeros.clone() }
}

/// The geometry of a rig as built. Counts are rounded down, so half a count belongs to the zeros.
fn truth(rig: &Rig, built: &Built) -> Geometry {
    let half = |(i, zero): (usize, &f64)| zero + 0.5 * rig.joints[2 * i].radians_per_count();
    Geometry { device: built.device, zeros: built.zeros.iter().enumerate().map(half).collect() }
}

#[test]
fn three_random_rigs_are_found_and_their_orientation_drifts_little() {
    for (file, seed) in [("prototype", 1), ("three_wheels", 2), ("four_wheels", 3)] {
        let rig = rig(file);
        let built = Built::new(&rig.device, seed).expect("near the drawing");
        let (counts, _) = turned(&rig, &built, &Wander::new(seed, Vec3::splat(SPEED)), 60.0);
        let begun = std::time::Instant::now();
        let found = found_in(&rig, counts).expect("a good recording");
        let took = begun.elapsed();
        let (counts, real) = turned(&rig, &built, &Wander::new(seed + 100, Vec3::splat(SPEED)), 36.0);
        let (geometry, truth) = (geometry(&rig, &found), truth(&rig, &built));
        let computed = geometry.orientations(&rig, OdometryMethod::Midpoint, &counts);
        let drift = geometry.drift(&truth, &computed, &real);
        let drawn = Geometry { device: rig.device, zeros: vec![0.0; built.zeros.len()] };
        let computed = drawn.orientations(&rig, OdometryMethod::Midpoint, &counts);
        let before = drawn.drift(&truth, &computed, &real);
        println!(
            "{file}: {took:?}, drift {:.3} and {:.3} mrad, drawn {:.1}, stiffness {:.2e}, drawn {:.2e}, slip {:?}, out {:.3}",
            1e3 * drift[3600], 1e3 * drift[drift.len() - 1], 1e3 * before[before.len() - 1],
            geometry.stiffness_error(&truth), drawn.stiffness_error(&truth), found.share, found.left_out
        );
        for value in &found.values {
            let truth = match (value.name, value.wheel) {
                (Name::Cone, Some(i)) => built.device.wheels()[i].spec().cone,
                (Name::Toe, Some(i)) => built.device.wheels()[i].spec().toe,
                (Name::Radius, Some(i)) => built.device.wheels()[i].spec().radius,
                (Name::Axis(k), Some(i)) => built.device.wheels()[i].spec().axis[k],
                (Name::Zero, Some(i)) => built.zeros[i],
                _ => 0.0,
            };
            println!(
                "  {:?} {}: drawn {:.6} true {truth:.6} found {:.6} +- {:.6} {} {:.2}",
                value.wheel, value.name, value.drawn, value.found, value.interval, value.seen,
                (value.found - truth) / value.interval * 1.96
            );
        }
        assert!(drift[3600] < 0.5e-3, "{file}: {:e}", drift[3600]);
        assert!(drift[drift.len() - 1] < 2e-3, "{file}: {:e}", drift[drift.len() - 1]);
        assert!(geometry.stiffness_error(&truth) < 0.01);
        assert!(found.missing().is_empty());
    }
}
