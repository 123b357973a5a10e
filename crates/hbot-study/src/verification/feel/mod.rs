//! The study `feel`: what the passivity stage changes for the hand, and which scenes shake with it.

mod felt;
mod shaken;

use hbot_config::scene::SHELF;
use hbot_config::{RigConfig, SceneFile};
use hbot_plot::short;
use hbot_sim::phenomena::Hand;
use serde_json::json;

use self::felt::{Felt, felt, free};
use crate::context::Context;
use crate::report::{Report, head, row};
use crate::whole::{prototype, scene_of};

/// The hands that move the sphere, each with its name.
const HANDS: [(&str, Hand); 3] = [
    ("default", Hand { rate: 1.0, ..Hand::USUAL }),
    (
        "strong",
        Hand { stiffness: 30.0, damping: 0.3, inertia: 4.0e-3, amplitude: 0.15, rate: 1.0, ..Hand::USUAL },
    ),
    ("finger", Hand { stiffness: 0.3, damping: 0.005, inertia: 2.0e-4, rate: 1.0, ..Hand::USUAL }),
];
/// Rates of the hand's motion, Hz.
const RATES: [f64; 5] = [1.0, 2.0, 5.0, 10.0, 20.0];
/// Damping of the spring at half its border, N m s/rad.
const DAMPING: f64 = 0.02;
/// Largest change of the impedance that counts as feeling alike, relative to the impedance.
const ALIKE: f64 = 0.05;

/// Least impedance to which a change is compared, N m/rad. It is a thirtieth of the default hand's.
const LEAST: f64 = 0.1;

/// Angle below which two orientations count as equal, rad: some roundings of a unit quaternion.
const EQUAL: f64 = 1.0e-14;

/// Runs the study `feel` and returns its report.
pub(crate) fn study(context: &Context) -> Report {
    let mut report = Report::new("feel", context.quick);
    context.expect(3);
    report.say(
        "What the passivity stage (`passivity` in a rig file's `[loop]`) changes for the hand, on the simulated prototype: the whole loop, controller, line and rig, in virtual time.",
    );
    context.part("what a hand feels");
    let felt = hands(context, &mut report);
    context.part("scenes that shake");
    let shaken = shaken::study(&mut report);
    context.part("springs");
    shaken::springs(context, &mut report);
    report.in_short("springs", [felt].into_iter().chain(shaken));
    report
}

