//! Studies of an Hbot: what accuracy costs, what each effect costs, where stability ends, what its paper reports, and what
//! other designs of it could do.
//!
//! A study measures on the machine at hand, checks what it says it checks, and writes `report.md`, the same as
//! one `report.html`, SVG plots and `summary.json` into one folder once it is done; a study that is stopped writes nothing.
//!
//! # Layers, top to bottom
//!
//! | module | what it does |
//! |---|---|
//! | `verification` | of this program. `accuracy`: error against time of every stage that has a choice; `effects`: what each effect and phenomenon costs a tick; `stability`: how stiff a wall may be, and what holds over a day |
//! | `research` | on the device. `paper`: every analysis and experiment of the paper; `design`: which dimensions a better Hbot would have |
//! | `report`, `machine`, `names` | what is written |
//! | `whole` | the whole loop, controller, line and simulated rig in lock-step |
//! | `timing`, `context`, `rng` | how it is timed, shown and stopped; numbers at random |
//!
//! Verification and research know nothing of each other. Plots are drawn by `hbot-plot`; true motions come from
//! `hbot_sim::motion`. Every study is deterministic but for its times.

mod computer;
mod context;
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
pub use verification::effects::{Counter, count_worker};

use context::{Context, Interrupted};
use research::{design, paper};
use verification::{accuracy, effects, stability};

/// Which study.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Study {
    /// Error against time of every stage that has a choice.
    Accuracy,
    /// What each effect and phenomenon costs a tick.
    Effects,
    /// How stiff a wall may be, and what holds over a day.
    Stability,
    /// Every analysis and experiment of the paper, beside what it reports.
    Paper,
    /// Which dimensions a better Hbot would have.
    Design,
}

impl Study {
    /// What the command line and the folder call it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Accuracy => "accuracy",
            Self::Effects => "effects",
            Self::Stability => "stability",
            Self::Paper => "paper",
            Self::Design => "design",
        }
    }
}

/// How a study is run.
#[derive(Debug, Clone, Default)]
pub struct StudyOptions {
    /// The folder that it writes to; made where it is not there. `None`: `target/study/NAME`.
    pub out: Option<PathBuf>,
    /// About 30 s (`paper` and `design`: up to a minute), with fewer samples, instead of up to 5 minutes.
    pub quick: bool,
    /// How this program counts its instructions, where it can.
    pub counter: Option<Counter>,
}

/// Why a study has no result.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// It was asked to stop.
    #[error("stopped; nothing was written")]
    Interrupted,
    /// Its results could not be written.
    #[error("{path}: {source}")]
    Write {
        /// Where to.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
}

impl From<Interrupted> for StudyError {
    fn from(_: Interrupted) -> Self {
        Self::Interrupted
    }
}

/// Runs `study` and writes what it found: the report, and the folder that it lies in.
///
/// # Errors
/// Where `interrupt` was raised on the way, or the folder cannot be written. Checks that do not hold are no error: see
/// [`Report::holds`].
pub fn run(
    study: Study,
    options: &StudyOptions,
    interrupt: &Interrupt,
) -> Result<(Report, PathBuf), StudyError> {
    let started = Instant::now();
    let mut report = measure(study, options, interrupt)?;
    report.seconds = started.elapsed().as_secs_f64();
    let out = options.out.clone().unwrap_or_else(|| Path::new("target/study").join(study.name()));
    report.write(&out).map_err(|(path, source)| StudyError::Write { path, source })?;
    Ok((report, out))
}

/// Runs `study` without writing anything.
///
/// # Errors
/// Where `interrupt` was raised on the way.
pub fn measure(study: Study, options: &StudyOptions, interrupt: &Interrupt) -> Result<Report, StudyError> {
    let context = Context::new(study.name(), options.quick, interrupt);
    let report = match study {
        Study::Accuracy => accuracy::study(&context),
        Study::Effects => effects::study(&context, options.counter.as_ref()),
        Study::Stability => stability::study(&context),
        Study::Paper => paper::study(&context),
        Study::Design => design::study(&context),
    };
    context.finish();
    Ok(report?)
}
