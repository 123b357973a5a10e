//! The bytes of an answer.

use core::ops::Deref;

use hbot_link::{FromController, MAX_FEEDBACK_FRAME, encode};

/// The bytes of one frame to send to the host, with its delimiter. Use it as a `&[u8]`.
#[derive(Clone, Debug)]
pub struct Answer {
    frame: [u8; MAX_FEEDBACK_FRAME],
    length: usize,
}

impl Answer {
    pub(crate) fn new(message: &FromController) -> Option<Self> {
        let mut frame = [0; MAX_FEEDBACK_FRAME];
        // The longest frame fits, so this is never `None`.
        let length = encode(message, &mut frame).ok()?;
        Some(Self { frame, length })
    }
}

impl Deref for Answer {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.frame[..self.length]
    }
}
