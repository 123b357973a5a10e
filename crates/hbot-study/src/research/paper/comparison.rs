//! The table that the report begins with: what the paper gives, what comes out here, and why the two differ.
//!
//! Every section adds its rows while it runs, and the table is put above them all in the end. So a section is
//!
//! ```text
//! pub(crate) fn study(context: &Context, report: &mut Report, comparison: &mut Comparison) -> Result<(), Interrupted>
//! ```
//!
//! A figure that the paper gives stands in summary.json as well: `report.figure(id, ours).note("paper", theirs)`.

use crate::report::{Report, ReportPlace, row};

/// The rows so far, in the order of the sections.
#[derive(Debug, Default)]
pub(crate) struct Comparison {
    rows: Vec<Vec<String>>,
}

impl Comparison {
    /// One row: `what` is compared (with its place in the paper, such as "GCI (V.D)"), the figure of the `paper`, `ours`, each
    /// with its unit, and `why` they differ, in a sentence or two; "" where they agree.
    pub(crate) fn row(
        &mut self,
        what: &str,
        paper: impl Into<String>,
        ours: impl Into<String>,
        why: impl Into<String>,
    ) {
        self.rows.push(vec![what.to_owned(), paper.into(), ours.into(), why.into()]);
    }

    /// Puts the table into `report` where its text had come to at `place`.
    pub(crate) fn put(self, report: &mut Report, place: ReportPlace) {
        let mut table = vec![row(["what", "the paper", "here", "why they differ"])];
        table.extend(self.rows);
        report.table_at(place, &table);
    }
}
