//! Tests of what the panel concludes from what arrives, and models for the tests of the views.

use std::sync::Arc;
use std::time::Duration;

use hbot_api::{Requester, WheelInfo};
use serde_json::json;

pub(crate) use super::judged::tests::told;
use super::*;

/// Name of the panel in these tests.
pub(crate) const ME: &str = "panel anna@lab2";

/// Returns the model of a panel that commands an active rig with one spring.
pub(crate) fn commanding(simulated: bool) -> Model {
    let mut model = Model::new("rig:4268", ME, 120);
    let scene = json!({"name": "Spring", "effect": [
        {"id": "spring", "kind": "spring", "gain": 1.0, "law": "geodesic", "stiffness": 2.0, "damping": 0.01}]});
    let info = json!({"limits": {"torque": 0.9}, "effects": hbot_config::scene::kinds(), "scene": scene,
        "rig": {"name": "Prototype", "simulated": simulated}, "render": {"stiffness_stable": 5.0}});
    let mut info: InfoOk = serde_json::from_value(info).expect("an answer to info");
    info.rig.wheels = vec![WheelInfo::default(); 3];
    hear(&mut model, News::Connected(hello(3)));
    hear(&mut model, News::StopLine(4));
    hear(&mut model, News::Info(Box::new(info)));
    hear(&mut model, News::Lease { lease: Lease::Mine, cause: None });
    see(&mut model, 100, Mode::Active);
    model
}

pub(crate) fn hello(session: u64) -> HelloOk {
    let (server, rig) = ("hbot 0.1.0".to_owned(), "Prototype".to_owned());
    HelloOk { server, version: 1, rig, rate_hz: 1000.0, session }
}

/// Gives the model news from the network.
pub(crate) fn hear(model: &mut Model, news: News) {
    model.take(&mut Delivery { news: [news].into(), ..Delivery::default() });
}

/// Gives the model a state of the rig.
pub(crate) fn see(model: &mut Model, tick: u64, mode: Mode) {
    see_state(model, StateEvent { tick, mode, t: tick as f64 / 1000.0, ..StateEvent::default() });
}

/// Gives the model a state of the rig.
pub(crate) fn see_state(model: &mut Model, state: StateEvent) {
    model.take(&mut Delivery { samples: [Arc::new(state)].into(), ..Delivery::default() });
    // A slow machine makes nobody silent.
    model.heard = Some(Instant::now() + Duration::from_secs(3600));
}

/// Lets so much time pass for the model that a silent server is noticed.
pub(crate) fn grow_silent(model: &mut Model) {
    model.heard = Instant::now().checked_sub(2 * SILENT_AFTER);
}

/// Makes the last state so old that the window is grey.
pub(crate) fn grow_quiet(model: &mut Model) {
    model.heard = Instant::now().checked_sub(Duration::from_millis(640));
}

pub(crate) fn disconnect(model: &mut Model) {
    let again_in = Duration::from_secs(1);
    hear(model, News::Offline { why: "the server stops".to_owned(), absent: true, again_in });
}

/// Returns the event of a stop by the client `name` with the session `session`.
pub(crate) fn stopped_by(name: &str, session: Option<u64>) -> FaultEvent {
    let (mode, message) = (Mode::Estop, "stopped".to_owned());
    let by = Some(Requester { name: name.to_owned(), session });
    let (found, remedy) = (None, None);
    FaultEvent { tick: 200, t: 0.2, mode, fault: None, message, found, remedy, flight_log: None, by }
}

/// Returns the lease of the client `name` with the session `session`.
pub(crate) fn held_by(name: &str, session: u64) -> Lease {
    Lease::Other(Requester { name: name.to_owned(), session: Some(session) })
}

/// Makes the model's user stop the rig, without a confirmation by the server.
pub(crate) fn stop_in_vain(model: &mut Model) {
    model.asked(&Intent::Stop);
    let result = Err("the server has not confirmed the stop (no answer)".to_owned());
    hear(model, News::Stop { server: model.server.clone(), result });
}

fn confirm(model: &mut Model) {
    hear(model, News::Stop { server: model.server.clone(), result: Ok(()) });
}

