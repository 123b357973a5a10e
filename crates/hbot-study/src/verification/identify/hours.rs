//! Eight hours of turning by hand with a reference from outside: what a camera, or a sensor of
//! gravity in the sphere, leaves of the orientation's error.

use core::f64::consts::PI;
use std::collections::VecDeque;

use hbot_config::RigConfig;
use hbot_core::design::rig::Zero;
use hbot_core::inputs::{Command, Inputs, JointReadings};
use hbot_core::outputs::State;
use hbot_core::{CompiledScene, Controller, Device, MAX_JOINTS, Quat, Rig, Vec3, rotation};
use hbot_identify::{What, identify};
use hbot_plot::short;
use hbot_sim::wander::{Built, Wander, normal};

use super::rigs::{Encoders, counts, geometry, read, recorded, truth};
use crate::context::Context;
use crate::report::{Report, head, row};
use crate::rng::Rng;

const DEGREE: f64 = PI / 180.0;
/// Errors of the reference from outside: standard deviation about each axis, rad, ticks from one
/// measurement to the next, and its delay in ticks.
const SIGMA: f64 = DEGREE;
const EACH: u64 = 33;
const LATE: usize = 50;
/// Time after which the error counts, ticks: what is known of the orientation at the start is not
/// what the reference is good for.
const SETTLED: u64 = 60_000;
/// Largest error, degrees.
const MOST: f64 = 0.5;
/// Range of the heading's error, root mean square, in units of its sigma.
const HONEST: [f64; 2] = [0.1, 2.0];
/// Parts of its path that a wheel loses (standard deviation): that of rubber wheels which a hand
/// takes along, and a larger one.
const CREEPS: [f64; 2] = [3.0e-4, 1.0e-3];
/// Random rig that is built from the drawing.
const SEED: u64 = 1001;

/// What measures the orientation from outside.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Source {
    Camera,
    Gravity,
}

/// A control law that gets measurements from outside.
struct Fused {
    controller: Controller,
    source: Source,
    /// The measurements on their way.
    sent: VecDeque<(u64, Command)>,
    /// Largest error and sum of its squares, rad, and the same of the tilt.
    worst: [f64; 2],
    squares: [f64; 2],
    count: f64,
    /// Sum of the squares of the heading's error in units of its sigma.
    relative: f64,
    sigma: Vec3,
}

impl Fused {
    fn new(rig: Rig, source: Source) -> Self {
        Self {
            controller: Controller::new(rig),
            source,
            sent: VecDeque::new(),
            worst: [0.0; 2],
            squares: [0.0; 2],
            count: 0.0,
            relative: 0.0,
            sigma: Vec3::ZERO,
        }
    }

    /// Takes the reading of a tick, at which the true orientation is `real`.
    fn tick(&mut self, scene: &CompiledScene, reading: JointReadings, real: Quat, rng: &mut Rng) {
        let tick = u64::from(reading.sequence) + 1;
        let mut inputs = Inputs { feedback: Some(reading), ..Inputs::quiet(tick) };
        if tick.is_multiple_of(EACH) {
            let mut next = || normal(|| rng.unit());
            let noise = rotation::exp(Vec3::new(next(), next(), next()) * SIGMA);
            self.sent.push_back((
                tick + LATE as u64,
                match self.source {
                    Source::Camera => Command::AlignBySigma {
                        q: noise * real,
                        sigma: Vec3::splat(SIGMA),
                        weight: 1.0,
                        tick,
                    },
                    Source::Gravity => {
                        let body = real.conjugate() * (noise * -Vec3::Z);
                        Command::AlignDirection { body, world: -Vec3::Z, sigma: SIGMA, tick }
                    }
                },
            ));
        }
        if let Some((_, command)) = self.sent.pop_front_if(|(due, _)| *due <= tick) {
            inputs.commands.push(command).unwrap_or_else(|_| unreachable!("one command in a tick"));
        }
        let State { q, sigma, .. } = self.controller.tick(scene, &inputs).state;
        let Some(sigma) = sigma.filter(|_| tick > SETTLED) else { return };
        let error = rotation::difference(q, real);
        let errors = [error.length(), (q * (real.conjugate() * Vec3::Z)).angle_between(Vec3::Z)];
        for (k, error) in errors.into_iter().enumerate() {
            self.worst[k] = self.worst[k].max(error);
            self.squares[k] += error * error;
        }
        self.count += 1.0;
        self.relative += (error.z / sigma.z).powi(2);
        self.sigma = sigma;
    }

    /// Root mean square of the error (0) or the tilt (1), rad.
    fn rms(&self, k: usize) -> f64 {
        (self.squares[k] / self.count.max(1.0)).sqrt()
    }
}

