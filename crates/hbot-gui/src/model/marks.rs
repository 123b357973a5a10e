//! Moments that explain the curves of the plots: another scene, a changed parameter, a stop.

use std::collections::VecDeque;

use super::SPAN_S;

/// Largest number of marks that are kept.
const MAX_MARKS: usize = 64;
/// Two changes of one parameter that are closer than this become one mark at the later one, because
/// a slider that is dragged makes many, s.
const MERGED_S: f64 = 1.0;
/// Time in which the server blends the torque after a change, s (docs/effects.md).
const BLEND_S: f64 = 0.05;

/// What happened at a mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum What {
    Scene,
    Set,
    Fault,
}

/// A moment that the plots mark.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Mark {
    pub(crate) what: What,
    /// Time of the mark on the control loop's clock, s.
    pub(crate) t: f64,
    /// A short description, such as `spring: stiffness = 2`.
    pub(crate) text: String,
}

/// The marks of the last [`SPAN_S`] seconds, oldest first, and the newest change of the scene.
#[derive(Clone, Debug, Default)]
pub(crate) struct Marks {
    list: VecDeque<Mark>,
    /// The newest change of the scene, and the time from which the torque is that of the new scene
    /// alone, s.
    changed: Option<(Mark, f64)>,
}

impl Marks {
    /// Adds a mark. `fading_s` is how long the torque can still contain the scene before, in
    /// addition to the blend.
    pub(crate) fn add(&mut self, mark: Mark, fading_s: f64) {
        if mark.what != What::Fault {
            self.changed = Some((mark.clone(), mark.t + BLEND_S.max(fading_s)));
        }
        if let Some(last) = self.list.back_mut()
            && (last.what, subject(&last.text)) == (mark.what, subject(&mark.text))
            && mark.t - last.t < MERGED_S
        {
            *last = mark;
            return;
        }
        self.list.retain(|old| mark.t - old.t <= SPAN_S);
        if self.list.len() == MAX_MARKS {
            self.list.pop_front();
        }
        self.list.push_back(mark);
    }

    /// Returns the marks from the time `from` to the time `to`, oldest first.
    pub(crate) fn between(&self, from: f64, to: f64) -> impl Iterator<Item = &Mark> {
        self.list.iter().filter(move |mark| from <= mark.t && mark.t <= to)
    }

    /// Returns the newest change of the scene, and the time from which the torque is that of the
    /// new scene alone, s.
    pub(crate) const fn changed(&self) -> Option<&(Mark, f64)> {
        self.changed.as_ref()
    }

    /// Records that the effects of the newest scene fade in or out for `fading_s`. The panel learns
    /// it only after the scene has begun.
    pub(crate) fn fades(&mut self, fading_s: f64) {
        if let Some((mark, until)) = &mut self.changed {
            *until = until.max(mark.t + fading_s);
        }
    }

    pub(crate) fn clear(&mut self) {
        *self = Self::default();
    }
}

/// Returns what a mark is about: the text before the value, if there is one.
fn subject(text: &str) -> &str {
    text.split(" = ").next().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(t: f64, text: &str) -> Mark {
        Mark { what: What::Set, t, text: text.to_owned() }
    }

    #[test]
    fn a_dragged_slider_leaves_one_mark_and_another_parameter_its_own() {
        let mut marks = Marks::default();
        for k in 0..1000 {
            marks.add(set(f64::from(k) * 0.01, &format!("spring: stiffness = {k}")), 0.0);
        }
        marks.add(set(10.0, "spring: damping = 0.1"), 0.0);
        let texts: Vec<_> = marks.between(0.0, 20.0).map(|mark| mark.text.as_str()).collect();
        assert_eq!(texts, ["spring: stiffness = 999", "spring: damping = 0.1"]);
        assert_eq!(marks.changed().expect("changed").1, 10.0 + BLEND_S);
    }

    #[test]
    fn marks_are_bounded_and_a_fault_does_not_change_the_scene() {
        let mut marks = Marks::default();
        for k in 0..1000 {
            marks.add(Mark { what: What::Fault, t: f64::from(k) * 0.01, text: k.to_string() }, 0.0);
        }
        assert_eq!(marks.between(0.0, 100.0).count(), MAX_MARKS);
        assert_eq!(marks.changed(), None);
        marks.add(set(9.99 + 2.0 * SPAN_S, "spring: gain = 1"), 3.0);
        assert_eq!(marks.between(0.0, 100.0).count(), 1, "older ones are no longer in any plot");
        assert_eq!(marks.changed().expect("changed").1, 9.99 + 2.0 * SPAN_S + 3.0);
    }
}
