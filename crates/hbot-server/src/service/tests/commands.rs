//! Tests of each op: its effect, which clients may use it, and the table of modes, over the
//! network.

use hbot_api::{
    Align, AlignDirection, ClockInfo, Encoding, ErrorCode, LeaseInfo, OpName, PassivityInfo,
    ReferenceCommand, Request, TorqueCommand, TractionInfo, Who,
};

use super::*;

fn torque(torque: [f64; 3], valid_ms: u64) -> TorqueCommand {
    TorqueCommand { torque, valid_ms, tick: None, seq: None }
}

fn reference(effect: &str) -> ReferenceCommand {
    let q = [1.0, 0.0, 0.0, 0.0];
    ReferenceCommand { effect: effect.to_owned(), q, omega: None, valid_ms: 100, tick: None, seq: None }
}

fn align(q: [f64; 4], weight: f64, t: Option<f64>) -> Op {
    Op::Align(Align { q, weight, sigma: None, t })
}

fn mode(result: Result<Value, ClientError>) -> String {
    result.unwrap()["mode"].as_str().unwrap().to_owned()
}

pub(super) fn state(
    client: &mut Client,
    what: &str,
    found: impl Fn(&hbot_api::StateEvent) -> bool,
) -> hbot_api::StateEvent {
    event(client, what, |event| match event {
        Event::State(state) if found(state) => Some(state.clone()),
        _ => None,
    })
}

#[test]
fn the_table_of_states_over_the_wire() {
    let bench = bench();
    let mut client = bench.holder();
    bench.wait_for(Mode::Idle);
    assert_eq!(mode(client.call(Op::Reset)), "idle", "reset when idle changes nothing");
    assert_eq!(mode(client.call(Op::Disable)), "idle");
    assert_eq!(mode(client.call(Op::Enable)), "enabling");
    bench.wait_for(Mode::Active);
    assert_eq!(mode(client.call(Op::Enable)), "active", "enable when active changes nothing");
    assert_eq!(mode(client.call(Op::Disable)), "idle");
    assert_eq!(mode(client.call(Op::Enable)), "enabling");
    assert_eq!(mode(client.call(Op::Estop)), "estop");
    let told = fault_event(&mut client);
    assert_eq!((told.mode, told.fault), (Mode::Estop, None));
    assert_eq!(refused(client.call(Op::Enable)).code, ErrorCode::Faulted);
    assert_eq!(mode(client.call(Op::Disable)), "estop");
    assert_eq!(mode(client.call(Op::Reset)), "idle");
    assert_eq!(fault_event(&mut client).mode, Mode::Idle);

    bench.with_rig(|rig| rig.inject(hbot_sim::controller::InjectedFault::Failed(true)));
    let told = fault_event(&mut client);
    assert_eq!((told.mode, told.fault), (Mode::Fault, Some(hbot_api::Fault::ControllerFault)));
    let error = refused(client.call(Op::Enable));
    assert_eq!(error.code, ErrorCode::Faulted);
    assert!(error.message.contains("controller_fault"), "{error}");
    assert!(refused(client.call(Op::Reset)).message.contains("still there"));
    assert_eq!(mode(client.call(Op::Estop)), "estop", "a fault can be stopped as well");
    bench.with_rig(|rig| rig.inject(hbot_sim::controller::InjectedFault::Failed(false)));
    bench.wait_ticks(5);
    assert_eq!(mode(client.call(Op::Reset)), "idle");
    let summary = bench.finish();
    assert_eq!((summary.estops, summary.faults.total()), (2, 1));
}

