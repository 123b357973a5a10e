//! Tests of the whole crate: the bytes in messages, what is refused, and the client against a small
//! server.

mod axes;
mod client;
mod docs;
mod golden;
mod refusals;
mod render;
mod round_trip;
mod samples;
mod speed;
mod splitter;
mod stop;
mod text;

use crate::{Encoding, Splitter};

/// Returns the single message in `bytes`, without the newline or length that frames it.
fn unframed(encoding: Encoding, bytes: &[u8]) -> Vec<u8> {
    let mut splitter = Splitter::with_limit(encoding, crate::MAX_ANSWER_BYTES);
    splitter.push(bytes);
    let message = splitter.next_message().expect("whole").expect("legal").to_vec();
    assert_eq!(splitter.pending(), 0);
    message
}

fn encoded<T: serde::Serialize>(encoding: Encoding, message: &T) -> Vec<u8> {
    let mut bytes = Vec::new();
    encoding.encode(message, &mut bytes).expect("finite");
    bytes
}
