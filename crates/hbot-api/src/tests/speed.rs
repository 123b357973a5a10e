//! Checks the cost of encoding a state. The server encodes one for each subscriber in every tick.

use super::samples;
use crate::{Encoding, Event};

#[test]
fn a_state_is_encoded_without_taking_memory() {
    let event = Event::State(samples::state());
    for encoding in Encoding::ALL {
        let mut out = Vec::with_capacity(4096);
        let took = allocation_counter::measure(|| encoding.encode(&event, &mut out).unwrap());
        assert_eq!(took.count_total, 0, "{encoding}");
    }
}
