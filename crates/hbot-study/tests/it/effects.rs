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
        assert!(value(&report, &format!("effects_{}_added_ns", listed.name)).is_finite());
    }
    assert!(value(&report, "effects_none_ns") > 0.0);
}

#[test]
fn the_worker_takes_what_the_study_gives_it_and_nothing_else() {
    let setups = r#"[{"names": ["spring", "hand"], "gone": false}, {"names": ["damper"], "gone": true}]"#;
    assert_eq!(count_worker(setups), Ok(()));
    for wrong in ["", "{}", "[{}]", r#"[{"names": [1], "gone": false}]"#, r#"[{"names": []}]"#] {
        assert!(count_worker(wrong).is_err(), "{wrong}");
    }
}
