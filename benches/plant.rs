//! Measures the time of one step of the simulated plant, for each integration method, with 2 and 4
//! wheels. The sphere is held by a spring and driven by two sines.
//!
//! `cargo bench --bench plant`

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use hbot_core::{Device, Quat, Vec3, WheelSpec};
use hbot_sim::plant::{JointTorques, Method, Plant, PlantState, Sine, SpringDamper, Sum};
use hbot_testing::prototype::{self, of_the_task};

fn device(wheels: usize) -> Device {
    let axes = [[1.0, 0.0, -1.0], [-1.0, 0.0, -1.0], [0.0, 1.0, -1.0], [0.0, -1.0, -1.0]];
    let wheel = |axis| of_the_task(WheelSpec { axis: Vec3::from_array(axis), ..prototype::wheels()[0] });
    Device::new(0.102, 0.467, &axes.map(wheel)[..wheels]).expect("a legal device")
}

fn steps(c: &mut Criterion) {
    let spring = SpringDamper { stiffness: 4.0, damping: 0.05, reference: Quat::IDENTITY };
    let drive = Sum(
        Sine { amplitude: Vec3::new(0.5, 0.0, 0.0), hertz: 2.0 },
        Sine { amplitude: Vec3::new(0.0, 0.3, 0.0), hertz: 3.0 },
    );
    let load = Sum(spring, drive);
    let mut group = c.benchmark_group("plant");
    for wheels in [2, 4] {
        let plant = Plant::new(&device(wheels)).expect("a possible plant");
        for method in Method::ALL {
            group.bench_function(BenchmarkId::new(format!("{method:?}"), wheels), |b| {
                let (mut state, mut t) = (PlantState::default(), 0.0);
                let h = 1.0e-3;
                b.iter(|| {
                    plant.step(method, &mut state, t, h, black_box(&JointTorques::default()), &load);
                    t += h;
                    state.omega
                });
            });
        }
    }
    group.finish();
}

criterion_group!(benches, steps);
criterion_main!(benches);
