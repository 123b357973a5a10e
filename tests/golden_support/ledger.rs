//! Record of all comparisons: their number, and every failure.

/// All comparisons of one file in one width.
pub struct Ledger {
    file: String,
    width: &'static str,
    case: usize,
    /// Figures outside their tolerances, and cases that cannot be computed.
    pub failures: Vec<String>,
    /// Number of compared figures.
    pub compared: usize,
}

impl Ledger {
    pub fn new(file: &str, width: &'static str) -> Self {
        Self { file: file.to_owned(), width, case: 0, failures: Vec::new(), compared: 0 }
    }

    /// Sets the case of the comparisons that follow. Cases are counted from 0.
    pub fn case(&mut self, index: usize) {
        self.case = index;
    }

    pub fn fail(&mut self, field: &str, what: String) {
        self.failures.push(format!("{} ({}), case {}, {field}: {what}", self.file, self.width, self.case));
    }

    /// Compares a figure. `index` gives its place in the field if the field has several. A NaN
    /// fails.
    pub fn number(&mut self, field: &str, index: &[usize], got: f64, want: f64, tolerance: f64) {
        let deviation = (got - want).abs();
        self.compared += 1;
        if deviation != 0.0 && !(deviation / tolerance <= 1.0) {
            let place: String = index.iter().map(|i| format!("[{i}]")).collect();
            self.fail(
                &format!("{field}{place}"),
                format!("got {got:e}, expected {want:e}, off by {deviation:e}, tolerance {tolerance:e}"),
            );
        }
    }

    /// Compares lists of figures, and their lengths.
    pub fn numbers(&mut self, field: &str, index: &[usize], got: &[f64], want: &[f64], tolerance: f64) {
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
    pub fn rotation(&mut self, field: &str, index: &[usize], got: [f64; 4], want: [f64; 4], tolerance: f64) {
        let dot: f64 = got.iter().zip(want).map(|(a, b)| a * b).sum();
        let sign = if dot < 0.0 { -1.0 } else { 1.0 };
        self.numbers(field, index, &got.map(|x| sign * x), &want, tolerance);
    }
}