#[test]
fn virtual_time_passes_in_the_steps_of_the_holder_until_it_gives_the_lease_back() {
    let bench = bench();
    let mut client = bench.holder();
    bench.wait_for(Mode::Idle);
    client.advance(1).unwrap();
    // What the loop answers takes one tick, and nothing else does.
    let begun = client.advance(1).unwrap().tick;
    assert_eq!(mode(client.call(Op::Enable)), "enabling");
    assert_eq!(client.advance(10).unwrap().tick, begun + 11);
    let pushed = |seq, torque| TorqueCommand {
        torque: [0.0, 0.0, torque],
        valid_ms: 1000,
        tick: None,
        seq: Some(seq),
    };
    for (seq, ticks) in [(1, 7), (2, 1000), (3, 1)] {
        let before = client.ping(Value::Null).unwrap().tick;
        client.torque(pushed(seq, 0.1)).unwrap();
        let state = client.advance(ticks).unwrap();
        assert_eq!(state.tick, before + ticks, "a stream message lets no time pass");
        let stream = state.client.unwrap();
        assert_eq!((stream.seq, state.mode == Mode::Active), (Some(seq), seq > 1));
    }
    // An answer comes, however many orders of a tick wait before it: the loop takes seven.
    for seq in 0..20 {
        client.torque(pushed(seq, 0.0)).unwrap();
    }
    assert_eq!(mode(client.call(Op::Disable)), "idle");
    // A stop acts while time waits, and other clients cannot make it pass.
    let mut other = bench.client("other");
    assert_eq!(refused(other.call(Op::Advance { ticks: 1 })).code, ErrorCode::NotHolder);
    assert_eq!(mode(other.call(Op::Estop)), "estop");
    let stopped = other.ping(Value::Null).unwrap().tick;
    assert_eq!(client.advance(1).unwrap().mode, Mode::Estop);
    client.release().unwrap();
    bench.wait_ticks(stopped + 5000);
}

