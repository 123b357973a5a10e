//! The study `stability`: borders compared with theory, and conserved quantities.

use hbot_study::Study;

use crate::{assert_documented, assert_holds, measure};

#[test]
fn borders_stand_beside_theory_and_every_check_holds() {
    let report = measure(Study::Stability);
    assert_documented(&report);
    assert_holds(&report);
    let borders: Vec<_> = report.figures().iter().filter(|figure| figure.id.starts_with("border_")).collect();
    assert!(borders.len() > 100, "{}", borders.len());
    for figure in borders {
        let of = |key: &str| figure.more.get(key).and_then(|value| value.as_f64());
        assert_eq!(of("measured"), Some(figure.value), "{}", figure.id);
        assert!(of("predicted").is_some(), "{} says not what was predicted", figure.id);
    }
}
