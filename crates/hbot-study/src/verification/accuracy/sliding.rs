//! Accuracy and computing time of the plant whose contacts slip. Its time stepping is tested on a
//! scene in which a wheel slides.

use core::f64::consts::PI;

use hbot_core::{Device, Quat};
use hbot_plot::{Lines, Series};
use hbot_sim::hand::Grip;
use hbot_sim::phenomena::Hand;
use hbot_sim::phenomena::{Phenomena, Slip};
use hbot_sim::plant::{Dynamics, Method, PlantState};

use super::order::Errors;
use super::plant::apart;
use super::sci;
use crate::context::Context;
use crate::report::{Report, row, spread};
use crate::timing::{Timed, sampled};

/// Time steps whose errors are compared, in microseconds. All of them divide [`LOOK_US`].
const STEPS_US: [u32; 7] = [1000, 500, 250, 125, 100, 50, 25];
/// The reference solution uses steps that are this many times shorter than the shortest compared
/// step.
const FINER: u32 = 16;
/// Duration of the simulated scene, s.
const TASK_S: f64 = 0.12;
/// Interval between two samples of the error, in microseconds.
const LOOK_US: u32 = 2000;
/// Peak torque of the drive in the test scene, N m. On a wheel of 15.5 mm radius it is 1.4 times
/// the torque that the contact can hold, so the wheel slides.
const DRIVE: f64 = 0.18;

/// The test scene: a simulated hand holds the prototype's sphere. One drive is loaded beyond the
/// limit of its contact for 60 ms and then released.
struct Scene<'a> {
    device: &'a Device,
    phenomena: Phenomena,
}

impl Scene<'_> {
    /// Simulates the scene with steps of `step_us / parts` microseconds. Returns the orientation at
    /// each sample, and the largest slip, m/s.
    fn run(&self, step_us: u32, parts: u32) -> (Vec<Quat>, f64) {
        let mut state =
            PlantState { steer: [0.3, -0.4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], ..PlantState::default() };
        let dynamics = Dynamics::new(self.device, &self.phenomena, Method::Rk4, &state);
        let mut dynamics = dynamics.unwrap_or_else(|error| unreachable!("the prototype is a plant: {error}"));
        let hand = Hand { amplitude: 0.0, ..Hand::default() };
        let grip = Grip::new(hand, 0.0, state.q);
        dynamics.set_sphere_inertia(self.device.sphere_inertia() + hand.inertia);
        let h = f64::from(step_us) * 1.0e-6 / f64::from(parts);
        let steps = (TASK_S / h).round() as u32;
        let (mut looks, mut slip) = (Vec::new(), 0.0_f64);
        for k in 0..steps {
            let t = f64::from(k) * h;
            let mut tau = [0.0; 16];
            // The torque is constant during a step and has the value of the middle of the step.
            tau[1] = DRIVE * push(t + 0.5 * h);
            dynamics.step(&mut state, t, h, &tau, hbot_core::Vec3::ZERO, Some(&grip));
            if (u64::from(k + 1) * u64::from(step_us)).is_multiple_of(u64::from(LOOK_US * parts)) {
                looks.push(state.q);
                let [u, v] = dynamics.slip(&state)[0];
                slip = slip.max(libm::hypot(u, v));
            }
        }
        (looks, slip)
    }
}

/// Returns the torque of the drive at time `t` (s), relative to its peak torque.
fn push(t: f64) -> f64 {
    if t < 0.06 { libm::sin(PI * t / 0.06).powi(2) } else { 0.0 }
}

pub(super) fn study(context: &Context, report: &mut Report, device: &Device) {
    context.part("the plant that slips");
    report.heading("The plant that slips");
    let scene =
        Scene { device, phenomena: Phenomena { slip: Some(Slip::default()), ..Phenomena::default() } };
    let finest = STEPS_US[STEPS_US.len() - 1];
    let (exact, slip) = scene.run(finest, FINER);
    let floor = apart(&exact, &scene.run(finest, FINER / 2).0);
    introduce(report, slip, floor);
    let mut timed: Vec<Timed<'_>> = STEPS_US
        .iter()
        .map(|step_us| {
            let scene = &scene;
            // The time of a call in ns, divided by 1e6 for each simulated second, is the time in ms
            // per simulated second.
            Timed::new(move || scene.run(*step_us, 1)).in_units_of(TASK_S * 1.0e6)
        })
        .collect();
    let (least, rounds) = if context.quick { (100, 5) } else { (500, 21) };
    let times = sampled(&mut timed, std::time::Duration::from_micros(least), rounds);
    let mut table = vec![row(["step, us", "error, rad", "ms a simulated second (quartiles)"])];
    let (mut points, mut errors) = (Vec::new(), Errors::default());
    for (step_us, time) in STEPS_US.iter().zip(times) {
        let error = apart(&scene.run(*step_us, 1).0, &exact);
        report.figure(format!("plant_nonsmooth_{step_us}us_error_rad"), error);
        report.time(format!("plant_nonsmooth_{step_us}us_ms_per_s"), time);
        table.push(row([step_us.to_string(), sci(error), spread(time)]));
        points.push((time.median, error));
        errors.0.push((f64::from(*step_us), error));
    }
    report.table(&table);
    report.check("the sliding scene slides, m/s", format!("{slip:.2}"), slip > 0.05);
    errors.check(report, "plant that slips, time stepping", floor, 1);
    report.lines(
        "plant_nonsmooth",
        "The plant that slips: largest orientation error over the scene against computing time; from 1 ms (left) to 25 us",
        Lines::new(
            "Time stepping on a sliding scene",
            "ms of computing for a simulated second",
            "largest orientation error, rad",
            vec![Series::new("time stepping", points, 0)],
        )
        .log([true; 2]),
    );
}

/// Writes the introduction of the section about sliding contacts. `slip` is the largest slip in the
/// task, m/s, and `floor` is the error of the reference solution, rad.
fn introduce(report: &mut Report, slip: f64, floor: f64) {
    let finest = STEPS_US[STEPS_US.len() - 1];
    report.say(&format!(
        "Contacts that hold 8 N (the default of `slip`), on the prototype in a hand that holds still: one drive is pushed with up to {DRIVE} N m, \
         slips at up to {slip:.1} m/s, and grips again, in {TASK_S} s. The time stepping for set-valued laws is of order 1 by nature. The error is the largest \
         of the orientation, looked at every {} ms, against steps of {:.2} us (good to {floor:.0e}). A rig in virtual time takes steps of 250 us at most with these \
         phenomena.",
        LOOK_US / 1000,
        f64::from(finest) / f64::from(FINER),
    ));
    report.family("plant_nonsmooth_{step_us}us_error_rad | rad | largest orientation error over the sliding scene, by time stepping");
    report
        .family("plant_nonsmooth_{step_us}us_ms_per_s | ms/s | computing for a second of the sliding scene");
}
