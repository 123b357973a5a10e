//! At which deflection an effect reaches the rig's torque limit. The law of the effect is asked.

use std::cmp::Ordering;
use std::f64::consts::PI;

use hbot_core::render::around::{Place, Spot, Swing};
use hbot_core::{CompiledScene, Mat3, Quat, Vec3, rotation};

/// Number of steps in which the torque of a law is searched from no deflection to half a turn. Each
/// is about 3 mrad, less than the centiradian that the panel shows.
const STEPS: u32 = 1000;
/// Swing in which the stiffest axis of a law is found: small, so that friction sticks.
const SMALL: f64 = 1.0e-4;
/// A torque that is smaller than its largest value by this part counts as the largest value.
const NEARLY: f64 = 1.0e-6;

/// Where the torque of an effect reaches a limit, while the sphere is at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Reach {
    /// At this angle, rad: from the edge of a wall if there is a wall, and from rest otherwise.
    At { angle: f64, wall: bool },
    /// Nowhere. The effect has its largest torque, N m, for the first time after a turn of `angle`,
    /// rad. Dry friction slides from there on.
    Never { most: f64, angle: f64 },
}

/// Returns where the effect with the index `index` of `scene` reaches the torque `limit`, N m: at
/// the least angle of all its walls and of a turn about its stiffest axis. Returns `None` if it has
/// no torque at rest.
pub(crate) fn reach(scene: &CompiledScene, index: usize, limit: f64) -> Option<Reach> {
    let mut places = Vec::new();
    scene.places(Quat::IDENTITY, |place| {
        if place.effect == index {
            places.push(place);
        }
    });
    let rest = places.iter().find(|place| place.deeper == Vec3::ZERO).copied();
    let found = places.iter().filter_map(|place| {
        let wall = place.spot == Spot::Wall;
        let axis = if place.deeper == Vec3::ZERO { stiffest(scene, index, place)? } else { place.deeper };
        // The end of a dead band is on the way from where the sphere is at rest.
        let from = if wall { *place } else { rest.unwrap_or(*place) };
        let torque = |angle: f64| {
            let q = rotation::exp(axis * angle) * from.q;
            -scene.pull(index, &from, Quat::IDENTITY, q).dot(axis)
        };
        first(limit, wall, torque)
    });
    // What reaches the limit comes first, the sooner the better, and else what has most torque.
    let order = |reach: &Reach| match *reach {
        Reach::At { angle, .. } => (0, angle),
        Reach::Never { most, .. } => (1, -most),
    };
    found.min_by(|a, b| order(a).partial_cmp(&order(b)).unwrap_or(Ordering::Equal))
}

/// Returns the axis in frame N about which the law is stiffest around `place`, or `None` if it has
/// no stiffness there.
fn stiffest(scene: &CompiledScene, index: usize, place: &Place) -> Option<Vec3> {
    let swing = Swing { axes: Mat3::IDENTITY, turn: [SMALL; 3], speed: SMALL };
    let stiffness = scene.around(index, place, Quat::IDENTITY, &swing).stiffness;
    let start = [0, 1, 2].map(|k| stiffness.col(k)).into_iter();
    let start = start.max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?;
    // Each multiplication makes the direction of the largest eigenvalue stronger.
    (0..100).try_fold(start, |axis, _| Some(stiffness * axis.try_normalize()?))?.try_normalize()
}

/// Finds the first angle between 0 and half a turn at which `torque` reaches `limit`.
fn first(limit: f64, wall: bool, torque: impl Fn(f64) -> f64) -> Option<Reach> {
    let most = |k: u32| f64::from(k) * PI / f64::from(STEPS);
    let torques: Vec<f64> = (0..=STEPS).map(|k| torque(most(k))).collect();
    let largest = torques.iter().copied().fold(0.0, f64::max);
    let is_reached = largest >= limit;
    let level = if is_reached { limit } else { (1.0 - NEARLY) * largest };
    let k = torques.iter().position(|torque| largest > 0.0 && *torque >= level)?;
    let (mut low, mut high) = (most(k.saturating_sub(1) as u32), most(k as u32));
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if torque(middle) >= level { high = middle } else { low = middle }
    }
    Some(if is_reached {
        Reach::At { angle: high, wall }
    } else {
        Reach::Never { most: largest, angle: high }
    })
}

