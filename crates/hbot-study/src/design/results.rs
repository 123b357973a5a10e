//! The fronts: plots, the best designs with their rig files, and the prototype's place.

use super::figures::{Of, families, figures};
use super::front::{Found, better_by, compromise, dominates, front};
use super::margins::{MARGINS, margins};
use super::space::{DEGREE, Parts, WHEELS};
use super::torus::Measures;
use super::{margins as bounds, rigfile, with_unit};
use crate::plot::scatter::{Cloud, Scatter};
use crate::report::{Report, row};

/// Points of a cloud that are drawn.
const DRAWN: usize = 400;

/// An axis of the plots.
struct Axis {
    name: &'static str,
    /// As an axis has it.
    long: &'static str,
    /// Smaller is better.
    falls: bool,
    of: fn(&Measures) -> f64,
}

const AXES: [Axis; 4] = [
    Axis {
        name: "conditioning",
        long: "mean spectral index, GCI (more is better)",
        falls: false,
        of: |m| m.gci,
    },
    Axis {
        name: "peak torque",
        long: "peak torque in the worst case, N m (more is better)",
        falls: false,
        of: |m| m.torque,
    },
    Axis {
        name: "apparent inertia",
        long: "largest apparent inertia, kg m² (less is better)",
        falls: true,
        of: |m| m.inertia,
    },
    Axis {
        name: "steering speed",
        long: "steering speed, rad/s per rad/s (less is better)",
        falls: true,
        of: |m| m.speed[0],
    },
];
const SHORT: [&str; 4] = ["conditioning", "torque", "inertia", "steering"];

/// A design of note.
struct Best {
    which: &'static str,
    found: Found,
}

/// The fronts of all wheel counts, each measured as thoroughly as what is told.
pub(super) struct Fronts {
    /// One a wheel count, in the order of [`WHEELS`].
    pub(super) each: Vec<Vec<Found>>,
    pub(super) prototype: Measures,
}

impl Fronts {
    /// The front of one wheel count.
    pub(super) fn of(&self, wheels: usize) -> &[Found] {
        WHEELS.iter().position(|w| *w == wheels).map_or(&[], |k| &self.each[k])
    }

    /// Of each wheel count those that no design of any count beats.
    fn joint(&self) -> Vec<Found> {
        let all: Vec<Found> = self.each.iter().flatten().copied().collect();
        let costs: Vec<_> = all.iter().map(|found| found.measures.costs()).collect();
        front(&costs).into_iter().map(|k| all[k]).collect()
    }

    /// The designs of note of one wheel count; the compromise first.
    fn best(&self, wheels: usize) -> Vec<Best> {
        let all = self.of(wheels);
        let costs: Vec<_> = all.iter().map(|found| found.measures.costs()).collect();
        let mut best: Vec<Best> = Vec::new();
        best.extend(compromise(&costs).map(|k| Best { which: "compromise", found: all[k] }));
        for (m, which) in SHORT.into_iter().enumerate() {
            let least = (0..all.len()).min_by(|a, b| costs[*a][m].total_cmp(&costs[*b][m]));
            best.extend(least.map(|k| Best { which, found: all[k] }));
        }
        if let Some((found, by)) = self.nearest_above(wheels)
            && by > 1.0
        {
            best.push(Best { which: "better", found });
        }
        best
    }

    /// The design of a wheel count that is better than the prototype in every figure by the largest factor, and that factor.
    pub(super) fn nearest_above(&self, wheels: usize) -> Option<(Found, f64)> {
        let by = |found: &Found| better_by(&found.measures, &self.prototype);
        let best = self.of(wheels).iter().max_by(|a, b| by(a).total_cmp(&by(b)))?;
        Some((*best, by(best)))
    }
}

impl Fronts {
    /// How many designs of a wheel count beat the prototype in all figures.
    pub(super) fn dominating(&self, wheels: usize) -> usize {
        let beats = |found: &&Found| dominates(&found.measures.costs(), &self.prototype.costs());
        self.of(wheels).iter().filter(beats).count()
    }
}

pub(super) fn tell(report: &mut Report, parts: &Parts, fronts: &Fronts) {
    plots(report, fronts);
    best(report, parts, fronts);
    place(report, parts, fronts);
}

