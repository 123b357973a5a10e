//! Compares the plant with vectors that an independent program computed from the physics notes.

use std::path::PathBuf;

use hbot_core::design::device::{Device, WheelSpec};
use hbot_core::{Quat, Vec3, rotation};
use hbot_sim::plant::{Load, Method, Plant, PlantState, Sine, SpringDamper, Sum};
use serde_json::Value;

/// Reads all test cases of one JSON file in the folder `tests/golden`.
fn cases(name: &str) -> Vec<Value> {
    let folder = std::env::var_os("HBOT_GOLDEN")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/golden"), PathBuf::from);
    let path = folder.join(name);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let file: Value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    file["cases"].as_array().unwrap().clone()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

fn vector(value: &Value) -> Vec3 {
    Vec3::from_slice(&numbers(value))
}

fn quaternion(value: &Value) -> Quat {
    rotation::from_wxyz(numbers(value).try_into().unwrap()).unwrap()
}

fn device(value: &Value) -> Device {
    let wheel = |w: &Value| {
        let number = |key: &str| w[key].as_f64().unwrap();
        WheelSpec {
            axis: vector(&w["axis"]),
            cone: number("cone"),
            toe: number("toe"),
            radius: number("radius"),
            steer_inertia: number("steer_inertia"),
            drive_inertia: number("drive_inertia"),
            axial_inertia: w.get("axial_inertia").map_or(0.0, |x| x.as_f64().unwrap()),
        }
    };
    let wheels: Vec<_> = value["wheels"].as_array().unwrap().iter().map(wheel).collect();
    Device::new(value["sphere_radius"].as_f64().unwrap(), value["sphere_mass"].as_f64().unwrap(), &wheels)
        .unwrap()
}

fn padded<const N: usize>(values: &[f64]) -> [f64; N] {
    core::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0))
}

/// The plant's acceleration and energy equal those of the golden vectors. The vectors are accurate
/// to about 1e-12. The torques summed in a case are larger than their sum, which costs digits.
#[test]
fn dynamics() {
    let (mut worst_acceleration, mut worst_energy): (f64, f64) = (0.0, 0.0);
    for (i, case) in cases("dynamics.json").iter().enumerate() {
        let plant = Plant::new(&device(&case["device"])).unwrap();
        let state = PlantState {
            omega: vector(&case["omega"]),
            steer: padded(&numbers(&case["theta"])),
            ..PlantState::default()
        };
        let tau = padded(&numbers(&case["joint_torques"]));
        let wanted = vector(&case["acceleration"]);
        let acceleration = plant.acceleration(&state, vector(&case["torque"]), &tau);
        let off = (acceleration - wanted).length() / wanted.length();
        worst_acceleration = worst_acceleration.max(off);
        assert!(off < 1e-11, "dynamics.json, case {i}: acceleration {acceleration}, wanted {wanted}");

        let wanted = case["energy"].as_f64().unwrap();
        let off = (plant.energy(&state) - wanted).abs() / wanted;
        worst_energy = worst_energy.max(off);
        assert!(off < 1e-12, "dynamics.json, case {i}: energy {} J, wanted {wanted} J", plant.energy(&state));
    }
    println!("acceleration within {worst_acceleration:.1e} relative, energy within {worst_energy:.1e}");
}

struct Trajectory {
    plant: Plant,
    start: PlantState,
    spring: SpringDamper,
    drives: Vec<Sine>,
    samples: Vec<(f64, PlantState)>,
}

