//! Figures that pages quote are those of the studies' reports, which a run without `--quick` has
//! written beside them.
//!
//! A page's sentence stands in a test with `{}` for each figure, which the test looks up in the
//! report. Figures of time are not compared: they are the machine's. docs/performance.md and
//! docs/effects.md quote benches and no study.

pub(crate) mod accuracy;
mod design;
mod paper;
mod stability;

/// Returns a cell of a report's table. `section` is the heading above the table, `row` holds the
/// first cells of the row, and `column` is the head of the column. Panics unless exactly one cell
/// fits.
fn whole_cell(report: &str, section: &str, row: &[&str], column: &str) -> String {
    let body = report.split("\n## ").find_map(|part| part.strip_prefix(section)?.strip_prefix('\n'));
    let body = body.unwrap_or_else(|| panic!("the report has no section {section:?}"));
    let mut found = Vec::new();
    for (head, cells) in rows(body) {
        if cells.starts_with(row) {
            found.extend(head.iter().position(|name| *name == column).map(|at| cells[at]));
        }
    }
    assert_eq!(found.len(), 1, "{section}, {row:?}, {column}: {found:?}");
    found[0].to_owned()
}

/// Returns the first word of a cell of a report's table: a figure without its quartiles and
/// remarks.
fn cell(report: &str, section: &str, row: &[&str], column: &str) -> String {
    whole_cell(report, section, row, column).split(' ').next().unwrap_or_default().to_owned()
}

/// Returns the result that a report states for the check named `what`.
fn check(report: &str, what: &str) -> String {
    whole_cell(report, "Checks", &[what], "found")
}

/// Returns the rows of all Markdown tables in `text`. Each row is given as the head of its table
/// and its own cells.
fn rows(text: &str) -> Vec<(Vec<&str>, Vec<&str>)> {
    let mut head: Vec<&str> = Vec::new();
    let mut rows = Vec::new();
    for line in text.lines() {
        let Some(cells) = line.strip_prefix("| ").and_then(|line| line.strip_suffix(" |")) else {
            if !line.starts_with("|---") {
                head.clear();
            }
            continue;
        };
        let cells: Vec<&str> = cells.split(" | ").collect();
        if head.is_empty() {
            head = cells;
        } else {
            rows.push((head.clone(), cells));
        }
    }
    rows
}

/// Returns `text` with each `{}` replaced by the next entry of `figures`.
fn filled(text: &str, figures: &[String]) -> String {
    assert_eq!(text.matches("{}").count(), figures.len(), "{text}");
    figures.iter().fold(text.to_owned(), |text, figure| text.replacen("{}", figure, 1))
}

/// Returns the number at the start of a table cell. Panics if the first word is not a number.
fn number(cell: &str) -> f64 {
    let word = cell.split(' ').next().unwrap_or_default();
    word.parse().unwrap_or_else(|_| panic!("no number: {cell:?}"))
}

/// Multiplies the number at the start of a table cell by `scale`, and returns it rounded to the
/// given number of decimals.
fn rounded(cell: &str, scale: f64, decimals: usize) -> String {
    format!("{:.decimals$}", number(cell) * scale)
}

/// Returns whether two decimal numbers can be roundings of one number. Each can differ from it by
/// half a unit of its own last digit.
fn agree(a: &str, b: &str) -> bool {
    let half = |text: &str| {
        let (digits, exponent) = text.split_once('e').unwrap_or((text, "0"));
        let decimals = digits.split_once('.').map_or(0, |(_, decimals)| decimals.len() as i32);
        0.5 * 10.0_f64.powi(exponent.parse::<i32>().expect("an exponent") - decimals)
    };
    (number(a) - number(b)).abs() <= (half(a) + half(b)) * (1.0 + 1e-9)
}

/// Removes each expected text in `said` from `text`, and returns the rest with single spaces
/// between words. A test then checks that the rest contains no other figure.
///
/// Panics if `text` does not contain an expected text.
fn left_over(page: &str, text: &str, said: impl IntoIterator<Item = String>) -> String {
    let mut text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    for said in said {
        assert!(text.contains(&said), "{page} should say, with the figures of its report:\n{said}");
        text = text.replacen(&said, "", 1);
    }
    text
}

/// Returns the numbers in `text` that have a decimal point or a negative exponent, such as 2.0e-6.
fn numbers(text: &str) -> Vec<&str> {
    text.split(|c: char| !(c.is_ascii_alphanumeric() || c == '.' || c == '-'))
        .map(|word| word.trim_end_matches('.'))
        .filter(|word| word.contains("e-") || word.contains('.'))
        .filter(|word| word.parse::<f64>().is_ok())
        .collect()
}

#[test]
fn numbers_are_seen() {
    assert_eq!(
        numbers("2.0e-6, (7e-7), `1e-3` and 5.5e-5. Not e-mail, x 10, 0.5.1 or -e-; 1.25"),
        ["2.0e-6", "7e-7", "1e-3", "5.5e-5", "1.25"]
    );
}

#[test]
fn roundings_of_one_number_agree_and_others_do_not() {
    for (a, b) in
        [("0.0155", "1.6e-2"), ("0.907", "0.91"), ("0.625", "0.62"), ("0.0000", "3.9e-6"), ("13", "12.7")]
    {
        assert!(agree(a, b) && agree(b, a), "{a} and {b}");
    }
    for (a, b) in [("0.0156", "1.7e-2"), ("0.907", "0.90"), ("14", "12.7")] {
        assert!(!agree(a, b) && !agree(b, a), "{a} and {b}");
    }
}