fn plots(report: &mut Report, fronts: &Fronts) {
    report.heading("The fronts");
    let joint = fronts.joint();
    report.say(
        "Designs that keep all margins and that no other with as many wheels beats in all four figures at once. Open points: those designs, seen along two of the four axes. Joined points: of them those that no other beats in \
         these two. A point that looks beaten in one plot is not in another. The black diamond is the prototype.",
    );
    report.family("design_front_{wheels}w_designs", "1", "designs on the front of so many wheels");
    report.family(
        "design_front_{wheels}w_overall",
        "1",
        "of them those that no design of any wheel count beats",
    );
    for wheels in WHEELS {
        report.figure(format!("design_front_{wheels}w_designs"), fronts.of(wheels).len() as f64);
        let overall = joint.iter().filter(|found| found.point.wheels == wheels).count();
        report.figure(format!("design_front_{wheels}w_overall"), overall as f64);
    }
    for (i, x) in AXES.iter().enumerate() {
        for (j, y) in AXES.iter().enumerate().skip(i + 1) {
            let mut clouds = Vec::new();
            for (colour, wheels) in WHEELS.into_iter().enumerate() {
                let all = fronts.of(wheels);
                let points: Vec<(f64, f64)> =
                    all.iter().map(|found| ((x.of)(&found.measures), (y.of)(&found.measures))).collect();
                let name = |what: &str| format!("{wheels} wheels, {what}");
                let every = points.len().div_ceil(DRAWN).max(1);
                clouds.push(Cloud {
                    name: name("front of all four"),
                    points: points.iter().copied().step_by(every).collect(),
                    colour,
                    joined: false,
                });
                clouds.push(Cloud {
                    name: name("of these two"),
                    points: best_of_two(&points, x.falls, y.falls),
                    colour,
                    joined: true,
                });
            }
            report.plot(
                &format!("front_{}_{}", SHORT[i], SHORT[j]),
                &format!("{} against {}", capital(y.name), x.name),
                Scatter {
                    title: format!("{} against {}", capital(y.name), x.name),
                    x: x.long.to_owned(),
                    y: y.long.to_owned(),
                    clouds,
                    mark: (
                        "the prototype".to_owned(),
                        ((x.of)(&fronts.prototype), (y.of)(&fronts.prototype)),
                    ),
                }
                .svg(),
            );
        }
    }
}

fn capital(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or(String::new(), |first| first.to_uppercase().chain(chars).collect())
}

/// Of some points those that no other beats in both, from left to right.
fn best_of_two(points: &[(f64, f64)], x_falls: bool, y_falls: bool) -> Vec<(f64, f64)> {
    let sign = |falls: bool| if falls { 1.0 } else { -1.0 };
    let cost = |p: &(f64, f64)| [sign(x_falls) * p.0, sign(y_falls) * p.1, 0.0, 0.0];
    let costs: Vec<_> = points.iter().map(cost).collect();
    let mut best: Vec<(f64, f64)> = front(&costs).into_iter().map(|k| points[k]).collect();
    best.sort_by(|a, b| a.0.total_cmp(&b.0));
    best
}

fn best(report: &mut Report, parts: &Parts, fronts: &Fronts) {
    report.heading("The best designs");
    report.say(
        "Of each number of wheels: the compromise (nearest to the best of every figure, each scaled to its range on the front), the best in each of the four, and, where there is one, the one that is better than the prototype in all four by the \
         largest factor. Each is a rig file beside this report, `design_<wheels>w_<which>.toml`: `hbot rig check` judges it, `hbot server --rig` runs it. Its torque limit is 0.95 of what motors and contacts give in any \
         direction at any posture.",
    );
    families(report, Of::Prototype);
    families(report, Of::Best);
    figures(report, "design_prototype", parts, &parts.prototype, &fronts.prototype);
    let mut table = vec![row([
        "design",
        "cone, deg",
        "toe, deg",
        "tilt, deg",
        "r, mm",
        "GCI",
        "peak torque, N m",
        "inertia, kg m²",
        "steering speed",
        "drive speed",
        "slips from, N m",
        "contact force at peak torque, N",
        "margins at their bound",
    ])];
    let p = &parts.prototype;
    table.push(line("prototype", parts, p, &fronts.prototype));
    let (mut accepted, mut files) = (0, 0);
    for wheels in WHEELS {
        for Best { which, found } in fronts.best(wheels) {
            let design = found.point.design();
            let name = format!("{wheels}w_{which}");
            figures(report, &format!("design_best_{name}"), parts, &design, &found.measures);
            table.push(line(&name, parts, &design, &found.measures));
            let title = format!("Hbot, {wheels} wheels, {which}");
            let text = rigfile::text(parts, &title, &design, &found.measures);
            files += 1;
            accepted += usize::from(hbot_config::RigConfig::from_toml(&text, &name).is_ok());
            report.file(&format!("design_{name}.toml"), text);
        }
    }
    report.table(&table);
    report.check(
        "every rig file that is written is a legal rig",
        format!("{accepted} of {files}"),
        accepted == files,
    );
    bind(report, parts, fronts);
}