impl Trajectory {
    fn new(case: &Value) -> Self {
        let state = |q: &Value, theta: Vec<f64>, drive: Vec<f64>, omega: &Value| PlantState {
            q: quaternion(q),
            omega: vector(omega),
            steer: padded(&theta),
            drive: padded(&drive),
        };
        let sample = |s: &Value| {
            let joints = numbers(&s["joints"]);
            let every_other = |from: usize| joints.iter().skip(from).step_by(2).copied().collect();
            (s["t"].as_f64().unwrap(), state(&s["q"], every_other(0), every_other(1), &s["omega"]))
        };
        Self {
            plant: Plant::new(&device(&case["device"])).unwrap(),
            start: state(&case["q0"], numbers(&case["theta0"]), vec![], &case["omega0"]),
            spring: SpringDamper {
                stiffness: case["spring"]["stiffness"].as_f64().unwrap(),
                damping: case["spring"]["damping"].as_f64().unwrap(),
                reference: quaternion(&case["spring"]["q_desired"]),
            },
            drives: case["drive"]
                .as_array()
                .unwrap()
                .iter()
                .map(|d| Sine {
                    amplitude: vector(&d["axis"]) * d["amplitude"].as_f64().unwrap(),
                    hertz: d["hertz"].as_f64().unwrap(),
                })
                .collect(),
            samples: case["samples"].as_array().unwrap().iter().map(sample).collect(),
        }
    }

    fn load(&self) -> impl Load {
        let [first, second] = self.drives[..] else { panic!("two drives a case") };
        Sum(self.spring, Sum(first, second))
    }
}

/// Returns the largest difference between two states: of the orientation, a joint angle (rad), or
/// the angular velocity (rad/s).
fn distance(a: &PlantState, b: &PlantState) -> f64 {
    let joints = a.joints().iter().zip(b.joints()).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
    rotation::angle_between(a.q, b.q).max((a.omega - b.omega).length()).max(joints)
}

/// The adaptive reference integrator reproduces the golden trajectories. They come from an
/// integrator with tolerance 1e-13 and are accurate to 1e-10. Wheels act as casters and amplify
/// errors, so a difference of 1e-9 is accepted.
#[test]
fn trajectories_by_the_reference() {
    let mut worst: f64 = 0.0;
    for (i, case) in cases("trajectories.json").iter().enumerate() {
        let trajectory = Trajectory::new(case);
        let (mut state, mut t) = (trajectory.start, 0.0);
        for (at, wanted) in &trajectory.samples {
            trajectory
                .plant
                .advance_exactly(&mut state, t, at - t, &[0.0; 16], &trajectory.load(), 1e-13)
                .unwrap();
            t = *at;
            let off = distance(&state, wanted);
            worst = worst.max(off);
            assert!(
                off < 1e-9,
                "trajectories.json, case {i}, t = {t}: off by {off:e}: {state:?}, wanted {wanted:?}"
            );
        }
    }
    println!("reference within {worst:.1e}");
}

/// Each integration method approaches the end of a golden trajectory with its order: half the step
/// gives an error 2^order times smaller.
#[test]
fn trajectories_by_each_method() {
    for method in Method::ALL {
        let mut ratios = Vec::new();
        for (i, case) in cases("trajectories.json").iter().enumerate() {
            let trajectory = Trajectory::new(case);
            let (end, wanted) = trajectory.samples.last().unwrap();
            let off = [4000.0, 8000.0].map(|rate: f64| {
                let steps = (end * rate).round() as usize;
                let h = end / steps as f64;
                let mut state = trajectory.start;
                for k in 0..steps {
                    trajectory.plant.step(
                        method,
                        &mut state,
                        k as f64 * h,
                        h,
                        &[0.0; 16],
                        &trajectory.load(),
                    );
                }
                distance(&state, wanted)
            });
            println!("{method:?}, case {i}: off by {:.1e} at 4 kHz, {:.1e} at 8 kHz", off[0], off[1]);
            if method.order() == 4 {
                assert!(
                    off[1] < 1e-8,
                    "trajectories.json, case {i}, {method:?}: off by {:e} at 8 kHz",
                    off[1]
                );
            }
            // Below this the error of the vectors themselves matters.
            if off[1] > 2e-10 {
                ratios.push((off[0] / off[1]).log2());
            }
        }
        ratios.sort_by(f64::total_cmp);
        if let Some(order) = ratios.get(ratios.len() / 2) {
            assert!(
                (order - f64::from(method.order())).abs() < 0.3,
                "{method:?}: order {order:.2}, of {ratios:.2?}"
            );
        }
    }
}
