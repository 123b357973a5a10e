//! Tests of the client's render loop against a small server.

use super::client::{Peer, serve};
use super::samples;
use crate::*;
use serde_json::json;
use std::thread::JoinHandle;
use std::time::Duration;

fn state(tick: u64, mode: Mode) -> Event {
    let fault = None;
    Event::State(StateEvent { tick, mode, fault, ..samples::state() })
}

/// Answers requests until the connection ends. Returns the torques that arrived.
fn torques(peer: &mut Peer) -> Vec<TorqueCommand> {
    let mut torques = Vec::new();
    while let Some(request) = peer.request() {
        match request.op {
            Op::Torque(command) => torques.push(command),
            _ => peer.send(&Response::done(request.id)),
        }
    }
    torques
}

/// Starts a server that answers `subscribe` and sends these events. Returns its address and the
/// torques that it received.
fn events(events: Vec<Event>) -> (String, JoinHandle<Vec<TorqueCommand>>) {
    serve(move |mut peer| {
        peer.welcome();
        let request = peer.request().unwrap();
        let Op::Subscribe { every } = request.op else { panic!("{request:?}") };
        peer.send(&Response::ok(request.id, SubscribeOk { every }));
        events.iter().for_each(|event| peer.send(event));
        torques(&mut peer)
    })
}

fn each() -> RenderOptions {
    RenderOptions { late: LatePolicy::Each, ..RenderOptions::default() }
}

#[test]
fn each_state_gets_its_torque() {
    let (address, server) = events((1..=4).map(|tick| state(tick, Mode::Active)).collect());
    let mut client = Client::connect(&address, "tester").unwrap();
    let report =
        client.render(&each(), |state| (state.tick < 4).then_some([state.tick as f64, 0.0, 0.0])).unwrap();
    assert_eq!(report, RenderReport { end: RenderEnd::Asked, rendered: 3, missed: 0, refused: 0 });
    drop(client);
    let torques = server.join().unwrap();
    let seen: Vec<_> = torques.iter().map(|t| (t.torque[0], t.tick, t.seq, t.valid_ms)).collect();
    let last = (0.0, None, None, 1);
    let expected =
        [(1.0, Some(1), Some(1), 20), (2.0, Some(2), Some(2), 20), (3.0, Some(3), Some(3), 20), last];
    assert_eq!(seen, expected, "the last torque is zero");
}

/// The states that wait when the loop begins are all older than the last one.
#[test]
fn a_late_program_renders_only_the_newest_state() {
    let (address, server) = events((1..=100).map(|tick| state(tick, Mode::Active)).collect());
    let mut client = Client::connect(&address, "tester").unwrap();
    let mut ticks = Vec::new();
    let report = client
        .render(&RenderOptions::default(), |state| {
            ticks.push(state.tick);
            (state.tick < 100).then_some([0.0; 3])
        })
        .unwrap();
    assert_eq!(ticks.last(), Some(&100));
    // Every state is either rendered or missed; the last one ended the loop.
    assert_eq!(report.rendered + report.missed, 99);
    assert_eq!(report.rendered, ticks.len() as u64 - 1);
    assert!(ticks.is_sorted(), "{ticks:?}");
    drop(client);
    server.join().unwrap();
}

#[test]
fn what_ends_the_loop_is_told() {
    let lease =
        |session| Event::Lease(LeaseEvent { holder: None, session, cause: LeaseCause::Stolen, by: None });
    let fault = |mode| {
        let (tick, t, fault, message, by) = (2, 0.0, None, "stop".into(), None);
        let (found, remedy, flight_log) = (None, None, None);
        Event::Fault(FaultEvent { tick, t, mode, fault, message, found, remedy, flight_log, by })
    };
    let stopping = Event::Stopping(StoppingEvent { message: "bye".into() });
    // The session of the small server's client is 3.
    for (event, end) in [
        (lease(Some(4)), RenderEnd::LeaseLost),
        (lease(None), RenderEnd::LeaseLost),
        (fault(Mode::Fault), RenderEnd::Stopped(Mode::Fault)),
        (state(2, Mode::Estop), RenderEnd::Stopped(Mode::Estop)),
        (state(2, Mode::Idle), RenderEnd::Stopped(Mode::Idle)),
        (stopping, RenderEnd::ServerStopping),
    ] {
        let kept = !matches!(event, Event::State(_));
        let idle_at_first = vec![lease(Some(3)), state(0, Mode::Idle), state(1, Mode::Active), event.clone()];
        let (address, server) = events(idle_at_first);
        let mut client = Client::connect(&address, "tester").unwrap();
        let report = client.render(&each(), |_| Some([0.1, 0.0, 0.0])).unwrap();
        assert_eq!((report.end, report.rendered), (end, 2));
        assert_eq!(client.next_event(Duration::ZERO).unwrap(), Some(lease(Some(3))), "it is kept");
        let next = client.next_event(Duration::ZERO).unwrap();
        assert_eq!(next, kept.then_some(event), "it is kept for the program");
        drop(client);
        let zero = server.join().unwrap().last().unwrap().torque == [0.0; 3];
        assert_eq!(zero, end != RenderEnd::LeaseLost, "{end:?}");
    }
}

