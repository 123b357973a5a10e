//! The stiffest version of each kind of effect and of each ready-made scene that rests after a tap,
//! with and without the lead.

use hbot_config::scene::{SHELF, kinds};
use hbot_config::{RunningScene, SceneFile};
use hbot_core::CompiledScene;
use hbot_core::Vec3;
use hbot_core::render::effects::Span;
use hbot_core::safety::mode::Mode;
use hbot_plot::short;
use hbot_sim::phenomena::{Hand, Phenomena};
use serde_json::json;

use super::FACTOR;
use super::borders::{rig, whole};
use crate::context::Context;
use crate::report::{Report, row};

/// Lag of the motors, s.
const LAG: f64 = 5.0e-4;
/// Angular velocity of the tap, rad/s in N.
const TAP: Vec3 = Vec3::new(0.4, -0.3, 0.35);
/// Time from the tap to the judgement, and duration of the judgement, s.
const SETTLE_S: f64 = 1.7;
const JUDGE_S: f64 = 0.3;
/// Second difference of the angular velocity from tick to tick that is a swing, rad/s: root mean
/// square. It is that of an amplitude of 0.05 rad/s at 20 Hz; slow swings have almost none.
const SWINGS: f64 = 5.0e-4;
/// Gains that are tried, from least to largest: a factor of 2 apart.
const GAINS: u32 = 12;
const LEAST: f64 = 0.25;
/// Largest factor up to which no scene may be worse with a lead. Beyond it some scenes have almost
/// the largest damping that a loop bears, J/h: there is no room for the damping that a lead adds.
const ROOM: f64 = 32.0;
const RATIO: f64 = 2.0;
/// Kinds that give out energy on purpose. Nothing they do is a sign of delay.
const ON_PURPOSE: [&str; 4] = ["constant", "pulse", "track", "vibration"];
/// The default hand of the simulated rig, at rest.
const HAND: Hand = Hand { amplitude: 0.0, rate: 0.0, ..Hand::USUAL };

/// Returns `scene` with the torques of all effects multiplied by `gain`.
fn scaled(scene: &CompiledScene, gain: f64) -> CompiledScene {
    let effects: Vec<_> = scene
        .effects()
        .iter()
        .map(|effect| {
            let mut effect = *effect;
            effect.gain *= gain;
            effect.fade_s = 0.0;
            effect
        })
        .collect();
    let end = effects.iter().map(|effect| effect.numbers.start + effect.numbers.len).max().unwrap_or(0);
    let numbers = scene.numbers(Span { start: 0, len: end });
    CompiledScene::with_numbers(1000, &effects, numbers)
        .unwrap_or_else(|error| unreachable!("the effects of a legal scene: {error}"))
}

/// Returns whether the sphere comes to rest, or turns without a swing, after a tap.
fn rests(scene: &CompiledScene, factor: f64, hand: Option<Hand>) -> bool {
    swing(scene, factor, hand, TAP) < SWINGS
}

/// Returns the second difference of the angular velocity, root mean square, rad/s, some time after
/// the tap `tap`. It is infinite if the rig faults.
fn swing(scene: &CompiledScene, factor: f64, hand: Option<Hand>, tap: Vec3) -> f64 {
    let config = rig(1000, LAG, factor);
    let phenomena = Phenomena { motor: Some(crate::whole::motor(LAG)), hand, ..Phenomena::default() };
    let empty = json!({"name": "study", "effect": []});
    let mut whole = whole(&config, empty, phenomena, 250_000);
    whole.load(scene.clone());
    whole.run(0.7);
    let state = *whole.rig().state();
    whole.rig_mut().set_state(hbot_sim::plant::PlantState { omega: state.omega + tap, ..state });
    let (mut last, mut before) = (Vec3::ZERO, Vec3::ZERO);
    let (mut sum, mut count) = (0.0, 0.0);
    for tick in 0..whole.ticks(SETTLE_S + JUDGE_S) {
        if whole.step(None).state.mode != Mode::Active {
            return f64::INFINITY;
        }
        let omega = whole.rig().state().omega;
        if tick >= whole.ticks(SETTLE_S) {
            sum += (omega - last * 2.0 + before).length_squared();
            count += 1.0;
        }
        (before, last) = (last, omega);
    }
    libm::sqrt(sum / count)
}

/// Returns the largest gain below which the scene rests at all gains that are tried.
fn stiffest(scene: &CompiledScene, factor: f64, hand: Option<Hand>) -> f64 {
    let gains = (0..GAINS).map(|k| LEAST * RATIO.powi(k as i32));
    gains.take_while(|gain| rests(&scaled(scene, *gain), factor, hand)).last().unwrap_or(0.0)
}

pub(super) fn study(context: &Context, report: &mut Report) {
    context.part("all kinds and ready-made scenes");
    report.heading("All kinds and ready-made scenes");
    report.say(&format!(
        "Each kind of effect with its default parameters, and each ready-made scene, on the prototype at 1 kHz (motors with a lag of 0.5 ms, passivity off): the largest factor on its torque with which the sphere rests {SETTLE_S} s after a tap, \
         free and in the default hand, without a lead and with the factor {FACTOR}. Factors from {LEAST} are tried, {RATIO} times as large each, up to {}. Kinds that give out energy on purpose are left out.",
        short(LEAST * RATIO.powi(GAINS as i32 - 1))
    ));
    report.family("lead_stiffest_{scene}_{hold}_factor{c} | 1 | largest factor on the torque of a kind or a ready-made scene with which the sphere rests after a tap; c in hundredths");
    let mut table = vec![row(["scene", "free, without", "free, with", "held, without", "held, with"])];
    let mut scenes: Vec<(String, SceneFile)> = Vec::new();
    for kind in kinds().iter().filter(|kind| !ON_PURPOSE.contains(&kind.name)) {
        let scene = json!({"name": "study", "effect": [{"id": "one", "kind": kind.name}]});
        if let Ok(scene) = SceneFile::from_json(scene) {
            scenes.push((kind.name.to_owned(), scene));
        }
    }
    scenes.extend(SHELF.iter().map(|scene| (format!("scene {}", scene.file), scene.scene())));
    if context.quick {
        scenes.truncate(1);
    }
    let mut worse = Vec::new();
    for (name, file) in scenes {
        let scene = RunningScene::new().load(file);
        let mut cells = vec![name.clone()];
        for (hold, hand) in [("free", None), ("held", Some(HAND))] {
            let [without, with] = [0.0, FACTOR].map(|factor| stiffest(&scene, factor, hand));
            let id = name.replace([' ', '-'], "_");
            report.figure(format!("lead_stiffest_{id}_{hold}_factor0"), without);
            report.figure(format!("lead_stiffest_{id}_{hold}_factor{}", (100.0 * FACTOR).round()), with);
            cells.extend([short(without), short(with)]);
            if with < without.min(ROOM) {
                worse.push(format!("{name}, {hold}"));
            }
        }
        table.push(row(cells));
    }
    report.table(&table);
    let found = if worse.is_empty() { "none is".to_owned() } else { worse.join("; ") };
    report.check(
        format!("up to {ROOM} times its torque, no kind and no ready-made scene rests only without a lead"),
        found,
        worse.is_empty(),
    );
}
