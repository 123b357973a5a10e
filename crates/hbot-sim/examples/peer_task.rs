//! The task by which simulators are compared (`docs/internals/plant.md`): 2 s of a sphere held by a
//! spring and driven by two sinusoidal torques. It is run by `benches/peer/plant.sh`.
//!
//! ```text
//! peer_task run METHOD STEPS REPS   prints the median run time, s
//! peer_task error METHOD STEPS      prints the largest orientation error at the 10 ms marks,
//!                                   and the error at the end, rad
//! peer_task error FILE              prints these errors for a file written by the C program
//!
//! METHOD is a name from plant::Method, STEPS the number of steps in each 10 ms.
//! ```

use std::time::Instant;

use hbot_core::{Quat, Vec3, rotation};
use hbot_sim::plant::{Load, Method, Plant, PlantState, Sine, SpringDamper, Sum};
use hbot_testing::prototype::{device_with, of_the_task};

/// Number of moments at which the orientations of two simulations are compared. There is one moment
/// every 10 ms over 2 s.
const MARKS: usize = 200;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let plant = Plant::new(&device_with(of_the_task)).expect("the prototype is a legal plant");
    match arguments[..] {
        ["run", method, steps, reps] => {
            let (method, steps, reps): (_, u32, usize) = (named(method), number(steps), number(reps));
            let mut seconds: Vec<f64> = (0..reps)
                .map(|_| {
                    let start = Instant::now();
                    std::hint::black_box(run(&plant, method, steps, &load()));
                    start.elapsed().as_secs_f64()
                })
                .collect();
            seconds.sort_by(f64::total_cmp);
            println!("{:.9}", seconds[reps / 2]);
        }
        ["error", method, steps] => {
            let marks = run(&plant, named(method), number(steps), &load());
            print_error(&plant, marks.iter().map(|state| state.q));
        }
        ["error", file] => {
            let bytes = std::fs::read(file).expect("the C program's file");
            let numbers: Vec<f64> =
                bytes.as_chunks::<8>().0.iter().map(|bytes| f64::from_ne_bytes(*bytes)).collect();
            // Quaternion, two steer angles, angular velocity.
            let q = |state: &[f64]| Quat::from_xyzw(state[1], state[2], state[3], state[0]).normalize();
            print_error(&plant, numbers.chunks_exact(9).map(q));
        }
        _ => {
            eprintln!("usage: peer_task run METHOD STEPS REPS | error METHOD STEPS | error FILE");
            std::process::exit(2);
        }
    }
}

fn number<T: std::str::FromStr>(text: &str) -> T {
    text.parse().unwrap_or_else(|_| panic!("{text:?} is not a whole number"))
}

fn named(name: &str) -> Method {
    let known = |method: &Method| format!("{method:?}") == name;
    Method::ALL
        .into_iter()
        .find(known)
        .unwrap_or_else(|| panic!("no method {name:?}; there are {:?}", Method::ALL))
}

fn load() -> impl Load {
    let spring = SpringDamper { stiffness: 4.0, damping: 0.05, reference: Quat::IDENTITY };
    let about_n1 = Sine { amplitude: Vec3::X * 0.5, hertz: 2.0 };
    let about_n2 = Sine { amplitude: Vec3::Y * 0.3, hertz: 3.0 };
    Sum(spring, Sum(about_n1, about_n2))
}

/// Returns the states of the simulation at the start and at each of the [`MARKS`], one every 10 ms.
/// Each interval between two marks is divided into `steps` steps.
fn run(plant: &Plant, method: Method, steps: u32, load: &impl Load) -> Vec<PlantState> {
    let h = 0.01 / f64::from(steps);
    let mut marks = Vec::with_capacity(MARKS + 1);
    let (mut state, mut n) = (PlantState::default(), 0_u32);
    marks.push(state);
    for _ in 0..MARKS {
        for _ in 0..steps {
            plant.step(method, &mut state, f64::from(n) * h, h, &[0.0; 16], load);
            n += 1;
        }
        marks.push(state);
    }
    marks
}

fn print_error(plant: &Plant, orientations: impl Iterator<Item = Quat>) {
    let load = load();
    let mut exact = PlantState::default();
    let (mut worst, mut last): (f64, f64) = (0.0, 0.0);
    for (i, q) in orientations.enumerate() {
        if i > 0 {
            plant
                .advance_exactly(&mut exact, (i - 1) as f64 * 0.01, 0.01, &[0.0; 16], &load, 1e-13)
                .expect("a smooth load");
        }
        last = rotation::angle_between(q, exact.q);
        worst = worst.max(last);
    }
    println!("{worst:.3e} {last:.3e}");
}
