//! Scenes that shake by themselves, with and without the passivity stage.

use hbot_core::Vec3;
use hbot_plot::{Lines, Series};
use hbot_sim::phenomena::{Hand, Phenomena};
use serde_json::{Value, json};

use crate::context::Context;
use crate::report::{Report, head, row};
use crate::whole::{Whole, prototype, scene_of};

/// Angular velocity after a tap, rad/s in N.
const TAP: Vec3 = Vec3::new(0.3, 0.6, 0.15);

/// The scenes, each with its name.
fn cases() -> Vec<(&'static str, Value)> {
    let spring = |i: usize, k: f64, b: f64| json!({"id": format!("s{i}"), "kind": "spring", "anchor": "here", "stiffness": k, "damping": b});
    let one = |effect: Value| Value::Array(vec![effect]);
    vec![
        ("spring 10, damping 0.02", one(spring(0, 10.0, 0.02))),
        ("spring 40, damping 0.01", one(spring(0, 40.0, 0.01))),
        (
            "20 springs of 20 N m/rad, damping 0.002",
            Value::Array((0..20).map(|i| spring(i, 20.0, 0.002)).collect()),
        ),
        (
            "spring 40, damping about one axis",
            one(
                json!({"id": "s", "kind": "spring", "anchor": "here", "stiffness": 40, "damping": [[0.1, 0, 0], [0, 0, 0], [0, 0, 0]]}),
            ),
        ),
        (
            "spring 300, a wall never touched",
            json!([spring(0, 300.0, 0.0), {"id": "w", "kind": "end_stop", "cone": 2.7, "stiffness": 1, "damping": 0.7}]),
        ),
        (
            "spring 40, damper 0.1 beyond 100 rad/s",
            json!([spring(0, 40.0, 0.0), {"id": "d", "kind": "damper", "damping": 0.1, "deadband": 100}]),
        ),
        (
            "spring 40, detents that damp",
            json!([spring(0, 40.0, 0.0), {"id": "d", "kind": "detents", "axis": [1, 0, 0], "strength": 0, "damping": 0.1}]),
        ),
        (
            "end_stop 200, cone 0, damping 0.45",
            one(
                json!({"id": "w", "kind": "end_stop", "cone": 0, "anchor": "here", "stiffness": 200, "damping": 0.45}),
            ),
        ),
        ("snaps 0.9, width 0.01", one(json!({"id": "s", "kind": "snaps", "strength": 0.9, "width": 0.01}))),
        (
            "magnet 0.9, width 0.01",
            one(json!({"id": "m", "kind": "magnet", "anchor": "here", "strength": 0.9, "width": 0.01})),
        ),
        (
            "magnet 0.9, width 0.1",
            one(json!({"id": "m", "kind": "magnet", "anchor": "here", "strength": 0.9, "width": 0.1})),
        ),
        (
            "magnet 0.15, width 0.02",
            one(json!({"id": "m", "kind": "magnet", "anchor": "here", "strength": 0.15, "width": 0.02})),
        ),
        ("texture 500 waves, 0.9", one(json!({"id": "t", "kind": "texture", "waves": 500, "depth": 0.9}))),
        ("detents 30, 0.9", one(json!({"id": "d", "kind": "detents", "count": 30, "strength": 0.9}))),
        ("detents 720, 0.9", one(json!({"id": "d", "kind": "detents", "count": 720, "strength": 0.9}))),
        ("friction 0.3 (defaults)", one(json!({"id": "f", "kind": "friction", "torque": 0.3}))),
        (
            "friction 0.3, stiffness 100",
            one(json!({"id": "f", "kind": "friction", "torque": 0.3, "stiffness": 100})),
        ),
        (
            "friction 0.9, stiffness 1000, damping 0",
            one(json!({"id": "f", "kind": "friction", "torque": 0.9, "stiffness": 1000, "damping": 0})),
        ),
        (
            "pendulum 100 kg at 10 m, g 100",
            one(json!({"id": "p", "kind": "pendulum", "mass": 100, "centre": [0, 0, -10], "gravity": 100})),
        ),
        ("spring 400", one(spring(0, 400.0, 0.02))),
        ("spring 300", one(spring(0, 300.0, 0.0))),
    ]
}

/// The settings that are compared: lead and passivity stage.
const SETTINGS: [(&str, bool, bool); 4] =
    [("neither", false, false), ("passivity", false, true), ("lead", true, false), ("both", true, true)];
/// Scenes that are stiffer than the stage's largest damping can calm. They are announced by a
/// warning, and the guard against shaking lowers their torque.
const BEYOND: [&str; 3] =
    ["detents 720, 0.9", "friction 0.9, stiffness 1000, damping 0", "pendulum 100 kg at 10 m, g 100"];
/// Largest rate that counts as calm, root mean square, rad/s.
const CALM: f64 = 0.3;
/// Largest difference of two swings that counts as none, rad/s.
const EQUAL: f64 = 0.02;
/// Times from the start to the tap, from the tap to the measurement, and of the measurement, s.
const TIMES_S: [f64; 3] = [0.8, 2.0, 1.5];

