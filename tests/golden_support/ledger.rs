//! Record of all comparisons: every failure, and for each field the figure closest to its
//! tolerance.

use std::collections::BTreeMap;
use std::fmt;

/// All comparisons of one file in one width.
pub struct Ledger {
    file: String,
    width: &'static str,
    case: usize,
    pub failures: Vec<Failure>,
    worst: BTreeMap<&'static str, Worst>,
}

/// A figure outside its tolerance, or a case that could not be computed.
pub struct Failure {
    file: String,
    width: &'static str,
    case: usize,
    field: String,
    what: String,
}

#[derive(Clone, Copy, Default)]
struct Worst {
    /// Ratio of deviation and tolerance. A value up to 1 passes.
    ratio: f64,
    deviation: f64,
    case: usize,
    count: usize,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({}), case {}, {}: {}", self.file, self.width, self.case, self.field, self.what)
    }
}

impl Ledger {
    pub fn new(file: &str, width: &'static str) -> Self {
        Self { file: file.to_owned(), width, case: 0, failures: Vec::new(), worst: BTreeMap::new() }
    }

    /// Sets the case of the comparisons that follow. Cases are counted from 0.
    pub fn case(&mut self, index: usize) {
        self.case = index;
    }

    /// Records a case that cannot be computed.
    pub fn fail(&mut self, field: &str, what: String) {
        self.failures.push(Failure {
            file: self.file.clone(),
            width: self.width,
            case: self.case,
            field: field.to_owned(),
            what,
        });
    }

    /// Compares a figure. `index` gives its place in the field if the field has several. A NaN
    /// fails.
    pub fn number(&mut self, field: &'static str, index: &[usize], got: f64, want: f64, tolerance: f64) {
        let deviation = (got - want).abs();
        let ratio = if deviation == 0.0 { 0.0 } else { deviation / tolerance };
        let worst = self.worst.entry(field).or_default();
        worst.count += 1;
        if !(ratio <= worst.ratio) {
            *worst = Worst { ratio, deviation, case: self.case, ..*worst };
        }
        if !(ratio <= 1.0) {
            let place: String = index.iter().map(|i| format!("[{i}]")).collect();
            self.fail(
                &format!("{field}{place}"),
                format!("got {got:e}, expected {want:e}, off by {deviation:e}, tolerance {tolerance:e}"),
            );
        }
    }

    /// Compares lists of figures, and their lengths.
    pub fn numbers(
        &mut self,
        field: &'static str,
        index: &[usize],
        got: &[f64],
        want: &[f64],
        tolerance: f64,
    ) {
        if got.len() != want.len() {
            self.fail(field, format!("got {} figures, expected {}", got.len(), want.len()));
            return;
        }
        for (k, (got, want)) in got.iter().zip(want).enumerate() {
            let place: Vec<usize> = index.iter().copied().chain([k]).collect();
            self.number(field, &place, *got, *want, tolerance);
        }
    }

    /// Compares unit quaternions regardless of their signs.
    pub fn rotation(
        &mut self,
        field: &'static str,
        index: &[usize],
        got: [f64; 4],
        want: [f64; 4],
        tolerance: f64,
    ) {
        let dot: f64 = got.iter().zip(want).map(|(a, b)| a * b).sum();
        let sign = if dot < 0.0 { -1.0 } else { 1.0 };
        self.numbers(field, index, &got.map(|x| sign * x), &want, tolerance);
    }

    /// Returns the number of compared figures.
    pub fn compared(&self) -> usize {
        self.worst.values().map(|w| w.count).sum()
    }
}

/// Prints the worst figure of each field.
impl fmt::Display for Ledger {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} ({}): {} figures", self.file, self.width, self.compared())?;
        for (field, w) in &self.worst {
            writeln!(
                f,
                "  {field:<28} worst {:.1e}, {:.2e} of its tolerance, case {}",
                w.deviation, w.ratio, w.case
            )?;
        }
        Ok(())
    }
}
