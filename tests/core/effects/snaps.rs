//! Snaps: from any orientation to the nearest well.

use super::{Felt, anywhere, askew, own, snaps};
use crate::prelude::*;

fn wells(set: SnapSet, figures: &[f64]) -> Vec<Quat> {
    let base = askew().reference().0;
    let quats =
        |all: &[[f64; 4]]| all.iter().map(|g| base * rotation::from_wxyz(*g).unwrap()).collect::<Vec<_>>();
    let x = rotation::exp(Vec3::X * core::f64::consts::FRAC_PI_2);
    let third = rotation::exp(Vec3::ONE.normalize() * (core::f64::consts::TAU / 3.0));
    let half = rotation::exp(Vec3::X * core::f64::consts::PI);
    let golden = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let fifth = rotation::exp(Vec3::new(0.0, golden, 1.0).normalize() * (core::f64::consts::TAU / 5.0));
    match set {
        SnapSet::Own => quats(figures.as_chunks().0),
        SnapSet::Cube => generated(&[x, third]).into_iter().map(|g| base * g).collect(),
        SnapSet::Tetrahedron => generated(&[half, third]).into_iter().map(|g| base * g).collect(),
        SnapSet::Icosahedron => generated(&[fifth, third]).into_iter().map(|g| base * g).collect(),
    }
}

fn generated(by: &[Quat]) -> Vec<Quat> {
    let mut group = vec![Quat::IDENTITY];
    let mut next = 0;
    while next < group.len() {
        for g in by {
            let product = group[next] * *g;
            if group.iter().all(|known| known.dot(product).abs() < 0.999) {
                group.push(product);
            }
        }
        next += 1;
    }
    group
}

/// Returns sin² of half the angle to each well and the well's index, in ascending order.
fn distances(q: Quat, wells: &[Quat]) -> Vec<(f64, usize)> {
    let mut all: Vec<_> = wells.iter().enumerate().map(|(i, g)| (1.0 - q.dot(*g).powi(2), i)).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all
}

/// Releases a sphere without inertia, or with very large damping. It turns in proportion to the
/// torque until it rests. Returns its final orientation.
fn settled(felt: &mut Felt, mut q: Quat) -> Quat {
    for _ in 0..400 {
        let step = felt.at(q) * 0.4;
        q = rotation::renormalized(rotation::exp(step) * q);
        if step.length() < 1e-6 {
            break;
        }
    }
    q
}

#[test]
fn from_ten_thousand_orientations_it_settles_in_the_nearest_well() {
    let figures = own();
    for (set, order) in
        [(SnapSet::Tetrahedron, 12), (SnapSet::Cube, 24), (SnapSet::Icosahedron, 60), (SnapSet::Own, 4)]
    {
        let wells = wells(set, &figures);
        assert_eq!(wells.len(), order);
        let figures: &[f64] = if set == SnapSet::Own { &figures } else { &[] };
        let snaps = snaps(set, figures);
        let mut felt = Felt::with_numbers(Kind::Snaps(snaps), figures);
        let mut rng = Rng(30);
        let (mut contested, mut missed) = (0, 0);
        for _ in 0..10_000 {
            let start = anywhere(&mut rng);
            let from = distances(start, &wells);
            let to = distances(settled(&mut felt, start), &wells);
            assert!(to[0].0 < 1e-8, "{set:?}: it rests {} from any well", to[0].0);
            // On the way down a third well can come as near as the first, within the rounding. Then
            // the ridge between the first two is not a mirror plane.
            let near = from.iter().filter(|(u, _)| *u < from[0].0 + snaps.rounding).count();
            if near > 2 {
                contested += 1;
                let among = from[..near].iter().any(|(_, i)| *i == to[0].1);
                assert!(among, "{set:?}: not in one of the {near} nearest");
                missed += usize::from(to[0].1 != from[0].1);
            } else {
                assert_eq!(to[0].1, from[0].1, "{set:?}: from {start}, {from:?}");
            }
        }
        println!(
            "{set:?}: {} of 10000 in the nearest; {contested} began where three wells are about as near",
            10_000 - missed
        );
        assert!(contested < 700, "{set:?}: {contested} said nothing");
        // A few starts pass near a third well and stay there.
        assert!(missed < 10, "{set:?}: {missed} in another of those that were about as near");
    }
}

/// With inertia a lightly damped sphere can cross a lower ridge. How often it does is measured and
/// not promised, but it does come to rest in a well.
#[test]
fn a_sphere_with_inertia_rests_in_a_well() {
    const INERTIA: f64 = 3.24e-3;
    let wells = wells(SnapSet::Cube, &[]);
    // 0.05 N m s/rad is 0.6 of the critical damping 2 sqrt(K I) for the stiffness of a well. The
    // default 0.01 is 0.12 of it.
    for (damping, least) in [(0.05, 0.98), (0.01, 0.7)] {
        let mut rng = Rng(31);
        let mut nearest = 0;
        for _ in 0..500 {
            let kind = Kind::Snaps(Snaps { damping, ..snaps(SnapSet::Cube, &[]) });
            let mut felt = Felt::new(kind);
            let (mut q, mut omega) = (anywhere(&mut rng), Vec3::ZERO);
            let from = distances(q, &wells)[0].1;
            for _ in 0..8000 {
                omega += felt.moving(q, omega) * (1e-3 / INERTIA);
                q = rotation::renormalized(rotation::exp(omega * 1e-3) * q);
            }
            let to = distances(q, &wells)[0];
            assert!(to.0 < 1e-6, "{} from any well", to.0);
            nearest += usize::from(to.1 == from);
        }
        println!("snaps: with inertia and {damping} N m s/rad {nearest} of 500 rest in the nearest");
        assert!(nearest as f64 >= least * 500.0, "{nearest}");
    }
}

/// Near a well U is a quarter of the square of the angle, so the energy there is that of a spring
/// of A/w.
#[test]
fn every_well_is_a_spring_of_its_strength_over_its_width_and_no_torque_exceeds_the_strength() {
    const ANGLE: f64 = 1e-4;
    let figures = own();
    for set in [SnapSet::Tetrahedron, SnapSet::Cube, SnapSet::Icosahedron, SnapSet::Own] {
        let figures: &[f64] = if set == SnapSet::Own { &figures } else { &[] };
        let law = snaps(set, figures);
        let stiffness = law.strength / law.width;
        let mut felt = Felt::with_numbers(Kind::Snaps(law), figures);
        let mut rng = Rng(32);
        for well in wells(set, figures) {
            let energy = felt.energy(well);
            assert!(energy.abs() < 1e-14, "{set:?}: {energy:e} J in a well");
            let turn = (rotation::exp(rng.vector(3.0)) * Vec3::X) * ANGLE;
            let q = rotation::exp(turn) * well;
            let (torque, energy) = (felt.at(q), felt.energy(q));
            // The next term of the series is smaller by (angle/w)².
            assert!((torque + turn * stiffness).length() < 1e-6 * stiffness * ANGLE, "{set:?}: {torque}");
            // The tolerance is the rounding of U, a difference of numbers near 1.
            assert!((energy - 0.5 * stiffness * ANGLE * ANGLE).abs() < 1e-14, "{set:?}: {energy:e} J");
        }
        let largest = (0..3000).map(|_| felt.at(anywhere(&mut rng)).length()).fold(0.0, f64::max);
        assert!(largest <= law.strength, "{set:?}: {largest} N m");
        assert!(largest > 0.8 * law.strength, "{set:?}: at most {largest} N m");
    }
}