#[test]
fn a_stop_that_is_not_confirmed_stays_until_a_state_proves_it() {
    let mut model = commanding(false);
    stop_in_vain(&mut model);
    assert_eq!(model.headline(), Headline::NotStopped);
    see(&mut model, 100, Mode::Estop);
    assert_eq!(model.headline(), Headline::NotStopped, "that state is not newer");
    see(&mut model, 101, Mode::Active);
    assert_eq!(model.headline(), Headline::NotStopped);
    confirm(&mut model);
    assert_eq!(model.headline(), Headline::NotStopped, "no state has proved it");
    disconnect(&mut model);
    assert_eq!(model.headline(), Headline::NotStopped);
    hear(&mut model, News::Connected(hello(9)));
    see(&mut model, 5, Mode::Active);
    assert_eq!(model.headline(), Headline::NotStopped);
    see(&mut model, 6, Mode::Idle);
    assert_eq!(model.headline(), Headline::Mode(Mode::Idle));
}

#[test]
fn the_state_of_another_server_does_not_prove_a_stop() {
    let mut model = commanding(false);
    stop_in_vain(&mut model);
    model.asked(&Intent::Connect("other:4268".to_owned()));
    hear(&mut model, News::Connected(hello(1)));
    see(&mut model, 500, Mode::Idle);
    assert_eq!(model.headline(), Headline::NotStopped);
    let stop = model.unconfirmed_stop().expect("a stop");
    assert_eq!(stop.server, "rig:4268");
    assert!(stop.way_out("other:4268", true).contains("This panel is at other:4268 now"));
}

#[test]
fn a_stop_that_is_confirmed_at_once_is_not_reported() {
    let mut model = commanding(false);
    model.asked(&Intent::Stop);
    assert_eq!(model.headline(), Headline::Mode(Mode::Active), "the answer is still to come");
    confirm(&mut model);
    assert!(model.stops.is_empty());
    model.asked(&Intent::Stop);
    see(&mut model, 101, Mode::Estop);
    assert!(model.stops.is_empty(), "a state is as good as an answer");
}

#[test]
fn stops_at_two_servers_are_confirmed_apart() {
    let mut model = commanding(false);
    stop_in_vain(&mut model);
    model.asked(&Intent::Connect("other:4268".to_owned()));
    hear(&mut model, News::Connected(hello(1)));
    see(&mut model, 500, Mode::Active);
    let unconfirmed = |model: &Model| model.unconfirmed_stop().map(|stop| stop.server.clone());
    assert_eq!(unconfirmed(&model).as_deref(), Some("rig:4268"));
    // That of the present server is told first.
    stop_in_vain(&mut model);
    assert_eq!(unconfirmed(&model).as_deref(), Some("other:4268"));
    // An answer of one server says nothing about the other.
    hear(&mut model, News::Stop { server: "rig:4268".to_owned(), result: Ok(()) });
    assert_eq!(unconfirmed(&model).as_deref(), Some("other:4268"));
    see(&mut model, 501, Mode::Estop);
    assert_eq!(unconfirmed(&model).as_deref(), Some("rig:4268"));
    model.asked(&Intent::Connect("rig:4268".to_owned()));
    hear(&mut model, News::Connected(hello(2)));
    see(&mut model, 7, Mode::Estop);
    assert_eq!(model.headline(), Headline::Mode(Mode::Estop));
}

#[test]
fn a_stop_is_pending_until_it_is_confirmed() {
    let mut model = commanding(false);
    assert!(!model.has_pending_stop() && !model.awaits_stop());
    model.asked(&Intent::Stop);
    assert!(model.has_pending_stop() && model.awaits_stop());
    confirm(&mut model);
    assert!(!model.has_pending_stop());
    stop_in_vain(&mut model);
    assert!(model.has_pending_stop() && !model.awaits_stop(), "NOT STOPPED says it");
}

