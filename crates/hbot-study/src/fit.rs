//! The straight line through points.

/// The line of least squares through points (x, y).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fit {
    pub(crate) slope: f64,
    /// Its y at x = 0.
    pub(crate) offset: f64,
    /// R², the share of the variance of y that the line explains.
    pub(crate) r2: f64,
}

impl Fit {
    pub(crate) fn through(points: &[(f64, f64)]) -> Self {
        let n = points.len() as f64;
        let (x, y) = points.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for (a, b) in points {
            (xx, xy, yy) = (xx + (a - x) * (a - x), xy + (a - x) * (b - y), yy + (b - y) * (b - y));
        }
        let slope = xy / xx;
        Self { slope, offset: y - slope * x, r2: xy * xy / (xx * yy) }
    }
}
