//! How well the rig is conditioned over its workspace (section V): GCI and GMI, by every reading of it that is open.

use hbot_config::RigConfig;
use hbot_core::{Device, Mat3, Quat, WheelSpec, rotation};
use hbot_sim::plant::{Plant, State};

use super::comparison::Comparison;
use super::torus::{self, CHOICES, FOUR, MOTORS, Motors, THREE, mean, posture};
use super::turns::{Turns, stepped};
use super::{so3, start_map};
use crate::context::{Context, Interrupted};
use crate::plot::{Lines, Series, short};
use crate::report::{Report, row};
use crate::rng::Rng;

/// The steering angles that the paper's turns begin at, rad: the paper names none, and its rig is set up with both wheels at zero.
const START: [f64; 2] = [0.0; 2];
/// The paper's global indices (section V.D).
const PAPER_GCI: f64 = 0.41;
const PAPER_GMI: f64 = 0.5;

/// What is read at one posture of one choice of motors.
#[derive(Debug, Clone, Copy, Default)]
struct Local {
    spectral: f64,
    frobenius: f64,
    /// Dynamic manipulability, 1/(kg m²)³, not yet divided by its largest.
    dynamic: f64,
}

/// A device ready for many postures.
pub(super) struct Rig {
    device: Device,
    plant: Plant,
    turns: Turns,
}

impl Rig {
    pub(super) fn new(device: Device) -> Self {
        let Ok(plant) = Plant::new(&device) else { unreachable!("wheels without an inertia of their own") };
        Self { device, plant, turns: Turns::new(&device) }
    }

    /// det of the apparent inertia I_s I + Gᵀ J_q G, (kg m²)³.
    fn inertia(&self, th: [f64; 2]) -> f64 {
        let mut state = State::default();
        state.steer[..2].copy_from_slice(&th);
        Mat3::determinant(&self.plant.apparent_inertia(&state))
    }

    fn local(&self, th: [f64; 2], choices: &[Motors]) -> Vec<Local> {
        let (posture, inertia) = (posture(&self.device, th), self.inertia(th));
        let each = |motors: &Motors| {
            let indices = motors.indices(&posture);
            let dynamic = motors.determinant(&posture).abs() / inertia;
            Local { spectral: indices.spectral, frobenius: indices.frobenius, dynamic }
        };
        choices.iter().map(each).collect()
    }

    /// Where the paper's way to `q` ends, from `start`.
    fn arrived(&self, q: Quat, start: [f64; 2]) -> [f64; 2] {
        self.turns.to(q, start)
    }

    /// Means over the torus at `cells` by `cells` even cells, a choice each.
    fn over_torus(&self, cells: usize, choices: &[Motors]) -> Vec<Local> {
        let all = torus::over(cells, |th| self.local(th, choices));
        weighed(all.into_iter().map(|locals| (locals, 1.0)), choices.len())
    }

    /// Means over orientations with their weights, each turned to from `start`.
    fn over_turns(&self, samples: &[(Quat, f64)], start: [f64; 2], choices: &[Motors]) -> Vec<Local> {
        let part = |from: usize, to: usize| -> Vec<_> {
            let each = |&(q, weight): &(Quat, f64)| (self.local(self.arrived(q, start), choices), weight);
            samples[from..to].iter().map(each).collect()
        };
        weighed(torus::in_two(samples.len(), part), choices.len())
    }

    /// GCI of `motors` by the spectral index over orientations, from `start`.
    pub(super) fn gci(&self, samples: &[Quat], start: [f64; 2], motors: &Motors) -> f64 {
        let each = |q: &Quat| motors.indices(&posture(&self.device, self.arrived(*q, start))).spectral;
        mean(samples.iter().map(each))
    }

    /// The largest dynamic manipulability over all steering angles.
    fn most_dynamic(&self, motors: &Motors) -> f64 {
        let negative = |th| -motors.determinant(&posture(&self.device, th)).abs() / self.inertia(th);
        -torus::least(48, negative).1
    }
}