#[test]
fn why_a_stop_failed_is_not_told_over_the_next_connection() {
    let mut model = commanding(false);
    stop_in_vain(&mut model);
    disconnect(&mut model);
    let told = |model: &Model| {
        let stop = model.unconfirmed_stop().expect("a stop");
        (stop.why().to_owned(), model.pushes_again(stop))
    };
    assert_eq!(told(&model), ("the server has not confirmed the stop (no answer)".to_owned(), false));
    hear(&mut model, News::Connected(hello(9)));
    let again = "asked for before the present connection".to_owned();
    assert_eq!(told(&model), (again.clone(), false), "no state has come yet");
    see(&mut model, 5, Mode::Active);
    assert_eq!(told(&model), (again.clone(), true));
    confirm(&mut model);
    assert_eq!(told(&model), (again, true), "no state has proved it");
    see(&mut model, 6, Mode::Estop);
    assert!(!model.has_pending_stop());
}

#[test]
fn what_is_shown_is_old_before_the_server_is_silent() {
    let mut model = commanding(false);
    assert!(model.is_fresh() && model.is_certain());
    grow_quiet(&mut model);
    assert!(model.quiet_for().is_some() && !model.is_fresh() && !model.is_certain());
    assert_eq!(model.headline(), Headline::Mode(Mode::Active));
    assert!(model.silent_for().is_none() && model.may_command(), "the limit of the alarm is another");
    // A panel that requests two states per second waits longer.
    model.samples_per_s = 2;
    assert!(model.is_fresh());
}

#[test]
fn a_silent_or_lost_server_is_no_contact() {
    let mut model = commanding(true);
    assert!(model.is_live() && model.may_command());
    grow_silent(&mut model);
    assert_eq!(model.headline(), Headline::NoContact);
    assert!(!model.is_live() && !model.may_command());
    see(&mut model, 102, Mode::Active);
    assert_eq!(model.headline(), Headline::Mode(Mode::Active));
    disconnect(&mut model);
    assert_eq!(model.headline(), Headline::NoContact);
    assert_eq!(model.badge(), None, "the next server there can have a real rig");
}

#[test]
fn the_badge_and_the_title_say_whether_motors_can_push() {
    assert_eq!(commanding(true).title(), "SIMULATED: Prototype at rig:4268 - hbot panel");
    let mut model = commanding(false);
    assert_eq!(model.title(), "LIVE: Prototype at rig:4268 - hbot panel");
    model.asked(&Intent::Connect("other:4268".to_owned()));
    assert_eq!((model.badge(), model.title()), (None, "hbot panel".to_owned()));
}

#[test]
fn what_a_lost_server_or_another_one_reported_is_forgotten() {
    let reporting = || {
        let mut model = commanding(true);
        hear(&mut model, News::Stats(Box::default()));
        for temperature_c in [Some(25.0), Some(26.0)] {
            hear(&mut model, News::Controllers(vec![ControllerInfo { temperature_c, ..Default::default() }]));
            assert_eq!(model.controllers[0].temperature_c, temperature_c);
        }
        assert!(model.stats.is_some());
        model
    };
    let forgotten = |model: &Model| model.controllers.is_empty() && model.stats.is_none();
    let mut lost = reporting();
    disconnect(&mut lost);
    assert!(forgotten(&lost));
    // An older server does not know the request for the controllers.
    let mut elsewhere = reporting();
    elsewhere.asked(&Intent::Connect("other:4268".to_owned()));
    hear(&mut elsewhere, News::Connected(hello(9)));
    assert!(forgotten(&elsewhere));
    let ends: [fn(&mut Model); 2] = [disconnect, |model| hear(model, News::Connected(hello(10)))];
    for end in ends {
        hear(&mut elsewhere, News::NoControllers);
        assert!(elsewhere.lacks_controllers);
        end(&mut elsewhere);
        assert!(!elsewhere.lacks_controllers, "the next server can be newer");
    }
}

#[test]
fn who_did_it_is_said_as_the_user_would_say_it() {
    let model = commanding(true);
    for (name, session, who) in [
        (ME, Some(3), "you"),
        (ME, Some(4), "you"),
        (ME, Some(5), "anna@lab2 (session 5)"),
        ("panel ben@lab3", Some(3), "ben@lab3"),
        ("hbot set ben@lab3", Some(6), "hbot set ben@lab3"),
        ("SIGUSR1", None, "the signal SIGUSR1"),
    ] {
        assert_eq!(model.who(&Requester { name: name.to_owned(), session }), who);
    }
}

