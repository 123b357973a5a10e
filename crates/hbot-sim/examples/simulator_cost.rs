//! Measures the cost and accuracy of the plant's methods, and the cost of one tick of the simulated
//! rig. Prints the tables of `docs/internals/plant.md`.

use std::time::Instant;

use hbot_core::design::device::Device;
use hbot_core::design::rig::{Joint, Zero};
use hbot_core::{Quat, Vec3, rotation};
use hbot_link::{Command, MAX_COMMAND_FRAME, ToController, encode};
use hbot_sim::controller::{Lags, SimulatedJoint};
use hbot_sim::phenomena::{Encoder, Hand, Link, Motor, Phenomena};
use hbot_sim::plant::{Load, Method, Plant, PlantState, Sine, SpringDamper, Sum};
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};
use hbot_testing::prototype::{device_with, of_the_task};

/// Number of times that each measurement is repeated. Only the fastest run is reported, because
/// other work on the machine slows down the others.
const RUNS: usize = 15;

fn main() {
    let device = device_with(of_the_task);
    let plant = Plant::new(&device).expect("the prototype is a legal plant");
    let spring = SpringDamper { stiffness: 4.0, damping: 0.05, reference: Quat::IDENTITY };
    let about_n1 = Sine { amplitude: Vec3::X * 0.5, hertz: 2.0 };
    let about_n2 = Sine { amplitude: Vec3::Y * 0.3, hertz: 3.0 };
    let load = Sum(spring, Sum(about_n1, about_n2));

    let mut exact = PlantState::default();
    plant.advance_exactly(&mut exact, 0.0, 2.0, &[0.0; 16], &load, 1e-13).expect("a smooth load");
    println!(
        "two wheels, spring and two swinging torques, 2 s from rest; error of orientation + steering angles\n"
    );
    println!(
        "| method | order | ns a step | error, 4 ms | 2 ms | 1 ms | 0.5 ms |\n|---|---|---|---|---|---|---|"
    );
    for method in Method::ALL {
        let errors = [500, 1000, 2000, 4000].map(|steps| {
            let end = run(&plant, method, steps, 2.0, &load);
            let steering = end.steer.iter().zip(&exact.steer).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            format!("{:.1e}", rotation::angle_between(end.q, exact.q) + steering)
        });
        let ns = quickest(20_000, || {
            std::hint::black_box(run(&plant, method, 20_000, 20.0, &load));
        });
        println!("| {method:?} | {} | {ns:.0} | {} |", method.order(), errors.join(" | "));
    }

    println!("\n| one tick of 1 ms: command in, step, feedback out | ns |\n|---|---|");
    let none = Phenomena::default();
    let held = Phenomena { hand: Some(Hand::default()), ..none };
    let cases = [
        ("nobody's hand", none),
        ("the default hand", held),
        ("and encoders", Phenomena { encoder: Some(Encoder::default()), ..held }),
        ("and motors", Phenomena { motor: Some(Motor::default()), ..held }),
        ("and the line", Phenomena { link: Some(Link::default()), ..held }),
    ];
    for (name, phenomena) in cases {
        println!("| {name} | {:.0} |", tick(&device, phenomena));
    }
}

/// Simulates `duration` seconds from rest in `steps` steps, and returns the state at the end.
fn run(plant: &Plant, method: Method, steps: u32, duration: f64, load: &impl Load) -> PlantState {
    let h = duration / f64::from(steps);
    let mut state = PlantState::default();
    for i in 0..steps {
        plant.step(method, &mut state, f64::from(i) * h, h, &[0.0; 16], load);
    }
    state
}

/// Returns the time that one tick of the simulated rig takes with `phenomena` switched on, ns.
fn tick(device: &Device, phenomena: Phenomena) -> f64 {
    let joint = Joint { gear: 17.0, continuous: 0.02, zero: Zero::Assume, ..Joint::new(16384, 0.2) };
    let config = SimulatedConfig {
        line: hbot_config::rig::Protocol::Hbot.into(),
        lags: Lags::default(),
        device: *device,
        joints: vec![SimulatedJoint::from(&joint); device.joints()],
        start: PlantState::default(),
        phenomena,
        imperfect: None,
        method: Method::Rk4,
        max_step_ns: 1_000_000,
        max_jump_ns: 100_000_000,
    };
    let mut rig = SimulatedRig::new(&config).expect("a legal rig");
    let torque = [0.01, 0.0, -0.01, 0.0].into_iter().collect();
    let command = ToController::Command(Command { sequence: 1 << 20, enable: true, watchdog_ms: 50, torque });
    let mut frame = [0; MAX_COMMAND_FRAME];
    let length = encode(&command, &mut frame).expect("a buffer of the largest size");
    let mut reply = Vec::with_capacity(1024);
    let mut now_ns = 0;
    quickest(20_000, || {
        for _ in 0..20_000 {
            now_ns += 1_000_000;
            reply.clear();
            rig.receive(now_ns, &frame[..length], &mut reply);
            std::hint::black_box(&reply);
        }
    })
}

/// Calls `run` [`RUNS`] times and returns the shortest time of one call, divided by `count`, ns.
fn quickest(count: u32, mut run: impl FnMut()) -> f64 {
    let mut least = f64::INFINITY;
    for _ in 0..RUNS {
        let start = Instant::now();
        run();
        least = least.min(start.elapsed().as_secs_f64());
    }
    least * 1e9 / f64::from(count)
}
