//! The first unstable spring with and without a lead: by a formula, by the eigenvalues of the
//! sampled loop, and in the whole loop.

use hbot_config::RigConfig;
use hbot_config::advice::{HOLDS, Hold, Sampled, Scene, StiffnessBound};
use hbot_core::{Mat3, Vec3};
use hbot_plot::short;
use hbot_sim::phenomena::{Hand, Phenomena};
use hbot_sim::rig::SimulatedConfig;
use serde_json::{Value, json};

use super::DAMPING;
use crate::context::Context;
use crate::report::{Report, row};
use crate::verification::stability::lag::{spectral_radius, step, without_growth};
use crate::whole::{Whole, inertia, motor, prototype, refine, scene_of};

/// Rates of the loop, Hz, and lags of the motors, s.
const LOOPS: [(u32, f64); 3] = [(1000, 5.0e-4), (1000, 1.0e-4), (4000, 5.0e-4)];
/// Largest allowed relative difference of formula and whole loop from the eigenvalues, for a free
/// sphere.
const WITHIN: f64 = 0.03;
/// Longest step of the plant, ns. In steps of 1 ms the lag would seem 0.01 ms shorter.
const MAX_STEP_NS: u64 = 50_000;
/// Stiffness up to which a border is searched, N m/rad.
const MOST: f64 = 2.0e3;
/// Largest stiffness of a spring without a gain, N m/rad.
const STIFFEST: f64 = 1000.0;
/// Time for which a swing is observed, s.
const WATCH_S: f64 = 2.0;
/// Torque of the first swing, N m: far below the torque limit, and so slow that the slew limit does
/// not act.
const THROWN: f64 = 0.1;
/// How many times as fine the encoders are as the prototype's, so that counts are no noise.
const FINER: u32 = 64;

/// A loop of which the first unstable spring is asked.
struct Case {
    config: RigConfig,
    sampled: Sampled,
    hold: Hold,
}

impl Case {
    fn new(rate: u32, lag: f64, factor: f64, hold: Hold) -> Self {
        let mut config = rig(rate, lag, factor);
        refine(&mut config, FINER);
        let Some(bound) = StiffnessBound::of(&config) else { unreachable!("the prototype has inertia") };
        let sampled = Sampled {
            inertia: Vec3::splat(inertia(&config.rig.device, Vec3::X)),
            axes: Mat3::IDENTITY,
            taps: Vec::new(),
            rate_lag: 0.0,
            ..bound.sampled().clone()
        };
        Self { config, sampled, hold }
    }

    /// Returns the stiffness at which a swing of a free sphere neither grows nor dies, by harmonic
    /// balance, N m/rad.
    ///
    /// At the frequency W the torque is late by y = W h (1/2 + D) + atan(W lag), and smaller by g =
    /// sinc(W h/2) / sqrt(1 + (W lag)²). With a lead t the spring's torque leads by W t, so
    ///
    /// ```text
    /// K (sin y - W t cos y) = B W cos y        J W² = g (K cos y + (K t + B) W sin y)
    /// ```
    ///
    /// The torque's steps also move the rate between the readings. A sampled rate is larger by
    /// that, by the part a = (W h/2)²/3 / (1 + (2 pi lag/h)²) of it: t and B count 1 + a times.
    fn by_formula(&self) -> f64 {
        let Sampled { period: h, lag, lead, .. } = self.sampled;
        let late = |w: f64| 1.5 * w * h + libm::atan(w * lag);
        let steps = 2.0 * std::f64::consts::PI * lag / h;
        let sampled = |w: f64| 1.0 + (0.5 * w * h) * (0.5 * w * h) / 3.0 / (1.0 + steps * steps);
        let stiffness = |w: f64| {
            let (y, w) = (late(w), w * sampled(w));
            DAMPING * w * libm::cos(y) / (libm::sin(y) - w * lead * libm::cos(y))
        };
        // Between the frequency below which the lead outweighs the delay, and a quarter of a swing.
        let (mut low, mut high) = (1.0e-3, 1.0);
        while late(high) < 0.5 * std::f64::consts::PI {
            high *= 1.001;
        }
        let end = high;
        while !(stiffness(low) > 0.0) && low < end {
            low *= 1.0005;
        }
        for _ in 0..60 {
            let w = 0.5 * (low + high);
            let (k, y) = (stiffness(w), late(w));
            let gain = libm::sin(0.5 * w * h) / (0.5 * w * h) / libm::sqrt(1.0 + (w * lag) * (w * lag));
            let pull = gain * (k * libm::cos(y) + (k * lead + DAMPING) * w * sampled(w) * libm::sin(y));
            if self.sampled.inertia.x * w * w < pull { low = w } else { high = w }
        }
        stiffness(low)
    }

