//! The study `design`: a search for the dimensions of a better Hbot.
//!
//! - `space`: what a design is.
//! - `local` and `torus`: the figures of a design at one posture and over all postures.
//! - `margins`: what a design must keep.
//! - `search` and `front`: the search for designs that no other dominates.
//! - `shapes`, `results`, `wheels` and `conclusions`: parts of the report.

mod conclusions;
mod figures;
mod front;
mod fronts;
mod local;
mod margins;
mod plots;
mod results;
mod rigfile;
mod search;
mod shapes;
mod short;
mod space;
mod torus;
mod wheels;

use crate::context::Context;
use crate::report::{Report, head, row};

use front::{BOX, Found, better_by, front, volume};
use fronts::Fronts;
use hbot_plot::{Lines, Series, short};
use margins::MARGINS;
use search::{Search, climb, measure, measure_all, search};
use space::{Design, MODULE_MASS, MODULE_ROOM, Parts, Point, WHEEL_DENSITY, WHEEL_WIDTH, WHEELS};
use torus::{Measures, TOLD};

/// Random seeds of the searches. One search per seed is run for each number of wheels.
const SEEDS: [u64; 2] = [1, 2];
/// Number of sample points with which the reported volumes are estimated. The volume is the share
/// of the points that designs dominate.
const VOLUME_POINTS: usize = 32_768;
/// Largest allowed difference of the volumes that two seeds reach, relative to the larger one. The
/// first value is for a full run, the second for a quick run, which varies more by chance.
const SEEDS_AGREE: [f64; 2] = [0.05, 0.2];
/// Number of designs that are measured per seed, for 2, 3 and 4 wheels: in a full run and in a
/// quick one. Designs with fewer wheels are faster to measure.
const EVALUATIONS: [[usize; 3]; 2] = [[10240, 6144, 4096], [1536, 512, 384]];

/// Runs the study `design` and returns its report.
pub(crate) fn study(context: &Context) -> Report {
    let mut report = Report::new("design", context.quick);
    let parts = Parts::prototype();
    context.expect(4 + (SEEDS.len() + 1) * WHEELS.len());
    introduce(&mut report, &parts);
    let Some(prototype) = measure(&parts, &parts.prototype, TOLD) else {
        unreachable!("the prototype is a legal design")
    };
    shapes::dimensions(context, &mut report, &parts);
    shapes::convergence(context, &mut report, &parts);
    let each = fronts(context, &mut report, &parts, &prototype);
    let fronts = Fronts { each, prototype };
    results::tell(&mut report, &parts, &fronts);
    wheels::study(context, &mut report, &parts);
    context.part("conclusions");
    conclusions::tell(&mut report, &parts, &fronts);
    short::conclude(&mut report);
    report
}

fn introduce(report: &mut Report, parts: &Parts) {
    report.say(&format!(
        "The paper names optimal dimensional synthesis as its next step. Here 2, 3 and 4 wheels, all alike and evenly about n3, are varied in cone angle (6 to 40 deg), toe angle (0 to 40 deg; the other sign is the mirror image), tilt of the \
         steering axes from -n3 (15 to 80 deg) and wheel radius (8 to 30 mm), in steps of 0.1 deg and 0.1 mm. Sphere, motors, gears, encoders, friction and normal force stay the prototype's: {} N m peak at each steering joint, {} at each drive, mu N = {} N.",
        parts.rig.joints[0].peak,
        parts.rig.joints[1].peak,
        margins::grip(parts)
    ));
    report.say(
        "Four figures are weighed, all over the uniform torus of all steering angles: **conditioning**, the mean spectral index sigma_min/sigma_max of G (GCI, to be large); **peak torque**, what the motors make in the worst direction at the \
         worst posture (to be large; the radius of the largest ball in the polytope of torques); **apparent inertia**, the largest eigenvalue of I_s I + Gᵀ J_q G at the worst posture (to be small); **steering speed**, 1/(sin a cos b), how fast a \
         wheel is steered at most while the sphere turns at 1 rad/s (to be small). Contact forces are those of the controller's allocation, which loads the contacts least, while no motor is at its limit.",
    );
    report.say(&format!(
        "Inertias follow the dimensions. Of a steering joint's {:.1e} kg m² the paper's prototype has {:.0} g at its wheel's centre (the module's mass that the simulated rig has too), on an arm of (R + r) sin a; what is left, {:.1e}, is taken as the rotor's and stays. Of a drive joint's {:.1e} the wheel's own part is that of a disc of {:.0} mm \
         and {:.0} kg/m³, which grows with r⁴; the rest stays. So a wider cone lowers the leverage 1/sin a but lengthens the arm as much: beyond the rotor, inertia does not fall with the cone.",
        parts.rig.device.wheels()[0].spec().steer_inertia,
        1.0e3 * MODULE_MASS,
        parts.steer_inertia(&Design { cone: 0.0, ..parts.prototype }),
        parts.rig.device.wheels()[0].spec().drive_inertia,
        1.0e3 * WHEEL_WIDTH,
        WHEEL_DENSITY
    ));
    report.say(&format!(
        "A module is taken to need {:.0} mm beyond the rim of its wheel and so to sweep, as it steers, a cone of half-angle a + asin((r + {:.0} mm)/(R + r)) about its axis; modules of neighbours must not touch, and all stay {:.0} deg below the equator, where the open half and the cage's ring are. What every design must keep, \
         whatever its wheels steer to:",
        1.0e3 * MODULE_ROOM,
        1.0e3 * MODULE_ROOM,
        space::BELOW_EQUATOR / space::DEGREE
    ));
    let mut table = vec![row(["margin", "at least", "what it is"])];
    for margin in &MARGINS {
        table.push(row([margin.name, &with_unit(margin.least, margin.unit), margin.meaning]));
    }
    report.table(&table);
}

