//! The round trip of questions to one axis, from which the driver knows how old the positions of
//! the axis are.
//!
//! An axis sends its position unasked, and no message says when the position was measured. A
//! question and its answer take the same way as a command and a position, so a position that
//! arrives is at most as old as the round trip. It is half as old if both ways take the same time,
//! and as old if only the way to the host is slow. Nobody can tell these apart, so the driver takes
//! the longer time.

use super::message::{Message, Question};

/// The values that the driver asks each axis for, in turn.
const QUESTIONS: [Question; 2] = [Question::Temperature, Question::Current];
/// Longest round trip, in ticks, that counts as usual. The answer to a question arrives before the
/// next command, or one tick later if the two clocks are unlucky.
const USUAL: u32 = 2;

/// The questions to one axis that are not answered yet, and the round trips of the last answers.
#[derive(Debug, Clone, Default)]
pub(super) struct RoundTrip {
    /// Tick at which each of [`QUESTIONS`] was asked, until it is answered.
    asked: [Option<u32>; QUESTIONS.len()],
    /// Round trips of the last two answers, in ticks, the last one first.
    trips: [Option<u32>; 2],
    /// Index of the next question.
    next: usize,
}

impl RoundTrip {
    /// Returns the next question, which must be sent with the command of `tick`. A question that
    /// has no answer after `given_up` ticks counts as lost.
    pub(super) fn ask(&mut self, tick: u32, given_up: u32) -> Question {
        let at = self.next;
        self.next = (at + 1) % QUESTIONS.len();
        // An answer does not say which of two equal questions it answers. The older one makes the
        // round trip too long and not too short.
        self.asked[at] = self.pending(at, tick, given_up).or(Some(tick));
        QUESTIONS[at]
    }

    /// Returns the tick at which a question was asked, if its answer can still come.
    fn pending(&self, at: usize, tick: u32, given_up: u32) -> Option<u32> {
        self.asked[at].filter(|asked| tick.wrapping_sub(*asked) < given_up)
    }

    /// Records a message that arrived before the command of `tick`. Returns whether the round trip
    /// was unknown before and is known now.
    pub(super) fn hear(&mut self, tick: u32, message: &Message) -> bool {
        let at = match message {
            Message::Temperature { .. } => 0,
            Message::Current { .. } => 1,
            _ => return false,
        };
        let Some(asked) = self.asked[at].take() else { return false };
        let first = self.ticks().is_none();
        self.trips = [Some(tick.wrapping_sub(asked).max(1)), self.trips[0]];
        first
    }

    /// Returns the round trip in ticks, at least 1, or `None` if no question was answered yet. It
    /// is the shorter one of the last two, so that a single answer that was held up does not make
    /// all positions old.
    pub(super) fn ticks(&self) -> Option<u32> {
        let [last, before] = self.trips;
        last.map(|last| before.map_or(last, |before| last.min(before)))
    }

    /// Returns whether the axis must be asked soon: its round trip is unknown, or the last answer
    /// came late and another one must show whether this lasts.
    pub(super) fn is_in_doubt(&self, tick: u32, given_up: u32) -> bool {
        let waits = (0..QUESTIONS.len()).any(|at| self.pending(at, tick, given_up).is_some());
        self.trips[0].is_none_or(|last| last > USUAL && !waits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEMPERATURE: Message = Message::Temperature { inverter: 25.0, motor: 25.0 };
    const CURRENT: Message = Message::Current { setpoint: 0.0, measured: 0.0 };

    #[test]
    fn a_round_trip_counts_when_two_answers_show_it() {
        let mut trip = RoundTrip::default();
        assert_eq!((trip.ticks(), trip.is_in_doubt(0, 50)), (None, true));
        assert!(!trip.hear(3, &TEMPERATURE), "nobody asked");
        assert_eq!(trip.ask(10, 50), Question::Temperature);
        assert!(trip.is_in_doubt(11, 50), "unknown until an answer comes");
        assert!(!trip.hear(11, &CURRENT) && trip.hear(11, &TEMPERATURE));
        assert_eq!((trip.ticks(), trip.is_in_doubt(12, 50)), (Some(1), false));
        assert_eq!(trip.ask(60, 50), Question::Current);
        assert!(!trip.hear(66, &CURRENT));
        // One late answer is looked into. The second one proves it.
        assert_eq!((trip.ticks(), trip.is_in_doubt(67, 50)), (Some(1), true));
        assert_eq!(trip.ask(70, 50), Question::Temperature);
        assert!(!trip.is_in_doubt(71, 50), "the answer must come first");
        assert!(!trip.hear(77, &TEMPERATURE) && !trip.hear(78, &TEMPERATURE), "the second is a copy");
        assert_eq!((trip.ticks(), trip.is_in_doubt(78, 50)), (Some(6), true));
        // A shorter one is believed at once.
        trip.ask(80, 50);
        trip.hear(81, &CURRENT);
        assert_eq!((trip.ticks(), trip.is_in_doubt(82, 50)), (Some(1), false));
    }

    #[test]
    fn of_two_equal_questions_the_older_is_taken_and_a_lost_one_is_given_up() {
        let mut trip = RoundTrip::default();
        for tick in [0, 5, 10] {
            trip.ask(tick, 50);
        }
        // The temperature was asked for in ticks 0 and 10.
        assert!(trip.hear(12, &TEMPERATURE));
        assert_eq!(trip.ticks(), Some(12));
        // The current of tick 5 never comes. It is asked for again, and this time answered.
        trip.ask(70, 50);
        trip.hear(71, &CURRENT);
        assert_eq!(trip.ticks(), Some(1));
        // Ticks wrap at 32 bits.
        trip.ask(u32::MAX, 50);
        trip.hear(2, &TEMPERATURE);
        trip.ask(3, 50);
        trip.hear(6, &CURRENT);
        assert_eq!(trip.ticks(), Some(3));
    }
}
