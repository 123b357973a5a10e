//! Tables of pages whose figures are those of the studies' reports, which a run without `--quick`
//! has written beside them. Times are not compared: they are the machine's.

pub(crate) const ACCURACY: &str = include_str!("../../../../docs/accuracy/report.md");
const IDENTIFY: &str = include_str!("../../../../docs/identify/report.md");
const IDENTIFY_PAGE: &str = include_str!("../../../../docs/identify.md");
const DESIGN: &str = include_str!("../../../../docs/design/report.md");
const DESIGN_PAGE: &str = include_str!("../../../../docs/design-study.md");
const PHYSICS: &str = include_str!("../../../../docs/internals/physics.md");

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

/// Returns the number at the start of a table cell. Panics if the first word is not a number.
fn number(cell: &str) -> f64 {
    let word = cell.split(' ').next().unwrap_or_default();
    word.parse().unwrap_or_else(|_| panic!("no number: {cell:?}"))
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

#[test]
fn the_drift_of_each_method_in_the_physics_notes_is_the_reports() {
    let row = |label: &str| PHYSICS.lines().find(|line| line.starts_with(label)).expect("a row").to_owned();
    for (label, method) in [("| Euler |", "euler"), ("| midpoint |", "midpoint"), ("| Magnus 4 |", "magnus4")]
    {
        let drift = cell(ACCURACY, "Odometry: the method's error", &[method, "f64"], "1000 Hz");
        let last = row(label).trim_end_matches(" |").rsplit("| ").next().expect("a cell").to_owned();
        assert_eq!(last.trim_end_matches(" rad"), drift, "docs/internals/physics.md, section 4: {label}");
    }
}

fn best(design: &str, column: &str) -> String {
    cell(DESIGN, "The best designs", &[design], column)
}

fn wheels(count: &str, column: &str) -> String {
    whole_cell(DESIGN, "Two, three and four of the prototype's wheels", &[count], column)
}

/// Converts a figure in docs/design-study.md to the unit of the report. Only the units of inertias
/// differ: g m² on the page and kg m² in the report.
fn in_report_unit(column: &str, figure: &str) -> String {
    if column == "inertia, g m²" { format!("{figure}e-3") } else { figure.to_owned() }
}

/// Checks that a table in docs/design-study.md agrees with the report. The table has a column named
/// `mark`, and `count` rows. `look_up` returns the report's figure for a row and a column.
fn compare(mark: &str, count: usize, look_up: impl Fn(&str, &str) -> String) {
    let rows: Vec<_> = rows(DESIGN_PAGE).into_iter().filter(|(head, _)| head.contains(&mark)).collect();
    assert_eq!(rows.len(), count, "rows of the table with {mark:?}");
    for (head, cells) in rows {
        for (column, ours) in head.iter().zip(&cells).skip(1) {
            let theirs = look_up(cells[0], column);
            let same = *ours == theirs || agree(&in_report_unit(column, ours), &theirs);
            assert!(same, "docs/design-study.md, {}, {column}: {ours} for {theirs}", cells[0]);
        }
    }
}

#[test]
fn the_table_of_designs_is_the_reports() {
    compare("cone, deg", 4, |design, column| {
        let name = design.replace(" wheels, ", "w_");
        best(&name, if column == "inertia, g m²" { "inertia, kg m²" } else { column })
    });
}

#[test]
fn the_table_of_more_wheels_is_the_reports() {
    compare("slip components seen", 3, |count, column| match column {
        "GCI" => wheels(count, "mean spectral index"),
        "one wheel's motors dead, N m" => wheels(count, "one wheel dead, N m"),
        "the same, normal force shared" => wheels(count, "normal force shared, N m"),
        "of one wheel's slip seen, worst" => {
            let both = wheels(count, "of one wheel's: mean, least");
            both.split(", ").nth(1).expect("mean and least").to_owned()
        }
        "inertia, g m²" => wheels(count, "inertia, kg m²"),
        column => wheels(count, column),
    });
}

/// The page says the largest value of all rigs, and the median in brackets.
#[test]
fn the_table_of_identified_rigs_is_the_reports() {
    let of_page: Vec<_> = rows(IDENTIFY_PAGE).into_iter().filter(|(head, _)| head[0] == "encoders").collect();
    assert_eq!(of_page.len(), 2);
    for (head, cells) in of_page {
        let section = format!("Encoders: {}\n", cells[0]);
        let body = IDENTIFY.split("\n## ").find(|part| part.starts_with(&section)).expect("a section");
        for (column, ours) in head.iter().zip(&cells).skip(1) {
            let theirs = match *column {
                "one turn, mrad" => "one turn, mrad",
                "ten turns, mrad" => "ten turns",
                "ten turns with the true geometry, mrad" => "ten with the truth",
                "ten turns as drawn, mrad" => "ten as drawn",
                "stiffness error, %" => "stiffness error",
                _ => "as drawn",
            };
            let figure = |(head, cells): (Vec<&str>, Vec<&str>)| {
                Some(number(cells[head.iter().position(|name| *name == theirs)?]))
            };
            let mut figures: Vec<f64> = rows(body).into_iter().filter_map(figure).collect();
            figures.sort_by(f64::total_cmp);
            assert_eq!(figures.len(), 30, "{section}");
            assert_eq!(*ours, format!("{} ({})", figures[29], figures[15]), "{section}{column}");
        }
    }
}

#[test]
fn what_a_reference_from_outside_leaves_is_the_reports() {
    let of =
        |row: &str| cell(IDENTIFY, "A reference from outside", &[row, "0.03 %"], "largest error, degrees");
    let [camera, drawn, tilt] = ["camera", "camera; the rig file says no drift", "gravity: the tilt"].map(of);
    for words in
        [format!("leaves at most {camera} degrees ({drawn} without the key)"), format!("a tilt of {tilt}.")]
    {
        assert!(IDENTIFY_PAGE.replace('\n', " ").contains(&words), "{words}");
    }
}
