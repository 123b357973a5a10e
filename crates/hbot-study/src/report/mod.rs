//! What a study has to say: text with tables and plots, a flat list of figures, and checks with their bounds.

mod html;
mod write;

use hbot_plot::short;
use serde_json::{Map, Value};

use crate::computer::Computer;
use crate::names;
use crate::timing::Time;

/// One figure of summary.json.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Its name: unique, the same in every run, lower_snake_case.
    pub id: String,
    /// What it is.
    pub value: f64,
    /// Its unit; `1` for a ratio.
    pub unit: &'static str,
    /// What else there is to say of it, such as its spread.
    pub more: Map<String, Value>,
}

/// Something that must hold.
#[derive(Debug, Clone, PartialEq)]
pub struct Check {
    /// What must hold, with its bound.
    pub what: String,
    /// What was found.
    pub found: String,
    /// Whether it holds.
    pub holds: bool,
}

/// A family of ids and what they mean; `{...}` stands for what varies.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Family {
    pub(crate) pattern: &'static str,
    pub(crate) unit: &'static str,
    pub(crate) meaning: &'static str,
}

/// A place in a report's text: an offset that stands between two of its blocks.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ReportPlace(usize);

/// What a study found.
#[derive(Debug, Clone)]
pub struct Report {
    study: &'static str,
    pub(crate) seconds: f64,
    pub(crate) quick: bool,
    machine: Computer,
    body: String,
    plots: Vec<(String, String)>,
    /// Other files, by name.
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
            machine: Computer::here(),
            body: String::new(),
            plots: Vec::new(),
            files: Vec::new(),
            figures: Vec::new(),
            checks: Vec::new(),
            families: Vec::new(),
        }
    }

    /// Every figure, in the order of the report.
    #[must_use]
    pub fn figures(&self) -> &[Figure] {
        &self.figures
    }

    /// Every check, in the order of the report.
    #[must_use]
    pub fn checks(&self) -> &[Check] {
        &self.checks
    }

    /// Whether all checks held.
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

    /// A table; the first row is its head.
    pub(crate) fn table(&mut self, rows: &[Vec<String>]) {
        self.body.push_str(&tabled(rows));
    }

    /// Where the text has come to, for what is only known once more of it is there.
    pub(crate) fn place(&self) -> ReportPlace {
        ReportPlace(self.body.len())
    }

    /// A table where the text had come to at `place`.
    pub(crate) fn table_at(&mut self, place: ReportPlace, rows: &[Vec<String>]) {
        self.body.insert_str(place.0, &tabled(rows));
    }

    /// A plot in a file of its own, `name.svg`.
    pub(crate) fn plot(&mut self, name: &str, caption: &str, svg: String) {
        self.body.push_str(&format!("![{caption}]({name}.svg)\n\n*{caption}*\n\n"));
        self.plots.push((name.to_owned(), svg));
    }

    /// Another file beside the report.
    pub(crate) fn file(&mut self, name: &str, text: String) {
        self.files.push((name.to_owned(), text));
    }

    /// What the ids of a family mean.
    pub(crate) fn family(&mut self, pattern: &'static str, unit: &'static str, meaning: &'static str) {
        self.families.push(Family { pattern, unit, meaning });
    }

    /// A figure of a family that was said.
    pub(crate) fn figure(&mut self, id: String, value: f64) -> &mut Figure {
        debug_assert!(names::is_id(&id), "{id}");
        let unit = self.families.iter().find(|f| names::matches(f.pattern, &id)).map_or("", |f| f.unit);
        self.figures.push(Figure { id, value, unit, more: Map::new() });
        let last = self.figures.len() - 1;
        &mut self.figures[last]
    }

    /// A time, with its quartiles; marked where the program was not compiled for speed.
    pub(crate) fn time(&mut self, id: String, time: Time) {
        let marked = self.machine.warning().is_some();
        let figure = self.figure(id, time.median);
        figure.note("q1", time.q1).note("q3", time.q3).note("samples", time.samples);
        if marked {
            figure.note("marked", "not release");
        }
    }

    pub(crate) fn check(&mut self, what: impl Into<String>, found: impl Into<String>, holds: bool) {
        self.checks.push(Check { what: what.into(), found: found.into(), holds });
    }
}

impl Figure {
    /// Something else to say of the figure.
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

/// A time with its quartiles, for a table.
pub(crate) fn spread(time: Time) -> String {
    format!("{} ({} to {})", short(time.median), short(time.q1), short(time.q3))
}

/// A row of a table.
pub(crate) fn row<S: AsRef<str>>(cells: impl IntoIterator<Item = S>) -> Vec<String> {
    cells.into_iter().map(|cell| cell.as_ref().to_owned()).collect()
}
