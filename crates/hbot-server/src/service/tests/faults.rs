//! Tests of faults, of the flight log, and of the end of the service.

use hbot_sim::controller::InjectedFault;

use super::*;

fn logs(dir: &std::path::Path) -> Vec<std::path::PathBuf> {
    let mut all: Vec<_> = std::fs::read_dir(dir).unwrap().map(|entry| entry.unwrap().path()).collect();
    all.sort();
    all
}

#[test]
fn a_fault_leaves_a_log_of_the_second_before_and_a_tenth_after() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("flights");
    let bench = TestService::start(TestOptions { flight_dir: Some(path.clone()), ..TestOptions::default() });
    let mut client = bench.active();
    bench.wait_ticks(1200);
    bench.with_rig(|rig| rig.inject(InjectedFault::Hot { joint: 1, on: true }));
    let told = fault_event(&mut client);
    assert_eq!((told.fault, &told.by), (Some(hbot_api::Fault::Thermal), &None), "by itself");
    bench.wait_ticks(150);
    let summary = bench.finish();
    assert_eq!((summary.flight_logs, summary.dropped_samples), (1, 0));

    let [log] = &logs(&path)[..] else { panic!("{:?}", logs(&path)) };
    assert!(log.to_str().unwrap().ends_with("-thermal.csv"), "{log:?}");
    assert_eq!(told.flight_log.as_deref(), log.to_str());
    let mut table = csv::Reader::from_path(log).unwrap();
    let names = table.headers().unwrap().clone();
    let column =
        |name: &str| names.iter().position(|n| n == name).unwrap_or_else(|| panic!("{name}: {names:?}"));
    let rows: Vec<_> = table.records().map(|row| row.unwrap()).collect();
    let ticks: Vec<u64> = rows.iter().map(|row| row[column("tick")].parse().unwrap()).collect();
    let expected: Vec<u64> = (told.tick - 1000..=told.tick + 100).collect();
    assert_eq!(ticks, expected);
    let mode = |i: usize| (rows[i][column("mode")].to_owned(), rows[i][column("fault")].to_owned());
    assert_eq!(mode(999), ("active".to_owned(), String::new()));
    assert_eq!(mode(1000), ("fault".to_owned(), "thermal".to_owned()));
    for name in
        ["q_w", "omega_x_rad_s", "torque_z_nm", "joint4_torque_nm", "compute_us", "age_us", "energy_j"]
    {
        assert!(rows[500][column(name)].parse::<f64>().unwrap().is_finite(), "{name}");
    }
}

#[test]
fn a_log_that_is_not_complete_is_written_at_the_end() {
    let dir = tempfile::tempdir().unwrap();
    let bench = TestService::start(TestOptions {
        flight_dir: Some(dir.path().to_owned()),
        // The loop is slowed down, so that the service ends before 100 ticks have passed.
        breath: Duration::from_millis(5),
        ..TestOptions::default()
    });
    bench.client("c").call(Op::Estop).unwrap();
    bench.finish();
    assert_eq!(logs(dir.path()).len(), 1);
}

#[test]
fn a_folder_that_cannot_be_written_is_counted() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("file");
    std::fs::write(&file, "in the way").unwrap();
    let bench =
        TestService::start(TestOptions { flight_dir: Some(file.join("flights")), ..TestOptions::default() });
    bench.client("c").call(Op::Estop).unwrap();
    bench.wait_ticks(150);
    let summary = bench.finish();
    assert_eq!((summary.flight_logs, summary.flight_logs_failed), (0, 1));
}

#[test]
fn old_logs_go() {
    let dir = tempfile::tempdir().unwrap();
    for i in 0..40 {
        std::fs::write(dir.path().join(format!("flight-20000101T0000{i:02}.000Z-1-001-estop.csv")), "")
            .unwrap();
    }
    std::fs::write(dir.path().join("notes.csv"), "").unwrap();
    let bench =
        TestService::start(TestOptions { flight_dir: Some(dir.path().to_owned()), ..TestOptions::default() });
    bench.client("c").call(Op::Estop).unwrap();
    bench.finish();
    let left = logs(dir.path());
    assert_eq!(left.len(), crate::flight::MAX_FILES + 1, "and what is no log");
    assert!(left[0].to_str().unwrap().contains("T000021"), "{:?}", left[0]);
}

#[test]
fn the_end_is_told() {
    let bench = bench();
    let mut client = bench.client("c");
    let mut raw = bench.raw();
    let waiting = std::thread::spawn(move || {
        event(&mut client, "stopping event", |event| match event {
            Event::Stopping(stopping) => Some(stopping.message.clone()),
            _ => None,
        })
    });
    bench.finish();
    assert_eq!(waiting.join().unwrap(), "the server stops");
    assert_eq!(raw.rest(), "", "one that has not said hello is told nothing");
}

#[test]
fn the_service_ends_with_the_loop() {
    let bench = TestService::start(TestOptions {
        ticks: Some(5000),
        breath: Duration::ZERO,
        ..TestOptions::default()
    });
    let mut bench = bench;
    // Nothing asks the service to stop.
    let shutdown = bench.shutdown.take();
    let summary = bench.end().unwrap();
    assert_eq!((summary.ticks, summary.dropped_samples), (5000, 0));
    drop(shutdown);
}
