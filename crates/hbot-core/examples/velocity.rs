//! What the rate estimates make of a known motion, with encoders of several fineness: noise, lag, false slip, time.
//!
//! `cargo run --release -p hbot-core --example velocity`; docs/velocity.md has its tables.

use std::f64::consts::TAU;
use std::time::Instant;

use hbot_core::inputs::{Complaints, Inputs, JointFeedback};
use hbot_core::kinematics::Posture;
use hbot_core::rig::{Joint, Limits, Methods, RateEstimate, Rig, Timing, Zero};
use hbot_core::{CompiledScene, Controller, Device, MAX_JOINTS, Vec3, WheelSpec};

const DT: f64 = 1e-3;
/// Ticks of each motion, and those at its start that are not judged.
const TICKS: usize = 20_000;
const SETTLE: usize = 500;

const METHODS: [(&str, RateEstimate); 9] = [
    ("`controller`, exact rates", RateEstimate::Controller),
    ("`difference`", RateEstimate::Difference),
    ("`low_pass`, 100 Hz", RateEstimate::LowPass { cutoff_hz: 100.0 }),
    ("`low_pass`, 30 Hz", RateEstimate::LowPass { cutoff_hz: 30.0 }),
    ("`adaptive_window`, 16 ticks", RateEstimate::AdaptiveWindow { tolerance_counts: 1, longest_ticks: 16 }),
    ("`adaptive_window`, 32 ticks", RateEstimate::AdaptiveWindow { tolerance_counts: 1, longest_ticks: 32 }),
    ("`kalman`, 30 rad/s²", RateEstimate::Kalman { acceleration: 30.0 }),
    ("`kalman`, 100 rad/s²", RateEstimate::Kalman { acceleration: 100.0 }),
    ("`kalman`, 300 rad/s²", RateEstimate::Kalman { acceleration: 300.0 }),
];

/// Encoder lines times four of the steering and of the drive (before its gear of 17).
const ENCODERS: [(&str, [u32; 2]); 4] = [
    ("4096 x 4", [16384, 16384]),
    ("512 x 4", [2048, 2048]),
    ("512 x 4 steering, 64 x 4 driving", [2048, 256]),
    ("64 x 4", [256, 256]),
];

/// A sphere's angular velocity over time, N, rad/s.
struct Motion {
    name: &'static str,
    size: f64,
    hertz: f64,
    steady: f64,
}

/// Held with a tremor of 0.5 mrad; felt along slowly; turned to and fro by 0.2 rad.
const MOTIONS: [Motion; 3] = [
    Motion { name: "held", size: 0.5e-3 * 9.0 * TAU, hertz: 9.0, steady: 0.0 },
    Motion { name: "slow", size: 0.02, hertz: 0.3, steady: 0.05 },
    Motion { name: "brisk", size: 2.0, hertz: 1.5, steady: 0.0 },
];

impl Motion {
    fn omega(&self, t: f64) -> Vec3 {
        let swing = |pace: f64| (TAU * self.hertz * pace * t).sin() * self.size;
        // Paces without a common period: the counts are passed at all phases.
        Vec3::new(swing(1.0), swing(0.707), swing(0.618)) * (1.0 / 3.0_f64.sqrt())
            + Vec3::new(0.6, -0.48, 0.64) * self.steady
    }

    /// Joint angles and the sphere's rate at each tick.
    fn joints(&self, device: &Device) -> Vec<([f64; 4], [f64; 4], Vec3)> {
        const PARTS: usize = 4;
        let h = DT / PARTS as f64;
        let rates = |t: f64, z: &[f64; 4]| {
            let rates = Posture::new(device, &[z[0], z[2]]).inverse(self.omega(t));
            [rates[0], rates[1], rates[2], rates[3]]
        };
        let along = |z: &[f64; 4], by: &[f64; 4], h: f64| core::array::from_fn(|j| z[j] + h * by[j]);
        let mut z = [0.3, 0.0, -0.5, 0.0];
        (0..TICKS)
            .map(|tick| {
                let now = tick as f64 * DT;
                let reading = (z, rates(now, &z), self.omega(now));
                for part in 0..PARTS {
                    let t = now + part as f64 * h;
                    let k1 = rates(t, &z);
                    let k2 = rates(t + 0.5 * h, &along(&z, &k1, 0.5 * h));
                    let k3 = rates(t + 0.5 * h, &along(&z, &k2, 0.5 * h));
                    let k4 = rates(t + h, &along(&z, &k3, h));
                    z = core::array::from_fn(|j| {
                        z[j] + h / 6.0 * (k1[j] + 2.0 * k2[j] + 2.0 * k3[j] + k4[j])
                    });
                }
                reading
            })
            .collect()
    }
}

fn rig(counts: [u32; 2], rate: RateEstimate) -> Rig {
    let wheel = |x: f64| WheelSpec {
        axis: Vec3::new(x, 0.0, -1.0),
        cone: 0.1745,
        toe: 0.0,
        radius: 0.0155,
        steer_inertia: 2.7e-5,
        drive_inertia: 3.5e-6,
        axial_inertia: 0.0,
    };
    let joint = |counts_per_turn, gear| Joint {
        counts_per_turn,
        gear,
        reversed: false,
        zero: Zero::Assume,
        peak: 0.1,
        continuous: 0.1,
    };
    let mut joints = [joint(counts[0], 1.0); MAX_JOINTS];
    joints.iter_mut().skip(1).step_by(2).for_each(|drive| *drive = joint(counts[1], 17.0));
    Rig {
        device: Device::new(0.102, 0.467, &[wheel(1.0), wheel(-1.0)]).expect("the prototype is legal"),
        joints,
        limits: Limits {
            torque: 0.9,
            torque_rate: 200.0,
            speed: 30.0,
            slip: 0.05,
            traction: None,
            enable_max_angle: 0.5,
            align_rate: 0.2,
            reference_rate: 2.0,
            thermal_time: None,
            max_age_ticks: 100,
        },
        timing: Timing { period_ns: 1_000_000, timeout_ticks: 20 },
        methods: Methods { rate, ..Methods::BALANCED },
    }
}

