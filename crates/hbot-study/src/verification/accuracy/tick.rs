//! Accuracy and computing time of the whole tick under each preset of the rig file.

use hbot_config::{Override, RigConfig, RunningScene, SceneFile};
use hbot_core::inputs::{Command, Complaints, Inputs, JointReadings};
use hbot_core::kinematics::Posture;
use hbot_core::mode::Mode;
use hbot_core::{CompiledScene, Controller, MAX_JOINTS, rotation};
use hbot_plot::{Lines, Series, short};
use hbot_sim::motion::{LEAD, MOTIONS, MotionSample, TrueMotion, angle};
use serde_json::json;

use super::motions::{Budget, budget};
use super::sci;
use crate::context::{Context, Interrupted};
use crate::report::{Report, head, row, spread};
use crate::timing::{Time, Timed, in_turn};

/// The motion that the controller follows. It is fast and does not change its direction.
const MOTION: TrueMotion = MOTIONS[1];
/// Accuracy presets that a rig file can name.
const PRESETS: [&str; 3] = ["fast", "balanced", "exact"];
/// Duration of the motion that the controller follows, s.
const TIME_S: u32 = 10;
/// Rate of the control loop, Hz.
const RATE: u32 = 1000;
/// Share of the loop's period that one tick is allowed to take. The highest loop rate in the report
/// follows from this share.
const LOAD: f64 = 0.1;
/// Number of ticks after which the soft start is over.
const STARTED: usize = 600;

/// Returns the configuration of the prototype with the accuracy preset `preset`.
fn rig(preset: &str) -> RigConfig {
    let with = Override { path: "loop.accuracy", value: json!(preset), from: "the study" };
    RigConfig::load(None, &[with]).unwrap_or_else(|error| unreachable!("a preset of the prototype: {error}"))
}

/// Returns a scene with one spring and one damper.
fn scene() -> CompiledScene {
    let scene = json!({"name": "study", "effect": [
        {"id": "spring", "kind": "spring", "stiffness": 4, "damping": 0, "fade_s": 0},
        {"id": "damper", "kind": "damper", "damping": 0.05, "fade_s": 0},
    ]});
    let file = SceneFile::from_json(scene);
    RunningScene::new().load(file.unwrap_or_else(|error| unreachable!("a legal scene: {error}")))
}

/// Returns the readings that motor controllers would send in each tick of a motion.
fn feedbacks(config: &RigConfig, motion: &TrueMotion, moments: &[MotionSample]) -> Vec<JointReadings> {
    let rig = &config.rig;
    let each = |(k, moment): (usize, &MotionSample)| {
        let omega = motion.omega(k as f64 / f64::from(RATE));
        let rates = Posture::new(&rig.device, &[moment.joints[0], moment.joints[2]]).inverse(omega);
        let mut counts = [0; MAX_JOINTS];
        for (j, angle) in moment.joints.iter().enumerate() {
            counts[j] = (angle / rig.joints[j].radians_per_count()).round() as i64 as i32;
        }
        JointReadings { sequence: k as u32, counts, rates, index_seen: 0, complaints: Complaints::default() }
    };
    moments.iter().enumerate().map(each).collect()
}

/// Runs one tick of the controller with one reading. In tick 1, torque is also enabled.
fn tick(controller: &mut Controller, scene: &CompiledScene, feedback: &JointReadings) -> hbot_core::Outputs {
    let mut inputs = Inputs::quiet(u64::from(feedback.sequence));
    inputs.feedback = Some(*feedback);
    if feedback.sequence == 1 {
        // There is room, as the tick has no other command.
        let _ = inputs.commands.push(Command::Enable);
    }
    controller.tick(scene, &inputs)
}

/// Accuracy and computing time of a whole tick with one accuracy preset.
struct Found {
    preset: &'static str,
    /// Names, as in rig files, of the odometry method and of the path that it assumes between
    /// readings.
    methods: String,
    /// Largest error of the controller's orientation during the motion, rad.
    error: f64,
    /// Errors of the orientation by cause: integration method, assumed path and encoder counts.
    budget: Budget,
    /// Mode of the controller in the last tick.
    mode: Mode,
    time: Time,
}

pub(super) fn study(context: &Context, report: &mut Report) -> Result<(), Interrupted> {
    context.part("the whole tick: error")?;
    introduce(report);
    let found = measured(context)?;
    tell(report, &found);
    Ok(())
}

