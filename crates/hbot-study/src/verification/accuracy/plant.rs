//! Accuracy of the plant's integration methods and steps, on the task of docs/internals/plant.md.

use hbot_core::design::device::WheelSpec;
use hbot_core::{Device, Quat, Vec3, rotation};
use hbot_plot::{Lines, Series};
use hbot_sim::plant::{Load, Method, Plant, PlantState, Sine, SpringDamper, Sum};

use super::order::Errors;
use super::sci;
use crate::context::Context;
use crate::names::snake;
use crate::report::{Report, row, spread};
use crate::timing::{Timed, sampled};

/// Integration steps whose errors are compared, in microseconds. All of them divide [`LOOK_US`].
const STEPS_US: [u32; 11] = [10_000, 5000, 4000, 2000, 1000, 500, 250, 125, 100, 50, 20];
/// Duration of the simulated task, s.
const TASK_S: f64 = 2.0;
/// Interval between two samples of the error, in microseconds. It is shorter than a quarter period
/// of the faster sinusoidal torque.
const LOOK_US: u32 = 20_000;
/// Tolerance of the adaptive reference integrator in each step.
const TOLERANCE: f64 = 1.0e-13;

/// Returns the prototype's device with the wheels of the comparison task: radius 10.2 mm, and
/// inertias that include those of the link and of the wheel.
fn task_device(prototype: &Device) -> Device {
    let wheel = |wheel: &hbot_core::design::device::Wheel| WheelSpec {
        radius: 0.0102,
        steer_inertia: 3.105_468_222_7e-5,
        drive_inertia: 3.5202e-6,
        ..*wheel.spec()
    };
    let wheels: Vec<WheelSpec> = prototype.wheels().iter().map(wheel).collect();
    let device = Device::new(prototype.sphere_radius(), prototype.sphere_mass(), &wheels);
    device.unwrap_or_else(|error| unreachable!("the task's device is legal: {error}"))
}

/// Returns the torque on the sphere in the comparison task: a spring with damping, and two
/// sinusoidal torques.
fn task_load() -> impl Load + Copy {
    let spring = SpringDamper { stiffness: 4.0, damping: 0.05, reference: Quat::IDENTITY };
    let first = Sine { amplitude: Vec3::X * 0.5, hertz: 2.0 };
    let second = Sine { amplitude: Vec3::Y * 0.3, hertz: 3.0 };
    Sum(spring, Sum(first, second))
}

/// Simulates the comparison task with steps of `step_us` microseconds. Returns the orientation at
/// each sample.
fn run(plant: &Plant, method: Method, step_us: u32, load: &impl Load) -> Vec<Quat> {
    let (mut state, h) = (PlantState::default(), f64::from(step_us) * 1.0e-6);
    let steps = (TASK_S / h).round() as u32;
    let mut looks = Vec::new();
    for k in 0..steps {
        plant.step(method, &mut state, f64::from(k) * h, h, &[0.0; 16], load);
        if ((k + 1) * step_us).is_multiple_of(LOOK_US) {
            looks.push(state.q);
        }
    }
    looks
}

fn reference(plant: &Plant, tolerance: f64, load: &impl Load) -> Vec<Quat> {
    let mut state = PlantState::default();
    let every = f64::from(LOOK_US) * 1.0e-6;
    let looks = (TASK_S / every).round() as u32;
    (0..looks)
        .map(|k| {
            let done =
                plant.advance_exactly(&mut state, f64::from(k) * every, every, &[0.0; 16], load, tolerance);
            done.unwrap_or_else(|error| unreachable!("the task's load is smooth: {error}"));
            state.q
        })
        .collect()
}

/// Returns the largest angle between two orientations with the same index in `a` and `b`, rad.
pub(super) fn apart(a: &[Quat], b: &[Quat]) -> f64 {
    a.iter().zip(b).map(|(a, b)| rotation::angle_between(*a, *b)).fold(0.0, f64::max)
}

pub(super) fn study(context: &Context, report: &mut Report, prototype: &Device) {
    context.part("the plant's methods");
    report.heading("The plant");
    let Ok(plant) = Plant::new(&task_device(prototype)) else { unreachable!("the task's device is a plant") };
    let load = task_load();
    let exact = reference(&plant, TOLERANCE, &load);
    let floor = apart(&exact, &reference(&plant, 4.0 * TOLERANCE, &load)).max(1.0e-14);
    introduce(report, floor);
    let mut cases = Vec::new();
    for method in Method::ALL {
        for step_us in STEPS_US {
            cases.push((method, step_us, apart(&run(&plant, method, step_us, &load), &exact)));
        }
    }
    let mut timed: Vec<Timed<'_>> = cases
        .iter()
        .map(|(method, step_us, _)| {
            let plant = &plant;
            let (method, step_us) = (*method, *step_us);
            // The time of a call in ns, divided by 2e6, is the time in ms per simulated second.
            Timed::new(move || run(plant, method, step_us, &load)).in_units_of(TASK_S * 1.0e6)
        })
        .collect();
    context.part("the plant's times");
    let (least, rounds) = if context.quick { (100, 5) } else { (500, 21) };
    let times = sampled(&mut timed, std::time::Duration::from_micros(least), rounds);
    let mut table = vec![row(["method", "step, us", "error, rad", "ms a simulated second (quartiles)"])];
    let mut lines = Vec::new();
    for (place, method) in Method::ALL.into_iter().enumerate() {
        let name = snake(&format!("{method:?}"));
        let (mut points, mut errors) = (Vec::new(), Errors::default());
        for ((of, step_us, error), time) in cases.iter().zip(&times) {
            if *of != method {
                continue;
            }
            report.figure(format!("plant_{name}_{step_us}us_error_rad"), *error);
            report.time(format!("plant_{name}_{step_us}us_ms_per_s"), *time);
            table.push(row([&name, &step_us.to_string(), &sci(*error), &spread(*time)]));
            points.push((time.median, *error));
            errors.0.push((f64::from(*step_us), *error));
        }
        errors.check(report, &format!("plant, {name}"), floor, method.order());
        lines.push(Series::new(name, points, place));
    }
    report.table(&table);
    draw(report, lines);
}

fn draw(report: &mut Report, lines: Vec<Series>) {
    report.lines(
        "plant",
        "The plant's methods: largest orientation error over the task against computing time; each line from 10 ms (left) to 20 us",
        Lines::new(
            "The plant's methods on the task",
            "ms of computing for a simulated second",
            "largest orientation error, rad",
            lines,
        )
        .log([true; 2])
        .front(),
    );
}

fn introduce(report: &mut Report, floor: f64) {
    report.say(&format!(
        "The task of docs/internals/plant.md: {TASK_S} s from rest of a sphere held by a spring (4 N m/rad, 0.05 N m s/rad) under two swinging \
         torques. The error is the largest of the orientation, looked at every 20 ms, against the adaptive reference at {TOLERANCE:e} a step \
         (which itself is good to {floor:.0e}). A rig in virtual time takes steps of 1 ms."
    ));
    report.family("plant_{method}_{step_us}us_error_rad | rad | largest orientation error over the task");
    report.family("plant_{method}_{step_us}us_ms_per_s | ms/s | computing for a second of simulated time");
}
