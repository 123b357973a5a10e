//! Checks of motion without slip, by the simulated rig's plant. The plant exists in f64 only.

use hbot_core::design::device::{MAX_JOINTS, MAX_WHEELS};
use hbot_core::design::singularity::singular_values;
use hbot_core::{Device, Vec3};
use hbot_sim::plant::{Method, Plant, PlantState, Sine, SpringDamper, Sum};

use super::double::checks::{array, device, norm, quaternion, row_condition, tolerance, vector, worst, wxyz};
use super::{Ledger, vectors};

/// Tolerance for the samples of a trajectory. The vectors are accurate to 1e-10
/// (tests/golden/README.md). The reference, with 1e-13 per step, adds about as much in the few
/// thousand steps of two seconds.
const TRAJECTORY: f64 = 1e-9;

fn plant(of: &vectors::Device, ledger: &mut Ledger) -> Option<(Device, Plant)> {
    let device = device(of).map_err(|error| ledger.fail("device", error.to_string())).ok()?;
    let plant = Plant::new(&device).map_err(|error| ledger.fail("device", error.to_string())).ok()?;
    Some((device, plant))
}

fn steer(theta: &[f64]) -> [f64; MAX_WHEELS] {
    core::array::from_fn(|i| theta.get(i).copied().unwrap_or(0.0))
}

pub fn dynamics(case: &vectors::Dynamics, ledger: &mut Ledger) {
    let Some((device, plant)) = plant(&case.device, ledger) else { return };
    if case.joint_torques.len() != device.joints() {
        return ledger.fail("joint_torques", format!("not one for each of {} joints", device.joints()));
    }
    let mut tau = [0.0; MAX_JOINTS];
    tau[..device.joints()].copy_from_slice(&case.joint_torques);
    let state = PlantState { omega: vector(case.omega), steer: steer(&case.theta), ..PlantState::default() };

    let inertia = plant.apparent_inertia(&state);
    let [largest, _, least] = singular_values(&[inertia.x_axis, inertia.y_axis, inertia.z_axis]);
    let rows = worst(&case.device, &case.theta, row_condition);
    // The terms are the torques applied and the gyroscopic torques J |g|³ w². Rounding of the rows
    // changes them in proportion to their size. Then one linear system with the apparent inertia is
    // solved.
    let posture = super::double::checks::posture(&device, &case.theta);
    let mut terms = norm(&case.torque);
    for (j, row) in posture.rows().iter().enumerate() {
        let wheel = &case.device.wheels[j / 2];
        let joint = if j % 2 == 0 { wheel.steer_inertia } else { wheel.drive_inertia };
        let steering = posture.rows()[j - j % 2].length();
        let omega = norm(&case.omega);
        terms += row.length() * (tau[j].abs() + joint * steering * row.length() * omega * omega);
    }
    let within = tolerance(terms / least, rows * largest / least);
    let got = plant.acceleration(&state, vector(case.torque), &tau);
    ledger.numbers("acceleration", &[], &array(got), &case.acceleration, within);
    // The energy is a sum of squares of rates. Only the rates themselves can have cancellation.
    let scale = 0.5 * largest * norm(&case.omega).powi(2);
    ledger.number("energy", &[], plant.energy(&state), case.energy, tolerance(scale, rows));
}

/// Compares the state at a sample with the expected one.
fn compare(
    ledger: &mut Ledger,
    index: usize,
    sample: &vectors::Sample,
    state: &PlantState,
    wheels: usize,
    within: f64,
) {
    ledger.rotation("samples.q", &[index], wxyz(state.q), sample.q, within);
    let joints = &state.joints()[..2 * wheels];
    for (j, (got, want)) in joints.iter().zip(&sample.joints).enumerate() {
        // The joints turn up to |G| times as far as the sphere.
        ledger.number("samples.joints", &[index, j], *got, *want, within * (1.0 + want.abs()) * 10.0);
    }
    if sample.joints.len() != joints.len() {
        ledger.fail("samples.joints", format!("{} of them for {wheels} wheels", sample.joints.len()));
    }
    ledger.numbers("samples.omega", &[index], &array(state.omega), &sample.omega, 10.0 * within);
}

pub fn trajectory(case: &vectors::Trajectory, ledger: &mut Ledger) {
    let Some((device, plant)) = plant(&case.device, ledger) else { return };
    let wheels = device.wheels().len();
    let spring = SpringDamper {
        stiffness: case.spring.stiffness,
        damping: case.spring.damping,
        reference: quaternion(case.spring.q_desired),
    };
    let sines: Vec<Sine> = case
        .drive
        .iter()
        .map(|sine| Sine { amplitude: vector(sine.axis) * sine.amplitude, hertz: sine.hertz })
        .collect();
    let drive = |t: f64, _, _| {
        sines.iter().fold(Vec3::ZERO, |sum, sine| {
            sum + sine.amplitude * libm::sin(core::f64::consts::TAU * sine.hertz * t)
        })
    };
    let load = Sum(spring, drive);
    let start = PlantState {
        q: quaternion(case.q0),
        omega: vector(case.omega0),
        steer: steer(&case.theta0),
        ..PlantState::default()
    };
    let free = [0.0; MAX_JOINTS];

    let (mut state, mut t) = (start, 0.0);
    for (k, sample) in case.samples.iter().enumerate() {
        if sample.t > t {
            if let Err(error) = plant.advance_exactly(&mut state, t, sample.t - t, &free, &load, 1e-13) {
                return ledger.fail("samples.t", error.to_string());
            }
            t = sample.t;
        }
        compare(ledger, k, sample, &state, wheels, TRAJECTORY);
    }

    // Each method is checked by its order at the first sample after the start: with half the step,
    // 2^-order of the error remains, or the accuracy of the vectors. Another half is allowed for
    // the next order.
    let Some(sample) = case.samples.iter().find(|sample| sample.t > 0.0) else { return };
    for method in Method::ALL {
        let [coarse, fine] = [200, 400].map(|steps| {
            let h = sample.t / f64::from(steps);
            let mut state = start;
            for k in 0..steps {
                plant.step(method, &mut state, f64::from(k) * h, h, &free, &load);
            }
            norm(&(state.omega - vector(sample.omega)).to_array())
        });
        let within = 1.5 * coarse / f64::from(method.order()).exp2() + TRAJECTORY;
        ledger.number("omega by each method at half the step", &[], fine, 0.0, within);
    }
}
