//! Messages for the user. The newest ones appear over the window for a moment, and a list keeps the
//! last hundred.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Number of messages kept.
const MAX_MESSAGES: usize = 100;

/// Whether a message is good news or bad news.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Weight {
    Good,
    Bad,
}

/// One message.
#[derive(Clone, Debug)]
pub(crate) struct Message {
    pub(crate) weight: Weight,
    pub(crate) text: String,
    pub(crate) at: Instant,
    /// Whether the window shows this message elsewhere too, so that it does not appear over the
    /// window.
    pub(crate) told: bool,
    /// Number of times that this message came in succession.
    pub(crate) times: u32,
}

/// The last hundred messages.
#[derive(Debug, Default)]
pub(crate) struct Messages {
    list: VecDeque<Message>,
}

impl Messages {
    pub(crate) fn add(&mut self, weight: Weight, text: String) {
        self.keep(weight, text, false);
    }

    /// Adds a message that the window also shows elsewhere. It goes only into the list and does not
    /// appear over the window.
    pub(crate) fn add_told(&mut self, weight: Weight, text: String) {
        self.keep(weight, text, true);
    }

    fn keep(&mut self, weight: Weight, text: String, told: bool) {
        if let Some(last) = self.list.back_mut()
            && last.text == text
        {
            last.times += 1;
            last.at = Instant::now();
            return;
        }
        if self.list.len() == MAX_MESSAGES {
            self.list.pop_front();
        }
        self.list.push_back(Message { weight, text, at: Instant::now(), told, times: 1 });
    }

    /// Returns all messages, newest first.
    pub(crate) fn newest_first(&self) -> impl ExactSizeIterator<Item = &Message> {
        self.list.iter().rev()
    }

    /// Returns the messages to show over the window, newest first. Good news stay for 3 s and bad
    /// news for 8 s.
    pub(crate) fn fresh(&self) -> impl Iterator<Item = &Message> {
        self.newest_first().take_while(|message| message.at.elapsed() < Duration::from_secs(8)).filter(
            |message| match message.weight {
                _ if message.told => false,
                Weight::Good => message.at.elapsed() < Duration::from_secs(3),
                Weight::Bad => true,
            },
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
