//! Studies of an Hbot. They measure what accuracy costs, what each effect costs, where stability
//! ends, how well the paper's results are reproduced, and what other designs could do.
//!
//! A study measures on the machine that it runs on and tests its own claims as checks. When it is
//! complete it writes one folder: `report.md`, `report.html` with the same content, SVG plots and
//! `summary.json`. Before that it writes nothing, so its program can end at any time.
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
//! - `timing`, `context`, `threads`, `rng`, `fit`: time measurement, progress, work on all
//!   processors, random numbers, straight lines.
//!
//! `verification` and `research` do not depend on each other. Plots are drawn by `hbot-plot`. The
//! true motions come from `hbot_sim::motion`. Every study is deterministic except for the times
//! that it measures.

mod computer;
mod context;
mod fit;
mod folder;
mod load;
mod names;
mod report;
mod research;
mod rng;
mod threads;
mod timing;
mod verification;
mod whole;

use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

pub use report::{Check, Figure, Report};
pub use verification::callgrind::{Counter, count_worker};

use context::Context;
use load::Load;
use research::{design, paper};
use verification::{accuracy, callgrind, effects, feel, identify, lead, stability};

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

/// A file or folder of the results that could not be written.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {source}")]
pub struct WriteError {
    /// Path of the file or folder.
    pub path: PathBuf,
    /// The error that the operating system reported.
    pub source: std::io::Error,
}

/// Whether a study has written its files. It is locked while they are written.
static WRITTEN: Mutex<bool> = Mutex::new(false);

fn written() -> MutexGuard<'static, bool> {
    WRITTEN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Calls `then` if no study of this program has written its files yet. None writes meanwhile, so a
/// program that ends in `then` leaves nothing.
pub fn if_unwritten(then: impl FnOnce()) {
    let written = written();
    if !*written {
        callgrind::clear();
        then();
    }
}

/// Runs `study` and writes its results. Returns the report and the folder that contains it.
///
/// # Errors
///
/// Fails if the folder cannot be written, which is found out before the study begins. A check that
/// does not hold is not an error: see [`Report::holds`].
pub fn run(study: Study, options: &StudyOptions) -> Result<(Report, PathBuf), WriteError> {
    let out = options.out.clone().unwrap_or_else(|| Path::new("target/study").join(study.name()));
    let trial = written();
    folder::check_writable(&out)?;
    drop(trial);
    let report = measure(study, options);
    let mut written = written();
    *written = true;
    report.write(&out)?;
    Ok((report, out))
}

/// Runs `study` and returns its report without writing any file.
#[must_use]
pub fn measure(study: Study, options: &StudyOptions) -> Report {
    let context = Context::new(study.name(), options.quick);
    let (started, load) = (Instant::now(), Load::begin());
    let mut report = match study {
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
    (report.seconds, report.others) = (started.elapsed().as_secs_f64(), load.of_others());
    report
}
