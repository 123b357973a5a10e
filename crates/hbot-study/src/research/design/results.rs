//! The results of the search: plots, the best designs with their rig files, and a comparison with
//! the prototype.

use super::figures::{families, figures};
use super::fronts::{Best, Fronts};
use super::margins::{MARGINS, margins};
use super::plots::plots;
use super::space::{DEGREE, Parts, WHEELS};
use super::torus::Measures;
use super::{margins as bounds, rigfile, with_unit};
use crate::report::{Report, head, row};

pub(super) fn tell(report: &mut Report, parts: &Parts, fronts: &Fronts) {
    plots(report, fronts);
    best(report, parts, fronts);
    place(report, parts, fronts);
}

fn best(report: &mut Report, parts: &Parts, fronts: &Fronts) {
    report.heading("The best designs");
    report.say(
        "Of each number of wheels: the compromise (nearest to the best of every figure, each scaled to its range on the front), the best in each of the four, and, where there is one, the one that is better than the prototype in all four by the \
         largest factor. Each is a rig file beside this report, `design_<wheels>w_<which>.toml`: `hbot rig check` judges it, `hbot server --rig` runs it. Its torque limit is 0.95 of what motors and contacts give in any \
         direction at any posture.",
    );
    families(report, "design_prototype");
    families(report, "design_best_{wheels}w_{which}");
    figures(report, "design_prototype", parts, &parts.prototype, &fronts.prototype);
    let mut table = vec![head(
        "design | cone, deg | toe, deg | tilt, deg | r, mm | GCI | peak torque, N m | inertia, kg m² | steering speed | drive speed | slips from, N m | contact force at peak torque, N | margins at their bound",
    )];
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

/// Returns whether `value` is close to the lower bound of `margin`: within 5 % of the bound, or
/// within 1 degree if the bound is 0.
fn near(value: f64, margin: &bounds::Margin) -> bool {
    let reach = if margin.least > 0.0 { 0.05 * margin.least } else { DEGREE };
    value < margin.least + reach
}

/// Reports for each margin the share of the best designs (the Pareto fronts) that are close to the
/// margin's lower bound. A margin with a large share is what prevents better designs.
fn bind(report: &mut Report, parts: &Parts, fronts: &Fronts) {
    report.say("How many of a front's designs have a margin at its bound (within 5 %, angles within 1 deg), in per cent: what holds them back.");
    report.family("design_front_{wheels}w_at_{margin} | 1 | share of a front's designs that have this margin at its bound");
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
    report.family("design_front_{wheels}w_dominating | 1 | designs on the front that beat the prototype in all four figures");
    report.family("design_front_{wheels}w_better_by | 1 | largest factor by which a design is better than the prototype in every figure at once; below 1 none is");
    let mut table = vec![head(
        "wheels | designs that beat it in all four | better in all by a factor of, at most | that design: GCI | peak torque | inertia | steering speed",
    )];
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
