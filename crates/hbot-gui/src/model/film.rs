//! A recording that the window shows, at one of its moments.

use std::sync::Arc;

use super::sample::quaternion;
use super::{Link, Model, SPAN_S, is_rendering};
use crate::recorded::Recorded;

/// A recording that is open, and the model of the rig at one of its moments. The views draw this
/// model like that of a rig.
#[derive(Debug)]
pub(crate) struct Film {
    pub(crate) recorded: Arc<Recorded>,
    at: usize,
    /// The tick from which the shown scene was rendered.
    scene: Option<u64>,
    pub(crate) model: Model,
    /// Whether the moment goes on by itself.
    pub(crate) playing: bool,
}

impl Film {
    pub(crate) fn new(recorded: Arc<Recorded>) -> Self {
        let mut model = Model::new("", "", 0);
        model.link = Link::Recording;
        model.info = recorded.info.clone();
        let mut film = Self { recorded, at: usize::MAX, scene: None, model, playing: false };
        film.show(0);
        film
    }

    pub(crate) fn name(&self) -> String {
        let path = &self.recorded.path;
        path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
    }

    /// Returns the times of the first and the last state, s.
    pub(crate) fn span(&self) -> [f64; 2] {
        let states = &self.recorded.states;
        [states.first(), states.last()].map(|state| state.map_or(0.0, |state| state.t))
    }

    /// Returns the time of the state that is shown, s.
    pub(crate) fn t(&self) -> f64 {
        self.model.state.as_ref().map_or(0.0, |state| state.t)
    }

    /// Shows the last state that is not after the time `t`, s.
    pub(crate) fn seek(&mut self, t: f64) {
        let after = self.recorded.states.partition_point(|state| state.t <= t);
        self.show(after.saturating_sub(1));
    }

    /// Shows the next state, if there is one.
    pub(crate) fn step(&mut self) {
        self.show(self.at + 1);
    }

    fn show(&mut self, at: usize) {
        if at == self.at {
            return;
        }
        let recorded = Arc::clone(&self.recorded);
        let Some(state) = recorded.states.get(at) else { return };
        // Going on adds to the curves, going back draws them anew.
        let from = if self.at < at { self.at + 1 } else { 0 };
        let first = recorded.states.partition_point(|other| other.t < state.t - SPAN_S);
        if from == 0 {
            self.model.history.clear();
        }
        for state in &recorded.states[from.max(first)..=at] {
            self.model.history.push(Arc::clone(state));
        }
        self.model.marks.clear();
        for mark in recorded.marks.iter().filter(|mark| state.t - SPAN_S <= mark.t && mark.t <= state.t) {
            self.model.marks.add(mark.clone(), 0.0);
        }
        let scene = recorded.scenes.iter().rfind(|(tick, _)| *tick <= state.tick);
        if let Some((tick, scene)) = scene
            && self.scene != Some(*tick)
        {
            self.model.scene.take(scene);
            self.scene = Some(*tick);
        }
        // Where rendering began, if the recording has that moment.
        let before = recorded.states[..at].iter().rposition(|state| !is_rendering(state.mode));
        let began = before.filter(|_| is_rendering(state.mode)).map(|index| &recorded.states[index + 1]);
        self.model.began = began.map(|state| quaternion(state.q));
        self.model.state = Some((**state).clone());
        self.at = at;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Mark, What};
    use hbot_api::{Mode, StateEvent};
    use serde_json::json;

    #[test]
    fn a_recording_shows_what_was_known_at_each_moment() {
        let state = |tick: u64| {
            let mode = if tick < 20 { Mode::Idle } else { Mode::Active };
            Arc::new(StateEvent { tick, t: tick as f64 / 100.0, mode, ..StateEvent::default() })
        };
        let scene = |name: &str| json!({"name": name, "effect": []});
        let recorded = Recorded {
            states: (10..5000).map(state).collect(),
            every: 1,
            scenes: vec![(0, scene("first")), (1000, scene("second"))],
            marks: vec![Mark { what: What::Scene, t: 10.0, text: "scene second".to_owned() }],
            ..Recorded::default()
        };
        let mut film = Film::new(Arc::new(recorded));
        assert_eq!((film.span(), film.t()), ([0.1, 49.99], 0.1));
        assert_eq!((film.model.scene.name(), film.model.began), ("first", None));
        for (t, tick, name, samples, marks) in [
            (9.995, 999, "first", 990, 0),
            (12.0, 1200, "second", 1191, 1),
            (45.0, 4500, "second", 3001, 0),
            (9.0, 900, "first", 891, 0),
            (900.0, 4999, "second", 3001, 0),
            (-5.0, 10, "first", 1, 0),
        ] {
            film.seek(t);
            let model = &film.model;
            assert_eq!(model.state.as_ref().map(|state| state.tick), Some(tick), "at {t} s");
            assert_eq!(model.scene.name(), name, "at {t} s");
            // By rounding, the state of 30 s before is within them or not.
            let shown = model.history.last(SPAN_S).len();
            assert!(shown.abs_diff(samples) <= 1, "{shown} at {t} s");
            assert_eq!(model.marks.between(0.0, t).count(), marks, "at {t} s");
            assert_eq!(model.began.is_some(), tick >= 20, "at {t} s");
            assert!(model.is_live() && !model.is_online() && !model.may_command() && !model.has_hand());
        }
    }
}