/// Taps a sphere in each scene, free and held, and reports how much it still swings. Returns the
/// results in two sentences.
pub(super) fn study(report: &mut Report) -> [String; 2] {
    report.family("swing_{n}_{sphere}_{setting} | rad/s | deviation of the sphere's rate from its mean 2 to 3.5 s after a tap, root mean square, in scene n of the table, free or held");
    let mut table = vec![head(
        "n | scene | free: neither | passivity | lead | both | held: neither | passivity | lead | both",
    )];
    let mut swinging = [[0_u32; 4]; 2];
    let (mut held_most, mut worse_most) = (("", 0.0_f64), ("", 0.0_f64));
    for (n, (name, effects)) in cases().into_iter().enumerate() {
        let mut cells = row([n.to_string(), name.to_owned()]);
        for (sphere, hand) in [("free", None), ("held", Some(Hand { amplitude: 0.0, ..Hand::default() }))] {
            let swings = SETTINGS.map(|(setting, lead, stage)| {
                let swing = swing(&effects, hand, lead, stage);
                report.figure(format!("swing_{n}_{sphere}_{setting}"), swing);
                cells.push(format!("{swing:.3}"));
                swing
            });
            for (count, swing) in swinging[usize::from(hand.is_some())].iter_mut().zip(swings) {
                *count += u32::from(swing > CALM);
            }
            let [_, passivity, lead, both] = swings;
            let worse = both - passivity.min(lead);
            if worse > worse_most.1 && !BEYOND.contains(&name) {
                worse_most = (name, worse);
            }
            if hand.is_some() && passivity > held_most.1 && !BEYOND.contains(&name) {
                held_most = (name, passivity);
            }
        }
        table.push(cells);
    }
    report.heading("Scenes that shake");
    report.say(
        "Deviation of the sphere's rate from its mean 2 to 3.5 s after a tap of 0.7 rad/s, root mean square, rad/s. Most of these scenes are announced by a warning. The sphere is free, or the default hand holds it still. \
         `lead` and `passivity` are those of `[loop]`. The guard against shaking is off.",
    );
    report.table(&table);
    report.check(
        format!(
            "Held, with passivity: every scene stays below {CALM} rad/s. Three that need more damping than the stage may add do not count"
        ),
        format!("{:.3} rad/s at most ({})", held_most.1, held_most.0),
        held_most.1 <= CALM,
    );
    report.check(
        "With both, none of the other scenes swings more than with lead or passivity alone",
        format!("{:.3} rad/s more at worst ({})", worse_most.1, worse_most.0),
        worse_most.1 <= EQUAL,
    );
    let told = |sphere: &str, [neither, passivity, lead, both]: [u32; 4]| {
        format!(
            "Of {} scenes, {neither} shake the {sphere} at more than {CALM} rad/s, {passivity} with passivity, {lead} with the lead, {both} with both.",
            cases().len()
        )
    };
    [told("free sphere", swinging[0]), told("held sphere", swinging[1])]
}

/// Plots how much a free sphere on a spring without damping still swings after a tap.
pub(super) fn springs(context: &Context, report: &mut Report) {
    report.family("spring_{k}_{setting} | rad/s | swing of a free sphere on a spring of k N m/rad without damping, 2 to 3.5 s after a tap, root mean square");
    let stiffnesses: &[u32] = if context.quick { &[5, 100] } else { &[2, 5, 10, 20, 50, 100, 200, 300, 400] };
    let mut series = Vec::new();
    for (k, (setting, lead, stage)) in SETTINGS.into_iter().enumerate() {
        let mut points = Vec::new();
        for stiffness in stiffnesses {
            let spring = json!([{"id": "s", "kind": "spring", "anchor": "here", "stiffness": stiffness}]);
            let swing = swing(&spring, None, lead, stage);
            report.figure(format!("spring_{stiffness}_{setting}"), swing);
            points.push((f64::from(*stiffness), swing.max(1.0e-4)));
        }
        series.push(Series::new(setting, points, k));
    }
    report.lines(
        "springs",
        "Swing of a free sphere on a spring without damping, 2 to 3.5 s after a tap, over the stiffness",
        Lines::new("Free sphere on a spring", "stiffness, N m/rad", "swing, rad/s", series).log([true, true]),
    );
}

/// Returns the swing of the sphere after a tap: the deviation of its rate from the mean rate, root
/// mean square, rad/s.
fn swing(effects: &Value, hand: Option<Hand>, lead: bool, stage: bool) -> f64 {
    let config = prototype(&[("loop.passivity", json!(stage)), ("loop.lead", json!(lead))]);
    let phenomena = Phenomena { hand, ..Phenomena::default() };
    let scene = json!({"name": "case", "effect": effects});
    let mut whole = Whole::new(&config, scene_of(scene), phenomena);
    let [before, after, measured] = TIMES_S;
    whole.run(before);
    whole.tap(TAP);
    whole.run(after);
    let measured = whole.ticks(measured);
    let (mut sum, mut squares) = (Vec3::ZERO, 0.0);
    for _ in 0..measured {
        whole.step(None);
        let omega = whole.rig().state().omega;
        sum += omega;
        squares += omega.length_squared();
    }
    let each = 1.0 / f64::from(measured);
    (squares * each - (sum * each).length_squared()).max(0.0).sqrt()
}
