//! The figure and the numbers of docs/internals/allocation.md come from the allocation itself.
//!
//! `HBOT_BLESS=1 cargo test -p hbot-study allocation_page` draws the figure again.

use std::path::PathBuf;

use hbot_config::rig::RigConfig;
use hbot_core::Vec3;
use hbot_core::allocation::{Allocation, JointLimits, allocate, allocate_clipped, capability};
use hbot_core::design::kinematics::Posture;
use hbot_plot::{Lines, Series};

const PAGE: &str = include_str!("../../../../docs/internals/allocation.md");

/// Steer angles of both wheels in the page's example, rad.
const STEER: [f64; 2] = [0.3, -0.5];

/// Wanted torque on the sphere in the page's example, in frame N, in N m.
const WANTED: Vec3 = Vec3::new(2.4, 0.0, 1.8);

/// The prototype at the steer angles of the page's example.
struct Example {
    posture: Posture,
    limits: JointLimits,
}

impl Example {
    fn new() -> Self {
        let rig = RigConfig::prototype().rig;
        Self { posture: Posture::new(&rig.device, &STEER), limits: JointLimits::of(&rig) }
    }

    fn exact(&self, wanted: Vec3) -> Allocation {
        allocate(self.posture.rows(), &self.limits, wanted)
    }

    fn clipped(&self, wanted: Vec3) -> Allocation {
        allocate_clipped(self.posture.rows(), &self.limits, wanted)
    }

    /// Returns the border of a region of torques in the plane of n1 and n3, N m. `largest` gives
    /// the largest torque in a direction.
    fn border(&self, largest: impl Fn(Vec3) -> f64) -> Vec<(f64, f64)> {
        (0..=360)
            .map(|degree| {
                let (n3, n1) = f64::from(degree).to_radians().sin_cos();
                let size = largest(Vec3::new(n1, 0.0, n3));
                (size * n1, size * n3)
            })
            .collect()
    }

    fn figure(&self) -> String {
        // A torque far beyond every limit is scaled down to the border of its region.
        let far = 100.0;
        let line = |name: &str, points, colour, open| Series { name: name.to_owned(), points, colour, open };
        let at = |torque: Vec3| (torque.x, torque.z);
        Lines {
            title: "Torques that the prototype can make at one posture".to_owned(),
            x: "torque about n1, N m".to_owned(),
            y: "torque about n3, N m".to_owned(),
            log: [false; 2],
            series: vec![
                line("border of regime 1", self.border(|way| far * self.clipped(way * far).scale), 0, false),
                line(
                    "border of regime 2 (the capability)",
                    self.border(|way| capability(self.posture.rows(), &self.limits, way)),
                    1,
                    false,
                ),
                line("T, the torque wanted", vec![(0.0, 0.0), at(WANTED)], 6, true),
                line("s T by exact", vec![at(WANTED * self.exact(WANTED).scale)], 2, false),
                line("s T by clipped", vec![at(WANTED * self.clipped(WANTED).scale)], 3, false),
            ],
            front: false,
        }
        .svg()
    }
}

#[test]
fn the_figure_is_that_of_the_allocation() {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../docs/internals/allocation.svg");
    let drawn = Example::new().figure();
    if std::env::var_os("HBOT_BLESS").is_some() {
        std::fs::write(&path, &drawn).expect("the docs folder can be written");
    }
    let kept = std::fs::read_to_string(&path).expect("the page has its figure");
    assert!(kept == drawn, "docs/internals/allocation.svg is not what the allocation gives: bless it");
}

#[test]
fn the_page_quotes_what_the_allocation_gives() {
    let example = Example::new();
    let (exact, clipped) = (example.exact(WANTED), example.clipped(WANTED));
    let joints = |found: &Allocation| {
        let torques = found.torque[..4].iter().map(|tau| format!("{tau:.3}"));
        torques.collect::<Vec<_>>().join(", ")
    };
    for said in [
        format!("| `exact` | {} | {:.3} |", joints(&exact), exact.scale),
        format!("| `clipped` | {} | {:.3} |", joints(&clipped), clipped.scale),
    ] {
        assert!(PAGE.contains(&said), "docs/internals/allocation.md has not: {said}");
    }
}