/// Searches for designs and returns the Pareto front for each number of wheels, from the designs of
/// all seeds. Also reports how well the fronts have converged.
fn fronts(context: &Context, report: &mut Report, parts: &Parts, prototype: &Measures) -> Vec<Vec<Found>> {
    let budget = EVALUATIONS[usize::from(context.quick)];
    explain_search(report, budget);
    let mut all = Vec::new();
    for (wheels, evaluations) in WHEELS.into_iter().zip(budget) {
        all.push(Front::search(context, parts, wheels, evaluations, prototype));
    }
    tell_search(report, &all);
    let bound = SEEDS_AGREE[usize::from(context.quick)];
    let apart = all.iter().map(Front::apart).fold(0.0, f64::max);
    report.check(
        format!("what two seeds find beats the same share of the box within {bound}, relatively"),
        format!("{apart:.3} apart at most"),
        apart <= bound,
    );
    all.into_iter().map(|front| front.found).collect()
}

fn explain_search(report: &mut Report, budget: [usize; 3]) {
    report.heading("The search");
    report.say(&format!(
        "{}, {} and {} designs with two, three and four wheels are measured from each of {} seeds: the prototype's dimensions first, then a half spread evenly over all dimensions (a Kronecker sequence; what has no room or too fast joints is passed over unmeasured), a half by steps between designs \
         that none has beaten so far (differences of two added to a third, or one dimension nudged). Every design that none beats is kept, however many: with four figures a population of fixed size, as in NSGA-II, would throw good ones away, and \
         designs are cheap. Then the design that is better than the prototype in all four figures by the largest factor is climbed to from the prototype and from the best found, step by step on the grid. \
         What all this found is measured again, more thoroughly, and held to its margins again. How far the fronts have converged is told by the share of a box that they beat: conditioning {} to {}, peak torque {} to {} N m, \
         inertia {} to {} kg m², steering speed {} to {}.",
        budget[0],
        budget[1],
        budget[2],
        SEEDS.len(),
        -BOX[0][0],
        -BOX[0][1],
        BOX[1][0],
        -BOX[1][1],
        short(BOX[2][0]),
        short(BOX[2][1]),
        BOX[3][0],
        BOX[3][1],
    ));
    report.family("design_front_{wheels}w_volume | 1 | share of the box that the front beats");
    report.family("design_front_{wheels}w_volume_seed{seed} | 1 | the same of what one seed found; `half`: with half the evaluations");
}

/// The best designs found with one number of wheels (the Pareto front), and the searches that found
/// them.
struct Front {
    wheels: usize,
    evaluations: usize,
    runs: Vec<Search>,
    found: Vec<Found>,
    /// Quality of the result of each search: the share of the volume of possible costs (`BOX`) that
    /// its designs dominate.
    shares: Vec<f64>,
}

impl Front {
    fn search(
        context: &Context,
        parts: &Parts,
        wheels: usize,
        evaluations: usize,
        prototype: &Measures,
    ) -> Self {
        let mut runs: Vec<Search> = Vec::new();
        for seed in SEEDS {
            context.part(&format!("{wheels} wheels, search {seed}"));
            runs.push(search(parts, wheels, evaluations, seed));
        }
        context.part(&format!("{wheels} wheels, the front"));
        let found = told(parts, wheels, &runs, prototype);
        let shares = runs.iter().map(|run| share(&run.archive.members)).collect();
        Self { wheels, evaluations, runs, found, shares }
    }

