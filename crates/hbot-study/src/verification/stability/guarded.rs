//! The whole loop with and without the passivity stage: the highest stiffness at which a spring
//! comes to rest, and the energy that the motors deliver.

use core::f64::consts::TAU;

use hbot_config::RigConfig;
use hbot_core::design::kinematics::Posture;
use hbot_core::safety::mode::Mode;
use hbot_core::{Device, MAX_JOINTS, Vec3, rotation};
use hbot_plot::{Lines, Series, short};
use hbot_sim::phenomena::{CageFriction, Encoder, Hand, Link, Phenomena};
use serde_json::json;

use super::search::bisected;
use super::{given, micro};
use crate::context::Context;
use crate::report::{Report, row};
use crate::whole::{START_S, Whole, prototype, spring};

/// Angular velocity that a tap gives to the sphere, in frame N, in rad/s: 1 rad/s about an axis
/// without symmetry.
pub(super) const TAP: Vec3 = Vec3::new(0.6, -0.48, 0.64);
/// Time for which the sphere is observed after the tap, s.
const WATCH_S: f64 = 4.0;
/// Number of equal intervals of the observation time. The energy is compared from one interval to
/// the next to see whether the swing decays.
const STRETCHES: u32 = 8;
/// Smallest share of its energy that a swing must lose from one interval to the next to count as
/// decaying.
const LOSES: f64 = 1.0e-3;
/// Lowest stiffness at which the search for the largest stable stiffness begins, relative to the
/// stability limit of the linear theory.
const FROM: f64 = 0.25;
/// Highest stiffness in the search for the largest stable stiffness, relative to the stability
/// limit of the linear theory.
const UP_TO: f64 = 32.0;
/// Factor between two successive stiffnesses that are tried.
const RATIO: f64 = core::f64::consts::SQRT_2;
/// Width of the range to which bisection between the last two stiffnesses narrows the limit,
/// relative to the limit. A finer search would find the limit of [`LOSES`]: on the rig with the
/// least damping, a swing that loses less than that is within 0.4 % of the border.
const RESOLUTION: f64 = 1.0e-3;
/// Required effect of the passivity stage. With it, the sphere must come to rest on every spring up
/// to this many times the stability limit of the linear theory, if friction and encoder steps are
/// small.
const GUARDED: f64 = 10.0;

/// The properties of a rig and its control loop on which the stability of a spring depends.
#[derive(Debug, Clone, Copy)]
pub(super) struct Setting {
    /// Rate of the control loop, Hz.
    rate: u32,
    /// Delay from a reading to the torque computed from it, in ticks.
    pub(super) delay: u32,
    /// Viscous damping of the rig's mechanics, without any damping by the motors, N m s/rad.
    own: f64,
    /// Size of one step of the encoders, in counts of the prototype's encoders.
    step: u32,
    /// Coulomb friction of the cage, N m.
    coulomb: f64,
}

/// The setting with which all others are compared. Each of the others differs from it in one field.
pub(super) const BASE: Setting = Setting { rate: 1000, delay: 1, own: 0.005, step: 1, coulomb: 0.0 };

impl Setting {
    pub(super) fn period(&self) -> f64 {
        1.0 / f64::from(self.rate)
    }

    /// Returns the largest stable stiffness of a spring by linear theory, b / (h (1/2 + D)), N
    /// m/rad.
    pub(super) fn border(&self) -> f64 {
        self.own / (self.period() * (0.5 + f64::from(self.delay)))
    }

    /// Returns whether the rig has no friction and encoders as fine as the prototype's. Only such
    /// rigs are checked against the limit of the linear theory.
    fn is_plain(&self) -> bool {
        self.step == 1 && self.coulomb == 0.0
    }

