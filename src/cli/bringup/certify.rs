//! `hbot rig certify`: one page about what a rig is and does. Each figure has its interval and says
//! how it was measured, and what was not measured says so.

mod latency;
mod page;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::SystemTime;

use anyhow::{Context as _, bail};
use clap::Args;
use hbot_config::advice::{StiffnessBound, USUAL_DAMPING};
use hbot_config::{Override, RigConfig};
use hbot_core::Vec3;
use hbot_core::design::kinematics::Posture;
use hbot_core::design::rig::OdometryMethod;
use hbot_identify::compare::Geometry;
use hbot_identify::identify::{Identified, Name};
use hbot_identify::motors::{Measured, MotorName};
use hbot_identify::{What, identify};
use hbot_plot::{Lines, Series, short};
use hbot_sim::wander::{Built, Wander};
use serde_json::json;

use self::latency::Latency;
use self::page::Page;
use super::identify::motors::{self, Motion};
use super::identify::{filed, read};
use super::{edit, joint_name};
use crate::cli::out::{WrongLine, say, tell};
use crate::cli::progress::Progress;

/// Number of turns over which the drift is computed, the time of each, s, and the time between two
/// readings, s.
const TURNS: usize = 10;
const TURN_S: f64 = 4.0;
const READING_S: f64 = 1.0e-3;
/// What stands in place of a figure that was not measured.
const NOT: &str = "not measured";
/// How recordings are given.
const RUNS: &str = "`hbot rig certify RIG.toml RUN.mcap`";

/// Options of `hbot rig certify`.
#[derive(Debug, Args)]
pub(crate) struct CertifyArgs {
    /// The rig file (TOML), unless --rig names it
    #[arg(value_name = "RIG.toml", required_unless_present = "rig")]
    rig_file: Option<PathBuf>,
    /// Recordings (MCAP) of this rig by `hbot server --record`: with motors off and a hand that
    /// turns the sphere for the geometry; of any use for the latency
    #[arg(value_name = "RUN.mcap")]
    runs: Vec<PathBuf>,
    /// The rig file (TOML), as an option
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
    /// Let the motors move the free sphere as well, as `hbot rig identify --motors` does, for
    /// torque accuracy and friction. No server may hold the rig
    #[arg(long)]
    motors: bool,
    #[command(flatten)]
    motion: Motion,
    /// `sim` for the simulated rig, or a serial device, in place of the rig file's port
    #[arg(long, value_name = "sim|DEVICE", requires = "motors")]
    port: Option<String>,
    /// Folder for certificate.md, certificate.html and the plots
    #[arg(long, value_name = "DIR", default_value = "certificate")]
    out: PathBuf,
    /// Write the rig file with the name of this certificate, which recordings then contain, to this
    /// file; it can be the rig file itself
    #[arg(long, value_name = "FILE")]
    write: Option<PathBuf>,
}

/// Everything that was measured.
struct Known {
    rig: RigConfig,
    geometry: Result<Identified, String>,
    latency: Latency,
    /// Whether a recording is of the simulated rig.
    simulated: bool,
    motors: Result<Measured, String>,
}

impl CertifyArgs {
    /// Returns the rig file and the recordings. With `--rig`, all that stands without an option are
    /// recordings.
    fn files(&self) -> anyhow::Result<(&Path, Vec<PathBuf>)> {
        let first = self.rig_file.as_ref();
        let rig = self.rig.as_ref().or(first).context("no rig file is named")?;
        let twice =
            first.filter(|file| self.rig.is_some() && file.extension().is_some_and(|end| end == "toml"));
        if let Some(file) = twice {
            bail!(WrongLine(format!("{} cannot be used with --rig: name one rig file", file.display())));
        }
        let runs = first.filter(|_| self.rig.is_some()).into_iter().chain(&self.runs);
        Ok((rig, runs.cloned().collect()))
    }
}

