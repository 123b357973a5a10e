//! Parameters of the effect `track`: a spring towards a moving reference.

use hbot_core::Quat;
use hbot_core::render::effects::{self, Kind};
use hbot_core::rotation::{angle_between, to_wxyz};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::target::{Anchor, IDENTITY, UP, target, unit_quaternion, unit_vector};
use super::{EffectKind, IdleKey, idle_keys};
use crate::document::{Report, join};

/// Largest number of points in a track, the kind of effect that moves the sphere along a path.
pub(in crate::scene) const MAX_POINTS: usize = 800;

/// A spring that pulls the sphere towards a moving reference. The reference follows a sine, a
/// chirp, waypoints or a recorded path.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Track {
    /// How the reference moves: to and fro (`sine` or `chirp`), or along `points` (`waypoints` or
    /// `record`).
    path: Path,
    /// Axis of a sine or chirp, in frame N (fixed in space). Any length except zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    axis: [f64; 3],
    /// Largest angle of a sine or chirp in either direction.
    #[schemars(range(min = 0.0, max = 3.0), extend("unit" = "rad"))]
    amplitude: f64,
    /// Frequency of a sine, or start frequency of a chirp.
    #[schemars(range(min = 0.0, max = 50.0), extend("unit" = "Hz"))]
    frequency: f64,
    /// End frequency of a chirp.
    #[schemars(range(min = 0.0, max = 50.0), extend("unit" = "Hz"))]
    frequency_end: f64,
    /// Time in which a chirp goes from `frequency` to `frequency_end`.
    #[schemars(range(min = 0.001, max = 3600.0), extend("unit" = "s"))]
    sweep_s: f64,
    /// Points of `waypoints` or `record`, each [t, w, x, y, z]: the time t in s, ascending from 0,
    /// and an orientation relative to the reference.
    #[schemars(
        length(max = MAX_POINTS),
        inner(inner(range(min = -100_000.0, max = 100_000.0))),
        extend("legal" = "up to 800 points [t, w, x, y, z]")
    )]
    points: Vec<[f64; 5]>,
    /// Only in a scene file, instead of `points`: a CSV file with the columns t, w, x, y, z. Its
    /// path is relative to the scene file.
    file: String,
    /// Whether the motion repeats without end. A chirp then goes up and down in frequency. Points
    /// start again after the last one, which must equal the first.
    repeat: bool,
    /// Torque of the spring per angle from the moving reference.
    #[schemars(range(min = 0.0, max = 1000.0), extend("unit" = "N m/rad"))]
    stiffness: f64,
    /// Torque of the damper per angular rate relative to the moving reference.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "N m s/rad"))]
    damping: f64,
    /// Angle from the moving reference within which there is no spring torque.
    #[schemars(range(min = 0.0, max = 3.0), extend("unit" = "rad"))]
    deadband: f64,
    /// Orientation from which the path of the moving reference is measured, as a quaternion [w, x,
    /// y, z]. Any length except zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    reference: [f64; 4],
    /// From where `reference` is measured: frame N (fixed in space), or the sphere's orientation
    /// when rendering is enabled.
    anchor: Anchor,
}

/// How the reference of a track moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Path {
    /// The reference turns to and fro about the axis in a sine.
    Sine,
    /// The reference turns to and fro about the axis in a sine whose frequency changes over time.
    Chirp,
    /// The reference goes from point to point with minimum jerk, and rests at each.
    Waypoints,
    /// The reference goes from point to point at constant rates, without resting.
    Record,
}

impl Default for Track {
    fn default() -> Self {
        Self {
            path: Path::Sine,
            axis: UP,
            amplitude: 0.3,
            frequency: 0.25,
            frequency_end: 1.0,
            sweep_s: 10.0,
            points: Vec::new(),
            file: String::new(),
            repeat: false,
            stiffness: 1.0,
            damping: 0.02,
            deadband: 0.0,
            reference: IDENTITY,
            anchor: Anchor::Absolute,
        }
    }
}

