//! What the rig keeps stable of the scene that the user sees, by the computation of the server.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;

use hbot_api::InfoOk;
use hbot_config::advice::{Abilities, StiffnessKey, Told, Warning};
use hbot_config::sweep::{Points, Probe};
use hbot_config::{RunningScene, SceneFile};
use serde_json::Value;

use super::reach::{Reach, reach};

/// Number of points of a curve of torque against angle.
const POINTS: usize = 120;
/// Number of answers that are kept: more than the rows of a panel.
const KEPT: usize = 12;

/// Judges scenes by what a server has told of its rig, and keeps the results: a window is drawn
/// many times for each change.
///
/// A border takes 20 ms for one spring, and up to 0.8 s for the ready-made scenes. So a thread
/// computes it, and until it has done so the window shows the last one.
#[derive(Debug, Default)]
pub(crate) struct Judged {
    told: Option<(Told, Arc<Abilities>)>,
    /// Where an effect of a scene, given by its index, reaches a limit of the torque, N m.
    reached: Option<((Value, usize, f64), Option<Reach>)>,
    /// The answers that are known, the last one first.
    known: Vec<(Question, Answer)>,
    /// The questions that the thread has not answered yet.
    asked: Vec<Question>,
    /// The thread. `None`: each question is answered at once.
    judge: Option<Apart>,
}

/// A question about a scene.
#[derive(Clone, Debug, PartialEq)]
struct Question {
    about: About,
    /// The scene. If a border is asked for, the stiffness in question is null in it, because its
    /// border does not depend on it.
    scene: Value,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum About {
    Warnings,
    /// The torque of the scene against angle.
    Curves,
    /// The border of a stiffness, at most `most`.
    Border {
        key: StiffnessKey,
        most: f64,
    },
}

impl About {
    /// Returns whether an answer to `other` is an older answer to this question.
    fn replaces(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Warnings, Self::Warnings) | (Self::Curves, Self::Curves) => true,
            (Self::Border { key, .. }, Self::Border { key: older, .. }) => key == older,
            _ => false,
        }
    }
}

#[derive(Clone, Debug)]
enum Answer {
    Warnings(Vec<Warning>),
    Curves(Option<[Points; 3]>),
    Border(Option<f64>),
}

impl Question {
    fn answer(&self, abilities: &Abilities) -> Answer {
        match self.about {
            About::Warnings => {
                let file = SceneFile::from_json(self.scene.clone()).ok();
                Answer::Warnings(file.map(|file| abilities.warnings(&file)).unwrap_or_default())
            }
            About::Curves => {
                let file = SceneFile::from_json(self.scene.clone()).ok();
                Answer::Curves(file.map(|file| Probe::new(&file).about_axes(POINTS)))
            }
            About::Border { key, most } => {
                let judge = abilities.judge.as_ref();
                Answer::Border(judge.and_then(|judge| judge.stiffness_border(&self.scene, key, most)))
            }
        }
    }
}

impl Judged {
    /// Creates a judge with a thread of its own. `wake` is called after each answer, so that the
    /// window is drawn again.
    pub(crate) fn apart(wake: impl Fn() + Send + 'static) -> Self {
        Self { judge: Apart::start(wake), ..Self::default() }
    }

    /// Takes what the server tells of its rig.
    pub(crate) fn take(&mut self, info: &InfoOk) {
        let told = Told::from(info);
        if self.told.as_ref().is_none_or(|(known, _)| *known != told) {
            let judge = self.judge.take();
            *self = Self {
                told: Some((told.clone(), Arc::new(Abilities::told(told)))),
                judge,
                ..Self::default()
            };
        }
    }

    /// Returns the warnings of `scene`, in the words of the answer to `load_scene`. Returns none if
    /// the scene has kinds or values that the panel does not know.
    pub(crate) fn warnings(&mut self, scene: &Value) -> &[Warning] {
        match self.ask(Question { about: About::Warnings, scene: scene.clone() }) {
            Some(Answer::Warnings(warnings)) => warnings,
            _ => &[],
        }
    }

