//! What a state costs: the server encodes one for each of its subscribers at every tick.

use super::samples;
use crate::{Encoding, Event};
use std::time::{Duration, Instant};

#[test]
fn a_state_is_encoded_without_taking_memory() {
    let event = Event::State(samples::state());
    for encoding in Encoding::ALL {
        let mut out = Vec::with_capacity(4096);
        let took = allocation_counter::measure(|| encoding.encode(&event, &mut out).unwrap());
        assert_eq!(took.count_total, 0, "{encoding}");
    }
}

/// `cargo test -p hbot-api -- --ignored --nocapture speed` prints the figures.
#[test]
#[ignore = "a measurement"]
fn a_state_is_encoded_quickly() {
    let mut state = samples::state();
    // Figures of full length, as a running rig gives them.
    let mut x = 0.123_456_789_012_345_6_f64;
    let mut next = || {
        x = (x * 997.1).fract() + 1e-3;
        x
    };
    state.q = state.q.map(|_| next());
    state.omega = state.omega.map(|_| next());
    state.torque = state.torque.map(|_| next());
    for joint in &mut state.joints {
        (joint.angle, joint.rate, joint.torque) = (next(), next(), next());
    }
    (state.slip, state.scale, state.traction, state.energy) = (next(), next(), next(), next());
    let event = Event::State(state);
    for encoding in Encoding::ALL {
        let mut out = Vec::with_capacity(4096);
        let (mut best, rounds) = (Duration::MAX, 2000);
        for _ in 0..20 {
            let start = Instant::now();
            for _ in 0..rounds {
                out.clear();
                encoding.encode(std::hint::black_box(&event), &mut out).unwrap();
            }
            best = best.min(start.elapsed() / rounds);
        }
        println!("{encoding}: {best:?} a state of {} bytes", out.len());
    }
}
