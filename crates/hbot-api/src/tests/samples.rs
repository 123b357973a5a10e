//! Samples: one message for every op, answer and event, in the order of `messages.golden`, from
//! which the requests are read.

use crate::*;
use serde_json::{Value, json};
use std::sync::LazyLock;

/// Returns the messages of `messages.golden`, each as a line of JSON and a frame of MessagePack.
pub(super) fn golden() -> Vec<(&'static str, Vec<u8>)> {
    let byte = |hex: &[u8]| u8::from_str_radix(str::from_utf8(hex).unwrap(), 16).unwrap();
    let lines: Vec<&str> =
        include_str!("messages.golden").lines().filter(|line| !line.starts_with('#')).collect();
    lines.chunks_exact(2).map(|pair| (pair[0], pair[1].as_bytes().chunks(2).map(byte).collect())).collect()
}

pub(super) fn requests() -> &'static [Request] {
    static REQUESTS: LazyLock<Vec<Request>> = LazyLock::new(|| {
        let read = |(line, _): (&str, _)| Request::read(Encoding::Json, line.as_bytes());
        golden().into_iter().map(read).map_while(Result::ok).collect()
    });
    &REQUESTS
}

pub(super) fn answers() -> Vec<ServerMessage> {
    fn ok(id: impl Into<Id>, body: impl serde::Serialize) -> ServerMessage {
        ServerMessage::Response(Response::ok(Some(id.into()), serde_json::to_value(body).unwrap()))
    }
    let refused = |error| ServerMessage::Response(Response::error(None, error));
    let effects = vec![EffectCost { id: "spring".into(), kind: "spring".into(), cost_ns: 210 }];
    vec![
        ok(
            1,
            HelloOk {
                server: "hbot 0.1.0".into(),
                version: 1,
                rig: "Hbot prototype".into(),
                rate_hz: 1000.0,
                session: 7,
            },
        ),
        ok(3, SubscribeOk { every: 10 }),
        ok(18, controllers()),
        ServerMessage::Response(Response::done(Some(6.into()))),
        ok(
            9,
            LoadSceneOk {
                effects,
                ignored: vec!["friction".into()],
                warnings: vec!["spring: too stiff".into()],
            },
        ),
        ok(10, SetOk { warnings: vec!["spring: too stiff".into()] }),
        ok(13, AlignOk { angle: 0.03125, used: true }),
        ok(18, AlignOk { angle: 0.5, used: false }),
        ok(22, ModelOk { stiffness_scale: 0.75 }),
        ok(14, ModeOk { mode: Mode::Enabling }),
        ok("p", PingOk { data: json!({"n": 1}), tick: 1000, t: 1.0 }),
        refused(ErrorBody::new(ErrorCode::BadRequest, "field \"every\" is missing")),
        refused(ErrorBody { holder: Some("other".into()), ..ErrorBody::new(ErrorCode::Busy, "held") }),
        refused(ErrorBody { angle: Some(0.75), ..ErrorBody::new(ErrorCode::OutOfRange, "too far") }),
    ]
}

/// Returns an answer to the op `controllers` with one controller that reports everything and one
/// that reports nothing.
pub(super) fn controllers() -> ControllersOk {
    let reports = ControllerInfo {
        joint: 0,
        port: Some("/dev/ttyACM0".into()),
        protocol: Some("moteus".into()),
        id: Some(1),
        firmware: Some("moteus 0x010f".into()),
        current_a: Some(-0.125),
        temperature_c: Some(31.5),
        flags: vec!["overtemperature".into()],
    };
    ControllersOk { controllers: vec![reports, ControllerInfo { joint: 1, ..ControllerInfo::default() }] }
}

pub(super) fn state() -> StateEvent {
    let joint = JointState { angle: -0.5, rate: 0.25, torque: 0.0625 };
    StateEvent {
        tick: 123_456,
        t: 123.456,
        mode: Mode::Active,
        fault: None,
        q: [0.5, -0.5, 0.5, -0.5],
        omega: [0.1, 0.0, -2.5],
        reference: Some([0.5, 0.5, -0.5, -0.5]),
        torque: [0.0, 1.5, -0.001],
        joints: vec![joint, JointState::default(), joint, JointState { angle: 1e-7, ..joint }],
        slip: 0.0,
        scale: 1.0,
        traction: 0.375,
        energy: -0.0125,
        client: Some(ClientStream { seq: Some(9), age_ticks: 2 }),
        hand: None,
        timing: StateTiming {
            lateness_us: 12.5,
            compute_us: 8.25,
            link_us: 310.0,
            age_us: 1250.0,
            lead_us: 2200.0,
        },
        orientation_sigma: None,
    }
}

