//! Measures the time to pass a sample from the loop to the service: through the ring buffer alone,
//! and to another thread and back.
//!
//! `cargo bench --bench handover`

use std::hint::black_box;
use std::sync::atomic::{AtomicBool, Ordering};

use criterion::{Criterion, criterion_group, criterion_main};
use hbot_config::RigConfig;
use hbot_core::{CompiledScene, Controller, Inputs};
use hbot_host::run_loop::sample::{Counters, Sample, TickTiming};
use rtrb::RingBuffer;

fn sample() -> Sample {
    let mut controller = Controller::new(RigConfig::prototype().rig);
    Sample {
        state: controller.tick(&CompiledScene::empty(), &Inputs::quiet(1)).state,
        t_ns: 1_000_000,
        scene: 0,
        timing: TickTiming::default(),
        counters: Counters::default(),
        answers: [None; 8],
        telemetry: Default::default(),
        complaints: Default::default(),
        restarted: false,
    }
}

fn rings(c: &mut Criterion) {
    let sample = sample();
    let mut group = c.benchmark_group("handover");
    group.bench_function("push_and_pop", |b| {
        let (mut into, mut out) = RingBuffer::new(4096);
        b.iter(|| into.push(black_box(sample)).is_ok() && out.pop().is_ok());
    });
    group.bench_function("to_another_thread_and_back", |b| {
        let (mut there, mut far) = RingBuffer::<Sample>::new(16);
        let (mut back, mut home) = RingBuffer::<Sample>::new(16);
        let stop = AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !stop.load(Ordering::Relaxed) {
                    match far.pop() {
                        Ok(sample) => back.push(sample).expect("one is on its way at a time"),
                        Err(_) => std::hint::spin_loop(),
                    }
                }
            });
            b.iter(|| {
                there.push(black_box(sample)).expect("one is on its way at a time");
                loop {
                    match home.pop() {
                        Ok(sample) => break sample.state.tick,
                        Err(_) => std::hint::spin_loop(),
                    }
                }
            });
            stop.store(true, Ordering::Relaxed);
        });
    });
    group.finish();
}

criterion_group!(benches, rings);
criterion_main!(benches);
