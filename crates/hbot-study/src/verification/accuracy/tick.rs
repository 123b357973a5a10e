//! Accuracy and cost of the whole tick with each odometry method and path of the rig file, the
//! presets among them.

use hbot_config::{Override, RigConfig, RunningScene, SceneFile};
use hbot_core::design::rig::OdometryMethod::{self, Euler, Magnus4, Midpoint};
use hbot_core::design::rig::PathFit::{self, Cubic, Quadratic, Straight};
use hbot_core::inputs::{Command, Inputs, JointReadings};
use hbot_core::safety::mode::Mode;
use hbot_core::{CompiledScene, Controller, rotation};
use hbot_plot::{NamedPoint, NamedPoints, PointGroup, short};
use hbot_sim::motion::{LEAD, MOTIONS, MotionSample, TrueMotion, angle};
use serde_json::{Value, json};

use super::motions::{Budget, budget};
use super::sci;
use crate::context::Context;
use crate::report::{Report, head, spread};
use crate::timing::{Difference, Time, Timed, compared};
use crate::verification::callgrind::{Counter, MANY};
use crate::verification::{Job, readings};

/// The motion that the controller follows. It is fast and does not change its direction.
const MOTION: TrueMotion = MOTIONS[1];
/// The odometry methods and paths that are compared, by increasing cost: their name in the ids of
/// figures, and the accuracy preset of a rig file that stands for them, if there is one. Euler's
/// method does not depend on the path.
const CHOICES: [(&str, Option<&str>, OdometryMethod, PathFit); 7] = [
    ("fast", Some("fast"), Euler, Straight),
    ("balanced", Some("balanced"), Midpoint, Straight),
    ("midpoint_quadratic", None, Midpoint, Quadratic),
    ("midpoint_cubic", None, Midpoint, Cubic),
    ("magnus4_straight", None, Magnus4, Straight),
    ("magnus4_quadratic", None, Magnus4, Quadratic),
    ("exact", Some("exact"), Magnus4, Cubic),
];
/// Duration of the motion that the controller follows, s.
const TIME_S: u32 = 10;
/// Rate of the control loop, Hz.
const RATE: u32 = 1000;
/// Share of the loop's period that one tick is allowed to take. The highest loop rate in the report
/// follows from this share.
const LOAD: f64 = 0.1;
/// Number of ticks after which the soft start is over.
const STARTED: usize = 600;

