//! The influence of each dimension on the figures, and the uncertainty of the figures.

use hbot_plot::{Lines, Series, short};

use super::search::{machine, measure};
use super::space::{DEGREE, Design, Parts, WHEELS};
use super::torus::{Effort, Measures, SEARCH, TOLD};
use crate::context::Context;
use crate::report::{Report, head, row};

/// The levels of thoroughness at which the figures are compared, from the least to the most
/// thorough.
const EFFORTS: [Effort; 5] = [
    SEARCH,
    Effort { samples: 1024, starts: 4 },
    Effort { samples: 4096, starts: 4 },
    TOLD,
    Effort { samples: 16384, starts: 64 },
];

/// Reports how much the figures change when they are measured more thoroughly.
pub(super) fn convergence(context: &Context, report: &mut Report, parts: &Parts) {
    context.part("how sure the figures are");
    introduce(report);
    let mut table = vec![head(
        "wheels | samples | starts | mean spectral index | least | peak torque, N m | inertia, kg m² | contact force, N per N m",
    )];
    let (mut mean_off, mut told_off) = (0.0_f64, 0.0_f64);
    for wheels in WHEELS {
        let design = Design { wheels, ..parts.prototype };
        let Some(machine) = machine(parts, &design) else {
            unreachable!("the prototype's wheels in a ring are a legal design")
        };
        let mut all = Vec::new();
        for effort in EFFORTS {
            let m = Measures::of(&machine, &design, effort);
            let stem = format!("design_samples_{wheels}w_{}_{}", effort.samples, effort.starts);
            report.figure(format!("{stem}_gci"), m.gci);
            report.figure(format!("{stem}_torque"), m.torque);
            table.push(row([
                wheels.to_string(),
                effort.samples.to_string(),
                effort.starts.to_string(),
                format!("{:.4}", m.gci),
                format!("{:.4}", m.conditioning),
                format!("{:.3}", m.torque),
                format!("{:.3e}", m.inertia),
                format!("{:.3}", m.load),
            ]));
            all.push(m);
        }
        let most = all[EFFORTS.len() - 1];
        mean_off = all.iter().map(|m| (m.gci / most.gci - 1.0).abs()).fold(mean_off, f64::max);
        let told = all[3];
        let parts = [told.torque / most.torque, told.inertia / most.inertia, told.load / most.load];
        told_off = parts.iter().map(|x| (x - 1.0).abs()).fold(told_off, f64::max);
    }
    report.table(&table);
    report.check(
        "mean spectral index by the samples of a search: within 0.5 % of sixty-four times as many",
        format!("{:.2} %", 100.0 * mean_off),
        mean_off < 0.005,
    );
    report.check(
        "worst torque, inertia and contact force as told: within 2 % of a four times longer search",
        format!("{:.2} %", 100.0 * told_off),
        told_off < 0.02,
    );
}

fn introduce(report: &mut Report) {
    report.heading("How sure the figures are");
    report.say(&format!(
        "Means are over even samples of the torus of steering angles (a Kronecker sequence of the generalised golden ratio). The worst posture is sought from the worst samples, by steps of one angle or two \
         that halve from 0.3 rad to 1 mrad; it may miss the very worst, and never overstates it. A search among designs looks at {} postures with {} starts, whatever is told below at {} with {}. The peak torque \
         is the least sure: it has narrow valleys. Here the prototype's wheel, two, three and four times.",
        SEARCH.samples, SEARCH.starts, TOLD.samples, TOLD.starts
    ));
    report.family("design_samples_{wheels}w_{samples}_{starts}_gci | 1 | mean spectral index of the prototype's wheel so many times, by so many samples");
    report.family("design_samples_{wheels}w_{samples}_{starts}_torque | N m | its peak torque in the worst direction at the worst posture, by so many samples and starts");
}

/// A function that returns a design with one dimension set to a value.
type Set = fn(&Design, f64) -> Design;