#[test]
fn only_names_that_are_alike_have_a_number() {
    let mut model = commanding(true);
    let who = |model: &Model, session| {
        model.who(&Requester { name: "panel ben@lab3".to_owned(), session: Some(session) })
    };
    hear(&mut model, News::Lease { lease: held_by("panel ben@lab3", 9), cause: None });
    assert_eq!([who(&model, 9), who(&model, 10)], ["ben@lab3", "ben@lab3 (session 10)"]);
    hear(&mut model, News::Lease { lease: held_by(ME, 9), cause: Some(LeaseCause::Stolen) });
    assert_eq!(who(&model, 10), "ben@lab3");
    let Lease::Other(holder) = &model.lease else { panic!("not held") };
    assert_eq!(model.other(holder), "anna@lab2 (session 9)");
}

#[test]
fn what_this_panel_asked_over_an_earlier_connection_is_by_you() {
    let mut model = commanding(true);
    let who = |model: &Model, session| model.who(&Requester { name: ME.to_owned(), session: Some(session) });
    // Both connections are lost and made again.
    hear(&mut model, News::StopLine(6));
    hear(&mut model, News::Connected(hello(7)));
    for session in [3, 4, 6, 7] {
        assert_eq!(who(&model, session), "you", "{session}");
    }
    assert_eq!(who(&model, 5), "anna@lab2 (session 5)", "another panel of the same user");
    // A server that has started again counts its connections from the beginning.
    hear(&mut model, News::Connected(hello(1)));
    hear(&mut model, News::StopLine(2));
    for session in [1, 2] {
        assert_eq!(who(&model, session), "you", "{session}");
    }
    for session in [3, 4, 6, 7] {
        assert_eq!(who(&model, session), format!("anna@lab2 (session {session})"));
    }
    model.asked(&Intent::Connect("other:4268".to_owned()));
    assert_eq!(who(&model, 1), "anna@lab2 (session 1)", "of another server");
}

#[test]
fn who_stopped_the_rig_stays_known_if_older_states_follow_the_event() {
    let mut model = commanding(true);
    hear(&mut model, News::Fault(stopped_by("panel ben@lab3", Some(7))));
    see(&mut model, 199, Mode::Active);
    see(&mut model, 200, Mode::Estop);
    assert!(model.fault.is_some());
    see(&mut model, 300, Mode::Idle);
    assert!(model.fault.is_none());
}

#[test]
fn the_end_of_a_server_is_one_message() {
    let mut model = commanding(true);
    let before = model.messages.newest_first().len();
    disconnect(&mut model);
    disconnect(&mut model);
    let texts: Vec<_> = model.messages.newest_first().map(|message| message.text.clone()).collect();
    assert_eq!(texts.len(), before + 1, "{texts:?}");
    assert_eq!(texts[0], "connection lost: the server stops");
}

#[test]
fn a_parameter_that_another_client_sets_is_marked_with_its_name() {
    let set = |name: &str, session| SetEvent {
        tick: 120,
        effect: "spring".to_owned(),
        parameters: json!({"stiffness": 2.5}).as_object().expect("a map").clone(),
        warnings: Vec::new(),
        advice: Vec::new(),
        by: Some(Requester { name: name.to_owned(), session: Some(session) }),
    };
    let (mut other, mut own) = (commanding(true), commanding(true));
    hear(&mut other, News::Set(set("lab", 9)));
    hear(&mut own, News::Set(set(ME, 3)));
    let marks =
        |model: &Model| -> Vec<_> { model.marks.between(0.0, 9.0).map(|mark| mark.text.clone()).collect() };
    assert_eq!(marks(&own), ["spring: stiffness = 2.5"]);
    assert_eq!(marks(&other), ["spring: stiffness = 2.5, set by lab"]);
}

#[test]
fn the_messages_call_the_user_you() {
    let mut model = commanding(true);
    for (name, session, told) in [(ME, 4, "stopped by you"), (ME, 9, "stopped by anna@lab2 (session 9)")] {
        hear(&mut model, News::Fault(stopped_by(name, Some(session))));
        let newest = &model.messages.newest_first().next().expect("a message").text;
        assert!(newest.contains(told), "{newest}");
    }
}
