//! Friction and encoder resolution: the stiffness at which a wall begins to buzz, compared with the
//! stiffness up to which it is passive.

use hbot_plot::{Lines, Series, short};

use super::wall::Wall;
use super::{border, micro};
use crate::context::Context;
use crate::report::{Report, row};

/// Coulomb friction torques that are compared, N m: none, the ball bearings of a good cage, the
/// prototype's cage, and a stiff cage.
const COULOMB: [f64; 4] = [0.0, 0.5e-3, 2.0e-3, 8.0e-3];
/// Smallest steps of the sphere's measured angle that are compared, rad. They result from encoders
/// with 16384, 2048 and 256 counts per turn of the steer joint, whose angle is 5.7 times the
/// sphere's.
const STEPS: [f64; 3] = [6.7e-5, 5.4e-4, 4.3e-3];
/// Values of the viscous damping of the mechanics that are simulated, N m s/rad. The damping that
/// the virtual wall renders is separate.
const OWN: [f64; 2] = [0.001, 0.003];
/// Period of the simulated loop, s.
const PERIOD: f64 = 1.0e-3;
/// Angle at which the axis is released at the start of a simulation, rad.
const RELEASED: f64 = 0.05;
/// Duration of a simulation, after which the axis must be at rest, s.
const TIME: f64 = 40.0;
/// Factor between two successive stiffnesses that are tried.
const RATIO: f64 = 1.05;

/// Returns whether the axis still moves at the end of a simulation and would not come to rest.
///
/// Its swing must be larger than two encoder steps, because a smaller swing can come from a reading
/// at the edge of a step. The swing must also not decrease: a decreasing one only needs more time
/// to come to rest.
fn buzzes(wall: &Wall) -> bool {
    let ticks = (TIME / wall.period) as usize;
    let mut reach = [(f64::INFINITY, f64::NEG_INFINITY); 10];
    let mut k = 0;
    wall.released(RELEASED, ticks, |x| {
        let (least, most) = &mut reach[10 * k / ticks];
        (*least, *most) = (least.min(x), most.max(x));
        k += 1;
    });
    let [.., before, last] = reach.map(|(least, most)| most - least);
    !(last <= 2.0 * wall.step || last < 0.99 * before)
}

/// Returns the lowest stiffness at which the axis does not come to rest, N m/rad. It tries
/// stiffnesses of a geometric series that begins with `from`.
fn first_buzz(wall: &Wall, from: f64) -> f64 {
    let mut stiffness = from;
    while stiffness < 1.0e4 && !buzzes(&Wall { stiffness, ..*wall }) {
        stiffness *= RATIO;
    }
    stiffness
}

pub(super) fn study(context: &Context, report: &mut Report, inertia: f64) {
    context.part("friction and the encoder's step");
    report.heading("Friction and the encoder's step");
    report.say(&format!(
        "A spring without damping or delay, at 1 kHz, releases an axis at {RELEASED} rad; friction truly sticks. Which stiffness first leaves it buzzing by more than \
         two steps of the encoder for ever (after {TIME} s, and no less than before)? Stiffnesses a factor of {RATIO} apart are tried, so the answer is known to 5 %. Beside it Abbott and Okamura's K <= min(2 b/h, 2 c/d), below which the wall is passive whatever the hand does. A wall that is not \
         passive may be quiet all the same, as long as nobody feeds it (Diolaiti et al.): friction stops it. A wall that is passive must be quiet."
    ));
    report.family("border_friction_own{b}_coulomb{c}_step{d} | N m/rad | stiffness that first buzzes at 1 kHz; b, c, d in 1e-6 of their SI units; `measured`, and in `predicted` the passive bound of Abbott and Okamura");
    let found = measure(inertia);
    let mut table =
        vec![row(["b", "c, N m", "d, rad", "first buzz, N m/rad", "passive to", "2 b/h", "2 c/d"])];
    for Buzz { own, coulomb, step, measured, viscous, dry } in &found {
        let passive = viscous.min(*dry);
        let id =
            format!("border_friction_own{}_coulomb{}_step{}", micro(*own), micro(*coulomb), micro(*step));
        border(report, id, *measured, passive);
        table.push(row([*own, *coulomb, *step, *measured, passive, *viscous, *dry].map(short)));
    }
    report.table(&table);
    report.lines(
        "border_friction",
        "Stiffness that first buzzes, and passive bound, over Coulomb friction; b = 0.001 N m s/rad, 1 kHz",
        Lines::new(
            "Friction and the encoder's step",
            "Coulomb friction, mN m",
            "stiffness, N m/rad",
            lines(&found),
        )
        .log([false, true]),
    );
    // What stands between two tries.
    let all_quiet = found.iter().all(|buzz| buzz.measured * RATIO >= buzz.viscous.min(buzz.dry));
    report.check(
        "no wall buzzes that Abbott and Okamura call passive",
        if all_quiet { "none does" } else { "one does" },
        all_quiet,
    );
}

/// Measured and predicted behaviour of an axis with one combination of damping, friction and
/// encoder step. `measured` is the lowest stiffness of the wall at which the axis does not come to
/// rest. `viscous` and `dry` are the stiffnesses up to which damping and friction, respectively,
/// make the axis passive. All are in N m/rad.
struct Buzz {
    own: f64,
    coulomb: f64,
    step: f64,
    measured: f64,
    viscous: f64,
    dry: f64,
}

fn measure(inertia: f64) -> Vec<Buzz> {
    let mut found = Vec::new();
    for (own, step) in OWN.into_iter().flat_map(|own| STEPS.map(|step| (own, step))) {
        for coulomb in COULOMB {
            let measured = first_buzz(&Wall { coulomb, step, ..Wall::of(inertia, own, PERIOD) }, 0.2);
            let (viscous, dry) = (2.0 * own / PERIOD, 2.0 * coulomb / step);
            found.push(Buzz { own, coulomb, step, measured, viscous, dry });
        }
    }
    found
}

/// Returns the lines of a plot over friction for the axis with the least damping. They show the
/// stiffness at which the axis first does not come to rest, and the stiffness up to which it is
/// passive.
fn lines(found: &[Buzz]) -> Vec<Series> {
    let of = |step: f64, value: fn(&Buzz) -> f64| {
        let drawn = found.iter().filter(|buzz| buzz.own == OWN[0] && buzz.step == step);
        drawn.map(|buzz| (1.0e3 * buzz.coulomb, value(buzz))).collect()
    };
    let both = |(colour, step): (usize, f64)| {
        let name = |what| format!("d = {}: {what}", short(step));
        [
            Series::new(name("buzzes"), of(step, |buzz| buzz.measured), colour),
            Series::new(name("passive"), of(step, |buzz| buzz.viscous.min(buzz.dry)), colour).open(true),
        ]
    };
    STEPS.into_iter().enumerate().flat_map(both).collect()
}