/// Varies each dimension of the prototype alone, and reports how the figures change.
pub(super) fn dimensions(context: &Context, report: &mut Report, parts: &Parts) {
    context.part("what each dimension does");
    report.heading("What each dimension does");
    let d = &parts.prototype;
    report.say(&format!(
        "The prototype with one dimension changed, relative to what it is (cone {:.1} deg, toe 0, axes {:.0} deg from -n3, wheels of {:.1} mm); margins aside, so that the whole course is seen. Where lines coincide, the one drawn last is seen: tilt leaves inertia and both speeds as they are, the radius leaves the steering speed and the torque before slip. Without toe the rows of G are c2/sin a and \
         (R/r) c1 for each wheel: steering turns the sphere about one axis with the leverage 1/sin a, driving about the other with R/r, and a wheel is as strong in both where r = R sin a, here {:.1} mm. With toe they are \
         (c2 - c1 tan b)/sin a and R c1/(r cos b), in the directions of b = 0: the toe gears both up by 1/cos b and makes them oblique, so conditioning only loses.",
        d.cone / DEGREE,
        d.tilt / DEGREE,
        1.0e3 * d.radius,
        1.0e3 * parts.sphere_radius() * libm::sin(d.cone)
    ));
    let Some(base) = measure(parts, d, SEARCH) else { unreachable!("the prototype is a legal design") };
    let sweeps: [(&str, &str, [f64; 2], f64, Set); 4] = [
        ("cone", "cone angle, deg", [4.0, 30.0], DEGREE, |d, cone| Design { cone, ..*d }),
        ("toe", "toe angle, deg", [0.0, 50.0], DEGREE, |d, toe| Design { toe, ..*d }),
        ("tilt", "steering axes from -n3, deg", [15.0, 75.0], DEGREE, |d, tilt| Design { tilt, ..*d }),
        ("radius", "wheel radius, mm", [8.0, 30.0], 1.0e-3, |d, radius| Design { radius, ..*d }),
    ];
    for (name, axis, [low, high], unit, set) in sweeps {
        let lines = sweep(parts, &base, [low, high], |x| set(d, x * unit));
        report.lines(
            &format!("dimension_{name}"),
            &format!("The prototype with another {name}, relative to itself"),
            Lines::new(format!("What the {name} does"), axis.to_owned(), "times the prototype's", lines),
        );
    }
    tilts(report, parts)
}

/// Measures designs in which one dimension varies from `low` to `high`. Returns one plot line per
/// figure. The figures are divided by those of the design `base`.
fn sweep(
    parts: &Parts,
    base: &Measures,
    [low, high]: [f64; 2],
    design: impl Fn(f64) -> Design,
) -> Vec<Series> {
    let mut lines: Vec<Series> = [
        ("mean spectral index", 0),
        ("peak torque, worst case", 1),
        ("torque before slip", 2),
        ("apparent inertia, largest", 6),
        ("steering speed", 3),
        ("drive speed", 5),
    ]
    .map(|(name, colour)| Series::new(name.to_owned(), Vec::new(), colour))
    .into();
    for k in 0..=26 {
        let x = low + (high - low) * f64::from(k) / 26.0;
        let Some(m) = measure(parts, &design(x), SEARCH) else { continue };
        let all = [
            m.gci / base.gci,
            m.torque / base.torque,
            base.load / m.load,
            m.inertia / base.inertia,
            m.speed[0] / base.speed[0],
            m.speed[1] / base.speed[1],
        ];
        for (line, y) in lines.iter_mut().zip(all) {
            line.points.push((x, y));
        }
    }
    lines
}

/// Reports how conditioning depends on the tilt of the steering axes, for each number of wheels.
/// The wheels are matched, r = R sin a: equally strong in steering and driving.
fn tilts(report: &mut Report, parts: &Parts) {
    report.say(
        "Where r = R sin a, G is most even where the contacts are spread most evenly over directions and their opposites: two at right angles (axes 45 deg from -n3), three or four with cos² = 1/3 (54.7 deg). \
         The third wheel is what lifts the index from 0.7, which two can never exceed, to near 1.",
    );
    report.family("design_tilt_{wheels}w_best_rad | rad | tilt at which matched wheels with the prototype's cone are best conditioned; `gci`: how well");
    let mut lines = Vec::new();
    let mut off = 0.0_f64;
    for (colour, wheels) in WHEELS.into_iter().enumerate() {
        let radius = parts.sphere_radius() * libm::sin(parts.prototype.cone);
        let mut points = Vec::new();
        for k in 0..=120 {
            let tilt = 20.0 + 0.5 * f64::from(k);
            let design = Design { wheels, tilt: tilt * DEGREE, radius, ..parts.prototype };
            if let Some(m) = measure(parts, &design, SEARCH) {
                points.push((tilt, m.gci));
            }
        }
        let best = points.iter().copied().fold((0.0, 0.0), |a, b| if b.1 > a.1 { b } else { a });
        report.figure(format!("design_tilt_{wheels}w_best_rad"), best.0 * DEGREE).note("gci", best.1);
        let ideal = if wheels == 2 { 45.0 } else { libm::acos(libm::sqrt(1.0 / 3.0)) / DEGREE };
        off = off.max((best.0 - ideal).abs());
        points.retain(|p| (p.0 * 0.5).fract() == 0.0);
        lines.push(Series::new(format!("{wheels} wheels, best at {} deg", short(best.0)), points, colour));
    }
    report.lines(
        "tilt_conditioning",
        "Mean spectral index over the tilt of the axes, cone 10 deg, r = R sin a",
        Lines::new(
            "Conditioning of matched wheels",
            "steering axes from -n3, deg",
            "mean spectral index",
            lines,
        ),
    );
    // The mean over a cone of 10 degrees is flat near its maximum.
    report.check(
        "matched wheels are best conditioned with axes at 45 deg (two), 54.7 deg (three, four), within 2 deg",
        format!("{off:.1} deg off at most"),
        off <= 2.0,
    );
}
