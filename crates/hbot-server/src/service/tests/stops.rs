//! Tests that a stop does not wait: not for other clients, not for requests of its own client, and
//! not for a message that can be parsed.

use hbot_api::{Event, TorqueCommand};
use hbot_core::inputs::Command;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, DuplexStream};
use tokio::task::yield_now;

use super::super::shared_hub::SharedHub;
use super::connection::{greeted_in_json, still};
use super::*;
use hbot_host::run_loop::bridge::LoopEnd;

const SET: &str = "{\"op\":\"set\",\"effect\":\"spring\",\"stiffness\":1}\n";
const ESTOP: &[u8] = b"{\"id\":\"stop\",\"op\":\"estop\"}\n";

/// Returns a request of about 64 KiB that would take milliseconds to parse.
fn long_ping() -> Vec<u8> {
    format!("{{\"op\":\"ping\",\"data\":[{}]}}\n", vec!["{\"a\":0}"; 8000].join(",")).into_bytes()
}

fn swallow(mut from: tokio::io::ReadHalf<DuplexStream>) {
    tokio::spawn(async move {
        let mut piece = vec![0; 64 * 1024];
        while from.read(&mut piece).await.is_ok_and(|n| n > 0) {}
    });
}

fn requests(hub: &SharedHub) -> u64 {
    hub.lock().summary().requests
}

/// Waits until an emergency stop is requested from the loop. Returns how many times other tasks ran
/// before that.
async fn turns_to_a_stop(loop_end: &LoopEnd) -> u32 {
    for turn in 0..100_000 {
        if loop_end.take_estop() {
            return turn;
        }
        yield_now().await;
    }
    panic!("nothing stops the loop");
}

#[tokio::test]
async fn clients_that_flood_keep_no_stop_from_the_loop() {
    const FLOODS: u64 = 58;
    let (loop_end, hub) = still();
    for _ in 0..FLOODS {
        let (from, mut to) = tokio::io::split(greeted_in_json(&hub, 1 << 20).await);
        swallow(from);
        tokio::spawn(async move {
            let flood = long_ping().repeat(16);
            while to.write_all(&flood).await.is_ok() {}
        });
    }
    let mut stopper = greeted_in_json(&hub, 1 << 20).await;
    for _ in 0..20 {
        for _ in 0..4 {
            yield_now().await;
        }
        let before = requests(&hub);
        stopper.write_all(ESTOP).await.unwrap();
        let turns = turns_to_a_stop(&loop_end).await;
        let others = requests(&hub) - before;
        // There are three tasks per client. The scheduler runs 61 of them between two checks of
        // this test.
        assert!(turns <= 6, "{turns} times 61 tasks");
        // A read of 16 KiB ends a turn, so each client completes less than one of these requests.
        assert!(others <= FLOODS, "{others} requests of others");
    }
}

#[tokio::test]
async fn what_is_read_in_one_turn_is_bounded_whatever_the_pieces() {
    let (_loop_end, hub) = still();
    let (from, mut to) = tokio::io::split(greeted_in_json(&hub, 1 << 20).await);
    swallow(from);
    // Each message is short enough to be parsed. The pipe holds more of them than one turn may
    // process.
    let ping = format!("{{\"op\":\"ping\",\"data\":\"{}\"}}\n", "x".repeat(2000));
    to.write_all(ping.repeat(500).as_bytes()).await.unwrap();
    let (mut most, mut before) = (0, requests(&hub));
    for _ in 0..60 {
        yield_now().await;
        let now = requests(&hub);
        most = most.max(now - before);
        before = now;
    }
    assert!((1..=2).contains(&most), "{most} requests in a turn");
}

#[tokio::test]
async fn a_stop_behind_requests_that_wait_is_found_at_once() {
    for (requests_before, op) in [(400, "{\"op\":\"info\"}\n"), (3000, SET)] {
        let (loop_end, hub) = still();
        let (from, mut to) = tokio::io::split(greeted_in_json(&hub, 1 << 20).await);
        swallow(from);
        to.write_all(op.repeat(requests_before).as_bytes()).await.unwrap();
        to.write_all(ESTOP).await.unwrap();
        let before = requests(&hub);
        let _ = turns_to_a_stop(&loop_end).await;
        let done = requests(&hub) - before;
        assert!(done <= 25, "{done} of {requests_before} x {op} came first");
    }
}

#[tokio::test]
async fn what_comes_before_a_stop_in_the_queue_gives_no_torque_after_it() {
    let (loop_end, hub) = still();
    let mut client = greeted_in_json(&hub, 1 << 20).await;
    client.write_all(b"{\"op\":\"acquire\"}\n").await.unwrap();
    // These are more bytes than are read at once, so that `enable` has to wait.
    let text = format!("{}{{\"id\":1,\"op\":\"enable\"}}\n{}", SET.repeat(150), SET.repeat(400));
    client.write_all(text.as_bytes()).await.unwrap();
    client.write_all(ESTOP).await.unwrap();
    let _ = turns_to_a_stop(&loop_end).await;
    let mut lines = tokio::io::BufReader::new(client);
    let enable = loop {
        let mut line = String::new();
        tokio::io::AsyncBufReadExt::read_line(&mut lines, &mut line).await.unwrap();
        let answer: Value = serde_json::from_str(&line).unwrap();
        if answer["id"] == 1 {
            break answer;
        }
    };
    assert_eq!(enable["error"]["code"], "faulted", "{enable}");
}

