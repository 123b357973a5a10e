//! Convergence of the global indices: how they settle on finer grids, what the paper's grid gives,
//! and a check that turns are exact.

use hbot_core::{Quat, Vec3, rotation};
use hbot_plot::{Lines, Series};

use super::indices::{IndexedDevice, Local, START};
use super::so3;
use super::torus::THREE;
use super::turns::stepped;
use crate::context::{Context, Interrupted};
use crate::report::{Report, row};
use crate::rng::Rng;

/// Reports how the mean indices for three motors converge on finer grids. `torus` and `so3` are the
/// means on the finest grids. Returns the means on the finest of the paper's grids without weights,
/// as the paper prints them.
pub(super) fn study(
    context: &Context,
    report: &mut Report,
    rig: &IndexedDevice,
    finest: &[(Quat, f64)],
    (cells, level): (usize, u8),
    [torus, so3]: [Local; 2],
) -> Result<Local, Interrupted> {
    context.part("convergence of the grids")?;
    report.family(
        "gci_grid_{grid}_{count}",
        "1",
        "GCI of the three motors, spectral, on a grid of {count} nodes; {grid}: torus, uniform (SO(3)), equal_steps (the paper's), equal_steps_weighted (with sin theta)",
    );
    let three = [THREE];
    let mut rows = vec![row(["grid", "nodes", "GCI, three motors, spectral"])];
    let mut lines = Vec::new();
    let mut add = |report: &mut Report, name: &str, id: &str, colour: usize, values: Vec<(usize, f64)>| {
        for &(count, value) in &values {
            rows.push(row([name, &count.to_string(), &format!("{value:.4}")]));
            report.figure(format!("gci_grid_{id}_{count}"), value);
        }
        let points = values.iter().map(|&(count, value)| (count as f64, value)).collect();
        lines.push(Series { name: name.to_owned(), points, colour, open: id == "torus" });
    };
    let mut values: Vec<(usize, f64)> = [8, 4, 2]
        .map(|part| {
            let cells = cells / part;
            (cells * cells, rig.over_torus(cells, &three)[0].spectral)
        })
        .to_vec();
    values.push((cells * cells, torus.spectral));
    let halved = (values[2].1 - values[3].1).abs();
    report.check(
        "GCI over the torus has converged: half as many cells a turn change it by less than 1e-3",
        format!("{halved:.1e}"),
        halved < 1.0e-3,
    );
    add(report, "the torus", "torus", 6, values);
    let mut values = Vec::new();
    for coarser in 1..level {
        let samples: Vec<_> = so3::uniform(coarser).map(|q| (q, 1.0)).collect();
        values.push((samples.len(), rig.over_turns(&samples, START, &three)[0].spectral));
    }
    values.push((finest.len(), so3.spectral));
    let halved = (values[values.len() - 2].1 - so3.spectral).abs();
    report.check(
        "GCI over SO(3) has converged: steps twice as long change it by less than 2e-3",
        format!("{halved:.1e}"),
        halved < 2.0e-3,
    );
    add(report, "uniform over SO(3)", "uniform", 0, values);
    let steps: &[u32] = if context.quick { &[4, 8, 12] } else { &[4, 8, 16, 32] };
    let mut printed = Local::default();
    let mut bare = Vec::new();
    let mut weighted = Vec::new();
    for &steps in steps {
        let samples: Vec<_> = so3::equal_steps(steps).collect();
        weighted.push((samples.len(), rig.over_turns(&samples, START, &three)[0].spectral));
        let samples: Vec<_> = samples.into_iter().map(|(q, _)| (q, 1.0)).collect();
        printed = rig.over_turns(&samples, START, &three)[0];
        bare.push((samples.len(), printed.spectral));
        context.go_on()?;
    }
    let last = weighted.len() - 1;
    let off = (weighted[last].1 - so3.spectral).abs();
    report.check(
        "equal steps of the Hopf coordinates with their weight agree with the uniform orientations to 0.01",
        format!("{off:.1e}"),
        off < 0.01,
    );
    let moved = bare[last].1 - weighted[last].1;
    add(report, "equal steps, as printed", "equal_steps", 1, bare);
    add(report, "equal steps, weight sin theta", "equal_steps_weighted", 2, weighted);
    report.say(&format!(
        "How the mean settles. The paper takes equal steps of each Hopf coordinate for uniform (V.C); they crowd orientations near theta = 0 and pi, and need the weight sin theta. \
         Leaving it out moves GCI by {moved:+.3}."
    ));
    report.table(&rows);
    report.plot(
        "gci_convergence",
        "GCI of the three motors (spectral) against the number of nodes: the torus, orientations spread evenly, and the paper's grid with and without its weight",
        Lines {
            title: "GCI as grids are refined".to_owned(),
            x: "nodes".to_owned(),
            y: "GCI, three motors, spectral".to_owned(),
            log: [true, false],
            series: lines,
            front: false,
        }
        .svg(),
    );
    Ok(printed)
}

/// Checks the closed form for the steer angles after a turn against the integrated kinematics.
pub(super) fn steps(report: &mut Report, rig: &IndexedDevice, quick: bool) {
    report.family(
        "turn_{steps}_steps_error_rad",
        "rad",
        "error of the steering angles after a turn in {steps} steps of zd = G w against the closed form, median over turns",
    );
    let mut rng = Rng(11);
    let turns: Vec<Quat> = (0..if quick { 100 } else { 500 })
        .map(|_| {
            let axis = Vec3::from_array(rng.direction());
            rotation::exp(axis * rng.between(0.5, core::f64::consts::PI))
        })
        .collect();
    let mut errors = Vec::new();
    let mut table = vec![row(["steps a turn", "error of the steering angles, median, rad"])];
    for steps in [40_u32, 80, 160, 320] {
        let off = |q: &Quat| {
            let (exact, found) = (rig.arrived(*q, START), stepped(&rig.device, *q, START, steps));
            let off = |k: usize| rotation::wrap_angle(found[k] - exact[k]).abs();
            off(0).max(off(1))
        };
        let mut all: Vec<f64> = turns.iter().map(off).collect();
        all.sort_by(f64::total_cmp);
        let median = all[all.len() / 2];
        report.figure(format!("turn_{steps}_steps_error_rad"), median);
        table.push(row([steps.to_string(), format!("{median:.1e}")]));
        errors.push(median);
    }
    let order = (errors[2] / errors[3]).log2();
    report.say(
        "A turn about a fixed axis leaves each wheel an equation of its own, which is solved in closed form. Against it, the kinematics zd = G w in steps of the \
         classic Runge-Kutta method (order 4). Turns do not reverse, so what a wheel's caster does to an error ends once the wheel has come about.",
    );
    report.table(&table);
    report.check(
        "stepped turns come to the closed form with order 4, within 0.3",
        format!("{order:.2}"),
        (order - 4.0).abs() < 0.3,
    );
}