fn introduce(report: &mut Report) {
    report.heading("The whole tick");
    report.say(&format!(
        "Controller::tick of the prototype at {RATE} Hz with a spring and a damper, active, under each preset of the rig file: from counts to \
         joint torques. The error is the largest of its orientation in {TIME_S} s of {} motion (3 rad/s and ever on: some five turns), read by \
         the prototype's encoders; beside it where it comes from. The highest rate is the one at which the tick takes {:.0} % of a period; the \
         serial line and the kernel come on top (docs/performance.md).",
        MOTION.name,
        100.0 * LOAD
    ));
    report.family("tick_{preset}_error_rad | rad | largest orientation error of the whole tick in 10 s of brisk motion at 1 kHz");
    report.family("tick_{preset}_{part}_part_rad | rad | the part of that error that {part} (method, path, counts) has by itself");
    report.family("tick_{preset}_ns | ns | one active tick with a spring and a damper, 2 wheels");
    report.family("tick_{preset}_max_hz | Hz | the loop rate at which the tick takes a tenth of a period");
}

/// Makes a new controller follow a motion. Returns the largest error of its orientation (rad), its
/// mode in the last tick, and a copy of the controller as it was just after the soft start.
fn followed(
    config: &RigConfig,
    scene: &CompiledScene,
    feedbacks: &[JointReadings],
    moments: &[MotionSample],
) -> (f64, Mode, Controller) {
    let mut controller = Controller::new(config.rig);
    let mut started = None;
    let mut worst = 0.0_f64;
    let mut mode = Mode::Unreferenced;
    for (k, (feedback, moment)) in feedbacks.iter().zip(moments).enumerate() {
        let state = tick(&mut controller, scene, feedback).state;
        worst = worst.max(angle(rotation::to_wxyz(state.q), moment.q));
        mode = state.mode;
        if k == STARTED {
            started = Some(controller.clone());
        }
    }
    (worst, mode, started.unwrap_or_else(|| unreachable!("longer than the soft start")))
}

fn measured(context: &Context) -> Result<Vec<Found>, Interrupted> {
    let configs = PRESETS.map(rig);
    let ticks = (TIME_S * RATE) as usize;
    let moments = MOTION.moments(&configs[0].rig.device, RATE, ticks + LEAD + 1, LEAD);
    let scene = scene();
    let feedbacks = feedbacks(&configs[0], &MOTION, &moments[LEAD..]);
    let mut timed = Vec::new();
    let mut errors = Vec::new();
    for config in &configs {
        context.go_on()?;
        let (error, mode, started) = followed(config, &scene, &feedbacks, &moments[LEAD..]);
        errors.push((error, mode));
        let (scene, rest) = (&scene, &feedbacks[STARTED + 1..]);
        // One timed run is a pass over the whole motion. It starts with a copy of 50 kB, which is
        // small relative to thousands of ticks.
        timed.push(
            Timed::new(move || {
                let mut controller = started.clone();
                rest.iter().map(|feedback| tick(&mut controller, scene, feedback).state.torque.x).sum::<f64>()
            })
            .in_units_of(rest.len() as f64),
        );
    }
    context.part("the whole tick: time")?;
    let times = in_turn(context, &mut timed)?;
    let found = |(((preset, config), (error, mode)), time): (((_, &RigConfig), (f64, Mode)), Time)| Found {
        preset,
        methods: format!("{}, {}", config.rig.methods.odometry.name(), config.rig.methods.path.name()),
        error,
        budget: budget(&config.rig, config.rig.methods, &moments),
        mode,
        time,
    };
    Ok(PRESETS.into_iter().zip(&configs).zip(errors).zip(times).map(found).collect())
}

fn tell(report: &mut Report, found: &[Found]) {
    let mut table = vec![head(
        "preset | odometry, path | error, rad in 10 s | of the method | of the path | of the counts | ns a tick (quartiles) | highest rate, Hz",
    )];
    for Found { preset, methods, error, budget, mode, time } in found {
        let Budget { method, path, counts, .. } = *budget;
        let highest = LOAD * 1.0e9 / time.median;
        report.check("the tick is active to the end", format!("{mode:?}"), *mode == Mode::Active);
        report.time(format!("tick_{preset}_ns"), *time);
        report.figure(format!("tick_{preset}_error_rad"), *error);
        for (part, value) in [("method", method), ("path", path), ("counts", counts)] {
            report.figure(format!("tick_{preset}_{part}_part_rad"), value);
        }
        report.figure(format!("tick_{preset}_max_hz"), highest);
        table.push(row([
            *preset,
            methods,
            &sci(*error),
            &sci(method),
            &sci(path),
            &sci(counts),
            &spread(*time),
            &short(highest),
        ]));
    }
    report.table(&table);
    report.say(
        "The other stages of the tick add nothing to the orientation. The spring laws and the allocation are exact to rounding in every preset as long as \
         the motors are not saturated (sections above): an error of the orientation is felt as that error times the stiffness.",
    );
    let point = |(colour, of): (usize, &Found)| {
        Series::new(of.preset.to_owned(), vec![(of.time.median, of.error)], colour)
    };
    report.lines(
        "tick",
        "The whole tick under each preset: error in 10 s of brisk motion against time",
        Lines::new(
            "The presets",
            "ns a tick",
            "error in 10 s, rad",
            found.iter().enumerate().map(point).collect(),
        )
        .log([false, true])
        .front(),
    );
}
