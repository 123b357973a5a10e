//! Tests of the lease, and of what the rig does when the lease holder disconnects.

use hbot_api::{ErrorCode, Fault, LeaseCause, LeaseEvent, Requester, TorqueCommand};
use hbot_core::inputs::OnClientLost;

use super::*;

fn lease(client: &mut Client) -> LeaseEvent {
    event(client, "lease event", |event| match event {
        Event::Lease(lease) => Some(lease.clone()),
        _ => None,
    })
}

fn held(lease: &LeaseEvent) -> (Option<&str>, Option<u64>, LeaseCause) {
    (lease.holder.as_deref(), lease.session, lease.cause)
}

#[test]
fn the_lease_has_one_holder_and_everybody_knows() {
    let bench = bench();
    let (mut a, mut b, mut watcher) = (bench.client("a"), bench.client("b"), bench.client("watcher"));
    let (at, bt) = (Some(a.hello().session), Some(b.hello().session));
    a.call(Op::Acquire { steal: false }).unwrap();
    a.call(Op::Acquire { steal: false }).unwrap();
    let error = refused(b.call(Op::Acquire { steal: false }));
    assert_eq!((error.code, error.holder.as_deref()), (ErrorCode::Busy, Some("a")));
    b.call(Op::Acquire { steal: true }).unwrap();
    assert_eq!(refused(a.call(Op::Enable)).holder.as_deref(), Some("b"));
    b.call(Op::Release).unwrap();
    assert_eq!(refused(a.call(Op::Enable)).holder, None);
    a.call(Op::Acquire { steal: true }).unwrap();
    drop(a);
    let by_a = Some(Requester { name: "a".to_owned(), session: at });
    let by_b = Some(Requester { name: "b".to_owned(), session: bt });
    for (holder, session, cause, by) in [
        (Some("a"), at, LeaseCause::Acquired, &by_a),
        (Some("b"), bt, LeaseCause::Stolen, &by_b),
        (None, None, LeaseCause::Released, &by_b),
        (Some("a"), at, LeaseCause::Acquired, &by_a),
        (None, None, LeaseCause::Disconnected, &by_a),
    ] {
        let event = lease(&mut watcher);
        assert_eq!((held(&event), &event.by), ((holder, session, cause), by));
    }
    bench.wait_until("a free lease", |status| status.holder.is_none());
}

#[test]
fn the_next_holder_is_not_told_of_the_stream_of_the_one_before() {
    let bench = bench();
    let mut a = bench.active();
    let mut b = bench.client("b");
    b.subscribe(1).unwrap();
    let stream = |seq| TorqueCommand { torque: [0.0; 3], valid_ms: 1000, tick: None, seq: Some(seq) };
    let told = |client: &mut Client, what: &str, seq: Option<u64>| {
        event(client, what, |event| match event {
            Event::State(state) => (state.client.map(|client| client.seq) == seq.map(Some)).then_some(()),
            _ => None,
        });
    };
    a.call(Op::Torque(stream(7))).unwrap();
    told(&mut b, "a's stream", Some(7));
    b.call(Op::Acquire { steal: true }).unwrap();
    told(&mut b, "no stream", None);
    b.call(Op::Torque(stream(8))).unwrap();
    told(&mut b, "b's stream", Some(8));
    b.call(Op::Release).unwrap();
    told(&mut b, "no stream", None);
    // The loop takes the end of a's lease and the first message of b in one tick.
    for seq in [20, 30] {
        a.call(Op::Acquire { steal: true }).unwrap();
        a.call(Op::Torque(stream(seq))).unwrap();
        told(&mut b, "a's stream", Some(seq));
        b.send(Op::Acquire { steal: true }).unwrap();
        b.send(Op::Torque(stream(seq + 1))).unwrap();
        told(&mut b, "b's stream", Some(seq + 1));
    }
}

/// Starts a service with the given policy for a lost client. The lease holder commands a torque for
/// one second and then disconnects. Returns the service and a client that is subscribed to states.
fn lost(policy: OnClientLost) -> (TestService, Client) {
    let mut rig = RigConfig::prototype();
    rig.api.on_client_lost = policy;
    let bench = TestService::start(TestOptions { rig, ..TestOptions::default() });
    let mut holder = bench.active();
    let mut watcher = bench.client("watcher");
    watcher.subscribe(1).unwrap();
    let torque = TorqueCommand { torque: [0.05, 0.0, 0.0], valid_ms: 1000, tick: None, seq: None };
    holder.call(Op::Torque(torque)).unwrap();
    drop(holder);
    assert_eq!(lease(&mut watcher).cause, LeaseCause::Disconnected);
    (bench, watcher)
}

#[test]
fn a_lost_holder_is_a_fault_where_the_rig_says_so() {
    let (bench, mut watcher) = lost(OnClientLost::Fault);
    let told = fault_event(&mut watcher);
    assert_eq!(told.fault, Some(Fault::ClientLost));
    assert_eq!(told.by.map(|by| by.session), Some(Some(1)), "the client that was lost");
    bench.wait_for(Mode::Fault);
}

#[test]
fn otherwise_the_scene_stays() {
    for policy in [OnClientLost::Ramp, OnClientLost::Keep] {
        let (bench, _watcher) = lost(policy);
        bench.wait_ticks(300);
        bench.wait_for(Mode::Active);
    }
}

#[test]
fn answers_still_come_to_a_client_that_says_no_more() {
    let bench = bench();
    bench.wait_for(Mode::Idle);
    let mut raw = bench.raw();
    raw.bytes(
        b"{\"id\":1,\"op\":\"hello\",\"version\":1,\"name\":\"pipe\"}\n{\"id\":2,\"op\":\"acquire\"}\n\
          {\"id\":3,\"op\":\"load_scene\",\"scene\":{}}\n{\"id\":4,\"op\":\"estop\"}\n",
    );
    raw.stream.shutdown(std::net::Shutdown::Write).unwrap();
    let rest = raw.rest();
    let lines: Vec<Value> = rest.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    for id in 1..=4 {
        assert!(lines.iter().any(|line| line["id"] == id && line.get("ok").is_some()), "{id}: {rest}");
    }
    assert!(lines.iter().any(|line| line["ok"]["mode"] == "estop"), "{rest}");
}
