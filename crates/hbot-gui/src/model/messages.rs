//! What has happened, for people: the newest for a moment over the window, the last hundred in a list.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Messages kept.
const MAX_MESSAGES: usize = 100;

/// Whether a message is good news.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Weight {
    Good,
    Bad,
}

/// One of them.
#[derive(Clone, Debug)]
pub(crate) struct Message {
    pub(crate) weight: Weight,
    pub(crate) text: String,
    pub(crate) at: Instant,
    /// It stands elsewhere in the window as well, and needs no place over it.
    pub(crate) told: bool,
    /// Times that it came without another between.
    pub(crate) times: u32,
}

/// The last hundred.
#[derive(Debug, Default)]
pub(crate) struct Messages {
    list: VecDeque<Message>,
}

impl Messages {
    pub(crate) fn add(&mut self, weight: Weight, text: String) {
        self.keep(weight, text, false);
    }

    /// Into the list alone: the window tells it elsewhere.
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

    /// All, newest first.
    pub(crate) fn newest_first(&self) -> impl ExactSizeIterator<Item = &Message> {
        self.list.iter().rev()
    }

    /// Those that have not been read yet by anybody who reads fast, newest first. Bad news stay longer.
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
