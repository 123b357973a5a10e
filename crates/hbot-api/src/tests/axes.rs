//! The conversions of axes, and `docs/axes.md` with them.

use crate::Axes;

const PAGE: &str = include_str!("../../../../docs/axes.md");

/// Rounding of a few products of numbers of about 1.
const ROUNDING: f64 = 1e-15;

/// Returns `q v q*` for a unit quaternion `[w, x, y, z]`: the formula that all programs use,
/// whatever the handedness of their axes.
fn rotated(q: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let [w, x, y, z] = q;
    let u = [x, y, z];
    let t = cross(u, v).map(|c| 2.0 * c);
    let s = cross(u, t);
    [0, 1, 2].map(|k| v[k] + w * t[k] + s[k])
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(q: [f64; 4]) -> [f64; 4] {
    let norm = q.iter().map(|c| c * c).sum::<f64>().sqrt();
    q.map(|c| c / norm)
}

/// Puts a quaternion of another program into the order w, x, y, z.
fn scalar_first(axes: Axes, q: [f64; 4]) -> [f64; 4] {
    if axes == Axes::Chai3d { q } else { [q[3], q[0], q[1], q[2]] }
}

#[track_caller]
fn assert_close(a: &[f64], b: &[f64]) {
    assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() <= ROUNDING), "{a:?} {b:?}");
}

/// Unit vectors, and one without symmetry.
const VECTORS: [[f64; 3]; 4] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.3, -0.5, 0.7]];

/// Quarter turns about each axis, and one without symmetry.
fn turns() -> [[f64; 4]; 4] {
    [[1.0, 1.0, 0.0, 0.0], [1.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 1.0], [0.4, 0.1, -0.7, 0.5]].map(unit)
}

#[test]
fn a_converted_quaternion_turns_converted_vectors() {
    for axes in Axes::ALL {
        for q in turns() {
            for v in VECTORS {
                let there = rotated(scalar_first(axes, axes.quaternion(q)), axes.vector(v));
                assert_close(&there, &axes.vector(rotated(q, v)));
            }
        }
    }
}

/// The velocity of a point is omega x r, whatever the axes: so an angular velocity converts as an
/// axial vector.
#[test]
fn the_velocity_of_a_point_is_the_cross_product_in_all_axes() {
    for axes in Axes::ALL {
        for omega in VECTORS {
            for r in VECTORS {
                let there = cross(axes.axial(omega), axes.vector(r));
                assert_close(&there, &axes.vector(cross(omega, r)));
            }
        }
    }
}

#[test]
fn every_conversion_has_an_inverse() {
    for axes in Axes::ALL {
        for v in VECTORS {
            assert_eq!(axes.vector_to_n(axes.vector(v)), v);
            assert_eq!(axes.axial_to_n(axes.axial(v)), v);
        }
        for q in turns() {
            assert_eq!(axes.quaternion_to_n(axes.quaternion(q)), q);
        }
    }
}

#[test]
fn handedness_is_that_of_the_axes() {
    for axes in Axes::ALL {
        let [right, away, up] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|v| axes.vector(v));
        // In frame N, right x away is up.
        let up = up.map(|c| c * axes.handedness());
        assert_close(&cross(right, away), &up);
    }
}

/// Returns the cells of the row that begins with `name` in the table under a heading of the page.
fn row(heading: &str, name: &str) -> Vec<&'static str> {
    let (_, section) = PAGE.split_once(&format!("\n## {heading}\n")).unwrap_or_else(|| panic!("{heading}"));
    let line = section.lines().find(|line| line.starts_with(&format!("| {name} |")));
    let line = line.unwrap_or_else(|| panic!("docs/axes.md, {heading}: no row {name}"));
    line.trim_matches('|').split('|').map(str::trim).collect()
}

/// Reads `-n2, n1, n3`, and computes it from a vector.
fn by_the_page(cell: &str, v: [f64; 3]) -> Vec<f64> {
    let component = |text: &str| {
        let (sign, name) = text.strip_prefix('-').map_or((1.0, text), |name| (-1.0, name));
        let k = ["n1", "n2", "n3"].iter().position(|n| *n == name).unwrap_or_else(|| panic!("{text}"));
        sign * v[k]
    };
    cell.split(", ").map(component).collect()
}

/// Reads `-q1, w, q3`, and computes it from a quaternion `[w, q1, q2, q3]`.
fn quaternion_by_the_page(cell: &str, q: [f64; 4]) -> Vec<f64> {
    let component = |text: &str| {
        let (sign, name) = text.strip_prefix('-').map_or((1.0, text), |name| (-1.0, name));
        let names = ["w", "q1", "q2", "q3"];
        sign * q[names.iter().position(|n| *n == name).unwrap_or_else(|| panic!("{text}"))]
    };
    cell.split(", ").map(component).collect()
}

#[test]
fn the_page_has_the_conversions() {
    for (axes, name) in Axes::ALL.into_iter().zip(["ROS", "Unity", "Unreal", "CHAI3D"]) {
        let cells = row("The table", name);
        assert_eq!(cells.len(), 8, "{name}");
        assert_eq!(cells[2], if axes.handedness() > 0.0 { "right" } else { "left" }, "{name}");
        assert_eq!(cells[3], if axes.units_per_metre() > 1.0 { "cm" } else { "m" }, "{name}");
        for v in VECTORS {
            assert_close(&by_the_page(cells[4], v), &axes.vector(v));
            assert_close(&by_the_page(cells[5], v), &axes.axial(v));
        }
        for q in turns() {
            assert_close(&quaternion_by_the_page(cells[6], q), &axes.quaternion(q));
        }
        assert_eq!(cells[7], format!("`{axes}`"), "the name in programs");
    }
}

#[test]
fn the_page_has_a_quarter_turn() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    for (axes, name) in Axes::ALL.into_iter().zip(["ROS", "Unity", "Unreal", "CHAI3D"]) {
        let cells = row("Known vectors", name);
        let written = |cell: &str| -> Vec<f64> { cell.split(", ").map(|n| n.parse().unwrap()).collect() };
        assert_eq!(written(cells[1]), axes.vector([1.0, 0.0, 0.0]));
        assert_eq!(written(cells[2]), axes.vector([0.0, 1.0, 0.0]));
        let turn = axes.quaternion([half, 0.0, 0.0, half]);
        // The page has four digits.
        for (written, computed) in written(cells[3]).iter().zip(turn) {
            assert!((written - computed).abs() < 5e-5, "{name}: {turn:?}");
        }
    }
}