/// Weighed means, a choice each.
fn weighed(all: impl IntoIterator<Item = (Vec<Local>, f64)>, choices: usize) -> Vec<Local> {
    let mut sums = vec![Local::default(); choices];
    let mut whole = 0.0;
    for (locals, weight) in all {
        whole += weight;
        for (sum, local) in sums.iter_mut().zip(&locals) {
            sum.spectral += weight * local.spectral;
            sum.frobenius += weight * local.frobenius;
            sum.dynamic += weight * local.dynamic;
        }
    }
    let over = |sum: Local| Local {
        spectral: sum.spectral / whole,
        frobenius: sum.frobenius / whole,
        dynamic: sum.dynamic / whole,
    };
    sums.into_iter().map(over).collect()
}

/// The prototype with other wheels.
fn changed(change: impl Fn(WheelSpec) -> WheelSpec) -> Device {
    let device = RigConfig::prototype().rig.device;
    let specs: Vec<WheelSpec> = device.wheels().iter().map(|wheel| change(*wheel.spec())).collect();
    let made = Device::new(device.sphere_radius(), device.sphere_mass(), &specs);
    made.unwrap_or_else(|error| unreachable!("radius and inertia make nothing singular: {error}"))
}

pub(super) fn study(
    context: &Context,
    report: &mut Report,
    comparison: &mut Comparison,
) -> Result<(), Interrupted> {
    context.part("conditioning over the torus")?;
    report.heading("Conditioning and dynamic manipulability (section V)");
    report.say(
        "LCI is sigma_min/sigma_max of G (*spectral*), or 3/sqrt(sum sigma² sum sigma⁻²) (*Frobenius*, eq. 17 and 18 with W = I/3); dynamic manipulability is \
         |det G_3|/det(I_s I + Gᵀ J_q G) for three motors (eq. 20), with sqrt(det GᵀG) for all four. GCI and GMI are means of LCI and of dynamic manipulability \
         over its largest value, over a workspace: the uniform **torus** of steering angles, or **SO(3)** the paper's way: the rig turns the sphere from a fixed start \
         (both wheels at zero) about the axis of the rotation to each orientation, and the posture is where it arrives. Orientations are spread evenly: HEALPix points of \
         equal area times equal steps of psi.",
    );
    report.family(
        "gci_{motors}_{norm}_{workspace}",
        "1",
        "global conditioning index; {norm}: spectral or frobenius; {workspace}: torus, or so3 the paper's way from steering angles of zero",
    );
    report.family(
        "gmi_{motors}_{workspace}",
        "1",
        "global dynamic manipulability index, over the largest of the torus; {workspace} likewise",
    );
    report.say(&format!("In the ids, {MOTORS}."));
    let rig = Rig::new(RigConfig::prototype().rig.device);
    let cells = if context.quick { 96 } else { 256 };
    let level = if context.quick { 3 } else { 4 };
    let over_torus = rig.over_torus(cells, &CHOICES);
    let most: Vec<f64> = CHOICES.iter().map(|motors| rig.most_dynamic(motors)).collect();
    context.part("conditioning over SO(3)")?;
    let samples: Vec<(Quat, f64)> = so3::uniform(level).map(|q| (q, 1.0)).collect();
    let over_so3 = rig.over_turns(&samples, START, &CHOICES);
    let mut table = vec![row([
        "motors",
        "GCI spectral, torus",
        "SO(3)",
        "GCI Frobenius, torus",
        "SO(3)",
        "GMI, torus",
        "SO(3)",
    ])];
    for (k, motors) in CHOICES.iter().enumerate() {
        let mut cells = vec![motors.name.to_owned()];
        let both = [("torus", over_torus[k]), ("so3", over_so3[k])];
        for norm in ["spectral", "frobenius"] {
            for (workspace, local) in both {
                let value = if norm == "spectral" { local.spectral } else { local.frobenius };
                let figure = report.figure(format!("gci_{}_{norm}_{workspace}", motors.id), value);
                figure.note("paper", PAPER_GCI);
                cells.push(format!("{value:.3}"));
            }
        }
        for (workspace, local) in both {
            let value = local.dynamic / most[k];
            report.figure(format!("gmi_{}_{workspace}", motors.id), value).note("paper", PAPER_GMI);
            cells.push(format!("{value:.3}"));
        }
        table.push(cells);
    }
    report.table(&table);
    let three = (over_torus[1], over_so3[1]);
    explain(report, comparison, &over_torus, &over_so3, [most[0], most[1]]);
    converge(context, report, &rig, &samples, (cells, level), three)?;
    steps(report, &rig, context.quick);
    start_map::study(context, report, &rig, (START, three.1.spectral))?;
    radius(context, report)?;
    readings(report, &rig, three.0.dynamic / most[1], context.quick);
    Ok(())
}

