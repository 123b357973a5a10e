//! The whole loop: the largest stable stiffness of a spring that the controller renders on the simulated prototype.

use hbot_config::{Override, RigConfig, RunningScene, SceneFile};
use hbot_core::inputs::{Command, Inputs};
use hbot_core::outputs::Drive;
use hbot_core::{Controller, MAX_JOINTS, Vec3, rotation};
use hbot_sim::exchange::Exchange;
use hbot_sim::plant::{Plant, State};
use hbot_sim::rig::{RigConfig as SimulatedConfig, SimulatedRig};
use serde_json::json;

use super::{border, micro};
use crate::context::{Context, Interrupted};
use crate::plot::short;
use crate::report::{Report, row};

/// Loop rates, Hz.
const RATES: [u32; 3] = [1000, 2000, 4000];
/// Damping of the spring, N m s/rad.
const DAMPING: [f64; 3] = [0.005, 0.01, 0.02];
/// How near the measured border must be.
const WITHIN: f64 = 0.1;
/// Bisections of a bracket of 4: to 1 %.
const HALVINGS: u32 = 7;
/// How far the sphere is thrown off, rad: a few hundred counts, and far from the torque's limits.
const THROWN: f64 = 0.01;
/// Soft start, then the time to watch, s.
const START_S: f64 = 0.6;
const WATCH_S: f64 = 1.5;

/// A loop of controller, line and rig in lock-step.
struct Loop {
    controller: Controller,
    scene: hbot_core::CompiledScene,
    exchange: Exchange,
    drive: Drive,
    feedback: Option<hbot_core::inputs::JointFeedback>,
    tick: u32,
    period_ns: u64,
}

impl Loop {
    fn new(rate: u32, stiffness: f64, damping: f64) -> Self {
        let with = Override { path: "loop.rate_hz", value: json!(rate), from: "the study" };
        let config = RigConfig::load(None, &[with]);
        let config = config.unwrap_or_else(|error| unreachable!("a legal rate: {error}"));
        let scene = json!({"name": "study", "effect": [
            {"id": "spring", "kind": "spring", "stiffness": stiffness, "damping": damping, "fade_s": 0}
        ]});
        let scene =
            SceneFile::from_json(scene).unwrap_or_else(|error| unreachable!("a legal scene: {error}"));
        let rig = SimulatedRig::new(&SimulatedConfig::new(&config.rig));
        let rig = rig.unwrap_or_else(|error| unreachable!("the prototype can be simulated: {error}"));
        Self {
            controller: Controller::new(config.rig),
            scene: RunningScene::new().load(scene),
            exchange: Exchange::new(rig, config.rig.device.joints()),
            drive: Drive { enable: false, torque: [0.0; MAX_JOINTS] },
            feedback: None,
            tick: 0,
            period_ns: config.rig.timing.period_ns,
        }
    }

    /// One tick: the reading that came back in the last one, and a command that acts from this one on. From a reading to its torque
    /// is one period.
    fn step(&mut self) {
        let mut inputs = Inputs::quiet(u64::from(self.tick));
        inputs.feedback = self.feedback.take();
        if self.tick == 2 {
            // A tick without any other command has room.
            let _ = inputs.commands.push(Command::Enable);
        }
        self.drive = self.controller.tick(&self.scene, &inputs).drive;
        self.feedback = self.exchange.tick(u64::from(self.tick) * self.period_ns, self.tick, &self.drive);
        self.tick += 1;
    }

    /// Whether a swing about n1 grows.
    fn grows(mut self, stiffness: f64) -> bool {
        let ticks = |seconds: f64| (seconds * 1.0e9 / self.period_ns as f64) as u32;
        let (start, watch) = (ticks(START_S), ticks(WATCH_S));
        for _ in 0..start {
            self.step();
        }
        let state = *self.exchange.rig().state();
        let Ok(plant) = Plant::new(&self.controller.rig().device) else { return true };
        let inertia = plant.apparent_inertia(&state).x_axis.x;
        let omega = Vec3::X * (THROWN * libm::sqrt(stiffness / inertia));
        self.exchange.rig_mut().set_state(State { omega, ..state });
        let (mut early, mut late) = (0.0_f64, 0.0_f64);
        for k in 0..watch {
            self.step();
            let angle = rotation::log(self.exchange.rig().state().q).length();
            if k < watch / 5 {
                early = early.max(angle);
            } else if k > 4 * (watch / 5) {
                late = late.max(angle);
            }
        }
        !(late <= early)
    }
}

pub(super) fn study(context: &Context, report: &mut Report) -> Result<(), Interrupted> {
    context.part("the whole loop")?;
    report.heading("The whole loop");
    report.say(
        "The prototype's controller, its line and its simulated rig in lock-step, without friction: the stiffness from which a small swing about n1 grows, beside \
         B/(h (1/2 + D)). The torque of a reading acts one period after it, D = 1, in virtual time as on the wire (docs/performance.md). The ideal rig has no damping of its own; \
         a real one has, and stands more.",
    );
    report.family(
        "border_rig_{rate}hz_damping{B}",
        "N m/rad",
        "stiffness of a spring from which the whole simulated loop swings up; damping in 1e-6 N m s/rad; `measured` and `predicted` in the row",
    );
    let mut table = vec![row(["Hz", "B, N m s/rad", "measured, N m/rad", "predicted", "ratio"])];
    let mut worst = 0.0_f64;
    let rates = if context.quick { &RATES[..1] } else { &RATES[..] };
    for rate in rates {
        for damping in DAMPING {
            context.go_on()?;
            let predicted = damping * f64::from(*rate) / 1.5;
            let (mut low, mut high) = (0.5 * predicted, 2.0 * predicted);
            for _ in 0..HALVINGS {
                let middle = (low * high).sqrt();
                if Loop::new(*rate, middle, damping).grows(middle) { high = middle } else { low = middle }
            }
            let measured = (low * high).sqrt();
            border(report, format!("border_rig_{rate}hz_damping{}", micro(damping)), measured, predicted);
            worst = worst.max((measured / predicted - 1.0).abs());
            let numbers = [damping, measured, predicted, measured / predicted].map(short);
            table.push(row([rate.to_string()].into_iter().chain(numbers)));
        }
    }
    report.table(&table);
    report.check(
        format!("the whole loop swings up from B/(h (1/2 + D)), D = 1, within {WITHIN}"),
        format!("{worst:.3} at worst"),
        worst <= WITHIN,
    );
    Ok(())
}