impl Track {
    /// Checks the points of a `waypoints` or `record` path. If they are not legal, adds mistakes to
    /// the report and returns `None`.
    fn check_points(&self, path: &str, report: &mut Report) -> Option<()> {
        let at = join(path, "points");
        if self.points.len() < 2 {
            let legal = format!("2 to {MAX_POINTS} points [t, w, x, y, z]");
            report.push(&at, format!("{} points make no path", self.points.len()), legal);
            return None;
        }
        let mut last = None;
        for (i, [t, w, x, y, z]) in self.points.iter().enumerate() {
            let at = format!("{at}[{i}]");
            unit_quaternion([*w, *x, *y, *z], &at, report)?;
            let legal = match last {
                None if *t != 0.0 => Some("0 s at the first point".to_owned()),
                Some(last) if !(*t >= last + 1.0e-3) => Some(format!("{} s or more", last + 1.0e-3)),
                _ => None,
            };
            if legal.is_some() {
                report.push(&format!("{at}[0]"), format!("the time {t} s does not follow"), legal);
                return None;
            }
            last = Some(*t);
        }
        let ends = [self.points.first(), self.points.last()].map(|p| p.map_or(Quat::IDENTITY, orientation));
        /// Largest angle between the first and the last point of a path that repeats, rad. The
        /// reference can move by this angle in a few ticks.
        const CLOSED: f64 = 0.01;
        if self.repeat && angle_between(ends[0], ends[1]) > CLOSED {
            let legal = "a last point that is the first one again".to_owned();
            report.push(&join(path, "repeat"), "the path would jump from its end to its start", legal);
            return None;
        }
        Some(())
    }
}

fn orientation([_, w, x, y, z]: &[f64; 5]) -> Quat {
    Quat::from_xyzw(*x, *y, *z, *w).normalize()
}

impl EffectKind for Track {
    const NAME: &'static str = "track";

    fn compile(&self, path: &str, report: &mut Report) -> Option<Kind> {
        // Checked for every path, because a later `set` can choose one that has points.
        if !self.file.is_empty() {
            let legal = "points here, or a scene file that names the file".to_owned();
            report.push(&join(path, "file"), "a file is read with a scene file alone", legal);
            return None;
        }
        let axis = unit_vector(self.axis, &join(path, "axis"), report);
        let target = target(self.reference, self.anchor, path, report);
        let swing = |to: f64, sweep: f64| {
            Some(effects::TrackPath::Swing {
                axis: axis?,
                amplitude: self.amplitude,
                from: self.frequency,
                to,
                sweep,
                repeat: self.repeat && sweep > 0.0,
            })
        };
        let path = match self.path {
            Path::Sine => swing(self.frequency, 0.0),
            Path::Chirp => swing(self.frequency_end, self.sweep_s),
            Path::Waypoints | Path::Record => {
                self.check_points(path, report)?;
                Some(effects::TrackPath::Points { rest: self.path == Path::Waypoints, repeat: self.repeat })
            }
        };
        Some(Kind::Track(effects::Track {
            target: target?,
            path: path?,
            stiffness: self.stiffness,
            damping: self.damping,
            deadband: self.deadband,
        }))
    }

    fn numbers(&self) -> Vec<f64> {
        let numbers = |point: &[f64; 5]| {
            let [w, x, y, z] = to_wxyz(orientation(point));
            [point[0], w, x, y, z]
        };
        match self.path {
            Path::Waypoints | Path::Record => self.points.iter().flat_map(numbers).collect(),
            Path::Sine | Path::Chirp => Vec::new(),
        }
    }

    fn idle(&self) -> Vec<IdleKey> {
        const SWING: &str = "set path = \"sine\" or path = \"chirp\"";
        const CHIRP: &str = "set path = \"chirp\"";
        const POINTS: &str = "set path = \"waypoints\" or path = \"record\"";
        const ENDING: &str = "set another path (a sine always repeats)";
        match self.path {
            Path::Sine => [
                idle_keys(&["frequency_end", "sweep_s"], "path", CHIRP),
                idle_keys(&["points"], "path", POINTS),
                idle_keys(&["repeat"], "path", ENDING),
            ]
            .concat(),
            Path::Chirp => idle_keys(&["points"], "path", POINTS),
            Path::Waypoints | Path::Record => [
                idle_keys(&["axis", "amplitude", "frequency"], "path", SWING),
                idle_keys(&["frequency_end", "sweep_s"], "path", CHIRP),
            ]
            .concat(),
        }
    }
}
