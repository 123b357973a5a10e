//! The order of a method: the power of the step with which its error falls.

use crate::report::Report;

/// Errors of a method for several step sizes, as pairs of step and error, with the largest step
/// first.
#[derive(Debug, Clone, Default)]
pub(crate) struct Errors(pub(crate) Vec<(f64, f64)>);

/// An error is used to determine a method's order only if it is more than this many times as large
/// as the rounding error.
const ABOVE: f64 = 100.0;
/// Largest allowed difference between a method's measured order of accuracy and its theoretical
/// one.
pub(crate) const WITHIN: f64 = 0.1;

impl Errors {
    /// Returns the order of accuracy of the method. It is determined from the two smallest steps
    /// whose errors exceed 100 times the rounding error `floor`. Returns `None` if fewer than two
    /// errors do.
    pub(crate) fn order(&self, floor: f64) -> Option<f64> {
        let above: Vec<&(f64, f64)> = self.0.iter().filter(|(_, e)| *e > ABOVE * floor).collect();
        let [.., (h1, e1), (h2, e2)] = above[..] else { return None };
        Some((e1 / e2).ln() / (h1 / h2).ln())
    }

    /// Checks that the measured order of accuracy of the method called `what` agrees with its
    /// theoretical order `theory`, and adds the check to the report. Returns the measured order.
    /// `floor` is the rounding error.
    pub(crate) fn check(&self, report: &mut Report, what: &str, floor: f64, theory: u32) -> Option<f64> {
        let order = self.order(floor);
        if let Some(order) = order {
            report.check(
                format!("{what}: order within {WITHIN} of {theory}, where the error is above {ABOVE} times its floor of {floor:.0e}"),
                format!("{order:.3}"),
                (order - f64::from(theory)).abs() <= WITHIN,
            );
        }
        order
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_is_that_of_the_finest_steps_above_the_floor() {
        // The first error does not follow the order yet, and the last one is at the floor.
        let errors = Errors(vec![(4.0, 1.0), (2.0, 0.2), (1.0, 0.05), (0.5, 1e-3), (0.25, 1e-3)]);
        assert_eq!(errors.order(1e-4), Some(2.0));
        assert_eq!(errors.order(1.0), None);
    }

    #[test]
    fn a_wrong_order_does_not_hold() {
        let mut report = Report::new("test", true);
        let errors = Errors(vec![(2.0, 8.0), (1.0, 1.0)]);
        errors.check(&mut report, "a method", 0.0, 3);
        assert!(report.holds());
        errors.check(&mut report, "a method", 0.0, 2);
        assert!(!report.holds());
    }
}
