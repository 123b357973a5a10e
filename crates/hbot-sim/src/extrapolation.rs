//! Solves y' = f(t, y) for a smooth f, accurate to rounding error. It is the reference for
//! prescribed motions.
//!
//! The method is Gragg's modified midpoint rule with Richardson extrapolation up to order 12
//! (Bulirsch and Stoer; Hairer, Norsett and Wanner 1993, II.9). An interval is halved while the
//! last two columns of the extrapolation table differ by more than the tolerance.

/// Number of substeps with which each row of the extrapolation table integrates the interval.
const SUBSTEPS: [usize; ROWS] = [2, 4, 6, 8, 10, 12];
/// Number of rows of the extrapolation table. Row k gives a result of order 2 k, so the last one is
/// of order 12.
const ROWS: usize = 6;
/// Largest allowed difference of the last two columns of the extrapolation table, relative to 1 +
/// |y|. It is some tens of rounding errors.
const TOLERANCE: f64 = 1.0e-14;
/// Largest number of times that an interval is halved. After these, the remaining difference is
/// rounding, and smaller steps do not help.
const HALVINGS: u32 = 10;

/// Returns the solution of y' = `f`(t, y) at time `t` + `h`, starting from `y` at time `t`.
#[must_use]
pub fn advance<const N: usize>(
    f: &impl Fn(f64, &[f64; N]) -> [f64; N],
    t: f64,
    h: f64,
    y: &[f64; N],
) -> [f64; N] {
    halved(f, t, h, y, HALVINGS)
}

fn halved<const N: usize>(
    f: &impl Fn(f64, &[f64; N]) -> [f64; N],
    t: f64,
    h: f64,
    y: &[f64; N],
    halvings: u32,
) -> [f64; N] {
    let (end, error) = extrapolated(f, t, h, y);
    if error <= TOLERANCE || halvings == 0 {
        return end;
    }
    let middle = halved(f, t, 0.5 * h, y, halvings - 1);
    halved(f, t + 0.5 * h, 0.5 * h, &middle, halvings - 1)
}

/// Integrates over one interval of length `h`. Returns y at the end and the difference of the last
/// two columns of the extrapolation table, which estimates the error.
fn extrapolated<const N: usize>(
    f: &impl Fn(f64, &[f64; N]) -> [f64; N],
    t: f64,
    h: f64,
    y: &[f64; N],
) -> ([f64; N], f64) {
    let start = f(t, y);
    // The table holds the change of y, which rounds less than y itself.
    let mut above = [[0.0; N]; ROWS];
    let mut error = 0.0;
    for (row, &n) in SUBSTEPS.iter().enumerate() {
        let mut entries = [[0.0; N]; ROWS];
        entries[0] = midpoint(f, t, h, y, &start, n);
        for k in 1..=row {
            let ratio = (n as f64 / SUBSTEPS[row - k] as f64).powi(2) - 1.0;
            entries[k] =
                core::array::from_fn(|i| entries[k - 1][i] + (entries[k - 1][i] - above[k - 1][i]) / ratio);
        }
        if row > 0 {
            let off = |i: usize| (entries[row][i] - entries[row - 1][i]).abs() / (1.0 + y[i].abs());
            error = (0..N).map(off).fold(0.0, f64::max);
        }
        if row + 1 == ROWS || row > 0 && error <= TOLERANCE {
            return (core::array::from_fn(|i| y[i] + entries[row][i]), error);
        }
        above = entries;
    }
    unreachable!("the last row ends it")
}

/// Returns the change of y over the time `h` by Gragg's midpoint rule with `n` substeps and
/// smoothing at the end.
fn midpoint<const N: usize>(
    f: &impl Fn(f64, &[f64; N]) -> [f64; N],
    t: f64,
    h: f64,
    y: &[f64; N],
    start: &[f64; N],
    n: usize,
) -> [f64; N] {
    let step = h / n as f64;
    let mut before = [0.0; N];
    let mut here: [f64; N] = core::array::from_fn(|i| step * start[i]);
    for k in 1..n {
        let at: [f64; N] = core::array::from_fn(|i| y[i] + here[i]);
        let rate = f(t + k as f64 * step, &at);
        let next = core::array::from_fn(|i| before[i] + 2.0 * step * rate[i]);
        before = core::mem::replace(&mut here, next);
    }
    let at: [f64; N] = core::array::from_fn(|i| y[i] + here[i]);
    let rate = f(t + h, &at);
    core::array::from_fn(|i| 0.5 * (before[i] + here[i] + step * rate[i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_swing_of_many_turns_is_followed_to_rounding() {
        let f = |_: f64, y: &[f64; 2]| [y[1], -y[0]];
        let mut y = [0.0, 1.0];
        for k in 0..400 {
            y = advance(&f, f64::from(k) * 0.25, 0.25, &y);
        }
        // 400 steps, each within the tolerance of 1e-14.
        assert!((y[0] - 100.0_f64.sin()).abs() < 4e-12 && (y[1] - 100.0_f64.cos()).abs() < 4e-12, "{y:?}");
    }

    #[test]
    fn an_interval_that_is_too_long_is_halved() {
        let end = advance(&|t: f64, _: &[f64; 1]| [(40.0 * t).cos()], 0.0, 1.0, &[0.0]);
        assert!((end[0] - 40.0_f64.sin() / 40.0).abs() < 1e-14, "{end:?}");
    }
}
