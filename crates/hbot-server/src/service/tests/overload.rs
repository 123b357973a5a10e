//! Tests with clients that read too slowly or ask too much.

use hbot_api::DroppedEvent;

use super::*;

fn bounds() -> Bounds {
    Bounds { outgoing: 32, stuck: Duration::from_secs(3600), ..TestOptions::default().bounds }
}

#[test]
fn a_slow_reader_loses_states_and_is_told_how_many() {
    let bench = TestService::start(TestOptions {
        bounds: bounds(),
        breath: Duration::ZERO,
        ..TestOptions::default()
    });
    let mut slow = greeted(&bench);
    slow.send(r#"{"id": 1, "op": "subscribe", "every": 1}"#);
    let mut other = bench.client("other");
    let dropped = |client: &mut Client| client.stats().unwrap().dropped_states;
    // States fill the buffers of the operating system, then the queue, and then they are dropped.
    // The other client is served meanwhile.
    let deadline = Instant::now() + PATIENCE;
    while dropped(&mut other) < 1000 {
        assert!(Instant::now() < deadline);
    }
    // When the client reads again, the received and the dropped states together are consecutive
    // ticks without a gap.
    let mut last = None;
    let (mut hole, mut told) = (0, None);
    while told.is_none() {
        let line = slow.line();
        match line["event"].as_str() {
            Some("state") => {
                let tick = line["tick"].as_u64().unwrap();
                hole += last.map_or(0, |last: u64| tick - last - 1);
                last = Some(tick);
            }
            Some("dropped") => told = Some(serde_json::from_value::<DroppedEvent>(line).unwrap()),
            _ => {}
        }
    }
    let told = told.unwrap();
    assert_eq!((hole, told.count), (0, told.total));
    // The next state is the first after the dropped ones.
    let next = loop {
        let line = slow.line();
        if line["event"] == "state" {
            break line["tick"].as_u64().unwrap();
        }
        assert_ne!(line["event"], "dropped", "two in a row");
    };
    assert_eq!(next, last.unwrap() + told.count + 1);
    other.call(Op::Ping { data: Value::Null }).unwrap();
    assert_eq!(bench.finish().connections_cut, 0);
}

#[test]
fn one_that_reads_no_answers_is_cut_and_others_are_not() {
    let bench = TestService::start(TestOptions { bounds: bounds(), ..TestOptions::default() });
    let mut other = bench.client("other");
    let mut deaf = greeted(&bench);
    deaf.stream.set_write_timeout(Some(PATIENCE)).unwrap();
    let ask = format!("{{\"id\": 1, \"op\": \"ping\", \"data\": \"{}\"}}\n", "x".repeat(2000));
    // Answers fill the buffers of the operating system and then the queue. Then the connection is
    // cut.
    while deaf.stream.write_all(ask.as_bytes()).is_ok() {}
    bench.wait_until("one client", |status| status.clients == 1);
    other.call(Op::Ping { data: Value::Null }).unwrap();
    assert_eq!(bench.finish().connections_cut, 1);
}

#[test]
fn one_that_is_stuck_is_cut() {
    let bounds = Bounds { stuck: Duration::from_millis(200), ..bounds() };
    let bench = TestService::start(TestOptions { bounds, breath: Duration::ZERO, ..TestOptions::default() });
    let mut stuck = greeted(&bench);
    stuck.send(r#"{"id": 1, "op": "subscribe", "every": 1}"#);
    bench.wait_until("the client", |status| status.clients == 1);
    bench.wait_until("no client", |status| status.clients == 0);
    assert_eq!(bench.finish().connections_cut, 1);
}

#[test]
fn a_flood_of_commands_does_not_keep_an_estop_back() {
    let bench = bench();
    let mut flood = JsonLines::connect(bench.address);
    flood.send(r#"{"id": 0, "op": "hello", "version": 1, "name": "flood"}"#);
    flood.line();
    flood.ask(r#"{"id": 1, "op": "acquire"}"#);
    let mut other = bench.client("other");
    let line = "{\"op\": \"torque\", \"torque\": [0, 0, 0], \"valid_ms\": 10}\n".repeat(2000);
    let writing = {
        let mut stream = flood.stream.try_clone().unwrap();
        std::thread::spawn(move || {
            // Writes until the server has ended.
            while stream.write_all(line.as_bytes()).is_ok() {}
        })
    };
    bench.wait_until("a flood", |status| status.sample.is_some_and(|s| s.state.client.is_some()));
    let before = other.call(Op::Ping { data: Value::Null }).unwrap()["tick"].as_u64().unwrap();
    assert_eq!(other.call(Op::Estop).unwrap()["mode"], "estop");
    let stopped = fault_event(&mut other).tick;
    assert!(stopped >= before);
    bench.wait_for(Mode::Estop);
    let summary = bench.finish();
    writing.join().unwrap();
    assert_eq!(summary.dropped_samples, 0);
}

#[test]
fn eight_subscribers_of_every_tick_all_get_every_tick() {
    let bench =
        TestService::start(TestOptions { breath: Duration::from_millis(1), ..TestOptions::default() });
    let mut clients: Vec<_> = (0..8).map(|i| bench.client(&format!("c{i}"))).collect();
    for client in &mut clients {
        client.subscribe(1).unwrap();
    }
    // All are read in turns. Of a client that waits for the others, states would be dropped if the
    // machine is busy.
    let mut last = [None; 8];
    for _ in 0..200 {
        for (client, last) in clients.iter_mut().zip(&mut last) {
            let tick = event(client, "state", |event| match event {
                Event::State(state) => Some(state.tick),
                _ => None,
            });
            assert!(last.is_none_or(|last: u64| tick == last + 1));
            *last = Some(tick);
        }
    }
    assert_eq!(bench.finish().dropped_states, 0);
}