#[test]
fn an_advance_that_waits_is_refused_when_the_lease_is_taken_and_keeps_no_other_waiting() {
    let bench = bench();
    let mut first = greeted(&bench);
    first.ask(r#"{"id": 1, "op": "acquire"}"#);
    first.send(r#"{"id": 7, "op": "advance", "ticks": 1000000}"#);
    let mut other = bench.client("other");
    other.acquire(true).unwrap();
    let told = std::iter::from_fn(|| Some(first.line())).find(|line| line["id"] == 7).unwrap();
    assert_eq!(told["error"]["code"], "not_holder", "{told}");
    other.advance(10).unwrap();
}

#[test]
fn a_rig_without_its_zeros_cannot_be_enabled() {
    let mut rig = RigConfig::prototype();
    let unknown =
        |joint: &mut hbot_core::design::rig::Joint| joint.zero = hbot_core::design::rig::Zero::Calibrate;
    rig.rig = rig.rig.with(|parts| parts.joints.iter_mut().for_each(unknown)).unwrap();
    let bench = TestService::start(TestOptions { rig, enable_at_start: true, ..TestOptions::default() });
    let mut client = bench.holder();
    bench.wait_ticks(50);
    let error = refused(client.call(Op::Enable));
    assert_eq!(error.code, ErrorCode::Faulted);
    assert!(error.message.contains("zero"), "{error}");
    assert_eq!(mode(client.call(Op::Reset)), "unreferenced");
}

#[test]
fn a_rig_that_is_to_be_enabled_at_the_start_is() {
    let bench = TestService::start(TestOptions { enable_at_start: true, ..TestOptions::default() });
    bench.wait_for(Mode::Active);
    // It is enabled only once. After a disable it stays idle.
    let mut client = bench.client("anybody");
    assert_eq!(mode(client.call(Op::Disable)), "idle");
    bench.wait_ticks(100);
    bench.wait_for(Mode::Idle);
}

#[test]
fn a_signal_stops_the_rig() {
    let bench = bench();
    let mut client = bench.client("watcher");
    bench.emergency.stop_by_signal();
    let told = fault_event(&mut client);
    assert_eq!((told.mode, told.fault), (Mode::Estop, None));
    assert_eq!(told.message, "stopped by SIGUSR1");
    assert_eq!(bench.finish().estops, 1);
}

#[test]
fn others_than_clients_can_ask_how_it_goes() {
    let bench = bench();
    bench.wait_ticks(10);
    let (wanted, summary) = oneshot::channel();
    bench.control.blocking_send(Control::Summarize(wanted)).unwrap();
    let summary = summary.blocking_recv().unwrap();
    assert!(summary.ticks >= 10 && summary.compute_us.count == summary.ticks);
}

fn request(op: OpName) -> Op {
    let golden = include_str!("../../../../hbot-api/src/tests/messages.golden").lines();
    let mut requests = golden.filter_map(|line| Request::read(Encoding::Json, line.as_bytes()).ok());
    requests.find(|request| request.op.name() == op).expect("one of every op").op
}

#[test]
fn what_moves_the_rig_needs_the_lease_and_what_stops_it_does_not() {
    let bench = bench();
    let mut holder = bench.holder();
    let mut other = bench.client("other");
    let of = |who| OpName::ALL.into_iter().filter(move |op| op.row().who == who);
    for op in of(Who::Holder) {
        let error = refused(other.call(request(op)));
        assert_eq!((error.code, error.holder.as_deref()), (ErrorCode::NotHolder, Some("holder")), "{op}");
    }
    for op in of(Who::Any) {
        match other.call(request(op)) {
            Err(ClientError::Server(error)) => {
                assert_eq!((op, error.code), (OpName::Acquire, ErrorCode::Busy), "{error}");
            }
            answer => drop(answer.unwrap_or_else(|error| panic!("{op}: {error}"))),
        }
    }
    // A release by another client does not take the lease from its holder.
    assert_eq!(mode(holder.call(Op::Reset)), "idle");
    let summary = bench.finish();
    let refused = of(Who::Holder).count() as u64;
    assert_eq!(summary.refused_streams, 6);
    assert_eq!((summary.refused.of(ErrorCode::NotHolder), summary.refused.of(ErrorCode::Busy)), (refused, 1));
    assert_eq!(summary.refused.total(), refused + 1);
}

#[test]
fn ping_repeats_and_tells_the_time() {
    let bench = bench();
    bench.wait_ticks(10);
    let mut client = bench.client("c");
    let data = json!({"a": [1, 2.5, "x", null]});
    let answer = client.call(Op::Ping { data: data.clone() }).unwrap();
    assert_eq!(answer["data"], data);
    let (tick, t) = (answer["tick"].as_u64().unwrap(), answer["t"].as_f64().unwrap());
    // The period is a whole number of nanoseconds, so the only error is the rounding of t.
    assert!(tick >= 10 && (t - tick as f64 * 1e-3).abs() < 1e-9);
}

#[test]
fn states_come_every_n_ticks_until_unsubscribed() {
    let bench = bench();
    let mut client = bench.client("c");
    client.subscribe(7).unwrap();
    let first = state(&mut client, "state", |_| true);
    let second = state(&mut client, "state", |_| true);
    assert_eq!((first.tick % 7, second.tick), (0, first.tick + 7));
    client.subscribe(3).unwrap();
    state(&mut client, "state of the new subscription", |state| state.tick % 7 != 0 && state.tick % 3 == 0);
    client.unsubscribe().unwrap();
    while client.next_event(Duration::ZERO).unwrap().is_some() {}
    bench.wait_ticks(50);
    assert_eq!(client.next_event(Duration::ZERO).unwrap(), None);
}

#[test]
fn a_stream_that_is_refused_is_counted_and_told_once_a_second() {
    let bench = bench();
    let mut client = bench.client("c");
    for _ in 0..50 {
        client.send(Op::Torque(torque([0.1, 0.0, 0.0], 10))).unwrap();
    }
    // All refusals are reported. The first comes at once and the others together, or in one event
    // for each second that the sending takes.
    let (mut told, mut first) = (0, true);
    while told < 50 {
        let refused = event(&mut client, "refused event", |event| match event {
            Event::Refused(refused) => Some(refused.clone()),
            _ => None,
        });
        told += refused.count;
        assert_eq!(
            (refused.total, refused.code, refused.op.as_deref()),
            (told, ErrorCode::NotHolder, Some("torque"))
        );
        assert!(refused.count == 1 || !first);
        first = false;
    }
    // A stream message that cannot be parsed still counts as one of a stream. With an id it gets an
    // answer.
    let mut raw = greeted(&bench);
    raw.send(r#"{"op": "torque", "torque": [1, 2], "valid_ms": 10}"#);
    let told = raw.line();
    assert_eq!((&told["event"], &told["code"]), (&json!("refused"), &json!("bad_request")));
    let answer = raw.ask(r#"{"id": 5, "op": "torque", "torque": [1, 2], "valid_ms": 10}"#);
    assert_eq!((&answer["id"], &answer["error"]["code"]), (&json!(5), &json!("bad_request")));
    assert_eq!(bench.finish().refused_streams, 52);
}

#[test]
fn stream_messages_of_long_ago_are_refused() {
    let bench = bench();
    let mut client = bench.active();
    let old = TorqueCommand { tick: Some(1), ..torque([0.0; 3], 10) };
    let error = refused(client.call(Op::Torque(old)));
    assert_eq!(error.code, ErrorCode::OutOfRange);
    assert!(error.message.contains("max_age_ticks"), "{error}");
    let old = ReferenceCommand { tick: Some(1), ..reference("spring") };
    assert_eq!(refused(client.call(Op::Reference(old))).code, ErrorCode::OutOfRange);
}

#[test]
fn references_move_effects_that_have_one() {
    let bench = bench();
    let mut client = bench.holder();
    client
        .call(scene(json!({"effect": [spring("a"), {"id": "b", "kind": "damper", "damping": 0.1}]})))
        .unwrap();
    client.call(Op::Reference(reference("a"))).unwrap();
    for (id, what) in [("b", "has no reference"), ("c", "is not in the scene")] {
        let error = refused(client.call(Op::Reference(reference(id))));
        assert_eq!(error.code, ErrorCode::UnknownEffect);
        assert!(error.message.contains(what) && error.message.ends_with("legal: a"), "{error}");
    }
}

#[test]
fn align_records_corrects_and_refuses() {
    let bench = bench();
    let mut client = bench.holder();
    bench.wait_for(Mode::Idle);
    bench.wait_ticks(20);
    let half = 0.1_f64;
    let turned = [half.cos(), half.sin(), 0.0, 0.0];
    let angle = |answer: Value| answer["angle"].as_f64().unwrap();
    // No hand moves the sphere, so the angle is that of the quaternion, to rounding.
    for _ in 0..2 {
        let seen = angle(client.call(align(turned, 0.0, None)).unwrap());
        assert!((seen - 0.2).abs() < 1e-9, "recorded only: {seen}");
    }
    client.call(align(turned, 1.0, None)).unwrap();
    bench.wait_ticks(5);
    let t = client.call(Op::Ping { data: Value::Null }).unwrap()["t"].as_f64();
    let seen = angle(client.call(align(turned, 0.0, t)).unwrap());
    assert!(seen < 1e-9, "idle, so corrected at once: {seen}");
    for t in [1e9, 1e300] {
        let error = refused(client.call(align(turned, 0.0, Some(t))));
        assert_eq!(error.code, ErrorCode::OutOfRange, "{t}");
    }
}

#[test]
fn a_measurement_with_a_sigma_is_weighed_and_its_uncertainty_is_in_the_state() {
    let bench = bench();
    let mut client = bench.holder();
    bench.wait_for(Mode::Idle);
    bench.wait_ticks(20);
    let measured = |angle: f64, sigma: f64| {
        let q = [(0.5 * angle).cos(), (0.5 * angle).sin(), 0.0, 0.0];
        Op::Align(Align { q, weight: 1.0, sigma: Some([sigma; 3]), t: None })
    };
    // The first one is taken as it is. `used` is absent unless it is false.
    assert!(client.call(measured(0.2, 0.01)).unwrap()["used"].is_null());
    let far = client.call(measured(1.0, 0.01)).unwrap();
    assert!((far["angle"].as_f64().unwrap() - 0.8).abs() < 1e-3 && far["used"] == false, "{far}");
    client.call(Op::Subscribe { every: 1 }).unwrap();
    let known = state(&mut client, "a sigma", |state| state.orientation_sigma.is_some());
    let sigma = known.orientation_sigma.unwrap();
    assert!(sigma.iter().all(|x| (0.009..0.012).contains(x)), "{sigma:?}");
    // Gravity agrees with an orientation that is turned by 0.2 rad about n1.
    let (body, world) = ([0.0, -0.2_f64.sin(), -0.2_f64.cos()], [0.0, 0.0, -1.0]);
    let answer =
        client.call(Op::AlignDirection(AlignDirection { body, world, sigma: 0.1, t: None })).unwrap();
    assert!(answer["angle"].as_f64().unwrap() < 1e-3, "{answer}");
}

#[test]
fn enable_far_from_a_reference_says_which_and_how_far() {
    let bench = bench();
    let mut client = bench.holder();
    bench.wait_for(Mode::Idle);
    let half = 0.5_f64;
    let far = json!([half.cos(), 0.0, half.sin(), 0.0]);
    client
        .call(scene(json!({"effect": [
            {"id": "air", "kind": "damper", "damping": 0.01},
            {"id": "far", "kind": "spring", "stiffness": 1, "reference": far},
        ]})))
        .unwrap();
    let error = refused(client.call(Op::Enable));
    assert_eq!(error.code, ErrorCode::OutOfRange);
    assert!((error.angle.unwrap() - 1.0).abs() < 1e-9, "{error:?}");
    assert!(error.message.contains("\"far\"") && error.message.contains("0.5"), "{error}");
    bench.wait_for(Mode::Idle);
}

/// Returns the prototype without a lead and without a limit of traction.
fn unled() -> RigConfig {
    let mut rig = RigConfig::prototype();
    rig.rig = rig.rig.with(|parts| (parts.lead, parts.limits.traction) = (None, None)).unwrap();
    rig
}

#[test]
fn info_and_stats_have_their_shape() {
    let bench = bench();
    bench.wait_for(Mode::Idle);
    let mut client = bench.client("c");
    let info = client.info().unwrap();
    assert_eq!(info.rig.wheels.len(), 2);
    assert_eq!((info.rig.simulated, info.accuracy.as_str()), (false, "balanced"));
    let clock = ClockInfo { monotonic_ns: ORIGIN.monotonic_ns, unix_ns: ORIGIN.unix_ns };
    assert_eq!(info.clock, Some(clock));
    assert_eq!(info.limits.traction, Some(TractionInfo { mu: 0.8, normal_force: 10.0 }));
    // The passivity controller is on by default.
    let limit = hbot_core::design::rig::PassivityLimit::of(&RigConfig::prototype().rig.device, 1.0e-3);
    let told = PassivityInfo { allowance: limit.allowance, store: limit.store, damping: limit.damping };
    assert_eq!(info.limits.passivity, Some(told));
    assert!(info.capability.unwrap().iter().all(|t| *t > 0.0), "{info:?}");
    // `stiffness_stable` is the border with the lead and 0.02 N m s/rad, which docs/stability.md
    // quotes.
    let render = info.render.clone().unwrap();
    assert!((render.stiffness_stable - 258.0).abs() < 0.5, "{render:?}");
    // Without a lead it is, to first order, this damping divided by 1.5 ticks of 1 ms and the lag
    // of the motors, 0.5 ms. The border of the sampled loop is less than 1 % below. Then
    // `stiffness_most` is 0.146457 times the smallest apparent inertia divided by the square of a
    // tick (docs/internals/physics.md, section 9, to six digits).
    let unled = TestService::start(TestOptions { rig: unled(), ..TestOptions::default() });
    let plain = unled.client("c").info().unwrap();
    assert_eq!((plain.limits.traction, plain.limits.energy), (None, None));
    let plain = plain.render.unwrap();
    let part = plain.stiffness_stable / (plain.damping / 2.0e-3);
    assert!(0.99 < part && part < 1.0, "{plain:?}");
    let most = 0.146_457e6 * plain.inertia;
    assert!((plain.stiffness_most / most - 1.0).abs() < 1e-5, "{plain:?}");
    // The damping that a torque one tick late, with this lag, can have at most is 0.880 J/h.
    let most = 0.8800e3 * render.inertia;
    assert!((render.damping_most / most - 1.0).abs() < 1e-3, "{render:?}");
    // Between two pairs the border is nearly straight: 1 % is far less than what a person feels.
    let after = render.border.iter().position(|[damping, _]| *damping >= render.damping).unwrap();
    let [[b0, k0], [b1, k1]] = [render.border[after - 1], render.border[after]];
    let between = k0 + (k1 - k0) * (render.damping - b0) / (b1 - b0);
    assert!((between / render.stiffness_stable - 1.0).abs() < 0.01, "{render:?}");
    assert!(render.border[0][0] == 0.0 && render.border.is_sorted_by(|[a, _], [b, _]| a < b), "{render:?}");
    assert_eq!(plain.border[0], [0.0, 0.0], "without the lead a spring needs damping");
    assert!(info.kind("spring").is_some() && info.phenomena.is_none());
    assert_eq!(info.scene["name"], "Spring");
    assert_eq!(info.lease, Some(LeaseInfo::default()));
    client.acquire(false).unwrap();
    let lease = LeaseInfo { holder: Some("c".to_owned()), session: Some(client.hello().session) };
    assert_eq!(bench.client("d").info().unwrap().lease, Some(lease));
    let stats = client.stats().unwrap();
    assert!(stats.ticks > 0);
    assert_eq!(stats.compute_us.count, stats.ticks);
    assert!(stats.compute_us.p50 <= stats.compute_us.max);
    assert_eq!((stats.faults.total(), stats.dropped_samples), (0, 0));
}