    /// Returns the loop with this setting, which renders a spring of `stiffness` (N m/rad) without
    /// damping. If `guard` is true, the passivity stage is on.
    fn whole(&self, stiffness: f64, guard: bool) -> Whole {
        let still =
            Hand { stiffness: 0.0, damping: self.own, inertia: 0.0, amplitude: 0.0, ..Hand::default() };
        // The answers arrive shortly before the end of a tick and are read at its end.
        let late = Link {
            latency_s: f64::from(self.delay - 1) * self.period() * (1.0 - 1.0e-3),
            command_latency_s: 0.0,
            jitter_s: 0.0,
            loss: 0.0,
            corrupt: 0.0,
            seed: 1,
        };
        let coarse = Encoder { step: self.step, turn_error: 0.0, index_error: 0.0, seed: 1 };
        let phenomena = Phenomena {
            cage_friction: (self.coulomb > 0.0).then_some(CageFriction { torque: self.coulomb }),
            encoder: (self.step > 1).then_some(coarse),
            link: (self.delay > 1).then_some(late),
            hand: Some(still),
            ..Phenomena::default()
        };
        // All energy counts, so that the energy given out can be compared with its bound.
        let guard = if guard { json!({ "strict": true }) } else { json!(false) };
        let config = prototype(&[("loop.rate_hz", json!(self.rate)), ("loop.passivity", guard)]);
        Whole::new(&config, spring(stiffness, 0.0), phenomena)
    }

    fn id(&self, guard: bool) -> String {
        let Self { rate, delay, own, step, coulomb } = self;
        let guard = if guard { "on" } else { "off" };
        format!(
            "border_guard_{rate}hz_delay{delay}_own{}_step{step}_coulomb{}_{guard}",
            micro(*own),
            micro(*coulomb)
        )
    }
}

/// How the sphere behaves after a tap.
pub(super) struct Tapped {
    /// Whether the sphere comes to rest: it is at rest already, or its swing decays.
    pub(super) settles: bool,
    /// Largest energy that the motors had delivered at any time since the tap, J.
    pub(super) most: f64,
}

/// Taps the sphere, which is held by a spring of `stiffness` (N m/rad), and observes its motion.
/// The sphere counts as at rest if it stays within the angle `floor` (rad). If `guard` is true, the
/// passivity stage is on.
pub(super) fn tapped(setting: &Setting, stiffness: f64, guard: bool, floor: f64) -> Tapped {
    let mut whole = setting.whole(stiffness, guard);
    whole.run(START_S);
    whole.tap(TAP);
    let put_in = whole.energy(stiffness);
    let each = whole.ticks(WATCH_S) / STRETCHES;
    // The sum over all joints and ticks of the joint torque times the angle by which the joint
    // turns.
    let mut given = 0.0;
    let (mut most, mut active) = (0.0_f64, true);
    let mut reach = 0.0;
    // The mean energy over an interval is compared. A swing about three axes exchanges energy
    // between them without losing it.
    let mut held = [0.0_f64; STRETCHES as usize];
    for held in &mut held {
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for _ in 0..each {
            let (torque, before) = (*whole.rig().joint_torque(), whole.rig().state().joints());
            active &= whole.step(None).state.mode == Mode::Active;
            let (at, after) = (rotation::log(whole.rig().state().q), whole.rig().state().joints());
            (low, high) = (low.min(at), high.max(at));
            *held += whole.energy(stiffness) / f64::from(each);
            given += (0..MAX_JOINTS).map(|j| torque[j] * (after[j] - before[j])).sum::<f64>();
            most = most.max(given);
        }
        reach = (high - low).length();
    }
    let [.., first, second, third] = held;
    let dies = |before: f64, after: f64| after < (1.0 - LOSES) * before;
    // Far beyond the border the sphere moves wildly at the torque limit, and its energy varies. A
    // loop that ended in a fault did not bring the sphere to rest either.
    let calms = third <= put_in && dies(first, second) && dies(second, third);
    Tapped { settles: active && (reach <= floor || calms), most }
}

/// Returns the largest stiffness at which the sphere still comes to rest after a tap, N m/rad.
/// Returns `None` if the sphere comes to rest at every stiffness up to [`UP_TO`] times the
/// stability limit of the linear theory.
fn border(setting: &Setting, guard: bool, floor: f64) -> Option<f64> {
    let mut high = FROM * setting.border();
    while tapped(setting, high, guard, floor).settles {
        if high >= UP_TO * setting.border() {
            return None;
        }
        high *= RATIO;
    }
    let fails = |stiffness| !tapped(setting, stiffness, guard, floor).settles;
    Some(bisected([high / RATIO, high], RESOLUTION, fails))
}