    /// Returns the first unstable stiffness of the sampled loop, N m/rad: for a free sphere by the
    /// largest eigenvalue, and in a hand by the judge of scenes, to which a growth of 1/20 s is
    /// none. [`MOST`] if it is larger.
    fn by_eigenvalues(&self) -> f64 {
        let Sampled { period, lag, lead, inertia, .. } = self.sampled;
        let rests = |stiffness: f64| {
            if self.hold.stiffness == 0.0 {
                let gains = [stiffness, DAMPING + stiffness * lead];
                return spectral_radius(step(period, lag, inertia.x, gains)) < 1.0;
            }
            let scene = Scene {
                stiffness: Mat3::IDENTITY * stiffness,
                damping: Mat3::IDENTITY * DAMPING,
                masses: Vec::new(),
            };
            self.sampled.is_stable(&scene, &self.hold)
        };
        let mut low = 0.1;
        while rests(1.05 * low) {
            low *= 1.05;
            if low > MOST {
                return MOST;
            }
        }
        let mut high = 1.05 * low;
        while high - low > 1.0e-4 * low {
            let middle = 0.5 * (low + high);
            if rests(middle) { low = middle } else { high = middle }
        }
        low
    }

    /// Returns the stiffness at which a swing of the whole loop neither grows nor dies, N m/rad.
    /// It is searched around `near`.
    fn measured(&self, near: f64) -> f64 {
        let found = without_growth(near, |stiffness| self.growth(stiffness));
        if (found / near - 1.0).abs() < WITHIN {
            return found;
        }
        // A swing that reaches the slew limit grows no more, so growth is no measure of distance.
        let (mut low, mut high) = ((1.0 - WITHIN) * near, (1.0 + WITHIN) * near);
        for _ in 0..10 {
            let middle = 0.5 * (low + high);
            if self.growth(middle) < 0.0 { low = middle } else { high = middle }
        }
        if low > (1.0 - WITHIN) * near && high < (1.0 + WITHIN) * near { low } else { found }
    }

    /// Returns how fast a swing about n1 grows in the whole loop, 1/s. Negative if it dies.
    fn growth(&self, stiffness: f64) -> f64 {
        let gain = libm::ceil(stiffness / STIFFEST).max(1.0);
        let scene = json!({"name": "study", "effect": [
            {"id": "spring", "kind": "spring", "stiffness": stiffness / gain, "damping": DAMPING / gain, "gain": gain, "fade_s": 0}
        ]});
        let Hold { stiffness: grip, damping, inertia, .. } = self.hold;
        let hand = Hand { stiffness: grip, damping, inertia, amplitude: 0.0, rate: 0.0, ..Hand::default() };
        let phenomena = Phenomena {
            motor: Some(motor(self.sampled.lag)),
            hand: (grip > 0.0).then_some(hand),
            ..Phenomena::default()
        };
        let mut whole = whole(&self.config, scene, phenomena, MAX_STEP_NS);
        let held = stiffness + grip;
        let omega = Vec3::X * (THROWN / libm::sqrt(held * (self.sampled.inertia.x + inertia)));
        let energies = whole.swung(omega, stiffness, WATCH_S);
        libm::log(energies[4] / energies[0]) / (2.0 * 0.8 * WATCH_S)
    }
}

/// Returns the prototype with a loop of `rate` Hz, motors with the lag `lag` (s) and a lead of
/// `factor` times the delay. 0 stands for no lead.
pub(super) fn rig(rate: u32, lag: f64, factor: f64) -> RigConfig {
    let lead = if factor > 0.0 { json!({"factor": factor}) } else { json!(false) };
    let mut config = prototype(&[
        ("loop.rate_hz", json!(rate)),
        ("loop.lead", lead),
        ("loop.passivity", json!(false)),
        ("loop.shaking_guard", json!(false)),
    ]);
    config.torque_lag = lag;
    let told = config.rig.with(|rig| rig.torque_lag = lag);
    config.rig = told.unwrap_or_else(|error| unreachable!("a legal lag: {error}"));
    config
}