#[tokio::test]
async fn a_disable_behind_requests_that_wait_is_done_before_them() {
    let (mut loop_end, hub) = still();
    let (from, mut to) = tokio::io::split(greeted_in_json(&hub, 1 << 20).await);
    swallow(from);
    to.write_all(SET.repeat(3000).as_bytes()).await.unwrap();
    to.write_all(b"{\"op\":\"disable\"}\n").await.unwrap();
    let before = requests(&hub);
    let order = loop {
        if let Some(order) = loop_end.take_order() {
            break order;
        }
        yield_now().await;
    };
    assert_eq!(order.command, Command::Disable);
    assert!(requests(&hub) - before <= 25);
}

#[tokio::test]
async fn a_signal_needs_nothing_of_the_service() {
    let (loop_end, hub) = still();
    let stop = hub.lock().emergency_stop();
    // Holding the hub simulates a turn that never ends.
    let busy = hub.lock();
    std::thread::spawn(move || stop.stop_by_signal()).join().unwrap();
    assert!(loop_end.take_estop() && !loop_end.take_estop());
    drop(busy);
}

#[test]
fn an_estop_in_any_shape_stops_the_rig() {
    let bench = bench();
    let mut holder = bench.holder();
    let mut raw = greeted(&bench);
    let long = format!(r#"{{"op":"estop","x":"{}"}}"#, "x".repeat(10_000));
    let longest = format!(r#"{{"x":"{}","op":"estop"}}"#, "x".repeat(70_000));
    let deep = format!(r#"{{"op":"estop","x":{}{}}}"#, "[".repeat(65), "]".repeat(65));
    let id = format!(r#"{{"id":"{}","op":"estop"}}"#, "x".repeat(129));
    let shapes: [&[u8]; 7] = [
        br#"{"op":"estop"}"#,
        br#"{"op":"estop",}"#,
        b"{\"op\":\"estop\",\"x\":\"\xff\"}",
        id.as_bytes(),
        deep.as_bytes(),
        long.as_bytes(),
        longest.as_bytes(),
    ];
    for shape in shapes {
        holder.call(Op::Reset).unwrap();
        bench.wait_for(Mode::Idle);
        raw.bytes(shape);
        raw.bytes(b"\n");
        bench.wait_for(Mode::Estop);
        let answer = raw.answer();
        assert_eq!(answer["id"], Value::Null, "{answer}");
        if shape.len() < 65_536 {
            assert_eq!(answer["ok"]["mode"], "estop", "{answer}");
        }
    }
    // If the id can be parsed, the answer repeats it.
    holder.call(Op::Reset).unwrap();
    assert_eq!(raw.ask(r#"{"op":"estop","why":[1],"id":7}"#)["id"], 7);
}

#[test]
fn an_estop_in_any_shape_of_messagepack_stops_the_rig() {
    let bench = bench();
    let mut holder = bench.holder();
    let mut raw = bench.raw();
    raw.send(r#"{"op": "hello", "version": 1, "name": "m", "encoding": "msgpack"}"#);
    raw.line();
    for map in [
        &b"\x82\xa2op\xa5estop\xa2id\xcb\x3f\xf0\0\0\0\0\0\0"[..],
        b"\x82\xa2op\xa5estop\x01\x02",
        b"\x82\xa2op\xa5estop\xa1x",
    ] {
        holder.call(Op::Reset).unwrap();
        bench.wait_for(Mode::Idle);
        raw.bytes(&u32::try_from(map.len()).unwrap().to_be_bytes());
        raw.bytes(map);
        bench.wait_for(Mode::Estop);
    }
}

#[test]
fn who_has_stopped_the_rig_is_told() {
    let bench = bench();
    let mut watcher = bench.client("watcher");
    let mut stopper = bench.client("a \"careful\" one");
    stopper.call(Op::Estop).unwrap();
    let told = fault_event(&mut watcher);
    let words = r#"stopped by client "a \"careful\" one" (session 2)"#;
    assert_eq!(told.message, words);
    let by = |told: hbot_api::FaultEvent| told.by.map(|by| (by.name, by.session));
    assert_eq!(by(told), Some(("a \"careful\" one".to_owned(), Some(2))));
    watcher.call(Op::Acquire { steal: false }).unwrap();
    watcher.call(Op::Reset).unwrap();
    assert_eq!(by(fault_event(&mut watcher)), Some(("watcher".to_owned(), Some(1))), "the reset");
}

#[test]
fn a_release_ends_the_stream() {
    let bench = bench();
    let mut holder = bench.active();
    holder.call(scene(json!({"effect": []}))).unwrap();
    holder.subscribe(1).unwrap();
    let torque = TorqueCommand { torque: [0.0, 0.05, 0.0], valid_ms: 1000, tick: None, seq: None };
    let pushes = |state: &hbot_api::StateEvent| state.torque[1] > 0.02;
    let mut next = |what: &str, found: &dyn Fn(&hbot_api::StateEvent) -> bool| {
        event(&mut holder, what, |event| match event {
            Event::State(state) if found(state) => Some(state.tick),
            _ => None,
        })
    };
    let mut other = bench.client("other");
    other.call(Op::Acquire { steal: true }).unwrap();
    other.call(Op::Torque(torque)).unwrap();
    let begun = next("torque", &pushes);
    other.call(Op::Release).unwrap();
    let ended = next("end of the torque", &|state| state.tick > begun && !pushes(state));
    // The stream would last for 1000 ticks. After the release it ramps down in 20 ticks.
    assert!(ended < begun + 900, "{} ticks", ended - begun);
}