/// Returns the largest turn of the sphere that corresponds to one encoder count of a joint, rad.
/// `counts` gives the encoder counts in one turn of each joint.
fn turn_of_a_count(device: &Device, counts: impl Fn(usize) -> f64) -> f64 {
    let posture = Posture::new(device, &vec![0.0; device.wheels().len()]);
    let turn = |j: usize| {
        let mut rates = [0.0; MAX_JOINTS];
        rates[j] = TAU / counts(j);
        posture.forward(device, &rates).omega.length()
    };
    (0..device.joints()).map(turn).fold(0.0, f64::max)
}

/// A series of settings that differ in one property, such as the loop rate. The stability limit is
/// plotted over this property.
struct Sweep {
    name: &'static str,
    x: &'static str,
    log: bool,
    settings: Vec<(f64, Setting)>,
}

fn sweeps(quick: bool) -> Vec<Sweep> {
    let rates = [500, 1000, 2000, 4000].map(|rate| (f64::from(rate), Setting { rate, ..BASE }));
    let own = [0.002, 0.005, 0.01, 0.02, 0.05].map(|own| (1.0e3 * own, Setting { own, ..BASE }));
    let delays = [1, 2, 3].map(|delay| (f64::from(delay), Setting { delay, ..BASE }));
    let steps = [1, 8, 64].map(|step| (f64::from(step), Setting { step, ..BASE }));
    let coulomb = [0.0, 0.5e-3, 2.0e-3, 8.0e-3].map(|coulomb| (1.0e3 * coulomb, Setting { coulomb, ..BASE }));
    let sweep = |name, x, log, settings: &[(f64, Setting)]| {
        let settings = if quick { settings[..2].to_vec() } else { settings.to_vec() };
        Sweep { name, x, log, settings }
    };
    let mut all = vec![
        sweep("own damping", "own damping, mN m s/rad", true, &own),
        sweep("loop rate", "loop rate, Hz", true, &rates),
        sweep("delay", "ticks from a reading to its torque", false, &delays),
    ];
    if !quick {
        all.push(sweep("encoder step", "counts of 16384 a turn in one step", true, &steps));
        all.push(sweep("friction", "Coulomb friction of the cage, mN m", false, &coulomb));
    }
    all
}

pub(super) fn study(context: &Context, report: &mut Report) {
    context.part("the passivity stage");
    let config = RigConfig::prototype();
    let device = &config.rig.device;
    let joints = &config.rig.joints;
    let count = turn_of_a_count(device, |j| joints[j].counts());
    introduce(report, count);
    let mut plain = Vec::new();
    for sweep in sweeps(context.quick) {
        let measured = sweep.settings.iter().map(|(_, setting)| Guarded::measure(setting, count));
        let measured = measured.collect::<Vec<_>>();
        tell(report, &sweep, &measured);
        plain.extend(measured.into_iter().filter(|found| found.setting.is_plain()));
    }
    let worst_off = plain.iter().map(|found| (found.ratio(0) - 1.0).abs()).fold(0.0, f64::max);
    report.check_within("without the stage a tap comes to rest up to the linear border", worst_off, WITHIN);
    let least_on = plain.iter().map(|found| found.ratio(1)).fold(f64::INFINITY, f64::min);
    report.check(
        format!("with the stage it does so up to {GUARDED} times the border, without friction and at the prototype's counts"),
        format!("{least_on:.1} times at least"),
        least_on >= GUARDED,
    );
    given::study(report, device, 3.0 * count);
}

fn introduce(report: &mut Report, count: f64) {
    report.heading("With and without the passivity stage");
    report.say(&format!(
        "The same whole loop, with the prototype's encoders, its rig now with a little damping b, as of bearings and a light hand, and a spring without damping. The sphere is tapped to 1 rad/s, 1.7 mJ of motion: up to which stiffness \
         does it come to rest, without and with `passivity = {{ strict = true }}` in the rig file? It counts as coming to rest where, {WATCH_S} s later, its swing has less energy than the tap gave it and still loses {LOSES} of that or more every {:.1} s, \
         or is less than three steps of the encoder, and no fault has ended it. Beside it the linear border b/(h (1/2 + D)), and where there is friction Abbott and Okamura's 2 c/d. All is as in \
         the first line of a table ({} Hz, D = {}, b = {} N m s/rad, counts as fine as the prototype's, no friction) but for what it varies. One count of the joint that moves the sphere most turns it by d = {count:.1e} rad. \
         Stiffnesses a factor of {RATIO:.3} apart are tried, then halved to {} %. \
         The search ends at {UP_TO} times the border, where the stage has most often not failed yet; with much damping it fails before, at a swing that lasts some twenty ticks, \
         because the damping that it may add is bounded.",
        WATCH_S / f64::from(STRETCHES), BASE.rate, BASE.delay, BASE.own, 100.0 * RESOLUTION
    ));
    report.family("border_guard_{rate}hz_delay{d}_own{b}_step{s}_coulomb{c}_{guard} | N m/rad | stiffness from which a tap does not come to rest, passivity stage on or off; b and c in 1e-6 of their SI units, s in counts; `measured`, and in `predicted` the linear border; `or_more`: the search ended there");
}

