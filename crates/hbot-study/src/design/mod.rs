//! `hbot study design`: which dimensions a better Hbot would have.

use crate::context::{Context, Interrupted};
use crate::report::Report;

/// The study.
pub(crate) fn study(context: &Context) -> Result<Report, Interrupted> {
    let report = Report::new("design", context.quick);
    Ok(report)
}