impl Reach {
    /// Says in words where an effect reaches the rig's torque limit `limit`, N m.
    pub(crate) fn in_words(self, limit: f64) -> String {
        match self {
            Self::At { angle, wall } => {
                let place = if wall { " in the wall" } else { "" };
                let digits = if angle < 0.1 { 2 } else { 0 };
                format!(
                    "reaches the rig's {limit} N m at {angle:.*} rad ({:.digits$}\u{b0}){place}",
                    2 + digits,
                    angle.to_degrees()
                )
            }
            Self::Never { most, angle } => format!(
                "at most {most:.3} N m, after a turn of {angle:.3} rad: never reaches the rig's {limit} N m"
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hbot_config::{RunningScene, SceneFile};
    use serde_json::{Value, json};

    fn of(mut effect: Value) -> Option<Reach> {
        effect["id"] = "e".into();
        // Another effect must make no difference.
        let first = json!({"id": "first", "kind": "spring", "stiffness": 9.0, "anchor": "here"});
        let file = SceneFile::from_json(json!({"name": "S", "effect": [first, effect]})).expect("legal");
        reach(&RunningScene::new().load(file), 1, 0.9)
    }

    /// The laws round at 1e-16 N m, against 5 N m/rad or less.
    #[track_caller]
    fn angle(reach: Option<Reach>, want: f64) {
        let Some(Reach::At { angle, .. }) = reach else { panic!("{reach:?}") };
        assert!((angle - want).abs() < 1e-9, "{angle}, not {want}");
    }

    #[test]
    fn friction_slides_before_it_reaches_the_limit() {
        let told = of(json!({"kind": "friction", "stiffness": 5.0, "torque": 0.03}));
        let Some(Reach::Never { most, angle: slides }) = told else { panic!("{told:?}") };
        assert!((most - 0.03).abs() < 1e-9 && (slides - 0.006).abs() < 1e-8, "{told:?}");
        let words = told.expect("known").in_words(0.9);
        assert_eq!(words, "at most 0.030 N m, after a turn of 0.006 rad: never reaches the rig's 0.9 N m");
        // Friction that is stronger than the rig holds the sphere like a spring up to the limit.
        angle(of(json!({"kind": "friction", "stiffness": 5.0, "torque": 0.92})), 0.18);
    }

    #[test]
    fn each_law_reaches_the_limit_where_its_own_torque_does() {
        let spring = |law: &str, deadband: f64| json!({"kind": "spring", "stiffness": 5.0, "law": law, "deadband": deadband, "gain": 1.0});
        angle(of(spring("geodesic", 0.1)), 0.28);
        angle(of(spring("quaternion", 0.0)), (0.9_f64 / 5.0).asin());
        let guide = |free: &str| json!({"kind": "guide", "stiffness": 5.0, "free": free, "axis": [1, 2, -1], "pointer": [1, 0, 1]});
        angle(of(guide("axis")), (0.9_f64 / 5.0).asin());
        angle(of(guide("swing")), (0.9_f64 / 5.0).asin());
        angle(of(guide("plane")), 0.5 * (2.0 * 0.9_f64 / 5.0).asin());
        // The reference of a track moves, so its damping would also give a torque.
        angle(of(json!({"kind": "track", "stiffness": 5.0, "damping": 0.0, "deadband": 0.1})), 0.28);
        let matrix = json!([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 5.0]]);
        angle(of(json!({"kind": "spring", "stiffness": matrix, "gain": 2.0})), 0.09);
        let wall = of(json!({"kind": "end_stop", "stiffness": 5.0, "cone": 0.6}));
        angle(wall, 0.18);
        assert!(wall.expect("known").in_words(0.9).ends_with("in the wall"));
        let soft = of(json!({"kind": "spring", "stiffness": 0.5, "law": "quaternion"}));
        let Some(Reach::Never { most, angle }) = soft else { panic!("{soft:?}") };
        // The sine is 1 at a quarter turn, which is one of the steps. Near it the torque differs
        // from its largest value by less than NEARLY in 1.5 mrad.
        assert!((most - 0.5).abs() < 1e-9 && (angle - 0.5 * PI).abs() < 2e-3, "{soft:?}");
        assert_eq!(of(json!({"kind": "damper"})), None, "it has no torque at rest");
    }
}