/// The readings that controllers with these encoders would send.
fn readings(rig: &Rig, truth: &[([f64; 4], [f64; 4], Vec3)]) -> Vec<JointFeedback> {
    let reading = |(tick, (angles, rates, _)): (usize, &([f64; 4], [f64; 4], Vec3))| {
        let mut feedback = JointFeedback {
            sequence: tick as u32,
            counts: [0; MAX_JOINTS],
            rates: [0.0; MAX_JOINTS],
            index_seen: 0,
            complaints: Complaints::default(),
        };
        for j in 0..4 {
            let unit = f64::from(rig.joints[j].counts_per_turn) * rig.joints[j].gear / TAU;
            feedback.counts[j] = (angles[j] * unit).floor() as i32;
            feedback.rates[j] = rates[j];
        }
        feedback
    };
    truth.iter().enumerate().map(reading).collect()
}

/// What an estimate makes of a motion.
struct Quality {
    /// Root mean square of the error of omega, rad/s, once the lag is taken out.
    noise: f64,
    /// By how long the estimate is late, s: what explains the most of its error.
    lag: f64,
    /// The largest slip that it sees where there is none, m/s.
    slip: f64,
}

fn judge(rig: &Rig, readings: &[JointFeedback], truth: &[([f64; 4], [f64; 4], Vec3)]) -> Quality {
    let mut controller = Controller::new(*rig);
    let (mut errors, mut slip) = (Vec::new(), 0.0_f64);
    for (tick, feedback) in readings.iter().enumerate() {
        let inputs = Inputs { feedback: Some(*feedback), ..Inputs::quiet(tick as u64) };
        let state = controller.tick(&CompiledScene::empty(), &inputs).state;
        if (SETTLE..TICKS - 1).contains(&tick) {
            let growth = (truth[tick + 1].2 - truth[tick - 1].2) / (2.0 * DT);
            errors.push((state.omega - truth[tick].2, growth));
            slip = slip.max(state.slip);
        }
    }
    // error = -lag growth + noise, in the least squares.
    let squares: f64 = errors.iter().map(|(_, growth)| growth.length_squared()).sum();
    let lag = -errors.iter().map(|(error, growth)| error.dot(*growth)).sum::<f64>() / squares;
    let rest: f64 = errors.iter().map(|(error, growth)| (*error + *growth * lag).length_squared()).sum();
    Quality { noise: (rest / errors.len() as f64).sqrt(), lag, slip }
}

/// The quickest of several runs, ns a tick, of every method in turn: what else the machine does disturbs all alike.
fn times(counts: [u32; 2], truth: &[([f64; 4], [f64; 4], Vec3)]) -> Vec<f64> {
    let mut best = vec![f64::INFINITY; METHODS.len()];
    for _ in 0..15 {
        for ((_, method), best) in METHODS.iter().zip(&mut best) {
            let rig = rig(counts, *method);
            let readings = readings(&rig, &truth[..4000]);
            let mut controller = Controller::new(rig);
            let scene = CompiledScene::empty();
            let start = Instant::now();
            for (tick, feedback) in readings.iter().enumerate() {
                let inputs = Inputs { feedback: Some(*feedback), ..Inputs::quiet(tick as u64) };
                std::hint::black_box(controller.tick(&scene, &inputs));
            }
            *best = best.min(start.elapsed().as_secs_f64() * 1e9 / readings.len() as f64);
        }
    }
    best.iter().map(|time| time - best[0]).collect()
}

fn main() {
    let device = rig([16384, 16384], RateEstimate::Controller).device;
    let truths: Vec<_> = MOTIONS.iter().map(|motion| motion.joints(&device)).collect();
    println!("noise: root mean square of the error of omega without its lag, rad/s\n");
    for (name, counts) in ENCODERS {
        println!("{name}\n");
        let motions: Vec<String> = MOTIONS.iter().map(|motion| format!("noise, {}", motion.name)).collect();
        println!("| method | {} | lag, ms | false slip, mm/s | ns more |", motions.join(" | "));
        println!("|---|---|---|---|---|---|---|");
        let slow = times(counts, &truths[1]);
        let brisk = times(counts, &truths[2]);
        for (k, (method, rate)) in METHODS.iter().enumerate() {
            let rig = rig(counts, *rate);
            let of: Vec<Quality> =
                truths.iter().map(|truth| judge(&rig, &readings(&rig, truth), truth)).collect();
            let noise: Vec<String> = of.iter().map(|q| format!("{:.4}", q.noise)).collect();
            let slip = of.iter().fold(0.0, |most: f64, q| most.max(q.slip)) * 1e3;
            // Tenths, and no minus before a zero.
            let (lag, time) = ((of[2].lag * 1e4).round() / 10.0 + 0.0, slow[k].max(brisk[k]));
            println!("| {method} | {} | {lag:.1} | {slip:.0} | {time:.0} |", noise.join(" | "));
        }
        println!();
    }
}
