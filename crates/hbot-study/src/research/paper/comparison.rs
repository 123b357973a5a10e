//! The table at the start of the report: the paper's figure, the figure found here, and the reason
//! for the difference.
//!
//! Every section adds its rows while it runs. At the end the table is inserted above all sections.
//! A section is therefore a function
//!
//! ```text
//! pub(crate) fn study(
//!     context: &Context,
//!     report: &mut Report,
//!     comparison: &mut Comparison,
//! ) -> Result<(), Interrupted>
//! ```
//!
//! A figure that the paper gives is also written to summary.json:
//! `report.figure(id, ours).note("paper", theirs)`.

use crate::report::{Report, ReportPlace, row};

/// The rows of the comparison table so far, in the order of the sections.
#[derive(Debug, Default)]
pub(crate) struct Comparison {
    rows: Vec<Vec<String>>,
}

impl Comparison {
    /// Adds a row to the table that compares this project's results with the paper's.
    ///
    /// `what` is the compared quantity and its place in the paper, such as "GCI (V.D)". `paper` and
    /// `ours` are the two values with units. `why` explains the difference in one or two sentences,
    /// and is empty if the values agree.
    pub(crate) fn row(
        &mut self,
        what: &str,
        paper: impl Into<String>,
        ours: impl Into<String>,
        why: impl Into<String>,
    ) {
        self.rows.push(vec![what.to_owned(), paper.into(), ours.into(), why.into()]);
    }

    /// Inserts the comparison table into `report` at `place`.
    pub(crate) fn put(self, report: &mut Report, place: ReportPlace) {
        let mut table = vec![row(["what", "the paper", "here", "why they differ"])];
        table.extend(self.rows);
        report.table_at(place, &table);
    }
}
