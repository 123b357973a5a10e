//! The report of a study: text with tables and plots, a flat list of figures, and checks with their
//! bounds.

mod html;
mod short;
mod write;

use hbot_plot::{Lines, short};
use serde_json::{Map, Value};

use crate::computer::Computer;
use crate::names;
use crate::timing::Time;
use short::Short;

/// A number that a study computed or measured. `summary.json` lists all figures.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Id of the figure in lower_snake_case. It is unique and does not change between runs.
    pub id: String,
    /// The number itself, in the unit [`unit`](Self::unit).
    pub value: f64,
    /// Unit of the number; `1` for a ratio.
    pub unit: &'static str,
    /// Further properties of the figure by name, such as its quartiles.
    pub more: Map<String, Value>,
}

/// A condition that must hold, and the value that the study found.
#[derive(Debug, Clone, PartialEq)]
pub struct Check {
    /// The condition in words, with its bound.
    pub what: String,
    /// The value that the study found, in words.
    pub found: String,
    /// Whether the condition holds.
    pub holds: bool,
}

/// A group of figures with one unit and one meaning. Their ids fit one pattern, in which each
/// `{...}` stands for a part that varies.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Family {
    pub(crate) pattern: String,
    pub(crate) unit: &'static str,
    pub(crate) meaning: &'static str,
}

/// A picture of a report: the name of its file without `.svg`, the text below it, and the SVG.
#[derive(Debug, Clone)]
pub(crate) struct Plot {
    name: String,
    caption: String,
    svg: String,
}

/// The results of a study: its text, plots, figures and checks.
#[derive(Debug, Clone)]
pub struct Report {
    study: &'static str,
    pub(crate) seconds: f64,
    pub(crate) quick: bool,
    /// Share of all processors that other programs used meanwhile, 0 to 1. `None` if unknown.
    pub(crate) others: Option<f64>,
    /// Whether a figure is a measured computing time.
    has_times: bool,
    machine: Computer,
    body: String,
    /// Where the next row of the comparison with the paper comes in `body`, a byte offset.
    compared_at: usize,
    plots: Vec<Plot>,
    short: Short,
    /// Further files that are written into the folder of the report, each with its name and
    /// content.
    files: Vec<(String, String)>,
    figures: Vec<Figure>,
    checks: Vec<Check>,
    families: Vec<Family>,
}

impl Report {
    pub(crate) fn new(study: &'static str, quick: bool) -> Self {
        Self {
            study,
            seconds: 0.0,
            quick,
            others: None,
            has_times: false,
            machine: Computer::here(),
            body: String::new(),
            compared_at: 0,
            plots: Vec::new(),
            short: Short::default(),
            files: Vec::new(),
            figures: Vec::new(),
            checks: Vec::new(),
            families: Vec::new(),
        }
    }

    /// Returns all figures, in the order in which the study reported them.
    #[must_use]
    pub fn figures(&self) -> &[Figure] {
        &self.figures
    }

    /// Returns all checks, in the order in which the study made them.
    #[must_use]
    pub fn checks(&self) -> &[Check] {
        &self.checks
    }