/// The largest stable stiffness of a spring on one rig, without and with the passivity stage, in N
/// m/rad. It is `None` if the spring was still stable at the highest stiffness tried.
struct Guarded {
    setting: Setting,
    found: [Option<f64>; 2],
    /// Angle by which the sphere turns while one joint's encoder advances by one step, rad. It is
    /// the largest such angle over all joints.
    step: f64,
}

impl Guarded {
    fn measure(setting: &Setting, count: f64) -> Self {
        let step = f64::from(setting.step) * count;
        let of = |guard| border(setting, guard, 3.0 * step);
        Self { setting: *setting, found: [of(false), of(true)], step }
    }

    fn measured(&self, guard: usize) -> f64 {
        self.found[guard].unwrap_or(UP_TO * self.setting.border())
    }

    fn ratio(&self, guard: usize) -> f64 {
        self.measured(guard) / self.setting.border()
    }

    /// Returns the table row of one measured rig. `x` is the value of the property that varies in
    /// the table.
    fn row(&self, x: f64) -> Vec<String> {
        let [off, on] = self.found.map(|found| if found.is_none() { "more than " } else { "" });
        let (border, dry) = (self.setting.border(), 2.0 * self.setting.coulomb / self.step);
        row([
            short(x),
            format!("{off}{}", short(self.measured(0))),
            format!("{on}{}", short(self.measured(1))),
            short(border),
            if dry > 0.0 { short(dry) } else { "-".to_owned() },
            format!("{off}{}", short(self.ratio(0))),
            format!("{on}{}", short(self.ratio(1))),
        ])
    }

    fn figures(&self, report: &mut Report) {
        for (k, guard) in [false, true].into_iter().enumerate() {
            let id = self.setting.id(guard);
            // The base is in every sweep, and has one figure.
            if !report.figures().iter().any(|figure| figure.id == id) {
                let figure = report.figure(id, self.measured(k));
                figure.note("measured", self.measured(k)).note("predicted", self.setting.border());
                figure.note("or_more", if self.found[k].is_none() { 1.0 } else { 0.0 });
            }
        }
    }
}

/// Reports a sweep, in which one property of the rig varies: figures, a table and a plot of the
/// largest stable stiffness.
fn tell(report: &mut Report, sweep: &Sweep, measured: &[Guarded]) {
    let head = ["off, N m/rad", "on, N m/rad", "linear border", "2 c/d", "off/border", "on/border"];
    let mut table = vec![row([sweep.x].into_iter().chain(head))];
    for ((x, _), found) in sweep.settings.iter().zip(measured) {
        found.figures(report);
        table.push(found.row(*x));
    }
    report.table(&table);
    let over = |value: &dyn Fn(&Guarded) -> f64| {
        sweep.settings.iter().zip(measured).map(|((x, _), found)| (*x, value(found))).collect()
    };
    let series = vec![
        Series::new(format!("with (sought to {UP_TO} times)"), over(&|found| found.measured(1)), 1),
        Series::new("without", over(&|found| found.measured(0)), 0),
        Series::new("b/(h (1/2 + D))", over(&|found| found.setting.border()), 6).open(true),
    ];
    let title = format!("With and without the passivity stage: {}", sweep.name);
    report.lines(
        &format!("border_guard_{}", sweep.name.replace(' ', "_")),
        &format!("Stiffness from which a tap does not come to rest, over {}", sweep.name),
        Lines::new(title, sweep.x, "stiffness, N m/rad", series).log([sweep.log, true]),
    );
}

/// Largest allowed relative difference between the stability limit measured without the passivity
/// stage and that of the linear theory.
const WITHIN: f64 = 0.05;
