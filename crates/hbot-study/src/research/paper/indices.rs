//! Conditioning of the rig over its workspace (section V): the global indices GCI and GMI, for
//! every possible reading of the paper.

use hbot_config::RigConfig;
use hbot_core::{Device, Mat3, Quat};
use hbot_sim::plant::{Plant, PlantState};

use super::torus::{self, CHOICES, MOTORS, Motors, mean, posture};
use super::turns::Turns;
use super::{grids, readings, so3, start_map};
use crate::context::Context;
use crate::report::{Report, head, row};
use crate::threads;

/// Steer angles at which the paper's turns begin, rad. The paper gives none. We use zero, because
/// the paper sets up its rig with both wheels at zero.
pub(super) const START: [f64; 2] = [0.0; 2];
/// The global conditioning index (GCI) that the paper reports, which is a mean over the workspace
/// (section V.D).
pub(super) const PAPER_GCI: f64 = 0.41;
/// The global manipulability index (GMI) that the paper reports, which is a mean over the workspace
/// relative to the largest value (section V.D).
pub(super) const PAPER_GMI: f64 = 0.5;

/// Conditioning and manipulability of the rig for one choice of motors, either at one posture or as
/// means over many.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Local {
    pub(super) spectral: f64,
    pub(super) frobenius: f64,
    /// Dynamic manipulability, 1/(kg m²)³, not yet divided by its largest value.
    pub(super) dynamic: f64,
}

/// A device with precomputed data, so that its indices can be computed quickly at many postures.
pub(super) struct IndexedDevice {
    pub(super) device: Device,
    plant: Plant,
    turns: Turns,
}

impl IndexedDevice {
    pub(super) fn new(device: Device) -> Self {
        let Ok(plant) = Plant::new(&device) else {
            unreachable!("the inertias of the device's wheels are possible")
        };
        Self { device, plant, turns: Turns::new(&device) }
    }