pub(crate) fn run_certify(args: &CertifyArgs) -> anyhow::Result<ExitCode> {
    let (file, runs) = args.files()?;
    // Before the motors move.
    Page::refuse_another(&args.out)?;
    if let Some(write) = &args.write {
        edit::refuse_another(write)?;
    }
    let over =
        args.port.as_ref().map(|port| Override { path: "link.port", value: json!(port), from: "--port" });
    let rig = crate::cli::rig_file::load(Some(file), over.as_slice())?;
    let (geometry, latency, simulated) = recorded(&rig, &runs)?;
    let motors = if args.motors {
        motors::measured(&rig, &args.motion)?
    } else {
        Err("`hbot rig certify --motors` measures it".to_owned())
    };
    let known = Known { rig, geometry, latency, simulated, motors };
    let text = hbot_config::read_text(file).with_context(|| file.display().to_string())?;
    let date = hbot_server::flight::utc(SystemTime::now());
    let name = format!("{date}, rig file {:08x}", crc32fast::hash(text.as_bytes()));
    let page = page_of(&known, file, &name)?;
    page.write(&args.out)?;
    let (with, without) = page.measured();
    let lacking: usize = without.iter().map(|(_, names)| names.len()).sum();
    tell!("{with} figures have a value, {lacking} are {NOT}")?;
    for (why, names) in without {
        tell!("  {}: {why}", names.join("; "))?;
    }
    for file in page::FILES.map(|file| args.out.join(file)).iter().filter(|file| file.exists()) {
        say!("{}: written", file.display())?;
    }
    if let Some(write) = &args.write {
        let mut document = edit::open(Some(file))?;
        edit::put(document.as_item_mut(), "certificate", name.into());
        edit::save(&document, write)?;
        say!("{}: written", write.display())?;
    }
    let failed = args.motors && known.motors.is_err() || !runs.is_empty() && known.geometry.is_err();
    Ok(if failed { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// Reads what recordings show: the geometry, or why there is none, the latency, and whether one is
/// of the simulated rig.
fn recorded(
    rig: &RigConfig,
    runs: &[PathBuf],
) -> anyhow::Result<(Result<Identified, String>, Latency, bool)> {
    let mut progress = Progress::new();
    let mut recordings = Vec::new();
    let mut latency = Latency::default();
    for run in runs {
        recordings.push(read(run, rig, &mut progress)?);
        latency.read(run)?;
    }
    if runs.is_empty() {
        return Ok((Err(format!("it needs recordings: {RUNS}")), latency, false));
    }
    let mut fitting = |step, most| progress.show(|_| format!("fitting: step {step} of at most {most}"));
    let simulated = recordings.iter().any(|recording| recording.simulated);
    let found = identify(&rig.rig, &recordings, What::Geometry, &mut fitting);
    let found = match found {
        Ok(found) if found.what == What::Geometry => Ok(found),
        Ok(_) => Err("the recordings are too short for the geometry".to_owned()),
        Err(refusal) => Err(refusal.to_string()),
    };
    Ok((found, latency, simulated))
}

fn page_of(known: &Known, file: &Path, name: &str) -> anyhow::Result<Page> {
    let rig = &known.rig;
    let mut page = Page::new(&format!("Certificate of {}", rig.name));
    let simulated = match (rig.link.port.is_simulated(), known.simulated) {
        (true, _) => " The rig is SIMULATED.",
        (false, true) => " A recording is of the SIMULATED rig: its figures say nothing about the real one.",
        (false, false) => "",
    };
    page.say(&format!(
        "{name} (CRC-32 of {}), hbot {}. \"95 %, ±\" is half the width of the interval that holds the truth in 95 % of the cases.{simulated}",
        file.display(),
        env!("CARGO_PKG_VERSION"),
    ));
    geometry(&mut page, known);
    torque(&mut page, known);
    inertia_and_stiffness(&mut page, known, file)?;
    times(&mut page, known);
    Ok(page)
}

/// The geometry: what the recordings say of the values in the rig file, and the drift that follows.
fn geometry(page: &mut Page, known: &Known) {
    page.heading("Geometry");
    let how = "counts of a hand's turns, motors off (docs/identify.md)";
    let found = match &known.geometry {
        Ok(found) => found,
        Err(why) => {
            page.table(
                &["figure", "value", "how"],
                vec![
                    vec!["axes, cones, toes, radii, zeros".into(), NOT.into(), why.clone()],
                    vec!["drift in a turn".into(), NOT.into(), why.clone()],
                ],
            );
            return;
        }
    };
    let mut rows = Vec::new();
    for value in &found.values {
        let of = value
            .wheel
            .map_or_else(|| "sphere".to_owned(), |wheel| format!("wheel {}", known.rig.wheels[wheel]));
        let (factor, unit) = match value.name {
            Name::Axis(_) => (1.0, ""),
            Name::Cone | Name::Toe | Name::Zero => (1.0e3, "mrad"),
            Name::Radius | Name::Centre(_) => (1.0e3, "mm"),
        };
        let number = |x: f64| format!("{:.4}", factor * x);
        let more = filed(&known.rig, value);
        rows.push(vec![
            format!("{of}, {}{}{unit}", value.name, if unit.is_empty() { "" } else { ", " }),
            number(value.drawn + more),
            number(value.found + more),
            number(value.interval),
            if value.seen { how.to_owned() } else { "hardly seen: turn longer about all axes".to_owned() },
        ]);
    }
    page.table(&["figure", "rig file", "found", "95 %, ±", "how"], rows);
    let Some(drift) = Drift::of(&known.rig, found) else { return };
    let mrad = |angle: f64| format!("{:.2} mrad", 1e3 * angle);
    page.table(&["figure", "value", "how"], vec![
        vec![
            "drift in a turn".into(),
            mrad(drift.after(1)),
            "the rig file's geometry against the one found, over a turn about an axis at random; computed".into(),
        ],
        vec![format!("drift in {TURNS} turns"), mrad(drift.after(TURNS)), "the same".into()],
        vec![
            "error of a stiffness, worst direction".into(),
            format!("{:.2} %", 100.0 * drift.stiffness),
            "by the geometry alone, over all postures; computed".into(),
        ],
    ]);
    let series = vec![Series::new("rig file against found", drift.points, 0)];
    let lines = Lines::new("Drift of the orientation", "turns", "drift, mrad", series);
    page.plot("drift", "What the orientation drifts if the geometry found is the true one", lines.svg());
}

/// What the orientation drifts, and how wrong a stiffness is, if the geometry that was found is the
/// true one.
struct Drift {
    /// Number of turns, and drift, mrad.
    points: Vec<(f64, f64)>,
    stiffness: f64,
}

impl Drift {
    fn of(rig: &RigConfig, found: &Identified) -> Option<Self> {
        let device = &rig.rig.device;
        let specs = &found.wheels;
        let real = hbot_core::Device::new(device.sphere_radius(), device.sphere_mass(), specs).ok()?;
        let n = specs.len();
        let ours = Geometry { device: *device, zeros: vec![0.0; n] };
        let truth = Geometry { device: real, zeros: found.zeros.clone() };
        let built = Built { device: real, zeros: found.zeros.clone() };
        let turns = Wander::turns(1, TURNS, TURN_S);
        let count = (TURNS as f64 * TURN_S / READING_S) as usize;
        let (mut counts, mut orientations) = (Vec::new(), Vec::new());
        for moment in turns.course(&built.device, READING_S).take(count + 1) {
            let mut now = [0; hbot_core::MAX_JOINTS];
            for (j, now) in now.iter_mut().enumerate().take(2 * n) {
                let zero = if j % 2 == 0 { built.zeros[j / 2] } else { 0.0 };
                *now = ((moment.angles[j] - zero) / rig.rig.joints[j].radians_per_count()).round() as i32;
            }
            counts.push(now);
            orientations.push(moment.q);
        }
        let computed = ours.orientations(&rig.rig, OdometryMethod::Midpoint, &counts);
        let drift = ours.drift(&truth, &computed, &orientations);
        let each = (TURN_S / READING_S) as usize;
        let points = (0..=4 * TURNS).map(|k| (0.25 * k as f64, 1e3 * drift[k * each / 4])).collect();
        Some(Self { points, stiffness: ours.stiffness_error(&truth) })
    }

    /// Returns the drift after so many turns, rad.
    fn after(&self, turns: usize) -> f64 {
        1.0e-3 * self.points[4 * turns].1
    }
}

/// Torque constants and friction.
fn torque(page: &mut Page, known: &Known) {
    page.heading("Torque and friction");
    let rig = &known.rig;
    let measured = match &known.motors {
        Ok(measured) => measured,
        Err(why) => {
            let not = |what: &str| vec![what.to_owned(), NOT.to_owned(), why.clone()];
            page.table(
                &["figure", "value", "how"],
                vec![not("torque accuracy"), not("friction of joints and sphere"), not("imbalance, cogging")],
            );
            return;
        }
    };
    let how = "motion by the motors; inertia of the sphere from its mass";
    let mut rows = Vec::new();
    let mut worst = (0.0_f64, 0.0);
    for value in &measured.values {
        let of = value.joint.map_or_else(|| "sphere".to_owned(), |j| joint_name(rig, j));
        let (factor, unit) = match value.name {
            MotorName::TorqueScale | MotorName::Loss => (1.0, ""),
            MotorName::Inertia => (1.0e6, ", 1e-6 kg m²"),
            MotorName::Viscous => (1.0e3, ", mN m s/rad"),
            MotorName::Coulomb | MotorName::Imbalance(_) | MotorName::Cogging(_) => (1.0e3, ", mN m"),
        };
        if value.name == MotorName::TorqueScale {
            let off = (value.found / value.filed - 1.0).abs();
            if off >= worst.0 {
                worst = (off, value.interval / value.filed);
            }
        }
        let number = |x: f64| format!("{:.4}", factor * x);
        rows.push(vec![
            format!("{of}: {}{unit}", value.name),
            number(value.filed),
            number(value.found),
            number(value.interval),
            if value.seen { how.to_owned() } else { "hardly seen".to_owned() },
        ]);
    }
    page.table(
        &["figure", "value", "95 %, ±", "how"],
        vec![vec![
            "error of a joint's torque, worst joint".into(),
            format!("{:.2} %", 100.0 * worst.0),
            format!("{:.2} %", 100.0 * worst.1),
            "torque constant found against the rig file's".into(),
        ]],
    );
    page.table(&["figure", "rig file", "found", "95 %, ±", "how"], rows);
    let back = BackDriving::of(rig, measured);
    page.table(
        &["figure", "value", "how"],
        vec![
            vec![
                "torque to turn the sphere, mean (most)".into(),
                format!("{:.2} ({:.2}) mN m", 1e3 * back.plain[0], 1e3 * back.plain[1]),
                "from the friction found, over postures and axes; computed".into(),
            ],
            vec![
                "the same with what the rig file feeds forward".into(),
                format!("{:.2} ({:.2}) mN m", 1e3 * back.fed[0], 1e3 * back.fed[1]),
                "friction found less the part that is fed forward; computed".into(),
            ],
        ],
    );
}

/// The torque that turns the sphere slowly: mean and most over postures and axes, N m.
struct BackDriving {
    plain: [f64; 2],
    fed: [f64; 2],
}

impl BackDriving {
    fn of(rig: &RigConfig, measured: &Measured) -> Self {
        let (device, n) = (&rig.rig.device, rig.rig.device.joints());
        let fed = |j: usize| {
            rig.rig.compensation.map_or(0.0, |known| known.part * known.joints[j].friction.coulomb)
        };
        let sphere_fed = rig.rig.compensation.map_or(0.0, |known| known.part * known.sphere.coulomb);
        let mut sums = [[0.0_f64; 2]; 2];
        let mut count = 0.0;
        for k in 0..64_usize {
            let steer: Vec<f64> = (0..n / 2)
                .map(|i| {
                    std::f64::consts::TAU * ((k as f64 + 0.5) * 0.754_877_666_f64.powi(i as i32 + 1)).fract()
                })
                .collect();
            let posture = Posture::new(device, &steer);
            for axis in
                [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE.normalize(), Vec3::new(1.0, -1.0, 0.5).normalize()]
            {
                let torque = |coulomb: &dyn Fn(usize) -> f64, sphere: f64| {
                    sphere + (0..n).map(|j| coulomb(j) * posture.rows()[j].dot(axis).abs()).sum::<f64>()
                };
                let joint = |j: usize| measured.joints[j].friction.coulomb;
                let plain = torque(&joint, measured.sphere.coulomb);
                let left =
                    torque(&|j| (joint(j) - fed(j)).abs(), (measured.sphere.coulomb - sphere_fed).abs());
                for (sum, torque) in sums.iter_mut().zip([plain, left]) {
                    *sum = [sum[0] + torque, sum[1].max(torque)];
                }
                count += 1.0;
            }
        }
        let [plain, fed] = sums.map(|[sum, most]| [sum / count, most]);
        Self { plain, fed }
    }
}

/// The apparent inertia and the largest stable stiffness.
fn inertia_and_stiffness(page: &mut Page, known: &Known, file: &Path) -> anyhow::Result<()> {
    page.heading("Inertia and stiffness");
    let how = "computed from the rig file (docs/internals/borders.md)";
    let with = StiffnessBound::of(&known.rig);
    let over = Override { path: "loop.lead", value: json!(false), from: "the certificate" };
    let without = StiffnessBound::of(&crate::cli::rig_file::load(Some(file), &[over])?);
    let (Some(with), Some(without)) = (with, without) else {
        page.table(
            &["figure", "value", "how"],
            vec![vec![
                "apparent inertia, largest stable stiffness".into(),
                "not known".into(),
                "the inertias of the rig file contradict each other".into(),
            ]],
        );
        return Ok(());
    };
    let mut rows =
        vec![vec!["least apparent inertia".into(), format!("{:.3e} kg m²", with.inertia()), how.to_owned()]];
    let lead = with.sampled().lead;
    let mut series = Vec::new();
    for (colour, (name, bound)) in
        [("without the lead", &without), ("with the lead", &with)].into_iter().enumerate()
    {
        if colour == 1 && lead == 0.0 {
            rows.push(vec!["the same with the lead".into(), "no lead".into(), "`loop.lead` is off".into()]);
            continue;
        }
        let [most, damping] = bound.most();
        rows.push(vec![
            format!("largest stable stiffness at {USUAL_DAMPING} N m s/rad, {name}"),
            format!("{} N m/rad", short(bound.stable(USUAL_DAMPING))),
            how.to_owned(),
        ]);
        rows.push(vec![
            format!("largest stable stiffness at any damping, {name}"),
            format!("{} N m/rad, with {} N m s/rad", short(most), short(damping)),
            how.to_owned(),
        ]);
        let at = |k: u32| bound.most_damping() * f64::from(k) / 60.0;
        let points = (0..=60).map(|k| (at(k), bound.stable(at(k)))).filter(|(_, y)| y.is_finite()).collect();
        series.push(Series::new(name, points, colour));
    }
    rows.push(vec![
        "bandwidth of the torque (half the power)".into(),
        format!("{} Hz", short(bandwidth(known.rig.rig.timing.period_s(), known.rig.torque_lag))),
        "a period's hold and `torque_lag`; computed".into(),
    ]);
    rows.push(vec![
        "stiffness lines under a load".into(),
        NOT.into(),
        "they need weights on the sphere".into(),
    ]);
    page.table(&["figure", "value", "how"], rows);
    let lines = Lines::new("Border of stability", "damping, N m s/rad", "stiffness, N m/rad", series);
    page.plot("stiffness", "In small motions, springs below the line are stable", lines.svg());
    Ok(())
}

/// The latency.
fn times(page: &mut Page, known: &Known) {
    page.heading("Latency");
    let latency = &known.latency;
    if latency.ticks() == 0 {
        let rows = ["age of a reading", "lateness of a tick"].map(|what| {
            vec![what.to_owned(), NOT.to_owned(), format!("it needs a recording with readings: {RUNS}")]
        });
        page.table(&["figure", "value", "how"], rows.to_vec());
        return;
    }
    let how = format!("{} ticks of the recordings", latency.ticks());
    let period_s = known.rig.rig.timing.period_s();
    let row = |what: &str, of: [f64; 4]| {
        let mut row = vec![what.to_owned()];
        row.extend(of.map(|s| format!("{:.3} ms", 1e3 * s)));
        row.push(how.clone());
        row
    };
    let rows = vec![
        row("from a reading's command to the tick that uses it", latency.age()),
        row("lateness of a tick", latency.lateness()),
        row(
            "from a reading to its torque: both, and the lag of the motors in the rig file",
            latency.whole(known.rig.torque_lag),
        ),
    ];
    page.table(&["figure", "median", "95 %", "99.9 %", "most", "how"], rows);
    let [usual, _, most, _] = latency.whole(known.rig.torque_lag).map(|s| short(quarter(s, period_s)));
    page.table(
        &["figure", "value", "how"],
        vec![vec![
            "frequency at which the torque is a quarter of a turn late".into(),
            format!("{usual} Hz, {most} Hz in one of a thousand ticks"),
            "from the latency above and half a period, for which the torque is held; computed".into(),
        ]],
    );
    if latency.is_virtual() {
        page.say("The recording is of virtual time, in which no tick is late.");
    }
}

/// Returns the frequency at which half the power of a torque is left that is held for `period_s`
/// and made with the time constant `lag_s`, Hz.
fn bandwidth(period_s: f64, lag_s: f64) -> f64 {
    let power = |hz: f64| {
        let half = std::f64::consts::PI * hz * period_s;
        (half.sin() / half).powi(2) / (1.0 + (std::f64::consts::TAU * hz * lag_s).powi(2))
    };
    // It falls up to the rate of the loop.
    let (mut low, mut high) = (1.0e-3 / period_s, 1.0 / period_s);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if power(middle) > 0.5 { low = middle } else { high = middle }
    }
    low
}

/// Returns the frequency of which `latency_s` and the half of `period_s` are a quarter, Hz.
fn quarter(latency_s: f64, period_s: f64) -> f64 {
    0.25 / (latency_s + 0.5 * period_s)
}
