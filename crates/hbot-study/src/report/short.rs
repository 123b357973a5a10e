//! The beginning of a report, which the terminal shows too: what the study found, in short, and
//! what may be wrong with its times.

use super::{Plot, Report};

/// Share of the processors from which on a machine counts as busy. Less than this is the desktop's
/// own work and moves no median.
const BUSY: f64 = 0.05;

/// What a study found, in a few sentences, and its most important plot.
#[derive(Debug, Clone, Default)]
pub(crate) struct Short {
    sentences: Vec<String>,
    /// Name of the plot.
    plot: &'static str,
}

impl Report {
    /// States what the study found: three to five sentences that are computed from its figures, and
    /// the name of the plot that shows it.
    pub(crate) fn in_short(&mut self, plot: &'static str, sentences: impl IntoIterator<Item = String>) {
        let sentences: Vec<String> = sentences.into_iter().collect();
        debug_assert!((3..=5).contains(&sentences.len()), "{sentences:?}");
        debug_assert!(self.plots.iter().any(|drawn| drawn.name == plot), "no plot {plot}");
        self.short = Short { sentences, plot };
    }

    /// Returns what the study found, in three to five sentences.
    #[must_use]
    pub fn conclusions(&self) -> &[String] {
        &self.short.sentences
    }

    /// Returns the file name of the plot that shows what the study found.
    #[must_use]
    pub fn chief_plot(&self) -> String {
        format!("{}.svg", self.short.plot)
    }

    /// Returns what may be wrong with the times of this run, one sentence or two for each reason.
    /// Empty if the study measured no times.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        if !self.has_times {
            return Vec::new();
        }
        let others = self.others.filter(|share| *share >= BUSY).map(|share| {
            format!(
                "This machine was busy: other programs used {:.0} % of its processors while this study ran. Its times are too long, and small differences between them mean nothing. Repeat the study on an idle machine.",
                100.0 * share
            )
        });
        self.machine.warning().map(str::to_owned).into_iter().chain(others).collect()
    }

    /// Returns the first part of the report as Markdown: warnings, conclusions, and the most
    /// important plot.
    pub(super) fn beginning(&self) -> String {
        let mut text = String::new();
        for warning in self.warnings() {
            text.push_str(&format!("**{warning}**\n\n"));
        }
        text.push_str("## In short\n\n");
        for sentence in &self.short.sentences {
            text.push_str(&format!("- {sentence}\n"));
        }
        if let Some(plot) = self.plots.iter().find(|plot| plot.name == self.short.plot) {
            text.push_str(&format!("\n{}", plot.markdown()));
        }
        text
    }

    /// Returns how many checks hold, as text: `46 of 46 checks hold`.
    #[must_use]
    pub fn verdict(&self) -> String {
        let hold = self.checks.iter().filter(|check| check.holds).count();
        format!("{hold} of {} checks hold", self.checks.len())
    }

    /// Returns the value of the figure `id`, for a conclusion. Panics in debug builds if there is
    /// none, and returns NaN in others.
    pub(crate) fn value(&self, id: &str) -> f64 {
        let found = self.figures.iter().find(|figure| figure.id == id);
        debug_assert!(found.is_some(), "no figure {id}");
        found.map_or(f64::NAN, |figure| figure.value)
    }
}

impl Plot {
    /// Returns the plot as Markdown, with its caption below it.
    pub(super) fn markdown(&self) -> String {
        let Self { name, caption, .. } = self;
        format!("![{caption}]({name}.svg)\n\n*{caption}*\n\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::timing::Time;

    fn report() -> Report {
        let mut report = Report::new("effects", true);
        report.plot("costs", "What it costs", "<svg></svg>".to_owned());
        report.plot("other", "Something else", "<svg></svg>".to_owned());
        report.in_short("costs", ["One.", "Two.", "Three."].map(str::to_owned));
        report
    }

    #[test]
    fn a_report_begins_with_its_conclusions_and_their_plot() {
        let text = report().markdown();
        let [heading, sentence, plot, rest] =
            ["## In short", "- Two.\n", "![What it costs](costs.svg)", "## This run"]
                .map(|part| text.find(part));
        assert!(heading.is_some() && heading < sentence && sentence < plot && plot < rest, "{text}");
        assert!(text.starts_with("# `hbot-study effects`\n\n## In short"), "{text}");
        assert_eq!(report().chief_plot(), "costs.svg");
    }

    #[test]
    fn a_busy_machine_is_said_first_where_times_were_measured() {
        let mut report = report();
        report.others = Some(0.43);
        assert!(!report.markdown().contains("busy"), "it has no times");
        report.time(
            "effects_none_ns".to_owned(),
            Time { median: 1.0, q1: 1.0, q3: 1.0, least: 1.0, samples: 1 },
        );
        let text = report.markdown();
        let said = text.find("other programs used 43 % of its processors");
        assert!(said.is_some() && said < text.find("## In short"), "{text}");
        for idle in [None, Some(0.04)] {
            report.others = idle;
            assert!(!report.warnings().iter().any(|warning| warning.contains("busy")), "{idle:?}");
        }
    }

    #[test]
    fn checks_are_counted() {
        let mut report = report();
        report.check("one is one", "1", true);
        report.check("one is two", "1", false);
        assert_eq!(report.verdict(), "1 of 2 checks hold");
    }
}
