//! Tests of the solver on problems with known solutions.

use super::super::law::Law;
use super::*;

fn row(terms: &[(usize, f64)]) -> Row {
    terms.iter().fold(Row::EMPTY, |row, (at, by)| row.and(*at, *by))
}

fn element(law: Law, rows: &[Row]) -> Element {
    let mut all = [Row::EMPTY; MAX_DIMENSION];
    all[..rows.len()].copy_from_slice(rows);
    Element { law, dimension: rows.len(), rows: all, impulse: [0.0; MAX_DIMENSION] }
}

fn friction(limit: f64, rows: &[Row]) -> Element {
    element(Law::Friction { limit }, rows)
}

/// Solves one step for masses that only the laws in `elements` couple. Returns the masses' speeds
/// at the end of the step, and how many iterations the solver needed.
fn solved(mass: &[f64], momentum: &[f64], elements: &mut [Element]) -> (Vec<f64>, Effort) {
    let mut problem = StepProblem::EMPTY;
    problem.n = mass.len();
    for (i, mass) in mass.iter().enumerate() {
        problem.mass[i][i] = *mass;
        problem.momentum[i] = momentum[i];
    }
    let mut speeds = [0.0; MAX_SPEEDS];
    let effort = Workspace::new(elements.len()).solve(&mut problem, elements, &mut speeds);
    assert!(effort.converged, "{effort:?}");
    (speeds[..mass.len()].to_vec(), effort)
}

/// Largest velocity that the solver can leave to a sticking part, relative to the velocities in the
/// test.
const LEFT: f64 = 1.0e-12;

#[test]
fn friction_takes_its_limit_or_all_there_is() {
    let x = row(&[(0, 1.0)]);
    for (limit, speed, impulse) in [(0.0, 2.5, 0.0), (3.0, 1.0, 3.0), (5.0, 0.0, 5.0), (9.0, 0.0, 5.0)] {
        let mut elements = [friction(limit, &[x])];
        let (speeds, _) = solved(&[2.0], &[5.0], &mut elements);
        assert!((speeds[0] - speed).abs() < 3.0 * LEFT, "limit {limit}: {}", speeds[0]);
        assert!((elements[0].impulse[0] - impulse).abs() < 10.0 * LEFT, "limit {limit}");
    }
    let mut elements = [friction(f64::INFINITY, &[x])];
    let (speeds, _) = solved(&[2.0], &[-5.0], &mut elements);
    assert!(speeds[0].abs() < 3.0 * LEFT && (elements[0].impulse[0] + 5.0).abs() < 10.0 * LEFT);
}

/// Friction acts on a velocity with three components, as it does in the cage. The sphere slides, so
/// the size of the impulse is the friction limit, and its direction is opposite to the velocity.
#[test]
fn friction_of_three_components_points_against_the_motion() {
    let mut elements = [friction(1.0, &[row(&[(0, 1.0)]), row(&[(1, 1.0)]), row(&[(2, 1.0)])])];
    let (speeds, _) = solved(&[2.0; 3], &[2.0, -1.0, 2.0], &mut elements);
    // The momentum is |r| = 3, of which 2 are left.
    for (speed, momentum) in speeds.iter().zip([2.0, -1.0, 2.0]) {
        assert!((speed - momentum / 3.0).abs() < LEFT, "{speeds:?}");
    }
}

/// If several friction laws act on one velocity, the total friction limit is the sum of their
/// limits. This holds although the share of each law in the total impulse is not unique.
#[test]
fn laws_that_say_the_same_add_up() {
    let x = row(&[(0, 1.0)]);
    for momentum in [2.0, 7.0] {
        let mut elements = [friction(1.0, &[x]), friction(2.0, &[row(&[(0, 2.0)])]), friction(0.0, &[x])];
        let (speeds, _) = solved(&[1.0], &[momentum], &mut elements);
        // The second law acts on twice the velocity, so it takes 4.
        let left = (momentum - 5.0f64).max(0.0);
        assert!((speeds[0] - left).abs() < 10.0 * LEFT, "{speeds:?}");
        let taken = elements[0].impulse[0] + 2.0 * elements[1].impulse[0] + elements[2].impulse[0];
        assert!((taken - (momentum - left)).abs() < 10.0 * LEFT, "{taken}");
    }
}

#[test]
fn without_momentum_nothing_moves() {
    let x = row(&[(0, 1.0)]);
    let mut elements =
        [friction(1.0, &[x]), friction(0.0, &[x]), element(Law::Gap { low: 0.0, high: 0.0 }, &[x])];
    let (speeds, effort) = solved(&[1.0], &[0.0], &mut elements);
    assert_eq!((speeds[0], effort.rounds, effort.newton), (0.0, 1, 0));
    // Impulses that balance each other from the step before also stay.
    let mut elements = [friction(1.0, &[x]), friction(1.0, &[x])];
    (elements[0].impulse[0], elements[1].impulse[0]) = (0.75, -0.75);
    let (speeds, _) = solved(&[1.0], &[0.0], &mut elements);
    assert_eq!(speeds[0], 0.0);
    assert_eq!((elements[0].impulse[0], elements[1].impulse[0]), (0.75, -0.75));
}

/// A stop limits the speed of one mass relative to another. A relative speed below the stop's upper
/// bound does not change, and a larger one is reduced to the bound. The total momentum is
/// conserved, even if one mass is 1e12 times the other.
#[test]
fn a_gap_is_open_up_to_its_end() {
    for mass in [1.0, 1e-6, 1e-12] {
        let difference = row(&[(0, 1.0), (1, -1.0)]);
        for (high, momentum, wanted) in [(0.5, 0.25, 0.25), (0.5, 1.0, 0.5), (0.0, 1.0, 0.0)] {
            let mut elements = [element(Law::Gap { low: -2.0, high }, &[difference])];
            let (speeds, _) = solved(&[mass, 1.0], &[momentum * mass, 0.0], &mut elements);
            assert!((speeds[0] - speeds[1] - wanted).abs() < 10.0 * LEFT, "{mass:e}: {speeds:?}");
            let kept = mass * speeds[0] + speeds[1];
            assert!((kept - momentum * mass).abs() < 10.0 * LEFT * mass, "{mass:e}: {kept:e}");
        }
    }
}
