//! Studies of an Hbot. They measure what accuracy costs, what each effect costs, where stability
//! ends, how well the paper's results are reproduced, and what other designs could do.
//!
//! A study measures on the machine that it runs on and tests its own claims as checks. When it is
//! complete it writes one folder: `report.md`, `report.html` with the same content, SVG plots and
//! `summary.json`. A study that is stopped writes nothing.
//!
//! # Layers, top to bottom
//!
//! - `verification`: studies of this program.
//!   - `accuracy`: error against time for every stage with a choice of methods.
//!   - `effects`: the cost per tick of each effect and phenomenon.
//!   - `feel`: what the passivity stage changes for the hand, and which scenes shake with it.
//!   - `identify`: how well `hbot rig identify` finds the geometry of rigs that are not as drawn.
//!   - `stability`: how stiff a wall can be, and a simulated day of operation.
//!   - `lead`: what rendering the scene ahead of its reading changes.
//! - `research`: studies of the rig.
//!   - `paper`: every analysis and experiment of the paper.
//!   - `design`: the dimensions of a better Hbot.
//! - `report`, `computer`, `load`, `names`: the report, its description of the machine, how busy
//!   others kept the machine, and the ids of figures.
//! - `folder`: a study finds out at its start whether it can write its results.
//! - `whole`: the whole loop: controller, line and simulated rig in lock-step.
//! - `timing`, `context`, `rng`: time measurement, progress and interruption, random numbers.
//!
//! `verification` and `research` do not depend on each other. Plots are drawn by `hbot-plot`. The
//! true motions come from `hbot_sim::motion`. Every study is deterministic except for the times
//! that it measures.

mod computer;
mod context;
mod folder;
mod load;
mod names;
mod report;
mod research;
mod rng;
mod timing;
mod verification;
mod whole;

use std::path::{Path, PathBuf};
use std::time::Instant;

pub use context::Interrupt;
pub use report::{Check, Figure, Report};
pub use verification::callgrind::{Counter, count_worker};

use context::{Context, Interrupted};
use load::Load;
use research::{design, paper};
use verification::{accuracy, effects, feel, identify, lead, stability};

/// The available studies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Study {
    /// Computes error and computing time for every stage of the computation that offers a choice of
    /// methods.
    Accuracy,
    /// Measures the computing time per tick of each effect and each phenomenon.
    Effects,
    /// Measures what the passivity stage changes for the hand, and which scenes shake with it.
    Feel,
    /// Identifies random rigs that are not as drawn, and measures what their orientation drifts.
    Identify,
    /// Finds how stiff a virtual wall can be, and what stays constant over a simulated day.
    Stability,
    /// Finds what the lead changes: borders, walls, and readings that come late.
    Lead,
    /// Repeats every analysis and experiment of the paper, and compares the results with the values
    /// in the paper.
    Paper,
    /// Searches for the dimensions of a better Hbot.
    Design,
}

impl Study {
    /// Returns the study's name on the command line, which is also the name of its default folder.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Accuracy => "accuracy",
            Self::Effects => "effects",
            Self::Feel => "feel",
            Self::Identify => "identify",
            Self::Stability => "stability",
            Self::Lead => "lead",
            Self::Paper => "paper",
            Self::Design => "design",
        }
    }
}

/// Options that apply to every study.
#[derive(Debug, Clone, Default)]
pub struct StudyOptions {
    /// Folder for the results. It is created if it does not exist. `None` means
    /// `target/study/NAME`.
    pub out: Option<PathBuf>,
    /// Whether to use fewer samples. The study then takes about 30 s (`paper` and `design`: up to a
    /// minute) instead of up to 5 minutes.
    pub quick: bool,
    /// How to run this program again under callgrind, which counts its instructions. `None` if
    /// instructions cannot be counted.
    pub counter: Option<Counter>,
}

/// The reason why a study has no result.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// The study was asked to stop.
    #[error("stopped; nothing was written")]
    Interrupted,
    /// A file or folder of the results could not be written.
    #[error("{path}: {source}")]
    Write {
        /// Path of the file or folder.
        path: PathBuf,
        /// The error that the operating system reported.
        source: std::io::Error,
    },
}

impl From<Interrupted> for StudyError {
    fn from(_: Interrupted) -> Self {
        Self::Interrupted
    }
}

/// Runs `study` and writes its results. Returns the report and the folder that contains it.
///
/// # Errors
///
/// Fails if `interrupt` was raised during the study, or if the folder cannot be written. The latter
/// is found out before the study begins. A check that does not hold is not an error: see
/// [`Report::holds`].
pub fn run(
    study: Study,
    options: &StudyOptions,
    interrupt: &Interrupt,
) -> Result<(Report, PathBuf), StudyError> {
    let write = |(path, source)| StudyError::Write { path, source };
    let out = options.out.clone().unwrap_or_else(|| Path::new("target/study").join(study.name()));
    folder::check_writable(&out).map_err(write)?;
    let report = measure(study, options, interrupt)?;
    report.write(&out).map_err(write)?;
    Ok((report, out))
}

/// Runs `study` and returns its report without writing any file.
///
/// # Errors
/// Fails if `interrupt` was raised during the study.
pub fn measure(study: Study, options: &StudyOptions, interrupt: &Interrupt) -> Result<Report, StudyError> {
    let context = Context::new(study.name(), options.quick, interrupt);
    let (started, load) = (Instant::now(), Load::begin());
    let report = match study {
        Study::Accuracy => accuracy::study(&context, options.counter.as_ref()),
        Study::Effects => effects::study(&context, options.counter.as_ref()),
        Study::Feel => feel::study(&context),
        Study::Identify => identify::study(&context),
        Study::Stability => stability::study(&context),
        Study::Lead => lead::study(&context),
        Study::Paper => paper::study(&context),
        Study::Design => design::study(&context),
    };
    context.finish();
    let mut report = report?;
    (report.seconds, report.others) = (started.elapsed().as_secs_f64(), load.of_others());
    Ok(report)
}