/// The expectations, and what the paper's two figures are likely to be.
fn explain(report: &mut Report, comparison: &mut Comparison, torus: &[Local], so3: &[Local], most: [f64; 2]) {
    // From an independent program: physics notes, section 11.
    let mut within = |what: &str, value: f64, [low, high]: [f64; 2]| {
        let holds = (low..=high).contains(&value);
        report.check(format!("{what} is {low:.3} to {high:.3}"), format!("{value:.4}"), holds);
    };
    within("GCI, three motors, spectral, over the torus", torus[1].spectral, [0.400, 0.410]);
    within("GCI, four motors, spectral, over the torus", torus[0].spectral, [0.641, 0.651]);
    within("GCI, three motors, spectral, over SO(3)", so3[1].spectral, [0.419, 0.431]);
    within("GCI, four motors, spectral, over SO(3)", so3[0].spectral, [0.673, 0.687]);
    within("GMI, three motors, over the torus", torus[1].dynamic / most[1], [0.620, 0.630]);
    comparison.row(
        "GCI (V.D)",
        "0.41",
        format!(
            "{:.3} over the torus, {:.3} the paper's way (three motors, spectral); all four {:.3} and {:.3}",
            torus[1].spectral, so3[1].spectral, torus[0].spectral, so3[0].spectral
        ),
        format!(
            "The norm that the paper states is Frobenius; it gives {:.2} ({:.2} the paper's way). 0.41 is the spectral index of the three motors that the paper gives torques of; \
             start, wheel radius and grid, of which it gives none, move it by more than what is left.",
            torus[1].frobenius, so3[1].frobenius
        ),
    );
    comparison.row(
        "GMI (V.D)",
        "0.5",
        format!(
            "{:.3} over the torus, {:.3} the paper's way (three motors); all four {:.3} and {:.3}",
            torus[1].dynamic / most[1],
            so3[1].dynamic / most[1],
            torus[0].dynamic / most[0],
            so3[0].dynamic / most[0]
        ),
        "The paper gives no joint inertia and not which Jacobian; no likely inertia brings it to 0.5. A mean divided by the largest value found depends on that one posture.",
    );
}