    /// Returns whether all conditions that the study checked hold.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.checks.iter().all(|check| check.holds)
    }

    pub(crate) fn heading(&mut self, text: &str) {
        self.body.push_str(&format!("\n## {text}\n\n"));
    }

    pub(crate) fn say(&mut self, text: &str) {
        self.body.push_str(text);
        self.body.push_str("\n\n");
    }

    /// Appends a table to the text. The first row of `rows` is its header.
    pub(crate) fn table(&mut self, rows: &[Vec<String>]) {
        self.body.push_str(&tabled(rows));
    }

    /// Begins the table of the paper's results beside ours, to which [`compare`](Self::compare)
    /// adds rows from anywhere below.
    pub(crate) fn begin_comparison(&mut self) {
        self.table(&[head("what | the paper | here | why they differ")]);
        // Before the empty line that ends a table.
        self.compared_at = self.body.len() - 1;
    }

    /// Adds a row to the table that compares our results with the paper's.
    ///
    /// `what` is the compared quantity and its place in the paper, such as "GCI (V.D)". `paper` and
    /// `ours` are the two values with units. `why` explains the difference in one or two sentences.
    pub(crate) fn compare(
        &mut self,
        what: &str,
        paper: impl Into<String>,
        ours: impl Into<String>,
        why: impl Into<String>,
    ) {
        let row = format!("| {what} | {} | {} | {} |\n", paper.into(), ours.into(), why.into());
        self.body.insert_str(self.compared_at, &row);
        self.compared_at += row.len();
    }

    /// Appends a plot and its caption to the text. The plot is written to the file `name.svg`.
    pub(crate) fn plot(&mut self, name: &str, caption: &str, svg: String) {
        let plot = Plot { name: name.to_owned(), caption: caption.to_owned(), svg };
        self.body.push_str(&plot.markdown());
        self.plots.push(plot);
    }

    /// Adds a line plot to the report. `name` is the name of its file, and `caption` is the text
    /// below it.
    pub(crate) fn lines(&mut self, name: &str, caption: &str, lines: Lines) {
        self.plot(name, caption, lines.svg());
    }

    /// Adds a file that will be written into the folder of the report.
    pub(crate) fn file(&mut self, name: &str, text: String) {
        self.files.push((name.to_owned(), text));
    }

    /// Declares a family of figures: all figures whose ids fit one pattern. `row` is the family's
    /// row in the report's table of ids: `pattern | unit | meaning`.
    pub(crate) fn family(&mut self, row: &'static str) {
        let mut cells = row.splitn(3, " | ");
        let (Some(pattern), Some(unit), Some(meaning)) = (cells.next(), cells.next(), cells.next()) else {
            unreachable!("a family has a pattern, a unit and a meaning: {row}")
        };
        self.meaning(Family { pattern: pattern.to_owned(), unit, meaning });
    }

    /// Adds a family of figures (pattern of their ids, unit and meaning) to the report's table of
    /// ids.
    pub(crate) fn meaning(&mut self, family: Family) {
        self.families.push(family);
    }

    /// Adds a figure with the given id. A pattern that fits the id must have been declared with
    /// [`family`](Self::family).
    pub(crate) fn figure(&mut self, id: String, value: f64) -> &mut Figure {
        debug_assert!(names::is_id(&id), "{id}");
        let unit = self.families.iter().find(|f| names::matches(&f.pattern, &id)).map_or("", |f| f.unit);
        self.figures.push(Figure { id, value, unit, more: Map::new() });
        let last = self.figures.len() - 1;
        &mut self.figures[last]
    }

    /// Adds a measured time with its quartiles as a figure. The figure is marked if the program was
    /// not compiled for speed.
    pub(crate) fn time(&mut self, id: String, time: Time) {
        self.has_times = true;
        let marked = self.machine.warning().is_some();
        let figure = self.figure(id, time.median);
        figure.note("q1", time.q1).note("q3", time.q3).note("samples", time.samples);
        if marked {
            figure.note("marked", "not release");
        }
    }

    /// Adds a check to the report that passes if the largest error `worst` is not above `bound`.
    /// `what` names the quantity.
    pub(crate) fn check_within(&mut self, what: &str, worst: f64, bound: f64) {
        self.check(format!("{what} within {bound}"), format!("{worst:.3} at worst"), worst <= bound);
    }

    pub(crate) fn check(&mut self, what: impl Into<String>, found: impl Into<String>, holds: bool) {
        self.checks.push(Check { what: what.into(), found: found.into(), holds });
    }
}

impl Figure {
    /// Adds a further property to the figure. Returns the figure, so that calls can be chained.
    pub(crate) fn note(&mut self, key: &str, value: impl Into<Value>) -> &mut Self {
        self.more.insert(key.to_owned(), value.into());
        self
    }
}

fn tabled(rows: &[Vec<String>]) -> String {
    let mut text = String::new();
    for (k, row) in rows.iter().enumerate() {
        text.push_str(&format!("| {} |\n", row.join(" | ")));
        if k == 0 {
            text.push_str(&format!("|{}\n", "---|".repeat(row.len())));
        }
    }
    text.push('\n');
    text
}

/// Formats a measured time as "median (lower quartile to upper quartile)", for a table cell.
pub(crate) fn spread(time: Time) -> String {
    format!("{} ({} to {})", short(time.median), short(time.q1), short(time.q3))
}

/// Returns a row of a table with the given cells.
pub(crate) fn row<S: AsRef<str>>(cells: impl IntoIterator<Item = S>) -> Vec<String> {
    cells.into_iter().map(|cell| cell.as_ref().to_owned()).collect()
}

/// Returns the cells of a table's head. `cells` holds them in one text, separated by ` | `.
pub(crate) fn head(cells: &str) -> Vec<String> {
    row(cells.split(" | "))
}