/// Returns the configuration of the prototype with the choice `choice`, an index into [`CHOICES`].
fn rig(choice: usize) -> RigConfig {
    let (_, preset, odometry, path) = CHOICES[choice];
    let preset = preset.unwrap_or("balanced");
    // Without a lead, because the reference renders the scene at the measured pose.
    let with = [("loop.accuracy", json!(preset)), ("loop.lead", json!(false))]
        .map(|(path, value)| Override { path, value, from: "the study" });
    let mut config = RigConfig::load(None, &with)
        .unwrap_or_else(|error| unreachable!("a preset of the prototype: {error}"));
    let rig = config.rig.with(|rig| (rig.methods.odometry, rig.methods.path) = (odometry, path));
    config.rig = rig.unwrap_or_else(|error| unreachable!("methods of the core: {error}"));
    config
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

/// Accuracy and cost of a whole tick with one odometry method and path.
pub(super) struct Found {
    /// Name in the ids of figures: the preset's, if there is one.
    pub(super) name: &'static str,
    is_preset: bool,
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
    /// How much longer a tick takes than with the first choice.
    pub(super) longer: Difference,
    /// Instructions of a tick, if they were counted.
    pub(super) instructions: Option<f64>,
}

pub(super) fn study(context: &Context, report: &mut Report, counter: Option<&Counter>) -> Vec<Found> {
    context.part("the whole tick: error");
    introduce(report);
    let mut found = measured(context);
    context.part("the whole tick: instructions");
    let jobs: Vec<Value> = (0..CHOICES.len()).map(|choice| json!({ "tick": choice })).collect();
    let counted = match counter {
        Some(counter) => counter.count(&jobs),
        None => Err("this program cannot run itself under valgrind".to_owned()),
    };
    match counted {
        Ok(counted) => {
            found.iter_mut().zip(counted).for_each(|(found, count)| found.instructions = Some(count));
        }
        Err(why) => report.say(&format!(
            "**Instructions were not counted: {why}.** The cost is told by times alone, which vary."
        )),
    }
    tell(report, &found);
    report.plot(
        "tick",
        "What accuracy costs: error in 10 s of brisk motion against the time of a tick, for every odometry method and path, with exact readings and with the prototype's encoders",
        picture(&found),
    );
    found
}

/// Returns the ticks with one choice, whose instructions are counted: ticks of the motion after the
/// soft start. Returns `None` if `job` is something else.
pub(in crate::verification) fn job(job: &Value) -> Option<Job> {
    let choice = usize::try_from(job.get("tick")?.as_u64()?).ok().filter(|choice| *choice < CHOICES.len())?;
    let config = rig(choice);
    let moments = MOTION.moments(&config.rig.device, RATE, STARTED + MANY + LEAD + 2, LEAD);
    let (scene, feedbacks) = (scene(), readings(&config.rig, &MOTION, &moments[LEAD..]));
    let (.., started) = followed(&config, &scene, &feedbacks, &moments[LEAD..]);
    Some(Box::new(move |ticks| {
        let mut controller = started.clone();
        let rest = feedbacks[STARTED + 1..].iter().take(ticks);
        rest.map(|feedback| tick(&mut controller, &scene, feedback).state.torque.x).sum()
    }))
}

fn introduce(report: &mut Report) {
    report.heading("The whole tick");
    report.say(&format!(
        "Controller::tick of the prototype at {RATE} Hz with a spring and a damper, active, with every odometry method and path of the rig file, the presets among them: from counts to \
         joint torques. The error is the largest of its orientation in {TIME_S} s of {} motion (3 rad/s and ever on: some five turns), read by \
         the prototype's encoders; beside it where it comes from. Instructions are callgrind's and the same in every run. The highest rate is the one at which the tick takes {:.0} % of a period; the \
         serial line and the kernel come on top (docs/performance.md).",
        MOTION.name,
        100.0 * LOAD
    ));
    report.family("tick_{choice}_error_rad | rad | largest orientation error of the whole tick in 10 s of brisk motion at 1 kHz; {choice}: a preset (fast, balanced, exact), or another odometry method and path");
    report.family("tick_{choice}_{part}_part_rad | rad | the part of that error that {part} (method, path, counts) has by itself; method_and_path: without the counts");
    report.family("tick_{choice}_instructions | 1 | instructions of one active tick with a spring and a damper, 2 wheels");
    report.family("tick_{choice}_ns | ns | time of such a tick");
    report.family("tick_{choice}_longer_ns | ns | how much longer it takes than `fast` in the same round: median, with `q1`, `q3` and whether it is `found`, that is, more than its spread");
    report.family("tick_{choice}_max_hz | Hz | the loop rate at which the tick takes a tenth of a period");
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

fn measured(context: &Context) -> Vec<Found> {
    let configs: Vec<RigConfig> = (0..CHOICES.len()).map(rig).collect();
    let ticks = (TIME_S * RATE) as usize;
    let moments = MOTION.moments(&configs[0].rig.device, RATE, ticks + LEAD + 1, LEAD);
    let scene = scene();
    let feedbacks = readings(&configs[0].rig, &MOTION, &moments[LEAD..]);
    let mut timed = Vec::new();
    let mut errors = Vec::new();
    for config in &configs {
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
    context.part("the whole tick: time");
    let times = compared(context.quick, &mut timed);
    let mut found = Vec::new();
    for (k, ((config, (error, mode)), (time, longer))) in configs.iter().zip(errors).zip(times).enumerate() {
        let (name, preset, odometry, path) = CHOICES[k];
        found.push(Found {
            name,
            is_preset: preset.is_some(),
            methods: format!("{}, {}", odometry.name(), path.name()),
            error,
            budget: budget(&config.rig, config.rig.methods, &moments),
            mode,
            time,
            longer,
            instructions: None,
        });
    }
    found
}

fn tell(report: &mut Report, found: &[Found]) {
    let mut table = vec![head(
        "preset | odometry, path | error, rad in 10 s | of the method | of the path | method and path | of the counts | instructions a tick | ns a tick (quartiles) | highest rate, Hz",
    )];
    for found in found {
        figures(report, found);
        let Found { name, is_preset, methods, error, budget, time, instructions, .. } = found;
        let errors = [*error, budget.method, budget.path, budget.both, budget.counts].map(sci);
        let name = if *is_preset { (*name).to_owned() } else { "-".to_owned() };
        let counted = instructions.map_or("-".to_owned(), |count| format!("{count:.0}"));
        let costs = [counted, spread(*time), short(LOAD * 1.0e9 / time.median)];
        table.push([name, methods.clone()].into_iter().chain(errors).chain(costs).collect());
    }
    let all_active = found.iter().all(|found| found.mode == Mode::Active);
    report.check(
        "the tick is active to the end",
        if all_active { "with every method" } else { "not with every method" },
        all_active,
    );
    report.table(&table);
    report.say(
        "The other stages of the tick add nothing to the orientation. The spring laws and the allocation are exact to rounding with every method as long as \
         the motors are not saturated (sections above): an error of the orientation is felt as that error times the stiffness.",
    );
}

/// Adds the figures of one method and path.
fn figures(report: &mut Report, found: &Found) {
    let Found { name, error, budget, time, longer, instructions, .. } = found;
    let Budget { method, path, counts, both, .. } = *budget;
    report.time(format!("tick_{name}_ns"), *time);
    if *name != CHOICES[0].0 {
        let figure = report.figure(format!("tick_{name}_longer_ns"), longer.median);
        figure.note("q1", longer.q1).note("q3", longer.q3).note("found", longer.is_found());
    }
    if let Some(count) = instructions {
        report.figure(format!("tick_{name}_instructions"), *count);
    }
    report.figure(format!("tick_{name}_error_rad"), *error);
    for (part, value) in [("method", method), ("path", path), ("method_and_path", both), ("counts", counts)] {
        report.figure(format!("tick_{name}_{part}_part_rad"), value);
    }
    report.figure(format!("tick_{name}_max_hz"), LOAD * 1.0e9 / time.median);
}

/// Returns a picture of what accuracy costs: each method at its error and time, with the
/// prototype's encoders and with exact readings.
fn picture(found: &[Found]) -> String {
    let point = |found: &Found, y: f64, named: bool| {
        let preset = if found.is_preset { format!(" ({})", found.name) } else { String::new() };
        let name = if named { format!("{}{preset}", found.methods) } else { String::new() };
        NamedPoint { name, x: found.time.median, spread: [found.time.q1, found.time.q3], y }
    };
    let group = |name: &str, colour, named, of: fn(&Found) -> f64| PointGroup {
        name: name.to_owned(),
        colour,
        points: found.iter().map(|found| point(found, of(found), named)).collect(),
    };
    let groups = vec![
        group("exact readings", 0, true, |found| found.budget.both),
        group("16384 counts a turn", 1, false, |found| found.error),
    ];
    NamedPoints {
        title: "What accuracy costs: the tick with every method".to_owned(),
        x: "ns a tick: median, bar from quartile to quartile".to_owned(),
        y: "error of the orientation in 10 s, rad".to_owned(),
        above: Some((format!("per cent of the period of a tick at {RATE} Hz"), 100.0e-9 * f64::from(RATE))),
        level: found.first().map(|found| ("the encoders' floor".to_owned(), found.budget.counts)),
        groups,
    }
    .svg()
}