fn line(name: &str, parts: &Parts, design: &super::space::Design, m: &Measures) -> Vec<String> {
    let at = bounds::margins(parts, design, m);
    let near: Vec<&str> = at
        .iter()
        .zip(&MARGINS)
        .filter(|(value, margin)| near(**value, margin))
        .map(|(_, m)| m.name)
        .collect();
    row([
        name.to_owned(),
        format!("{:.1}", design.cone / DEGREE),
        format!("{:.1}", design.toe / DEGREE),
        format!("{:.1}", design.tilt / DEGREE),
        format!("{:.1}", 1.0e3 * design.radius),
        format!("{:.3}", m.gci),
        format!("{:.2}", m.torque),
        format!("{:.2e}", m.inertia),
        format!("{:.2}", m.speed[0]),
        format!("{:.2}", m.speed[1]),
        format!("{:.2}", m.slips_from(bounds::grip(parts))),
        format!("{:.1}", m.torque * m.load),
        if near.is_empty() { "none".to_owned() } else { near.join(", ") },
    ])
}

/// Whether a margin is used up to 5 % of its bound, or 1 degree.
fn near(value: f64, margin: &bounds::Margin) -> bool {
    let reach = if margin.least > 0.0 { 0.05 * margin.least } else { DEGREE };
    value < margin.least + reach
}

/// Which margins hold the fronts back.
fn bind(report: &mut Report, parts: &Parts, fronts: &Fronts) {
    report.say("How many of a front's designs have a margin at its bound (within 5 %, angles within 1 deg), in per cent: what holds them back.");
    report.family(
        "design_front_{wheels}w_at_{margin}",
        "1",
        "share of a front's designs that have this margin at its bound",
    );
    let mut table = vec![row(["wheels"].into_iter().chain(MARGINS.iter().map(|m| m.name)))];
    let mut broken = 0;
    for wheels in WHEELS {
        let all = fronts.of(wheels);
        let mut counts = [0; MARGINS.len()];
        for found in all {
            let at = margins(parts, &found.point.design(), &found.measures);
            for ((count, value), margin) in counts.iter_mut().zip(at).zip(&MARGINS) {
                *count += usize::from(near(value, margin));
                broken += usize::from(!(value >= margin.least));
            }
        }
        let share = |count: usize| count as f64 / all.len().max(1) as f64;
        for (count, margin) in counts.iter().zip(&MARGINS) {
            report.figure(format!("design_front_{wheels}w_at_{}", margin.name), share(*count));
        }
        let cells = counts.iter().map(|count| format!("{:.0}", 100.0 * share(*count)));
        table.push(row([wheels.to_string()].into_iter().chain(cells)));
    }
    report.table(&table);
    report.check("every design of every front keeps every margin", format!("{broken} broken"), broken == 0);
}

fn place(report: &mut Report, parts: &Parts, fronts: &Fronts) {
    report.heading("The prototype's place");
    report.family(
        "design_front_{wheels}w_dominating",
        "1",
        "designs on the front that beat the prototype in all four figures",
    );
    report.family(
        "design_front_{wheels}w_better_by",
        "1",
        "largest factor by which a design is better than the prototype in every figure at once; below 1 none is",
    );
    let mut table = vec![row([
        "wheels",
        "designs that beat it in all four",
        "better in all by a factor of, at most",
        "that design: GCI",
        "peak torque",
        "inertia",
        "steering speed",
    ])];
    let p = &fronts.prototype;
    for wheels in WHEELS {
        let count = fronts.dominating(wheels);
        report.figure(format!("design_front_{wheels}w_dominating"), count as f64);
        let Some((found, by)) = fronts.nearest_above(wheels) else { continue };
        report.figure(format!("design_front_{wheels}w_better_by"), by);
        let m = &found.measures;
        let percent = |ratio: f64| format!("{:+.1} %", 100.0 * (ratio - 1.0));
        table.push(row([
            wheels.to_string(),
            count.to_string(),
            format!("{by:.3}"),
            percent(m.gci / p.gci),
            percent(m.torque / p.torque),
            percent(m.inertia / p.inertia),
            percent(m.speed[0] / p.speed[0]),
        ]));
    }
    report.table(&table);
    let kept = margins(parts, &parts.prototype, p);
    let bounds: Vec<String> = MARGINS
        .iter()
        .zip(kept)
        .map(|(margin, value)| format!("{} {}", margin.name, with_unit(value, margin.unit)))
        .collect();
    report.say(&format!("The prototype's own margins: {}.", bounds.join(", ")));
    let keeps = kept.iter().zip(&MARGINS).all(|(value, margin)| *value >= margin.least);
    report.check(
        "the prototype keeps every margin that the designs are held to",
        if keeps { "it does" } else { "it does not" },
        keeps,
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_two_figures_the_best_from_left_to_right() {
        let points = [(1.0, 1.0), (2.0, 3.0), (3.0, 2.0), (2.5, 2.5), (0.5, 0.5)];
        assert_eq!(best_of_two(&points, false, false), [(2.0, 3.0), (2.5, 2.5), (3.0, 2.0)]);
        assert_eq!(best_of_two(&points, true, true), [(0.5, 0.5)]);
        assert_eq!(best_of_two(&points, true, false), [(0.5, 0.5), (1.0, 1.0), (2.0, 3.0)]);
    }
}
