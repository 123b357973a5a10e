//! Parameters of a track.

use hbot_core::Quat;
use hbot_core::effects::{self, Kind};
use hbot_core::rotation::{angle_between, to_wxyz};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::EffectKind;
use super::target::{Anchor, IDENTITY, UP, target, unit_quaternion, unit_vector};
use crate::document::{Report, join};

/// The most points of a track.
pub(in crate::scene) const MAX_POINTS: usize = 800;

/// A spring to a reference that moves by itself: along a sine, a chirp, way-points or a record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Track {
    /// How the reference moves.
    path: Path,
    /// The axis of a sine or chirp in N, of any length but zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    axis: [f64; 3],
    /// How far a sine or chirp goes to either side.
    #[schemars(range(min = 0.0, max = 3.0), extend("unit" = "rad"))]
    amplitude: f64,
    /// Frequency of a sine, and of a chirp at its start.
    #[schemars(range(min = 0.0, max = 50.0), extend("unit" = "Hz"))]
    frequency: f64,
    /// Frequency of a chirp at its end.
    #[schemars(range(min = 0.0, max = 50.0), extend("unit" = "Hz"))]
    frequency_end: f64,
    /// How long a chirp takes from one to the other.
    #[schemars(range(min = 0.001, max = 3600.0), extend("unit" = "s"))]
    sweep_s: f64,
    /// Points of way-points or a record, each [t, w, x, y, z]: time in s, ascending from 0, and where to turn to from the reference.
    #[schemars(
        length(max = MAX_POINTS),
        inner(inner(range(min = -100_000.0, max = 100_000.0))),
        extend("legal" = "up to 800 points [t, w, x, y, z]")
    )]
    points: Vec<[f64; 5]>,
    /// In a scene file alone, in place of `points`: a CSV file with the columns t, w, x, y, z, relative to the scene file.
    file: String,
    /// Whether it goes on for ever: a chirp up and down, points from the last, which is the first then, on.
    repeat: bool,
    /// Torque for the angle to the reference.
    #[schemars(range(min = 0.0, max = 1000.0), extend("unit" = "N m/rad"))]
    stiffness: f64,
    /// Torque against the rate relative to the reference's.
    #[schemars(range(min = 0.0, max = 100.0), extend("unit" = "N m s/rad"))]
    damping: f64,
    /// No spring torque within this angle of the reference.
    #[schemars(range(min = 0.0, max = 3.0), extend("unit" = "rad"))]
    deadband: f64,
    /// What the path starts from, a quaternion [w, x, y, z] of any length but zero.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    reference: [f64; 4],
    /// What the reference is measured from.
    anchor: Anchor,
}

/// How the reference moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Path {
    /// To and fro about the axis.
    Sine,
    /// The same, faster and faster.
    Chirp,
    /// From point to point with least jerk, resting at each.
    Waypoints,
    /// From point to point at constant rates.
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
    /// Checks the points of a path that has some.
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
        /// As much as its reference moves in a tick or two.
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
        // Whatever the path: one that is not used yet may be by a later `set`.
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

    fn figures(&self) -> Vec<f64> {
        let figures = |point: &[f64; 5]| {
            let [w, x, y, z] = to_wxyz(orientation(point));
            [point[0], w, x, y, z]
        };
        match self.path {
            Path::Waypoints | Path::Record => self.points.iter().flat_map(figures).collect(),
            Path::Sine | Path::Chirp => Vec::new(),
        }
    }
}
