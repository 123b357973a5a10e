//! Messages for the user. The window shows a new message for some seconds, in a line of its own. A
//! list keeps the last hundred.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Largest number of messages to the user that are kept.
const MAX_MESSAGES: usize = 100;

/// How much a message concerns the user.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Weight {
    Good,
    /// Nothing is wrong, but the user must know it.
    Warn,
    Bad,
}

/// One message to the user.
#[derive(Clone, Debug)]
pub(crate) struct Message {
    pub(crate) weight: Weight,
    pub(crate) text: String,
    pub(crate) at: Instant,
    /// Whether the window also shows this message in another place. Such a message is only in the
    /// list.
    pub(crate) told: bool,
    /// How many times this message came in succession.
    pub(crate) times: u32,
}

/// The last messages to the user, at most a hundred.
#[derive(Debug, Default)]
pub(crate) struct Messages {
    list: VecDeque<Message>,
}

impl Messages {
    pub(crate) fn add(&mut self, weight: Weight, text: String) {
        self.keep(weight, text, false);
    }

    /// Adds a message that the window also shows in another place. It is only added to the
    /// list.
    pub(crate) fn add_told(&mut self, weight: Weight, text: String) {
        self.keep(weight, text, true);
    }

    fn keep(&mut self, weight: Weight, text: String, told: bool) {
        if let Some(last) = self.list.back_mut()
            && last.text == text
        {
            (last.weight, last.told) = (weight, told);
            last.times += 1;
            last.at = Instant::now();
            return;
        }
        if self.list.len() == MAX_MESSAGES {
            self.list.pop_front();
        }
        self.list.push_back(Message { weight, text, at: Instant::now(), told, times: 1 });
    }

    /// Ends the time for which messages that end with `ending` have a line, because they are no
    /// longer so.
    pub(crate) fn hide(&mut self, ending: &str) {
        let over = self.list.iter_mut().filter(|message| message.text.ends_with(ending));
        over.for_each(|message| message.told = true);
    }

    /// Returns all messages that are kept, newest first.
    pub(crate) fn newest_first(&self) -> impl ExactSizeIterator<Item = &Message> {
        self.list.iter().rev()
    }

    /// Returns the messages that are new now, newest first. Good news are new for 3 s, all others
    /// for 8 s.
    pub(crate) fn fresh(&self) -> impl Iterator<Item = &Message> {
        self.newest_first().take_while(|message| message.at.elapsed() < Duration::from_secs(8)).filter(
            |message| match message.weight {
                _ if message.told => false,
                Weight::Good => message.at.elapsed() < Duration::from_secs(3),
                Weight::Warn | Weight::Bad => true,
            },
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_over_is_hidden_until_it_comes_again() {
        let mut messages = Messages::default();
        for _ in 0..2 {
            messages.add(Weight::Warn, "taken".to_owned());
            assert_eq!(messages.fresh().count(), 1);
            messages.hide("taken");
            assert_eq!(messages.fresh().count(), 0);
        }
    }

    #[test]
    fn messages_are_bounded_and_repeats_are_counted() {
        let mut messages = Messages::default();
        for k in 0..1000 {
            messages.add(Weight::Bad, k.to_string());
            messages.add(Weight::Bad, k.to_string());
        }
        assert_eq!(messages.newest_first().len(), MAX_MESSAGES);
        let newest = messages.newest_first().next().expect("one");
        assert_eq!((newest.text.as_str(), newest.times), ("999", 2));
    }
}
