//! The study reports the cost of every effect and phenomenon that a scene can name.

use hbot_config::scene::{kinds, phenomena};
use hbot_study::{Study, count_worker};

use crate::{assert_documented, measure, value};

#[test]
fn every_kind_and_phenomenon_has_its_cost() {
    let report = measure(Study::Effects);
    assert_documented(&report);
    for listed in kinds().iter().chain(&phenomena()) {
        let text = report.markdown();
        assert!(text.contains(&format!("| {} |", listed.name)), "{} has no row", listed.name);
        // The added cost can be lost in noise, but it is always a number.
        let id = format!("effects_{}_added_ns", listed.name);
        assert!(value(&report, &id).is_finite());
        let figure = report.figures().iter().find(|figure| figure.id == id).expect("a figure");
        // A cost that noise may have made is a bound, and no cost is negative.
        let found = figure.more["found"].as_bool().expect("whether it is more than noise");
        let row = text.lines().find(|line| line.starts_with(&format!("| {} |", listed.name))).expect("a row");
        assert_eq!(row.contains("| below "), !found, "{row}");
        let negative = |cell: &str| cell.trim().starts_with('-') && cell.trim() != "-";
        assert!(!row.split('|').any(negative), "{row}");
    }
    assert!(value(&report, "effects_none_ns") > 0.0);
}

#[test]
fn the_worker_takes_what_the_study_gives_it_and_nothing_else() {
    let jobs =
        r#"[{"names": ["spring", "hand"], "gone": false}, {"names": ["damper"], "gone": true}, {"tick": 6}]"#;
    assert_eq!(count_worker(jobs), Ok(()));
    for wrong in [
        "",
        r#"[{"tick": 7}]"#,
        r#"[{"tick": -1}]"#,
        "{}",
        "[{}]",
        r#"[{"names": [1], "gone": false}]"#,
        r#"[{"names": []}]"#,
    ] {
        assert!(count_worker(wrong).is_err(), "{wrong}");
    }
}
