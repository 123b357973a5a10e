//! What takes up to a second to say of the running scene: up to which stiffness its springs are
//! stable, and its torque against angle. A thread of its own computes it, and only for a scene that
//! somebody asks about.

use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use hbot_api::StableInfo;
use hbot_config::advice::{Judge, StiffnessBorder, StiffnessBound};
use hbot_config::sweep::{Points, Probe};
use hbot_config::{RigConfig, SceneFile};

use crate::background;

/// Number of points of a curve of torque against angle.
const POINTS: usize = 120;

/// What is said of a scene.
#[derive(Clone, Debug, Default)]
pub(super) struct Said {
    /// Up to which stiffness each spring is stable. `None` if the inertias in the rig file
    /// contradict each other.
    pub(super) stable: Option<Vec<StableInfo>>,
    /// Pairs of an angle about n1, n2 and n3, rad, and the torque about it, N m.
    pub(super) curves: Option<[Vec<[f64; 2]>; 3]>,
}

/// Answers what is said of scenes.
pub(super) struct Outlook {
    /// The judge, and the stiffness above which no spring is stable, N m/rad.
    judge: Option<(Judge, f64)>,
    found: Arc<Mutex<Found>>,
}

#[derive(Default)]
struct Found {
    /// The revision of the scene that was computed last, and what was found.
    last: Option<(u64, Said)>,
    /// Whether the thread is at work.
    busy: bool,
}

impl Outlook {
    pub(super) fn new(rig: &RigConfig, judge: Option<Judge>) -> Self {
        let most = StiffnessBound::of(rig).map(|bound| bound.most()[0]);
        Self { judge: judge.zip(most), found: Arc::default() }
    }

    /// Returns what is known of `scene`, whose revision is `revision`: nothing at first. Then a
    /// thread begins to compute it, unless it is at work for an earlier scene.
    pub(super) fn of(&self, scene: &SceneFile, revision: u64) -> Said {
        let mut found = self.found.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, known)) = found.last.as_ref().filter(|(of, _)| *of == revision) {
            return known.clone();
        }
        if !found.busy {
            let (judge, scene, shared) = (self.judge.clone(), scene.clone(), Arc::clone(&self.found));
            let compute = move || {
                background::give_way();
                let said = said(judge.as_ref(), &scene);
                let mut found = shared.lock().unwrap_or_else(PoisonError::into_inner);
                *found = Found { last: Some((revision, said)), busy: false };
            };
            // Without a thread, only this answer is missing.
            found.busy = thread::Builder::new().name("hbot-outlook".to_owned()).spawn(compute).is_ok();
        }
        Said::default()
    }
}

fn said(judge: Option<&(Judge, f64)>, scene: &SceneFile) -> Said {
    let stable = judge.map(|(judge, most)| {
        let borders = judge.stiffness_borders(scene, *most);
        borders.into_iter().map(told).collect()
    });
    let pairs = |points: Points| points.into_iter().map(|(angle, torque)| [angle, torque]).collect();
    Said { stable, curves: Some(Probe::new(scene).about_axes(POINTS).map(pairs)) }
}

fn told(border: StiffnessBorder) -> StableInfo {
    let StiffnessBorder { effect, axis, stiffness } = border;
    StableInfo { effect, axis: axis.map(|axis| axis as u8 + 1), stiffness }
}
