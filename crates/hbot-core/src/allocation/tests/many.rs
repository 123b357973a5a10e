//! Tests with eight wheels, that is 16 joints: the largest number allowed, with null spaces of 13
//! dimensions and more.

use super::*;

fn reference(rows: &[Vec3], limits: &JointLimits) -> Reference {
    let driven = || (0..rows.len()).filter(|k| limits.driven(*k));
    Reference {
        rows: driven().map(|k| DVec3::new(wide(rows[k].x), wide(rows[k].y), wide(rows[k].z))).collect(),
        peak: driven().map(|k| wide(limits.peak[k])).collect(),
        weight: driven().map(|k| wide(limits.weight[k])).collect(),
    }
}

/// Compares the allocation with the slow reference solver: the largest torque along `axis`, and the
/// cost of making the fraction `part` of that torque.
fn check_against_reference(
    rows: &[Vec3],
    limits: &JointLimits,
    axis: Vec3,
    part: Real,
) -> Result<(), TestCaseError> {
    let reference = reference(rows, limits);
    let wide3 = |v: Vec3| DVec3::new(wide(v.x), wide(v.y), wide(v.z));
    let largest = capability(rows, limits, axis);
    let beyond = allocate(rows, limits, axis * (2.0 * largest));
    check_limits(rows, limits, &beyond)?;
    prop_assert!(fabs(beyond.scale - 0.5) <= ROUNDING && !beyond.deficient, "{beyond:?}");

    let wanted = axis * (part * largest);
    let found = allocate(rows, limits, wanted);
    check_limits(rows, limits, &found)?;
    prop_assert!(found.scale == 1.0 && !found.deficient, "{found:?}");
    prop_assert!((made(rows, &found) - wanted).length() <= ROUNDING * largest);
    let cost: f64 =
        (0..rows.len()).map(|k| 0.5 * wide(limits.weight[k]) * wide(found.torque[k]).powi(2)).sum();
    let least = reference.cost_by_barrier(wide3(wanted));
    // The barrier itself adds a cost: twice its last weight for each joint, where costs are about
    // 1.
    let doubt = 4.0 * wide(ROUNDING) * least + 1e-11;
    prop_assert!((cost - least).abs() <= doubt, "{cost}, not {least}: {found:?}");
    Ok(())
}

proptest! {
    #![proptest_config(config(200))]

    #[test]
    fn sixteen_joints_agree_with_an_interior_point_method(
        (rows, limits) in joints(MAX_JOINTS),
        axis in [-1.0..1.0 as Real, -1.0..1.0, -1.0..1.0],
        part in 0.05..0.95 as Real,
    ) {
        let axis = Vec3::from_array(axis);
        prop_assume!(axis.length() > 0.1);
        check_against_reference(&rows, &limits, axis.normalize(), part)?;
    }

    #[test]
    fn so_do_sixteen_that_are_alike_in_a_few_directions((rows, limits, axis) in lattice(), part in 0.05..0.95 as Real) {
        // Rows that are parallel in groups of three and four, with equal limits and costs. They
        // give facets of many rows and ties of all kinds.
        prop_assume!(axis != Vec3::ZERO && margin(&rows, &limits) > 0.05);
        let rows: Vec<Vec3> = rows.iter().copied().cycle().take(MAX_JOINTS).collect();
        prop_assume!(limits.peak[0] > 0.0);
        check_against_reference(&rows, &limits, axis.normalize(), part)?;
    }
}

proptest! {
    #![proptest_config(config(4))]

    #[test]
    fn the_largest_torque_of_sixteen_is_at_a_corner(
        (rows, limits) in joints(MAX_JOINTS),
        wanted in [-9.0..9.0 as Real, -9.0..9.0, -9.0..9.0],
    ) {
        // The reference tries every corner of the linear program, about two million.
        let wanted = Vec3::from_array(wanted);
        let scale = reference(&rows, &limits).scale(DVec3::new(wide(wanted.x), wide(wanted.y), wide(wanted.z)));
        let found = allocate(&rows, &limits, wanted);
        prop_assert!((wide(found.scale) - scale).abs() <= wide(ROUNDING) * scale, "{found:?} {scale}");
    }
}