pub(super) fn events() -> Vec<ServerMessage> {
    let fault = FaultEvent {
        tick: 5,
        t: 0.005,
        mode: Mode::Fault,
        fault: Some(Fault::LinkLost),
        message: "x: y".into(),
        found: Some("x".into()),
        remedy: Some("Y.".into()),
        flight_log: Some("x.csv".into()),
        by: None,
    };
    let by = Some(Requester { name: "other".into(), session: Some(8) });
    let lease = LeaseEvent {
        holder: Some("other".into()),
        session: Some(8),
        cause: LeaseCause::Stolen,
        by: by.clone(),
    };
    let signal = Some(Requester { name: "SIGUSR1".into(), session: None });
    let effects = vec![EffectCost { id: "dial".into(), kind: "detents".into(), cost_ns: 95 }];
    [
        Event::State(state()),
        Event::State(StateEvent {
            mode: Mode::Fault,
            fault: Some(Fault::ImplausibleFeedback),
            joints: vec![],
            client: None,
            hand: Some([0.0, -1.5, 0.25]),
            orientation_sigma: Some([0.125, 0.25, 3.0]),
            ..state()
        }),
        Event::Fault(fault.clone()),
        Event::Fault(FaultEvent { mode: Mode::Estop, fault: None, by: signal, ..fault }),
        Event::Lease(lease),
        Event::Lease(LeaseEvent { holder: None, session: None, cause: LeaseCause::Released, by: None }),
        Event::Scene(SceneEvent { tick: 77, name: "Dial".into(), effects, by: by.clone() }),
        Event::Set(SetEvent {
            tick: 78,
            effect: "spring".into(),
            parameters: serde_json::Map::from_iter([("stiffness".into(), 2.5.into())]),
            warnings: vec!["spring: too stiff; soften it".into()],
            advice: vec![WarningParts {
                effect: Some("spring".into()),
                what: "too stiff".into(),
                why: None,
                remedy: Some("Soften it.".into()),
                shakes: true,
            }],
            by,
        }),
        Event::Dropped(DroppedEvent { count: 3, total: 300 }),
        Event::Refused(RefusedEvent {
            count: 1,
            total: 2,
            op: Some("torque".into()),
            code: ErrorCode::NotHolder,
            message: "y".into(),
        }),
        Event::Shaking(ShakingEvent {
            tick: 77,
            t: 0.077,
            shaking: true,
            frequency: 16.5,
            amplitude: 1.25,
            effect: Some("spring".into()),
            gain: 0.5,
            message: "z".into(),
        }),
        Event::Stopping(StoppingEvent { message: "SIGTERM".into() }),
    ]
    .map(ServerMessage::Event)
    .into()
}

/// Returns an answer to the op `info` in which every field is present.
pub(super) fn info() -> InfoOk {
    let kind = KindInfo { name: "spring".into(), description: "a spring".into(), schema: Value::Null };
    InfoOk {
        rig: RigInfo { wheels: vec![WheelInfo::default()], ..RigInfo::default() },
        limits: LimitsInfo {
            energy: Some(EnergyInfo::default()),
            traction: Some(TractionInfo::default()),
            passivity: Some(PassivityInfo::default()),
            ..LimitsInfo::default()
        },
        clock: Some(ClockInfo::default()),
        render: Some(RenderInfo::default()),
        effects: vec![kind.clone()],
        phenomena: Some(vec![kind]),
        scenes: vec![SceneInfo::default()],
        modes: vec![ModeWords::default()],
        faults: vec![FaultWords::default()],
        advice: vec![WarningParts::default()],
        lease: Some(LeaseInfo::default()),
        mode: Some(Mode::Idle),
        ..InfoOk::default()
    }
}
