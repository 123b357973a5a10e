//! Stiffness, damping and virtual mass in a scene file: one number for all directions, or a matrix.

use hbot_core::Mat3;
use hbot_core::render::impedance::is_impedance;
use schemars::{Schema, json_schema};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::document::Report;

/// The legal values of a matrix in words. It also marks a matrix in a schema.
const MATRIX: &str = "three for the axes, such as [2,3,4], or a symmetric positive semidefinite 3x3 matrix";

/// Replaces three numbers, one for each axis, by the matrix with them on its diagonal, in each key
/// of `table` that `schema` allows to be a matrix.
pub(in crate::scene) fn to_matrices(schema: &Value, table: &mut Value) {
    for (key, value) in table.as_object_mut().into_iter().flatten() {
        let branches = schema["properties"][key]["anyOf"].as_array().into_iter().flatten();
        let Value::Array(elements) = &*value else { continue };
        if let [a, b, c] = &elements[..]
            && elements.iter().all(Value::is_number)
            && branches.into_iter().any(|branch| branch["legal"] == MATRIX)
        {
            *value = json!([[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, c]]);
        }
    }
}

/// A stiffness, damping or virtual mass: one number for all directions, or the rows of a symmetric
/// positive semidefinite 3x3 matrix.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub(super) enum Impedance {
    Number(f64),
    Rows([[f64; 3]; 3]),
}

impl Impedance {
    /// Returns the value as a 3x3 matrix. If the matrix is not symmetric and positive semidefinite,
    /// adds a mistake at `path` to the report and returns `None`.
    pub(super) fn matrix(&self, path: &str, report: &mut Report) -> Option<Mat3> {
        let rows = match self {
            Self::Number(x) => return Some(Mat3::from_diagonal(hbot_core::Vec3::splat(*x))),
            Self::Rows(rows) => rows,
        };
        // The matrix is symmetric, so its rows can stand for its columns.
        let matrix = Mat3::from_cols_array_2d(rows);
        if is_impedance(&matrix) {
            return Some(matrix);
        }
        let pairs = [(0, 1), (0, 2), (1, 2)];
        // The same tolerance for rounding as `is_impedance` of the core.
        let largest = rows.iter().flatten().fold(0.0_f64, |most, x| most.max(x.abs()));
        let uneven =
            |&(i, j): &(usize, usize)| (rows[i][j] - rows[j][i]).abs() > 64.0 * f64::EPSILON * largest;
        let message = match pairs.iter().find(|pair| uneven(pair)) {
            Some(&(i, j)) => format!(
                "the matrix is not symmetric: row {}, column {} is {} and row {}, column {} is {}",
                i + 1,
                j + 1,
                rows[i][j],
                j + 1,
                i + 1,
                rows[j][i]
            ),
            None => {
                "the matrix is not positive semidefinite: it would push away in some direction".to_owned()
            }
        };
        report.push(path, message, MATRIX.to_owned());
        None
    }
}

/// Returns the JSON schema of a number from 0 to `most`, or of a 3x3 matrix whose elements are at
/// most `most` in size. The schema names the unit `unit`.
fn schema(most: f64, unit: &str) -> Schema {
    json_schema!({
        "anyOf": [
            { "type": "number", "minimum": 0.0, "maximum": most, "unit": unit },
            {
                "type": "array", "minItems": 3, "maxItems": 3,
                "legal": MATRIX,
                "items": {
                    "type": "array", "minItems": 3, "maxItems": 3,
                    "items": { "type": "number", "minimum": -most, "maximum": most, "unit": unit }
                }
            }
        ],
        "unit": unit
    })
}

/// Returns the JSON schema of a stiffness of at most 1000 N m/rad.
pub(super) fn stiffness(_: &mut schemars::SchemaGenerator) -> Schema {
    schema(1000.0, "N m/rad")
}

/// Returns the JSON schema of a damping of at most 100 N m s/rad.
pub(super) fn damping(_: &mut schemars::SchemaGenerator) -> Schema {
    schema(100.0, "N m s/rad")
}

/// Returns the JSON schema of a virtual mass of at most 1 kg m².
pub(super) fn mass(_: &mut schemars::SchemaGenerator) -> Schema {
    schema(1.0, "kg m²")
}