#[test]
fn the_duration_ends_the_loop() {
    let (address, server) = events(vec![state(1, Mode::Active)]);
    let mut client = Client::connect(&address, "tester").unwrap();
    let options = RenderOptions { duration: Some(Duration::ZERO), ..each() };
    let report = client.render(&options, |_| panic!("no state is rendered after the end")).unwrap();
    assert_eq!((report.end, report.rendered), (RenderEnd::Duration, 0));
    drop(client);
    server.join().unwrap();
}

#[test]
fn refusals_are_counted_and_a_missing_lease_is_an_error() {
    let refused = |code, count| {
        let (total, op, message) = (count, Some("torque".into()), "why".into());
        Event::Refused(RefusedEvent { count, total, op, code, message })
    };
    let (address, server) = events(vec![
        refused(ErrorCode::OutOfRange, 5),
        state(1, Mode::Active),
        refused(ErrorCode::OutOfRange, 2),
        state(2, Mode::Fault),
    ]);
    let mut client = Client::connect(&address, "tester").unwrap();
    assert_eq!(client.render(&each(), |_| Some([0.0; 3])).unwrap().refused, 7);
    drop(client);
    server.join().unwrap();

    let (address, server) = events(vec![refused(ErrorCode::NotHolder, 1)]);
    let mut client = Client::connect(&address, "tester").unwrap();
    let error = client.render(&each(), |_| Some([0.0; 3])).unwrap_err();
    assert_eq!(error.code(), Some(ErrorCode::NotHolder));
    drop(client);
    server.join().unwrap();
}

#[test]
fn an_error_ends_the_stream_and_the_subscription() {
    let (address, server) = serve(|mut peer| {
        peer.welcome();
        let id = peer.request().unwrap().id;
        peer.send(&Response::ok(id, SubscribeOk { every: 1 }));
        peer.send(&state(1, Mode::Active));
        let zero = peer.request().unwrap().op;
        // Its answer is not taken for that of the next request.
        for _ in 0..2 {
            let Request { id, op } = peer.request().unwrap();
            match op {
                Op::Unsubscribe => peer.send(&Response::ok(id, json!({}))),
                _ => peer.send(&Response::error(id, ErrorBody::new(ErrorCode::Busy, "held".to_owned()))),
            }
        }
        zero
    });
    let mut client = Client::connect(&address, "tester").unwrap();
    let error = client.render(&each(), |_| Some([f64::NAN, 0.0, 0.0])).unwrap_err();
    assert!(matches!(error, ClientError::Encode(_)), "{error}");
    assert_eq!(client.acquire(false).unwrap_err().code(), Some(ErrorCode::Busy));
    let zero = TorqueCommand { torque: [0.0; 3], valid_ms: 1, tick: None, seq: None };
    assert_eq!(server.join().unwrap(), Op::Torque(zero));
}

#[test]
fn a_loop_without_states_and_a_dead_server_are_errors() {
    let (address, server) = events(vec![]);
    let mut client = Client::connect(&address, "tester").unwrap();
    // Long enough for the answer to subscribe, on a busy machine too.
    client.set_timeout(Duration::from_millis(500));
    let error = client.render(&each(), |_| Some([0.0; 3])).unwrap_err();
    assert!(matches!(error, ClientError::NoState { .. }), "{error}");
    drop(client);
    assert_eq!(server.join().unwrap().last().unwrap().torque, [0.0; 3]);

    let (address, server) = serve(|mut peer| {
        peer.welcome();
        let id = peer.request().unwrap().id;
        peer.send(&Response::ok(id, json!({"every": 1})));
        peer.send(&state(1, Mode::Active));
    });
    let mut client = Client::connect(&address, "tester").unwrap();
    let error = client.render(&each(), |_| Some([0.0; 3])).unwrap_err();
    assert!(matches!(error, ClientError::Closed), "{error}");
    server.join().unwrap();
}