/// Measures stiffness and damping of all ready-made scenes and of a spring at half its border, with
/// the stage off and on. Returns the result in a sentence.
fn hands(context: &Context, report: &mut Report) -> String {
    report.family("impedance_{scene}_{hand}_{hz}hz | 1 | largest change of the impedance that the stage makes, over three axes, relative to the impedance without it, which counts as at least 0.1 N m/rad; `off` and `on`: stiffness (N m/rad) and damping (N m s/rad) about the axis of the change");
    report.family("free_{scene} | rad | largest angle between the orientations of a free sphere with and without the stage in 2 s after a tap; `reach`: the way of the sphere");
    let [off, on] = [false, true].map(|on| prototype(&[("loop.passivity", json!(on))]));
    let half = 0.5 * DAMPING / (1.5 * off.rig.timing.period_s() + off.rig.torque_lag);
    let mut scenes: Vec<(String, SceneFile)> =
        SHELF.iter().map(|scene| (scene.file.to_owned(), scene.scene())).collect();
    let spring = json!({"name": "half", "effect": [
        {"id": "spring", "kind": "spring", "stiffness": half, "damping": DAMPING}
    ]});
    scenes.push(("half-border".to_owned(), scene_of(spring)));
    let mut table = vec![head("scene | hand | 1 Hz | 2 Hz | 5 Hz | 10 Hz | 20 Hz | ticks with damping")];
    let mut springs = vec![head("hand | Hz | K off, N m/rad | K on | B off, N m s/rad | B on")];
    let (mut alike, mut worst, mut apart) = (Vec::new(), 0.0_f64, 0.0_f64);
    for (name, scene) in &scenes {
        let id = name.replace(['-', '.'], "_");
        let swing = free([&off, &on], scene);
        report.figure(format!("free_{id}"), swing.apart).note("reach", swing.reach);
        apart = apart.max(swing.apart);
        let mut acts = swing.apart > EQUAL;
        let rates = if context.quick { &RATES[2..4] } else { &RATES[..] };
        for (hand_name, hand) in HANDS {
            let mut cells = row([name.as_str(), hand_name]);
            let mut share = 0.0_f64;
            for rate in RATES {
                if !rates.contains(&rate) {
                    cells.push("-".to_owned());
                    continue;
                }
                let [without, with] =
                    [&off, &on].map(|config: &RigConfig| felt(config, scene, Hand { rate, ..hand }));
                let change = most_changed(&without, &with);
                let [k, b, k_on, b_on] = change.numbers;
                report
                    .figure(format!("impedance_{id}_{hand_name}_{rate}hz"), change.size)
                    .note("off", vec![k, b])
                    .note("on", vec![k_on, b_on]);
                if name == "half-border" {
                    springs.push(row([hand_name.to_owned(), rate.to_string()]
                        .into_iter()
                        .chain([k, k_on, b, b_on].map(short))));
                }
                worst = worst.max(change.size);
                share = share.max(with.share);
                cells.push(format!("{:.2} %", 100.0 * change.size));
            }
            cells.push(format!("{:.1} %", 100.0 * share));
            if share > 0.0 {
                acts = true;
                table.push(cells);
            }
        }
        if !acts {
            alike.push(format!("`{name}`"));
        }
    }
    report.heading("What a hand feels");
    report.say(&format!(
        "Hands of 3, 30 and 0.3 N m/rad (`default`, `strong`, `finger`) move the sphere about n1, n2 and n3 at 1, 0.71 and 0.62 times the rate in the table. Stiffness K and damping B are the parts of the torque against the turn and \
         the rate. The table has the largest change |Z - Z'|/|Z| of the impedance Z = K + i w B that the stage makes, over the three axes; a |Z| below {LEAST} N m/rad counts as {LEAST}. It also has the largest share of ticks in which it adds damping. Rows without such ticks are left out. \
         The stage never acts in these scenes, and changes no bit: {}.",
        alike.join(", ")
    ));
    report.table(&table);
    report.say(&format!(
        "The spring `half-border` has {} N m/rad, half of what its damping of {DAMPING} N m s/rad keeps stable:",
        short(half)
    ));
    report.table(&springs);
    report.check(
        format!(
            "The stage changes the impedance of each ready-made scene and of the spring by at most {:.0} %",
            100.0 * ALIKE
        ),
        format!("{:.2} % at worst", 100.0 * worst),
        worst <= ALIKE,
    );
    report.check_within(
        "Free spheres after a tap of 2.1 rad/s: angle with and without the stage, rad,",
        apart,
        0.05,
    );
    format!(
        "The stage acts in {} of {} scenes that hands move, and changes the impedance by at most {:.2} %.",
        scenes.len() - alike.len(),
        scenes.len(),
        100.0 * worst
    )
}

/// The largest change of the impedance about an axis.
struct Change {
    size: f64,
    /// Stiffness and damping without the stage, and with it.
    numbers: [f64; 4],
}

fn most_changed(without: &Felt, with: &Felt) -> Change {
    let mut most = Change { size: -1.0, numbers: [0.0; 4] };
    for (a, b) in without.axes.iter().zip(&with.axes) {
        let pace = a.frequency * core::f64::consts::TAU;
        let change = (b.stiffness - a.stiffness).hypot((b.damping - a.damping) * pace);
        let size = change / a.stiffness.hypot(a.damping * pace).max(LEAST);
        if size > most.size {
            most = Change { size, numbers: [a.stiffness, a.damping, b.stiffness, b.damping] };
        }
    }
    most
}