    /// Returns the determinant of the apparent inertia I_s I + Gᵀ J_q G at the steer angles `th`,
    /// (kg m²)³.
    pub(super) fn inertia(&self, th: [f64; 2]) -> f64 {
        let mut state = PlantState::default();
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

    /// Returns the steer angles after the rig has turned the sphere about one axis from the
    /// identity to the orientation `q`, as in the paper, in rad. `start` are the steer angles
    /// before the turn, rad.
    pub(super) fn arrived(&self, q: Quat, start: [f64; 2]) -> [f64; 2] {
        self.turns.to(q, start)
    }

    /// Returns the mean indices over all postures, for each choice of motors. The torus of steer
    /// angles is divided into `cells` by `cells` equal cells.
    pub(super) fn over_torus(&self, cells: usize, choices: &[Motors]) -> Vec<Local> {
        let all = torus::over(cells, |th| self.local(th, choices));
        weighed(all.into_iter().map(|locals| (locals, 1.0)), choices.len())
    }

    /// Returns the weighted mean indices over the orientations in `samples`, for each choice of
    /// motors. The posture at each orientation is the one after a turn of the sphere that began
    /// with the steer angles `start`.
    pub(super) fn over_turns(
        &self,
        samples: &[(Quat, f64)],
        start: [f64; 2],
        choices: &[Motors],
    ) -> Vec<Local> {
        let each = |&(q, weight): &(Quat, f64)| (self.local(self.arrived(q, start), choices), weight);
        weighed(threads::map(samples, each), choices.len())
    }

    /// Returns the global conditioning index (GCI) of `motors`: the mean spectral index over the
    /// orientations in `samples`. The posture at each orientation is the one after a turn of the
    /// sphere that began with the steer angles `start`.
    pub(super) fn gci(&self, samples: &[Quat], start: [f64; 2], motors: &Motors) -> f64 {
        let each = |q: &Quat| motors.indices(&posture(&self.device, self.arrived(*q, start))).spectral;
        mean(samples.iter().map(each))
    }

    /// Returns the largest dynamic manipulability of `motors` over all steer angles.
    pub(super) fn most_dynamic(&self, motors: &Motors) -> f64 {
        let negative = |th| -motors.determinant(&posture(&self.device, th)).abs() / self.inertia(th);
        -torus::least(48, negative).1
    }
}

/// Returns the weighted means of the indices for each choice of motors. Each entry of `all` holds
/// the indices at one posture, for each choice, and the weight of this posture.
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

pub(super) fn study(context: &Context, report: &mut Report) {
    context.part("conditioning over the torus");
    introduce(report);
    let rig = IndexedDevice::new(RigConfig::prototype().rig.device);
    let cells = if context.quick { 96 } else { 256 };
    let level = if context.quick { 3 } else { 4 };
    let over_torus = rig.over_torus(cells, &CHOICES);
    let most: Vec<f64> = CHOICES.iter().map(|motors| rig.most_dynamic(motors)).collect();
    context.part("conditioning over SO(3)");
    let samples: Vec<(Quat, f64)> = so3::uniform(level).map(|q| (q, 1.0)).collect();
    report.say(&format!(
        "Here on {cells} by {cells} cells of the torus and at {} orientations. In the ids, {MOTORS}.",
        so3::count(level)
    ));
    let over_so3 = rig.over_turns(&samples, START, &CHOICES);
    global(report, &over_torus, &over_so3, &most);
    local(report, &rig, &most);
    let three = [over_torus[1], over_so3[1]];
    let printed = grids::study(context, report, &rig, &samples, (cells, level), three);
    let starts = start_map::study(context, report, &rig, (START, three[1].spectral));
    let wheels = readings::radius(context, report);
    let known = Known { three, four: [over_torus[0], over_so3[0]], printed, most: [most[0], most[1]] };
    readings::study(context, report, &rig, &known);
    explain(report, &known, &wheels, starts);
}

fn introduce(report: &mut Report) {
    report.heading("Conditioning and dynamic manipulability (section V)");
    report.say(
        "LCI is sigma_min/sigma_max of G (*spectral*), or 3/sqrt(sum sigma² sum sigma⁻²) (*Frobenius*, eq. 17 and 18 with W = I/3); dynamic manipulability is \
         |det G_3|/det(I_s I + Gᵀ J_q G) for three motors (eq. 20), with sqrt(det GᵀG) for all four. GCI and GMI are means of LCI and of dynamic manipulability \
         over its largest value, over a workspace: the uniform **torus** of steering angles, or **SO(3)** the paper's way: the rig turns the sphere from a fixed start \
         (both wheels at zero) about the axis of the rotation to each orientation, and the posture is where it arrives. Orientations are spread evenly: HEALPix points of \
         equal area times equal steps of psi.",
    );
    report.family("gci_{motors}_{norm}_{workspace} | 1 | global conditioning index; {norm}: spectral or frobenius; {workspace}: torus, or so3 the paper's way from steering angles of zero");
    report.family("gmi_{motors}_{workspace} | 1 | global dynamic manipulability index, over the largest of the torus; {workspace} likewise");
}

/// Reports the global conditioning index (GCI) and the global manipulability index (GMI) of each
/// choice of motors, over all steer angles and over all orientations. GMI is the mean dynamic
/// manipulability divided by its largest value, which `most` holds for each choice.
fn global(report: &mut Report, over_torus: &[Local], over_so3: &[Local], most: &[f64]) {
    let mut table = vec![head(
        "motors | GCI spectral, torus | SO(3) | GCI Frobenius, torus | SO(3) | GMI, torus | SO(3)",
    )];
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
}

/// Reports the indices that are not ratios, over all steer angles: the smallest and the median
/// manipulability, and the largest dynamic manipulability.
fn local(report: &mut Report, rig: &IndexedDevice, most: &[f64]) {
    report.family("manipulability_{motors}_{statistic} | 1 | 1/(sigma_1 sigma_2 sigma_3) of G over the torus; {statistic}: least, median");
    report.family("dynamic_manipulability_{motors}_largest | 1/(kg m²)³ | largest dynamic manipulability over the torus, what GMI is divided by");
    let mut table =
        vec![head("motors | manipulability, least | median | dynamic manipulability, largest, 1/(kg m²)³")];
    for (motors, most) in CHOICES.iter().zip(most) {
        let value = |th| motors.indices(&posture(&rig.device, th)).manipulability;
        let mut all = torus::over(64, value);
        all.sort_by(f64::total_cmp);
        let median = 0.5 * (all[all.len() / 2 - 1] + all[all.len() / 2]);
        let least = torus::least(64, value).1;
        report.figure(format!("manipulability_{}_least", motors.id), least);
        report.figure(format!("manipulability_{}_median", motors.id), median);
        report.figure(format!("dynamic_manipulability_{}_largest", motors.id), *most);
        table.push(row([motors.name, &sci(least), &sci(median), &sci(*most)]));
    }
    report.say(
        "Manipulability, 1/(sigma_1 sigma_2 sigma_3) of G, grows without bound towards a singularity, which is why the paper prefers LCI:",
    );
    report.table(&table);
}

/// Formats a number for a table, with three significant digits.
fn sci(value: f64) -> String {
    format!("{value:.2e}")
}

/// The indices in this project's interpretation of the paper, with which other interpretations are
/// compared.
pub(super) struct Known {
    /// Mean indices for three motors: first over all steer angles, then over all orientations.
    pub(super) three: [Local; 2],
    /// Mean indices for all four motors: first over all steer angles, then over all orientations.
    pub(super) four: [Local; 2],
    /// Mean indices for three motors on the finest of the paper's grids, without weights.
    pub(super) printed: Local,
    /// Largest dynamic manipulability of four and of three motors.
    pub(super) most: [f64; 2],
}

/// Checks that the indices have the values that an independent program computed, and explains how
/// the paper's values of GCI and GMI probably arose. `wheels` is a sentence about the influence of
/// the wheel radius. `starts` is the range of the mean conditioning index (GCI) over all steer
/// angles at which the turns can begin.
fn explain(report: &mut Report, known: &Known, wheels: &str, starts: [f64; 2]) {
    // From an independent program: physics notes, section 11.
    let mut within = |what: &str, value: f64, [low, high]: [f64; 2]| {
        let holds = (low..=high).contains(&value);
        report.check(format!("{what} is {low:.3} to {high:.3}"), format!("{value:.4}"), holds);
    };
    let Known { three, four, printed, most } = known;
    let gmi = [three.map(|local| local.dynamic / most[1]), four.map(|local| local.dynamic / most[0])];
    within("GCI, three motors, spectral, over the torus", three[0].spectral, [0.400, 0.410]);
    within("GCI, four motors, spectral, over the torus", four[0].spectral, [0.641, 0.651]);
    within("GCI, three motors, spectral, over SO(3)", three[1].spectral, [0.415, 0.430]);
    within("GCI, four motors, spectral, over SO(3)", four[1].spectral, [0.673, 0.687]);
    within("GCI, three motors, Frobenius, over the torus", three[0].frobenius, [0.655, 0.665]);
    within("GMI, three motors, over the torus", gmi[0][0], [0.620, 0.630]);
    report.compare(
        "GCI (V.D)",
        "0.41",
        format!(
            "{:.3} over the torus, {:.3} the paper's way (three motors, spectral); all four {:.3} and {:.3}",
            three[0].spectral, three[1].spectral, four[0].spectral, four[1].spectral
        ),
        format!(
            "The norm that the paper states is Frobenius; it gives {:.2} ({:.2} the paper's way). The spectral index of the three motors that the paper gives torques of comes nearest. The rest \
             hangs on what it does not give: {wheels}; other starts, {:.3} to {:.3}; its own grid, which is not uniform, {:.3}.",
            three[0].frobenius, three[1].frobenius, starts[0], starts[1], printed.spectral
        ),
    );
    report.compare(
        "GMI (V.D)",
        "0.5",
        format!(
            "{:.3} over the torus, {:.3} the paper's way (three motors); all four {:.3} and {:.3}",
            gmi[0][0], gmi[0][1], gmi[1][0], gmi[1][1]
        ),
        "The paper gives neither joint inertias nor which Jacobian. No likely inertia brings it to 0.5; another reading of eq. 20 or another grid moves it as far. A mean over the largest value \
         found hangs on that one posture.",
    );
}