/// Adds the section about references from outside to the report of the study.
pub(super) fn study(context: &Context, report: &mut Report) {
    let seconds = if context.quick { 300.0 } else { 8.0 * 3600.0 };
    report.family("identify_outside_{source} | rad | largest error of the orientation (`camera`, `camera_drawn`: the rig file says no drift) or of the tilt (`gravity`) with a reference from outside; `rms`: root mean square");
    let config = RigConfig::prototype();
    let drawing = config.rig;
    let built = Built::new(&drawing.device, SEED).unwrap_or_else(|e| unreachable!("near the drawing: {e}"));
    let hand = Wander::new(SEED, Vec3::splat(super::SPEED));
    let (recording, _) = counts(&drawing, &built, &hand, super::RECORDED_S, Encoders::REAL, SEED);
    let found = identify(&drawing, &recorded(recording), What::Geometry, &mut |_, _| ());
    let found = found.unwrap_or_else(|why| unreachable!("a good recording: {why}"));
    let ours = geometry(&drawing, &found.wheels, &found.zeros);
    let turn = ours.turn_from(&truth(&drawing, &built));
    let believed = |drift: Option<f64>| {
        let device = ours
            .zeros
            .iter()
            .enumerate()
            .fold(ours.device, |device: Device, (i, zero)| device.with_steering_zero(i, *zero));
        let rig = drawing.with(|parts| {
            (parts.device, parts.drift) = (device, drift);
            parts.joints.iter_mut().for_each(|joint| joint.zero = Zero::Assume);
        });
        rig.unwrap_or_else(|error| unreachable!("near the drawing: {error}"))
    };
    let hand = Wander::new(SEED + 1, Vec3::splat(super::SPEED));
    let run = |creep: f64| {
        let mut all = [
            Fused::new(believed(found.drift()), Source::Camera),
            Fused::new(believed(None), Source::Camera),
            Fused::new(believed(found.drift()), Source::Gravity),
        ];
        let scene = CompiledScene::empty();
        let mut rng = Rng(SEED);
        let seen = read(&drawing, &built, &hand, seconds, Encoders::slipping(creep), SEED);
        for (sequence, (counts, q)) in (0..).zip(seen) {
            let reading = JointReadings::new(sequence, counts, [0.0; MAX_JOINTS]);
            let real = turn * q * turn.conjugate();
            all.iter_mut().for_each(|fused| fused.tick(&scene, reading, real, &mut rng));
        }
        all
    };
    let slipping = [run(CREEPS[0]), run(CREEPS[1])];
    let [camera, drawn, gravity] = &slipping[0];
    report.heading("A reference from outside");
    report.say(&format!(
        "A hand turns the sphere for {} s about all axes, back and forth, on a rig that was identified with real encoders. Each second every wheel begins to lose another part of its path (0.03 or 0.1 %, standard deviation), and each minute one slips by 0.1 mm at once. \
         A camera measures the orientation 30 times a second with an error of 1 degree about each axis (standard deviation), 50 ms late; or a sensor in the sphere measures the direction of gravity in the same way. The errors are those after the first minute.",
        short(seconds)
    ));
    let degrees = |x: f64| format!("{:.3}", x / DEGREE);
    let mut table = vec![head(
        "reference | path that wheels lose | largest error, degrees | root mean square | sigma about n3 at the end",
    )];
    for (creep, all) in CREEPS.iter().zip(&slipping) {
        let names = [("camera", 0), ("camera; the rig file says no drift", 0), ("gravity: the tilt", 1)];
        for (fused, (name, k)) in all.iter().zip(names) {
            let [worst, rms, sigma] = [fused.worst[k], fused.rms(k), fused.sigma.z].map(degrees);
            table.push(row([name.to_owned(), format!("{} %", short(100.0 * creep)), worst, rms, sigma]));
        }
    }
    report.table(&table);
    for (name, fused, k) in [("camera", camera, 0), ("camera_drawn", drawn, 0), ("gravity", gravity, 1)] {
        report.figure(format!("identify_outside_{name}"), fused.worst[k]).note("rms", fused.rms(k));
    }
    let [camera_most, tilt_most] = [camera.worst[0], gravity.worst[1]].map(|x| x / DEGREE);
    report.check_within("camera: error of the orientation, degrees,", camera_most, MOST);
    report.check_within("gravity: error of the tilt, degrees,", tilt_most, MOST);
    let relative = (gravity.relative / gravity.count.max(1.0)).sqrt();
    let [least, most] = HONEST;
    report.check(
        format!("gravity: the heading's error is {least} to {most} of its sigma (root mean square)"),
        format!("{relative:.2}; the sigma is {} degrees at the end", degrees(gravity.sigma.z)),
        (least..=most).contains(&relative),
    );
}
