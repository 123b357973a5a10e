//! `hbot study paper`: every analysis and experiment of the paper on this project's own parts, beside what it reports.

use crate::context::{Context, Interrupted};
use crate::report::Report;

/// The study.
pub(crate) fn study(context: &Context) -> Result<Report, Interrupted> {
    let report = Report::new("paper", context.quick);
    Ok(report)
}