    /// Returns the torque of `scene` about n1, n2 and n3, N m, against the angle about this axis
    /// from the scene's anchor, rad. Returns `None` if it is not known.
    pub(crate) fn curves(&mut self, scene: &Value) -> Option<&[Points; 3]> {
        match self.ask(Question { about: About::Curves, scene: scene.clone() }) {
            Some(Answer::Curves(curves)) => curves.as_ref(),
            _ => None,
        }
    }

    /// Returns where the effect with the index `effect` of `scene` reaches the torque `limit`, N m.
    /// Returns `None` if it has no torque at rest, or if the panel does not know the scene.
    pub(crate) fn reach(&mut self, scene: &Value, effect: usize, limit: f64) -> Option<Reach> {
        let is_known =
            |(known, of, to): &(Value, usize, f64)| known == scene && (*of, *to) == (effect, limit);
        if let Some((_, reached)) = self.reached.as_ref().filter(|(known, _)| is_known(known)) {
            return *reached;
        }
        let file = SceneFile::from_json(scene.clone()).ok();
        let found = file.and_then(|file| reach(&RunningScene::new().load(file), effect, limit));
        self.reached = Some(((scene.clone(), effect, limit), found));
        found
    }

    /// Returns the largest stiffness at `key` with which the loop keeps `scene` stable, N m/rad; at
    /// most `most`. Returns `None` if it is not known.
    pub(crate) fn border(&mut self, scene: &Value, key: StiffnessKey, most: f64) -> Option<f64> {
        let scene = key.put(scene, Value::Null);
        match self.ask(Question { about: About::Border { key, most }, scene }) {
            Some(Answer::Border(border)) => *border,
            _ => None,
        }
    }

    /// Returns the answer to a question, or the last answer to an older one while the thread
    /// computes.
    fn ask(&mut self, question: Question) -> Option<&Answer> {
        let (_, abilities) = self.told.as_ref()?;
        if let Some(judge) = &self.judge {
            for (of, question, answer) in judge.answers.try_iter() {
                self.asked.retain(|asked| *asked != question);
                // What another server told counts no more.
                if Arc::ptr_eq(&of, abilities) {
                    self.known.insert(0, (question, answer));
                }
            }
        }
        if let Some(at) = self.known.iter().position(|(known, _)| *known == question) {
            return Some(&self.known[at].1);
        }
        match &self.judge {
            None => {
                let answer = question.answer(abilities);
                self.known.insert(0, (question.clone(), answer));
            }
            Some(judge) if !self.asked.contains(&question) => {
                self.asked.retain(|asked| !question.about.replaces(&asked.about));
                self.asked.push(question.clone());
                // The thread lives as long as this sender, so this does not fail.
                let _ = judge.questions.send((Arc::clone(abilities), question.clone()));
            }
            Some(_) => {}
        }
        self.known.truncate(KEPT);
        self.known.iter().find(|(known, _)| question.about.replaces(&known.about)).map(|(_, answer)| answer)
    }
}

/// A thread that answers questions, the newest of each kind. It ends when this value is dropped.
#[derive(Debug)]
struct Apart {
    questions: Sender<Asked>,
    answers: Receiver<(Arc<Abilities>, Question, Answer)>,
}

/// A question, and the abilities of the rig that it is about.
type Asked = (Arc<Abilities>, Question);

impl Apart {
    /// Returns `None` if the system gives no thread.
    fn start(wake: impl Fn() + Send + 'static) -> Option<Self> {
        let ((questions, inbox), (tell, answers)) = (channel(), channel());
        let judge = move || {
            let mut waiting = Vec::new();
            while let Some((abilities, question)) = next(&mut waiting, &inbox) {
                let answer = question.answer(&abilities);
                if tell.send((abilities, question, answer)).is_err() {
                    return;
                }
                wake();
            }
        };
        thread::Builder::new().name("judge".to_owned()).spawn(judge).ok()?;
        Some(Self { questions, answers })
    }
}

