//! Intervals that hold the truth in 95 % of the cases.

/// Half the width of an interval that holds the truth in 95 % of the cases, in standard deviations,
/// for many degrees of freedom.
pub(crate) const NINETY_FIVE: f64 = 1.96;

/// Returns Student's quantile for the two ends of 95 % (expansion of Cornish and Fisher, Abramowitz
/// and Stegun 26.7.5, two terms).
///
/// Below 2 degrees of freedom the expansion does not hold; less counts as 2.
pub(crate) fn ninety_five(freedom: f64) -> f64 {
    const Z: f64 = NINETY_FIVE;
    let freedom = freedom.max(2.0);
    let first = (Z * Z + 1.0) / (4.0 * freedom);
    let next = (5.0 * Z.powi(4) + 16.0 * Z * Z + 3.0) / (96.0 * freedom * freedom);
    Z * (1.0 + first + next)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_degrees_of_freedom_widen_an_interval_as_students_quantile_does() {
        // Quantiles of a table of Student's distribution.
        for (freedom, quantile, error) in
            [(3.0, 3.182, 0.05), (4.0, 2.776, 0.02), (10.0, 2.228, 0.003), (120.0, 1.980, 0.001)]
        {
            assert!((ninety_five(freedom) / quantile - 1.0).abs() < error, "{freedom}");
        }
        assert!((ninety_five(f64::INFINITY) - 1.96).abs() < 1e-9);
        assert!(ninety_five(0.0) < 4.0);
    }
}
