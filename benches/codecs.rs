//! Measures the time to encode and decode messages: frames on the serial line, and messages over
//! TCP.
//!
//! `cargo bench --bench codecs`

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use hbot_api::{ClientStream, Encoding, Event, JointState, Mode, Request, StateEvent, StateTiming};
use hbot_link::{
    Command, Decoder, Feedback, FromController, JointReading, MAX_COMMAND_FRAME, MAX_FEEDBACK_FRAME,
    ToController, encode,
};

fn link(c: &mut Criterion) {
    let mut command = Command { sequence: 123_456, enable: true, watchdog_ms: 20, ..Command::default() };
    command.torque.extend_from_slice(&[0.12, -0.034, 0.056, 0.078]).expect("four fit");
    let command = ToController::Command(command);
    let mut feedback = Feedback { sequence: 123_456, ..Feedback::default() };
    for i in 0..4 {
        let reading = JointReading {
            count: 40_000 * (i - 2),
            rate: 1.5,
            current: 0.2,
            temperature: 31.5,
            ..Default::default()
        };
        feedback.joints.push(reading).expect("four fit");
    }
    let feedback = FromController::Feedback(feedback);

    let mut group = c.benchmark_group("link");
    let mut frame = [0; MAX_COMMAND_FRAME];
    group.bench_function("encode_command", |b| b.iter(|| encode(black_box(&command), &mut frame)));
    let mut line = [0; MAX_FEEDBACK_FRAME];
    let n = encode(&feedback, &mut line).expect("it fits");
    group.bench_function("encode_feedback", |b| {
        let mut line = [0; MAX_FEEDBACK_FRAME];
        b.iter(|| encode(black_box(&feedback), &mut line));
    });
    group.bench_function("decode_feedback", |b| {
        let mut decoder = Decoder::<FromController>::new();
        b.iter(|| {
            let mut got = None;
            decoder.feed(black_box(&line[..n]), |frame| got = Some(frame));
            got
        });
    });
    group.finish();
}

fn state() -> Event {
    Event::State(StateEvent {
        tick: 123_456,
        t: 123.456,
        mode: Mode::Active,
        fault: None,
        q: [0.983_347, 0.098_334, -0.126_73, 0.087_25],
        omega: [1.234_567, -0.345_678, 0.012_345],
        reference: Some([0.993_347, 0.078_334, -0.056_73, 0.065_25]),
        torque: [0.123_456, -0.234_567, 0.345_678],
        joints: vec![JointState { angle: 1.234_567_89, rate: -12.345_678, torque: 0.067_891 }; 4],
        slip: 0.000_123,
        scale: 1.0,
        traction: 0.234_5,
        energy: -0.012_34,
        orientation_sigma: None,
        client: Some(ClientStream { seq: Some(77), age_ticks: 2 }),
        hand: None,
        timing: StateTiming {
            lateness_us: 12.3,
            compute_us: 0.9,
            link_us: 8.7,
            age_us: 1003.4,
            lead_us: 2200.0,
        },
    })
}

fn api(c: &mut Criterion) {
    let mut group = c.benchmark_group("api");
    let state = state();
    for (name, encoding) in [("json", Encoding::Json), ("msgpack", Encoding::Msgpack)] {
        let mut out = Vec::with_capacity(4096);
        group.bench_function(format!("encode_state_{name}"), |b| {
            b.iter(|| {
                out.clear();
                encoding.encode(black_box(&state), &mut out).map(|()| out.len())
            });
        });
    }
    let line = br#"{"op": "torque", "torque": [0.1, -0.2, 0.05], "valid_ms": 50, "tick": 123456, "seq": 77}"#;
    group.bench_function("read_torque_json", |b| b.iter(|| Request::read(Encoding::Json, black_box(line))));
    group.finish();
}

criterion_group!(benches, link, api);
criterion_main!(benches);
