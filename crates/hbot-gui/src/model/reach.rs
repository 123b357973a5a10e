//! At which deflection an effect reaches the rig's torque limit. It depends on the law of the kind:
//! dry friction slides before it, and a law with a sine may never reach it.

use std::f64::consts::PI;

use serde_json::Value;

/// Number of steps in which the torque of a law is searched from no deflection to half a turn. Each
/// is about 3 mrad, less than the centiradian that the panel shows.
const STEPS: u32 = 1000;

/// Where the torque of an effect reaches a limit, while the sphere is at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Reach {
    /// At this angle, rad, measured as [`Reach::from`] says.
    At(f64),
    /// Nowhere. The largest torque of the effect is this one, N m.
    Never(f64),
    /// The sphere slides at the torque `torque`, N m, which the effect has after a turn of `angle`,
    /// rad.
    Slides { torque: f64, angle: f64 },
}

/// Returns where an effect of the kind `kind` reaches the torque `limit`, N m. `stiffness` is the
/// stiffness about its stiffest axis, with the gain, and `gain` its gain. `value` returns a
/// parameter. Returns `None` for kinds whose law is not known here.
pub(crate) fn reach<'a>(
    kind: &str,
    [stiffness, gain, limit]: [f64; 3],
    value: impl Fn(&str) -> Option<&'a Value>,
) -> Option<Reach> {
    let number = |key| value(key).and_then(Value::as_f64).unwrap_or(0.0);
    let word = |key| value(key).and_then(Value::as_str).unwrap_or_default();
    let dead = number("deadband");
    // docs/effects.md has the laws. `half` is that of the vector part e of the quaternion.
    let linear = |angle: f64| stiffness * (angle - dead).max(0.0);
    let half = |angle: f64| {
        2.0 * stiffness * (0.5 * angle).cos() * ((0.5 * angle).sin() - (0.5 * dead).sin()).max(0.0)
    };
    let plane = |angle: f64| stiffness * (angle.sin() - dead.sin()).max(0.0) * angle.cos();
    match kind {
        "friction" => {
            let torque = number("torque") * gain;
            Some(if torque < limit {
                Reach::Slides { torque, angle: torque / stiffness }
            } else {
                Reach::At(limit / stiffness)
            })
        }
        "spring" if word("law") == "quaternion" => Some(first(limit, half)),
        "guide" if word("free") == "plane" => Some(first(limit, plane)),
        "guide" => Some(first(limit, half)),
        "spring" | "track" => Some(first(limit, linear)),
        "end_stop" => Some(first(limit, |depth| stiffness * depth)),
        _ => None,
    }
}

/// Finds the first angle between 0 and half a turn at which `torque` reaches `limit`.
fn first(limit: f64, torque: impl Fn(f64) -> f64) -> Reach {
    let at = |k: u32| f64::from(k) * PI / f64::from(STEPS);
    let Some(k) = (1..=STEPS).find(|k| torque(at(*k)) >= limit) else {
        return Reach::Never((0..=STEPS).map(|k| torque(at(k))).fold(0.0, f64::max));
    };
    let (mut low, mut high) = (at(k - 1), at(k));
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if torque(middle) >= limit { high = middle } else { low = middle }
    }
    Reach::At(high)
}

impl Reach {
    /// Says in words where an effect of the kind `kind` reaches the rig's torque limit `limit`,
    /// N m.
    pub(crate) fn in_words(self, kind: &str, limit: f64) -> String {
        match self {
            Self::At(angle) => {
                format!(
                    "reaches the rig's {limit} N m at {angle:.2} rad ({:.0}\u{b0}){}",
                    angle.to_degrees(),
                    Self::from(kind)
                )
            }
            Self::Never(most) => {
                format!("at most {most:.2} N m: never reaches the rig's {limit} N m")
            }
            Self::Slides { torque, angle } => format!(
                "slides at {torque:.3} N m, after {angle:.3} rad: never reaches the rig's {limit} N m"
            ),
        }
    }

    /// Says from where the angle of a kind is measured, if that is not its reference.
    fn from(kind: &str) -> &'static str {
        match kind {
            "end_stop" => " in the wall",
            "guide" => " off the guide",
            "track" => " from the moving reference",
            "friction" => " of a turn",
            _ => "",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn of(kind: &str, stiffness: f64, parameters: &Value) -> Option<Reach> {
        reach(kind, [stiffness, 1.0, 0.9], |key| parameters.get(key))
    }

    /// The tolerance is that of 40 halvings of a step of 3 mrad.
    fn angle(reach: Option<Reach>, want: f64) {
        let Some(Reach::At(angle)) = reach else { panic!("{reach:?}") };
        assert!((angle - want).abs() < 1e-12, "{angle}, not {want}");
    }

    #[test]
    fn friction_slides_before_it_reaches_the_limit() {
        let told = of("friction", 5.0, &json!({"torque": 0.03}));
        assert_eq!(told, Some(Reach::Slides { torque: 0.03, angle: 0.006 }));
        let words = told.expect("known").in_words("friction", 0.9);
        assert!(words.starts_with("slides at 0.030 N m") && !words.contains("reaches the rig's 0.9 N m at"));
        // Friction that is stronger than the rig holds the sphere like a spring up to the limit.
        angle(of("friction", 5.0, &json!({"torque": 2.0})), 0.18);
    }

    #[test]
    fn each_law_reaches_the_limit_where_its_own_torque_does() {
        angle(of("spring", 5.0, &json!({"law": "geodesic", "deadband": 0.1})), 0.28);
        angle(of("spring", 5.0, &json!({"law": "quaternion"})), (0.9_f64 / 5.0).asin());
        angle(of("guide", 5.0, &json!({"free": "axis"})), (0.9_f64 / 5.0).asin());
        angle(of("guide", 5.0, &json!({"free": "plane"})), 0.5 * (2.0 * 0.9_f64 / 5.0).asin());
        angle(of("end_stop", 5.0, &json!({"cone": 0.6})), 0.18);
        let soft = of("spring", 0.5, &json!({"law": "quaternion"}));
        let Some(Reach::Never(most)) = soft else { panic!("{soft:?}") };
        // The sine is 1 at a quarter turn, which is one of the steps.
        assert!((most - 0.5).abs() < 1e-12, "{most}");
        assert_eq!(of("new_kind", 5.0, &json!({})), None, "the panel claims nothing about an unknown law");
    }
}
