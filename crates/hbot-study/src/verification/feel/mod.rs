//! The study `feel`: what the passivity stage changes for the hand, and which scenes shake with it.

mod felt;
mod shaken;

use hbot_config::scene::SHELF;
use hbot_config::{RigConfig, SceneFile};
use hbot_plot::short;
use hbot_sim::phenomena::Hand;
use serde_json::json;

use self::felt::{Felt, felt, free};
use crate::context::{Context, Interrupted};
use crate::report::{Report, row};
use crate::whole::prototype;

/// The hands that move the sphere, each with its name.
const HANDS: [(&str, Hand); 3] = [
    ("default", Hand { stiffness: 3.0, damping: 0.05, inertia: 2.0e-3, amplitude: 0.25, rate: 1.0 }),
    ("strong", Hand { stiffness: 30.0, damping: 0.3, inertia: 4.0e-3, amplitude: 0.15, rate: 1.0 }),
    ("finger", Hand { stiffness: 0.3, damping: 0.005, inertia: 2.0e-4, amplitude: 0.25, rate: 1.0 }),
];
/// Rates of the hand's motion, Hz.
const RATES: [f64; 5] = [1.0, 2.0, 5.0, 10.0, 20.0];

/// Runs the study `feel` and returns its report.
pub(crate) fn study(context: &Context) -> Result<Report, Interrupted> {
    let mut report = Report::new("feel", context.quick);
    let [off, on] = [false, true].map(|on| prototype(&[("loop.passivity", json!(on))]));
    let mut scenes: Vec<(String, SceneFile)> =
        SHELF.iter().map(|scene| (scene.file.to_owned(), scene.scene())).collect();
    let half = 0.5 * 0.02 / (1.5 * off.rig.timing.period_s());
    let spring = json!({"name": "half", "effect": [
        {"id": "spring", "kind": "spring", "stiffness": half, "damping": 0.02}
    ]});
    let spring = SceneFile::from_json(spring).unwrap_or_else(|error| unreachable!("a legal scene: {error}"));
    scenes.push(("half border".to_owned(), spring));
    if std::env::var_os("ONLY").is_some() {
        scenes.clear();
    }
    for (name, scene) in &scenes {
        context.go_on()?;
        let swing = free([&off, &on], scene);
        println!("{name:22} free: apart {:.2e} of {:.2e} rad", swing.apart, swing.reach);
        for (hand_name, hand) in HANDS {
            let mut worst = (0.0_f64, 0.0_f64, 0.0_f64);
            let (mut added, mut share) = (0.0_f64, 0.0_f64);
            for rate in RATES {
                let [without, with] =
                    [&off, &on].map(|config: &RigConfig| felt(config, scene, Hand { rate, ..hand }));
                let _: &Felt = &with;
                for (a, b) in without.axes.iter().zip(&with.axes) {
                    let dk = (b.stiffness - a.stiffness).abs();
                    let db = (b.damping - a.damping).abs();
                    let z = a.stiffness.hypot(a.damping * a.frequency * core::f64::consts::TAU);
                    worst.0 = worst.0.max(dk / z);
                    worst.1 = worst.1.max(db);
                    worst.2 = worst.2.max(if db > 1e-3 { db / a.damping.abs() } else { 0.0 });
                }
                added = added.max(with.added / without.torque);
                share = share.max(with.share);
            }
            if share > 0.0 {
                println!(
                    "   {hand_name:10} dK/Z {:6.2} %  dB {:.5} {:6.2} %  added {:6.2} %  ticks {:6.2} %",
                    100.0 * worst.0,
                    worst.1,
                    100.0 * worst.2,
                    100.0 * added,
                    100.0 * share
                );
            }
        }
    }
    let _ = (short(1.0), row([""]));
    shaken::study(context, &mut report)?;
    Ok(report)
}
