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
        let (Some(measured), Some(predicted)) = (of("measured"), of("predicted")) else {
            panic!("{} says not what was measured and what was predicted", figure.id);
        };
        assert_eq!(measured, figure.value, "{}", figure.id);
        // The required bounds are 5 % and 10 %.
        let off = (measured / predicted - 1.0).abs();
        if figure.id.starts_with("border_linear_") {
            assert!(off < 0.05, "{}: {off}", figure.id);
        }
        if figure.id.starts_with("border_lag_") {
            let eigenvalues = of("eigenvalues").expect("beside the formula");
            let apart = (measured / eigenvalues - 1.0).abs();
            assert!(off < 0.01 && apart < 0.01, "{}: {off}, {apart}", figure.id);
        }
        if figure.id.starts_with("border_passive_") {
            assert!(off < 0.1, "{}: {off}", figure.id);
        }
    }
}
