//! Convergence of the global indices: how they settle on finer grids, and what the paper's grid
//! gives.

use hbot_core::Quat;
use hbot_plot::{Lines, Series};

use super::indices::{IndexedDevice, Local, START};
use super::so3;
use super::torus::THREE;
use crate::context::Context;
use crate::report::{Report, row};

/// Reports how the mean indices for three motors converge as grids become finer. `torus` and `so3`
/// are the means on the finest grids of postures and of orientations. Returns the means on the
/// finest of the paper's grids, without weights, as the paper's formula has none.
pub(super) fn study(
    context: &Context,
    report: &mut Report,
    rig: &IndexedDevice,
    finest: &[(Quat, f64)],
    (cells, level): (usize, u8),
    [torus, so3]: [Local; 2],
) -> Local {
    context.part("convergence of the grids");
    report.family("gci_grid_{grid}_{count} | 1 | GCI of the three motors, spectral, on a grid of {count} nodes; {grid}: torus, uniform (SO(3)), equal_steps (the paper's), equal_steps_weighted (with sin theta)");
    let mut settled =
        Settled { rows: vec![row(["grid", "nodes", "GCI, three motors, spectral"])], lines: Vec::new() };
    let over_torus = [8, 4, 2].map(|part| cells / part);
    let over_torus = over_torus.map(|cells| (cells * cells, rig.over_torus(cells, &[THREE])[0].spectral));
    let values = over_torus.into_iter().chain([(cells * cells, torus.spectral)]).collect();
    settled.add(report, ["the torus", "torus"], 6, values);
    let halved = (over_torus[2].1 - torus.spectral).abs();
    report.check(
        "GCI over the torus has converged: half as many cells a turn change it by less than 1e-3",
        format!("{halved:.1e}"),
        halved < 1.0e-3,
    );
    let even = |level| so3::uniform(level).map(|q| (q, 1.0)).collect::<Vec<_>>();
    let mut values: Vec<_> = (1..level).map(|coarser| spectral(rig, &even(coarser))).collect();
    values.push((finest.len(), so3.spectral));
    let halved = (values[values.len() - 2].1 - so3.spectral).abs();
    settled.add(report, ["uniform over SO(3)", "uniform"], 0, values);
    report.check(
        "GCI over SO(3) has converged: steps twice as long change it by less than 2e-3",
        format!("{halved:.1e}"),
        halved < 2.0e-3,
    );
    let (printed, moved) = equal_steps(context, report, rig, so3, &mut settled);
    report.say(&format!(
        "How the mean settles. The paper takes equal steps of each Hopf coordinate for uniform (V.C); they crowd orientations near theta = 0 and pi, and need the weight sin theta. \
         Leaving it out moves GCI by {moved:+.3}."
    ));
    report.table(&settled.rows);
    report.lines(
        "gci_convergence",
        "GCI of the three motors (spectral) against the number of nodes: the torus, orientations spread evenly, and the paper's grid with and without its weight",
        Lines::new("GCI as grids are refined", "nodes", "GCI, three motors, spectral", settled.lines)
            .log([true, false]),
    );
    printed
}

/// Table rows and plot lines that show how the global conditioning index (GCI) converges as the
/// grid of orientations or postures becomes finer.
struct Settled {
    rows: Vec<Vec<String>>,
    lines: Vec<Series>,
}

impl Settled {
    fn add(&mut self, report: &mut Report, [name, id]: [&str; 2], colour: usize, values: Vec<(usize, f64)>) {
        for &(count, value) in &values {
            self.rows.push(row([name, &count.to_string(), &format!("{value:.4}")]));
            report.figure(format!("gci_grid_{id}_{count}"), value);
        }
        let points = values.iter().map(|&(count, value)| (count as f64, value)).collect();
        let line = Series::new(name, points, colour);
        self.lines.push(line.open(id == "torus"));
    }
}

/// Returns the number of orientations in `samples`, and the global conditioning index (GCI): the
/// mean of the spectral index of the paper's three motors over these orientations.
fn spectral(rig: &IndexedDevice, samples: &[(Quat, f64)]) -> (usize, f64) {
    (samples.len(), rig.over_turns(samples, START, &[THREE])[0].spectral)
}

/// Computes the global conditioning index (GCI) on the paper's grids of equal steps: without
/// weights, as in the paper, and with the weight sin theta. Returns the mean indices on the finest
/// grid without weights, and by how much the GCI without weights exceeds the weighted GCI there.
fn equal_steps(
    context: &Context,
    report: &mut Report,
    rig: &IndexedDevice,
    so3: Local,
    settled: &mut Settled,
) -> (Local, f64) {
    let steps: &[u32] = if context.quick { &[4, 8, 12] } else { &[4, 8, 16, 32] };
    let mut printed = Local::default();
    let (mut bare, mut weighted) = (Vec::new(), Vec::new());
    for &steps in steps {
        let samples: Vec<_> = so3::equal_steps(steps).collect();
        weighted.push(spectral(rig, &samples));
        let samples: Vec<_> = samples.into_iter().map(|(q, _)| (q, 1.0)).collect();
        printed = rig.over_turns(&samples, START, &[THREE])[0];
        bare.push((samples.len(), printed.spectral));
    }
    let finest = weighted[weighted.len() - 1].1;
    let off = (finest - so3.spectral).abs();
    report.check(
        "equal steps of the Hopf coordinates with their weight agree with the uniform orientations to 0.01",
        format!("{off:.1e}"),
        off < 0.01,
    );
    settled.add(report, ["equal steps, as printed", "equal_steps"], 1, bare);
    settled.add(report, ["equal steps, weight sin theta", "equal_steps_weighted"], 2, weighted);
    (printed, printed.spectral - finest)
}