/// Waits for the next question. An older one that another replaces is forgotten. Returns `None` if
/// the window has gone.
fn next(waiting: &mut Vec<Asked>, inbox: &Receiver<Asked>) -> Option<Asked> {
    if waiting.is_empty() {
        waiting.push(inbox.recv().ok()?);
    }
    for asked in inbox.try_iter() {
        waiting.retain(|(_, older)| !asked.1.about.replaces(&older.about));
        waiting.push(asked);
    }
    // Curves take little time, and follow a slider at once.
    let curves = waiting.iter().position(|(_, question)| question.about == About::Curves);
    Some(waiting.remove(curves.unwrap_or(0)))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use hbot_config::RigConfig;
    use hbot_config::advice::StiffnessBound;
    use serde_json::json;

    /// What a server tells of the prototype without a lead.
    pub(crate) fn told() -> InfoOk {
        let mut rig = RigConfig::prototype();
        rig.rig = rig.rig.with(|parts| parts.lead = None).expect("legal");
        let bound = StiffnessBound::of(&rig).expect("legal inertias");
        let told = hbot_api::LoopInfo::from(bound.sampled());
        let limits = &rig.rig.limits;
        serde_json::from_value(json!({"rig": {"rate_hz": rig.rate_hz},
            "limits": {"torque": limits.torque, "torque_rate": limits.torque_rate, "speed": limits.speed},
            "render": {"loop": told}}))
        .expect("an answer to info")
    }

    fn scene(damping: f64) -> Value {
        json!({"name": "S", "effect": [{"id": "s", "kind": "spring", "stiffness": 40.0, "damping": damping}]})
    }

    #[test]
    fn a_curve_does_not_wait_for_a_border() {
        let abilities = Arc::new(Abilities::told(Told::from(&told())));
        let border = About::Border { key: StiffnessKey { effect: 0, axis: None }, most: 400.0 };
        let asked = |about| (Arc::clone(&abilities), Question { about, scene: scene(0.01) });
        let (questions, inbox) = channel();
        for question in [border, About::Curves, About::Warnings].map(asked) {
            questions.send(question).expect("a queue");
        }
        let mut waiting = Vec::new();
        let order = [(); 3].map(|()| next(&mut waiting, &inbox).expect("a question").1.about);
        assert_eq!(order, [About::Curves, border, About::Warnings]);
    }

    /// The window never waits: until the thread has answered, it has the last answer.
    #[test]
    fn a_thread_comes_to_the_same_answers() {
        let key = StiffnessKey { effect: 0, axis: None };
        let (mut at_once, (woken, wakes)) = (Judged::default(), channel());
        let mut apart = Judged::apart(move || woken.send(()).unwrap_or_default());
        at_once.take(&told());
        apart.take(&told());
        let mut last = None;
        for damping in [0.01, 0.02, 0.03] {
            let scene = scene(damping);
            let (border, warnings) = (at_once.border(&scene, key, 400.0), at_once.warnings(&scene).to_vec());
            assert!(
                border.is_some_and(|border| border > 1.0) && warnings.len() == 1,
                "{border:?} {warnings:?}"
            );
            assert_eq!(apart.border(&scene, key, 400.0), last, "the last answer");
            apart.warnings(&scene);
            (0..2).for_each(|_| wakes.recv_timeout(std::time::Duration::from_secs(60)).expect("an answer"));
            assert_eq!(apart.border(&scene, key, 400.0), border);
            assert_eq!(apart.warnings(&scene), warnings);
            last = border;
        }
        // Another server, another rig: nothing of before is shown.
        let mut other = told();
        other.limits.torque *= 2.0;
        apart.take(&other);
        assert_eq!(apart.border(&scene(0.01), key, 400.0), None);
        drop(apart);
        while wakes.recv_timeout(std::time::Duration::from_secs(60)).is_ok() {}
    }
}