    /// Returns the share of the volume of possible costs that the search `run` dominated after half
    /// of its evaluations. A share near the final one shows that the search has converged.
    fn half(&self, run: &Search) -> f64 {
        run.history.iter().rfind(|(n, _)| 2 * n <= self.evaluations).map_or(0.0, |(_, v)| *v)
    }

    /// Returns how much the results of the searches differ: the largest difference between their
    /// shares of the dominated volume, relative to the largest share.
    fn apart(&self) -> f64 {
        let most = self.shares.iter().copied().fold(0.0, f64::max);
        self.shares.iter().map(|share| (most - share) / most).fold(0.0, f64::max)
    }

    fn row(&self) -> Vec<String> {
        let [passed, tried] = self.runs[0].without_room;
        row([
            self.wheels.to_string(),
            self.found.len().to_string(),
            format!("{:.4}", share(&self.found)),
            format!("{:.4}", self.shares[0]),
            format!("{:.4}", self.shares[1]),
            format!("{:.4}", self.half(&self.runs[0])),
            format!("{passed} of {tried}"),
            format!("{} of {}", self.runs[0].failed, self.evaluations),
        ])
    }

    fn figures(&self, report: &mut Report) {
        let wheels = self.wheels;
        report.figure(format!("design_front_{wheels}w_volume"), share(&self.found));
        for ((seed, run), share) in SEEDS.iter().zip(&self.runs).zip(&self.shares) {
            let id = format!("design_front_{wheels}w_volume_seed{seed}");
            report.figure(id, *share).note("half", self.half(run));
        }
    }
}

/// Returns the share of the volume of possible costs (`BOX`) that the designs in `found` dominate.
fn share(found: &[Found]) -> f64 {
    volume(found.iter().map(|found| found.measures.costs()), VOLUME_POINTS)
}

fn tell_search(report: &mut Report, all: &[Front]) {
    let mut table = vec![head(
        "wheels | designs on the front | share of the box | seed 1 | seed 2 | seed 1 with half as many | no room, of those spread evenly | margins broken, of those measured",
    )];
    let mut lines = Vec::new();
    for (colour, front) in all.iter().enumerate() {
        front.figures(report);
        table.push(front.row());
        for (seed, run) in SEEDS.iter().zip(&front.runs) {
            let points = run.history.iter().map(|(n, v)| (*n as f64, *v)).collect();
            let line = Series::new(format!("{} wheels, seed {seed}", front.wheels), points, colour);
            lines.push(line.open(*seed != SEEDS[0]));
        }
    }
    report.table(&table);
    report.lines(
        "search",
        "Share of the box that is beaten over the designs measured, from two seeds",
        Lines::new("How the fronts grow", "designs measured", "share of the box beaten", lines),
    );
    report.say("A share of the front is less than that of its seeds only where the more thorough measurement found a design's worst posture to be worse.");
}

/// Returns the Pareto front of all designs that the searches `runs` found. Also considers the
/// designs that exceed the prototype in all figures by the largest factor. All are measured as
/// thoroughly as reported figures are.
fn told(parts: &Parts, wheels: usize, runs: &[Search], prototype: &Measures) -> Vec<Found> {
    let members = || runs.iter().flat_map(|run| &run.archive.members);
    let costs: Vec<_> = members().map(|found| found.measures.costs()).collect();
    let all: Vec<_> = members().map(|found| found.point).collect();
    let mut points: Vec<_> = front(&costs).into_iter().map(|k| all[k]).collect();
    let by = |found: &&Found| better_by(&found.measures, prototype);
    let best = members().max_by(|a, b| by(a).total_cmp(&by(b))).map(|found| found.point);
    let same = Point::of(&Design { wheels, ..parts.prototype });
    for from in best.into_iter().chain([same]) {
        points.push(climb(parts, from, prototype));
    }
    points.sort_unstable();
    points.dedup();
    let found: Vec<Found> = measure_all(parts, &points, TOLD).into_iter().flatten().collect();
    let costs: Vec<_> = found.iter().map(|f| f.measures.costs()).collect();
    front(&costs).into_iter().map(|k| found[k]).collect()
}

/// Formats a number with its unit. The unit `1`, which marks a ratio, is left out.
fn with_unit(value: f64, unit: &str) -> String {
    if unit == "1" { short(value) } else { format!("{} {unit}", short(value)) }
}