/// How the means settle as grids are refined, and what the paper's grid makes of it.
fn converge(
    context: &Context,
    report: &mut Report,
    rig: &Rig,
    finest: &[(Quat, f64)],
    (cells, level): (usize, u8),
    (torus, so3): (Local, Local),
) -> Result<(), Interrupted> {
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
    let mut bare = Vec::new();
    let mut weighted = Vec::new();
    for &steps in steps {
        let samples: Vec<_> = so3::equal_steps(steps).collect();
        weighted.push((samples.len(), rig.over_turns(&samples, START, &three)[0].spectral));
        let samples: Vec<_> = samples.into_iter().map(|(q, _)| (q, 1.0)).collect();
        bare.push((samples.len(), rig.over_turns(&samples, START, &three)[0].spectral));
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
    Ok(())
}

/// That the closed form of a turn is what the kinematics, integrated, come to.
fn steps(report: &mut Report, rig: &Rig, quick: bool) {
    report.family(
        "turn_{steps}_steps_error_rad",
        "rad",
        "error of the steering angles after a turn in {steps} steps of zd = G w against the closed form, median over turns",
    );
    let mut rng = Rng(11);
    let turns: Vec<Quat> = (0..if quick { 100 } else { 500 })
        .map(|_| {
            let axis = hbot_core::Vec3::from_array(rng.direction());
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

/// How much of it hangs on the wheel radius, which the paper does not give.
fn radius(context: &Context, report: &mut Report) -> Result<(), Interrupted> {
    context.part("indices against the wheel radius")?;
    report.family(
        "gci_{motors}_spectral_{workspace}_r_{radius}um",
        "1",
        "the same with wheels of {radius} micrometres",
    );
    let choices = [THREE, FOUR];
    let level = if context.quick { 1 } else { 3 };
    let samples: Vec<_> = so3::uniform(level).map(|q| (q, 1.0)).collect();
    let mut series: Vec<Series> = Vec::new();
    for (colour, motors) in choices.iter().enumerate() {
        for (name, open) in [("SO(3)", false), ("torus", true)] {
            let name = format!("{}, {name}", if motors.id == THREE.id { "three motors" } else { "all four" });
            series.push(Series { name, points: Vec::new(), colour, open });
        }
    }
    for radius in [10_000_u32, 12_000, 14_000, 15_500, 17_000, 20_000, 25_000] {
        let r = f64::from(radius) * 1.0e-6;
        let rig = Rig::new(changed(|wheel| WheelSpec { radius: r, ..wheel }));
        let over = [rig.over_turns(&samples, START, &choices), rig.over_torus(64, &choices)];
        for (k, motors) in choices.iter().enumerate() {
            for (w, workspace) in ["so3", "torus"].iter().enumerate() {
                let value = over[w][k].spectral;
                report.figure(format!("gci_{}_spectral_{workspace}_r_{radius}um", motors.id), value);
                series[2 * k + w].points.push((1.0e3 * r, value));
            }
        }
        context.go_on()?;
    }
    report.say(
        "GCI against the wheel radius, which the paper does not give (table II implies 15.3 +- 0.5 mm):",
    );
    report.plot(
        "gci_radius",
        "GCI (spectral) against the wheel radius, over SO(3) the paper's way and over the torus",
        Lines {
            title: "GCI against the wheel radius".to_owned(),
            x: "wheel radius r, mm".to_owned(),
            y: "GCI, spectral".to_owned(),
            log: [false; 2],
            series,
            front: false,
        }
        .svg(),
    );
    Ok(())
}

/// What other readings of equations 20 to 22 give.
fn readings(report: &mut Report, rig: &Rig, ours: f64, quick: bool) {
    report.family(
        "gmi_reading_{reading}",
        "1",
        "GMI of the three motors over the torus by another reading of eq. 20: sphere_alone (no joint inertia), joint_space (J = G_3 with the inertia seen at the joints), and \
         inertia_low, inertia_high (joint inertias 3 times smaller and larger)",
    );
    let cells = if quick { 64 } else { 128 };
    let normal = |value: &(dyn Fn([f64; 2]) -> f64 + Sync)| {
        let most = -torus::least(48, |th| -value(th)).1;
        mean(torus::over(cells, value)) / most
    };
    let det = |rig: &Rig, th| THREE.determinant(&posture(&rig.device, th)).abs();
    let scaled = |by: f64| {
        let rig = Rig::new(changed(|wheel| WheelSpec {
            steer_inertia: by * wheel.steer_inertia,
            drive_inertia: by * wheel.drive_inertia,
            ..wheel
        }));
        normal(&|th| det(&rig, th) / rig.inertia(th))
    };
    let all = [
        ("sphere_alone", "M the sphere's inertia alone: |det G_3|", normal(&|th| det(rig, th))),
        (
            "joint_space",
            "J = G_3 with M as seen at the joints: |det G_3|³/det M",
            normal(&|th| det(rig, th).powi(3) / rig.inertia(th)),
        ),
        ("inertia_low", "as above, joint inertias 3 times smaller", scaled(1.0 / 3.0)),
        ("inertia_high", "joint inertias 3 times larger", scaled(3.0)),
    ];
    let mut table = vec![row(["reading of eq. 20", "GMI, three motors, torus"])];
    table.push(row(["|det G_3|/det(I_s I + Gᵀ J_q G), ours", &format!("{ours:.3}")]));
    for (id, name, value) in &all {
        report.figure(format!("gmi_reading_{id}"), *value).note("paper", PAPER_GMI);
        table.push(row([*name, &format!("{value:.3}")]));
    }
    let nearest = all.iter().map(|(_, _, value)| *value).chain([ours]);
    let nearest = nearest.min_by(|a, b| (a - PAPER_GMI).abs().total_cmp(&(b - PAPER_GMI).abs()));
    report.say(&format!(
        "GMI by other readings of eq. 20. With J the forward Jacobian (det 1/det G_3) and the inertia as seen at the joints the result is ours again; with the sphere's it has no largest value. \
         The nearest to the paper's 0.5 is {}.",
        short(nearest.unwrap_or(ours))
    ));
    report.table(&table);
}
