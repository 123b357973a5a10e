//! Symmetric positive definite matrices of the size of the number of unknowns, at most 75.

/// A square matrix, stored by rows.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Square {
    size: usize,
    values: Vec<f64>,
}

impl Square {
    pub(crate) fn zero(size: usize) -> Self {
        Self { size, values: vec![0.0; size * size] }
    }

    pub(crate) fn at(&self, row: usize, column: usize) -> f64 {
        self.values[row * self.size + column]
    }

    pub(crate) fn add(&mut self, row: usize, column: usize, value: f64) {
        self.values[row * self.size + column] += value;
    }

    /// Adds `factor` times the product of the vector `v` with itself.
    pub(crate) fn add_outer(&mut self, v: &[f64], factor: f64) {
        for (row, a) in self.values.chunks_exact_mut(self.size).zip(v) {
            for (value, b) in row.iter_mut().zip(v) {
                *value += factor * a * b;
            }
        }
    }

    pub(crate) fn product(&self, other: &Self) -> Self {
        let n = self.size;
        let mut product = Self::zero(n);
        for i in 0..n {
            for k in 0..n {
                let factor = self.at(i, k);
                for j in 0..n {
                    product.values[i * n + j] += factor * other.at(k, j);
                }
            }
        }
        product
    }

    /// Returns the lower triangular factor of the decomposition of Cholesky. Returns `None` if the
    /// matrix is not positive definite.
    pub(crate) fn factor(&self) -> Option<Factor> {
        let n = self.size;
        let mut lower = Self::zero(n);
        for i in 0..n {
            for j in 0..=i {
                let known: f64 = (0..j).map(|k| lower.at(i, k) * lower.at(j, k)).sum();
                let rest = self.at(i, j) - known;
                lower.values[i * n + j] = if i == j {
                    // What rounding leaves of a singular matrix is no pivot.
                    if !(rest > 1.0e-14 * self.at(i, i)) {
                        return None;
                    }
                    rest.sqrt()
                } else {
                    rest / lower.at(j, j)
                };
            }
        }
        Some(Factor(lower))
    }
}

/// The lower triangular factor of a symmetric positive definite matrix.
#[derive(Debug, Clone)]
pub(crate) struct Factor(Square);

impl Factor {
    /// Solves the linear system with the right side `right`.
    pub(crate) fn solve(&self, right: &[f64]) -> Vec<f64> {
        let (n, lower) = (self.0.size, &self.0);
        let mut x = right.to_vec();
        for i in 0..n {
            let known: f64 = (0..i).map(|k| lower.at(i, k) * x[k]).sum();
            x[i] = (x[i] - known) / lower.at(i, i);
        }
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|k| lower.at(k, i) * x[k]).sum();
            x[i] = (x[i] - known) / lower.at(i, i);
        }
        x
    }

    /// Returns the inverse of the matrix.
    pub(crate) fn inverse(&self) -> Square {
        let n = self.0.size;
        let mut inverse = Square::zero(n);
        for j in 0..n {
            let mut unit = vec![0.0; n];
            unit[j] = 1.0;
            for (i, value) in self.solve(&unit).into_iter().enumerate() {
                inverse.values[i * n + j] = value;
            }
        }
        inverse
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_solution_solves_and_an_inverse_inverts() {
        let mut a = Square::zero(3);
        for (factor, v) in [(2.0, [1.0, 2.0, 3.0]), (1.0, [0.5, -1.0, 2.0]), (3.0, [1.0, 0.0, -1.0])] {
            a.add_outer(&v, factor);
        }
        let factor = a.factor().expect("three independent directions");
        let x = factor.solve(&[1.0, 2.0, 3.0]);
        for i in 0..3 {
            let right: f64 = (0..3).map(|j| a.at(i, j) * x[j]).sum();
            assert!((right - (i + 1) as f64).abs() < 1e-12, "{right}");
        }
        let unit = a.product(&factor.inverse());
        for i in 0..3 {
            for j in 0..3 {
                assert!((unit.at(i, j) - f64::from(u8::from(i == j))).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn two_directions_of_three_are_not_positive_definite() {
        let mut a = Square::zero(3);
        a.add_outer(&[1.0, 2.0, 3.0], 1.0);
        a.add_outer(&[0.0, 1.0, 0.0], 1.0);
        assert!(a.factor().is_none());
        a.add_outer(&[0.0, 0.0, 1.0], 1.0);
        assert!(a.factor().is_some());
    }
}