/// Creates the whole loop. The plant goes in steps of at most `max_step_ns`.
pub(super) fn whole(config: &RigConfig, scene: Value, phenomena: Phenomena, max_step_ns: u64) -> Whole {
    let simulated = SimulatedConfig { phenomena, max_step_ns, ..SimulatedConfig::new(&config.rig) };
    Whole::simulated(config, scene_of(scene), &simulated)
}

pub(super) fn study(context: &Context, report: &mut Report) {
    context.part("the first unstable spring");
    report.heading("The first unstable spring");
    report.say(&format!(
        "A spring with a damping of {DAMPING} N m s/rad holds the prototype's sphere; the rates are exact. The table has the stiffness from which a swing grows: by harmonic balance (formula, free sphere \
         only), by the eigenvalues of the sampled loop (in a hand: by the judge of scenes), and in the whole loop (control law, line, simulated rig), by the growth of the swing's energy over {WATCH_S} s. The factor is that of the \
         lead; 0 is none."
    ));
    report.family("lead_border_{rate}hz_lag{lag}us_factor{c}_grip{k} | N m/rad | first unstable stiffness of a spring with 0.01 N m s/rad by the eigenvalues, with a lead of c/100 times the delay and a hand of k N m/rad; `formula` and `whole` in the row");
    let mut table =
        vec![row(["Hz", "lag, ms", "hand", "factor", "formula, N m/rad", "eigenvalues", "whole loop"])];
    let mut worst = [0.0_f64; 2];
    let factors: &[f64] = if context.quick { &[0.0, 1.1] } else { &[0.0, 0.8, 1.0, 1.1, 1.2] };
    let loops = if context.quick { &LOOPS[..1] } else { &LOOPS[..] };
    for (rate, lag) in loops.iter().copied() {
        for hold in HOLDS {
            for factor in factors.iter().copied() {
                // Other factors are for the first loop.
                if rate != LOOPS[0].0 && ![0.0, 1.1].contains(&factor) {
                    continue;
                }
                let case = Case::new(rate, lag, factor, hold);
                let exact = case.by_eigenvalues();
                let whole = (exact < MOST).then(|| case.measured(exact));
                let free = hold.stiffness == 0.0;
                let formula = free.then(|| case.by_formula());
                let us = (1.0e6 * lag).round();
                let id = format!(
                    "lead_border_{rate}hz_lag{us}us_factor{}_grip{}",
                    (100.0 * factor).round(),
                    hold.stiffness
                );
                let mut figure = report.figure(id, exact);
                if let Some(whole) = whole {
                    figure = figure.note("whole", whole);
                    worst[1] = worst[1].max((whole / exact - 1.0).abs());
                }
                if let Some(formula) = formula {
                    figure.note("formula", formula);
                    worst[0] = worst[0].max((formula / exact - 1.0).abs());
                }
                table.push(row([
                    rate.to_string(),
                    short(1.0e3 * lag),
                    hold.name.to_owned(),
                    factor.to_string(),
                    formula.map_or("-".to_owned(), |x| format!("{x:.4}")),
                    if whole.is_some() { format!("{exact:.4}") } else { format!("over {MOST}") },
                    whole.map_or("-".to_owned(), |x| format!("{x:.4}")),
                ]));
            }
        }
    }
    report.table(&table);
    report.check_within("the formula is off the eigenvalues", worst[0], WITHIN);
    report.check_within("the whole loop is off the eigenvalues", worst[1], WITHIN);
    for (id, least) in [
        ("lead_border_1000hz_lag500us_factor110_grip0", 100.0),
        ("lead_border_1000hz_lag100us_factor110_grip0", 120.0),
        ("lead_border_4000hz_lag500us_factor110_grip0", 350.0),
    ] {
        if report.figures().iter().any(|figure| figure.id == id) {
            let found = report.value(id);
            report.check(format!("{id}: at least {least} N m/rad"), short(found), found >= least);
        }
    }
}
