//! Tests with servers that come and go, with other clients, and with servers that hang.

use std::net::TcpListener;
use std::time::Duration;

use eframe::egui::Key;
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use hbot_api::{Event, Mode};
use hbot_gui::PanelOptions;

use crate::bench::{AloneServer, Seat, ServerSetup, Wire, Witness, alone, painted};
use crate::controls::seated;
use crate::identity::Identity;

#[test]
fn it_starts_without_a_server_says_how_to_start_one_and_connects_when_it_comes() {
    let _alone = alone();
    let free = TcpListener::bind(("127.0.0.1", 0)).expect("a port").local_addr().expect("an address");
    let mut seat = Seat::at(free);
    seat.until_text(&format!("No server at {free}"));
    assert!(seat.shows("hbot server") && seat.shows("cargo run server") && seat.shows("Not connected."));
    assert!(!seat.is_enabled("Enable"));
    seat.harness.check_accessibility();
    let setup = ServerSetup { address: free, ..ServerSetup::default() };
    for _ in 0..2 {
        let bench = AloneServer::beside(&setup);
        seat.until_text("ACTIVE");
        seat.until_text("you command");
        bench.stop();
        seat.until_text("No server at");
    }
    // Who has released the command does not get it again by a new connection.
    for released in [false, true] {
        let bench = AloneServer::beside(&setup);
        // New states come only after the lease has been taken.
        seat.until("contact", |harness| harness.query_all_by_label_contains("NO CONTACT").next().is_none());
        seat.until_text("ACTIVE");
        assert_eq!(seat.shows("nobody commands"), released, "{}", seat.texts());
        seat.click(if released { "Take command" } else { "Release" });
        seat.until_text(if released { "you command" } else { "nobody commands" });
        bench.stop();
        seat.until_text("No server at");
    }
}

#[test]
fn a_server_that_refuses_says_why() {
    let bench =
        AloneServer::start(&ServerSetup { token: Some("a token of some length"), ..ServerSetup::default() });
    let mut seat = Seat::at(bench.address);
    seat.until_text("No connection to");
    assert!(seat.shows("see the server's token file"));
    let token = Some("a token of some length".to_owned().into());
    let mut seat = Seat::with(PanelOptions { token, ..PanelOptions::new(&bench.address.to_string()) });
    seat.until_text("you command");
}

#[test]
fn a_server_that_encrypts_is_met_by_its_certificate_and_met_again_when_it_comes_back() {
    let _alone = alone();
    let ours = Identity::new();
    let free = TcpListener::bind(("127.0.0.1", 0)).expect("a port").local_addr().expect("an address");
    let setup = ServerSetup { address: free, tls: Some(&ours), ..ServerSetup::default() };
    let options =
        PanelOptions { samples_per_s: 2, trust: Some(ours.trust()), ..PanelOptions::new(&free.to_string()) };
    let mut seat = Seat::with(options);
    seat.until_text("No server at");
    for _ in 0..2 {
        let bench = AloneServer::beside(&setup);
        seat.until_text("ACTIVE");
        seat.until_text("you command");
        // The stop has its own connection, which must be encrypted as well.
        let mut witness = Witness::new(&bench);
        seat.click("Stop");
        witness.state("stopped", |state| state.mode == Mode::Estop);
        seat.until_text("ESTOP");
        // If the stop line were not encrypted, the stop would go over the session and this message
        // would appear.
        assert!(!seat.shows("has not confirmed the stop"), "{}", seat.texts());
        bench.stop();
        seat.until_text("No server at");
    }
    // Replaces the server by another one of the same name with another certificate.
    let stranger = Identity::new();
    let bench = AloneServer::beside(&ServerSetup { tls: Some(&stranger), ..setup });
    seat.until_text("the server's certificate is not trusted: it is not in the file named");
    assert!(seat.shows("No connection to"), "{}", seat.texts());
    let mend = "copy the server's certificate from the rig PC, and name that file (hbot-gui --ca FILE)";
    assert!(seat.shows(mend), "{}", seat.texts());
    assert!(!seat.shows("CaUsedAsEndEntity") && !seat.is_enabled("Enable"), "{}", seat.texts());
    bench.stop();
    // Replaces the server by one that does not encrypt.
    let bench = AloneServer::beside(&ServerSetup { tls: None, ..setup });
    seat.until_text("the server does not encrypt: leave out the certificate");
    bench.stop();
}

#[test]
fn a_server_that_encrypts_says_so_to_a_panel_without_a_certificate() {
    let ours = Identity::new();
    let bench = AloneServer::start(&ServerSetup { tls: Some(&ours), ..ServerSetup::default() });
    let mut seat = Seat::at(bench.address);
    seat.until_text("the server encrypts: name its certificate, or its authority's (hbot-gui --ca FILE)");
    // A stop that cannot be sent must be reported.
    seat.click("Stop");
    seat.until_text("the server has not confirmed the stop (the server encrypts: name its certificate");
    assert!(seat.shows("Cut the motors' power."), "{}", seat.texts());
}

#[test]
fn a_certificate_that_cannot_be_used_is_told_before_there_is_a_window() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("no.pem");
    std::fs::write(&file, "no certificate").expect("written");
    for (name, why) in [("no.pem", "no certificate in it"), ("absent.pem", "cannot be read")] {
        let out = std::process::Command::new(env!("CARGO_BIN_EXE_hbot-gui"))
            .arg("--ca")
            .arg(folder.path().join(name))
            .output()
            .expect("it runs");
        let said = String::from_utf8_lossy(&out.stderr).into_owned();
        assert_eq!(out.status.code(), Some(1));
        assert!(said.contains("error: --ca: ") && said.contains(name) && said.contains(why), "{said}");
    }
}

#[test]
fn another_address_can_be_typed() {
    let bench = AloneServer::start(&ServerSetup::default());
    let free = TcpListener::bind(("127.0.0.1", 0)).expect("a port").local_addr().expect("an address");
    let mut seat = Seat::at(free);
    seat.until_text("No server at");
    for _ in 0..free.to_string().len() {
        seat.harness.get_by_label("Server address").focus();
        seat.harness.key_press(Key::End);
        seat.harness.key_press(Key::Backspace);
        seat.frame();
    }
    seat.type_text("Server address", &bench.address.to_string());
    seat.click("Connect");
    seat.until_text("ACTIVE");
    // The stop goes to the new server too.
    let mut witness = Witness::new(&bench);
    seat.click("Stop");
    witness.state("stopped", |state| state.mode == Mode::Estop);
}

#[test]
fn an_observer_says_who_commands_may_stop_and_may_take_over() {
    let bench = AloneServer::start(&ServerSetup::default());
    let mut other = bench.client("the experiment");
    other.acquire(false).expect("free");
    let mut witness = Witness::new(&bench);
    let mut seat = Seat::at(bench.address);
    seat.until_text("you observe, the experiment commands");
    seat.until_text("ACTIVE");
    // While the sphere pushes for another client, taking over needs a second click.
    for (answer, wanted) in
        [("Cancel", "you observe, the experiment commands"), ("Take over now", "you command")]
    {
        seat.click("Take over");
        seat.until_text("Take over from the experiment?");
        let holder = witness.info().lease.and_then(|lease| lease.holder);
        assert_eq!(holder.as_deref(), Some("the experiment"), "nothing happens before the answer");
        assert!(seat.is_enabled("Stop"));
        seat.click(answer);
        seat.until_text(wanted);
        assert!(!seat.shows("Take over from"));
    }
    other.acquire(true).expect("stolen");
    seat.until_text("you observe, the experiment commands");
    for control in ["Stiffness", "Enable", "Reset", "spring on", "spring stiffness", "Load"] {
        assert!(!seat.is_enabled(control), "{control}");
    }
    seat.click("Stop");
    witness.state("stopped by an observer", |state| state.mode == Mode::Estop);
    seat.until_text("ESTOP");
    seat.until_text("Stopped by you.");
    // A rig without torque changes hands at once.
    seat.click("Take over");
    seat.until_text("you command");
    assert!(seat.is_enabled("Reset"));
    other.acquire(true).expect("stolen");
    seat.until_text("the experiment has taken over command");
    other.release().expect("given back");
    seat.until_text("nobody commands");
    // A user who changes something on a free rig gets the lease.
    seat.click("Reset");
    seat.until_text("you command");
    seat.click("Release");
    seat.until_text("nobody commands");
    seat.click("Take command");
    seat.until_text("you command");
    // Another client stops the rig.
    seat.until_text("IDLE");
    other.estop().expect("stopped");
    seat.until_text("Stopped by the experiment.");
    assert!(!seat.is_enabled("Recover") && seat.is_enabled("Reset"));
}

#[test]
fn who_only_watches_takes_nothing() {
    let bench = AloneServer::start(&ServerSetup::default());
    let options =
        PanelOptions { observe: true, samples_per_s: 2, ..PanelOptions::new(&bench.address.to_string()) };
    let mut seat = Seat::with(options);
    seat.until_text("ACTIVE");
    seat.until_text("nobody commands");
    assert!(!seat.is_enabled("Stiffness") && seat.is_enabled("Stop"));
    let mut other = bench.client("the experiment");
    other.acquire(false).expect("nobody has taken it");
    seat.until_text("you observe, the experiment commands");
    drop(other);
    seat.until_text("nobody commands");
    seat.click("Take command");
    seat.until_text("you command");
    seat.until("the controls", |harness| !harness.get_by_label("Stiffness").accesskit_node().is_disabled());
}

#[test]
fn who_only_watches_knows_who_commanded_before() {
    let bench = AloneServer::start(&ServerSetup::default());
    let mut other = bench.client("the experiment");
    other.acquire(false).expect("free");
    let mut seat =
        Seat::with(PanelOptions { observe: true, ..PanelOptions::new(&bench.address.to_string()) });
    seat.until_text("you observe, the experiment commands");
}

#[test]
fn a_server_that_hangs_does_not_hang_the_window() {
    let bench = AloneServer::start(&ServerSetup::default());
    let wire = Wire::to(bench.address);
    let mut witness = Witness::new(&bench);
    let mut seat = Seat::at(wire.address);
    seat.until_text("ACTIVE");
    wire.freeze(true);
    seat.longest = Duration::ZERO;
    seat.until_text("silent ");
    assert!(
        seat.shows("NO CONTACT") && seat.shows("Last heard") && seat.shows(": ACTIVE, "),
        "{}",
        seat.texts()
    );
    assert!(!seat.is_enabled("Stiffness") && seat.is_enabled("Stop"));
    assert!(painted(&seat.harness).iter().any(|text| text == "may not arrive"), "{}", seat.texts());
    seat.click("Stop");
    seat.until_text("STOP sent, not confirmed yet");
    seat.until_text("the server has not confirmed the stop");
    // What a real rig is told instead is tested without a server.
    assert!(seat.shows("NOT STOPPED") && seat.shows("Simulated: nothing real moves."), "{}", seat.texts());
    assert!(!seat.shows("ut the motors' power"), "{}", seat.texts());
    // The network threads wait up to 2 s for an answer. This limit is far below, so it shows that
    // the window does not wait for them.
    assert!(seat.longest < Duration::from_secs(1), "a frame took {:?}", seat.longest);
    wire.freeze(false);
    // What was held up arrives now, including the stop.
    witness.state("stopped", |state| state.mode == Mode::Estop);
    seat.until_text("ESTOP");
    assert!(!seat.shows("NOT STOPPED"), "{}", seat.texts());
    // The panel has given up the connection over which it asked, but it was this panel.
    seat.until_text("Stopped by you.");
}

#[test]
fn a_stop_that_found_no_server_can_be_asked_again_when_one_comes() {
    let _alone = alone();
    let free = TcpListener::bind(("127.0.0.1", 0)).expect("a port").local_addr().expect("an address");
    let mut seat = Seat::at(free);
    seat.until_text("No server at");
    seat.click("Stop");
    seat.until_text("NOT STOPPED");
    seat.until_text("the server has not confirmed the stop (nobody listens there");
    assert!(seat.shows("Press STOP (or Esc) again."), "{}", seat.texts());
    assert!(!seat.shows("name another address"), "advice on the command line: {}", seat.texts());
    let bench = AloneServer::beside(&ServerSetup { address: free, ..ServerSetup::default() });
    let mut witness = Witness::new(&bench);
    witness.state("active", |state| state.mode == Mode::Active);
    // A panel learns who has stopped the rig only if it is connected when that happens.
    seat.until_text("ACTIVE");
    seat.click("Stop");
    seat.until_text("ESTOP");
    seat.until_text("Stopped by you.");
    assert!(!seat.shows("NOT STOPPED"), "{}", seat.texts());
    bench.stop();
}

#[test]
fn as_many_samples_as_a_server_can_send_leave_the_window_responsive() {
    let bench = AloneServer::start(&ServerSetup::default());
    // Requests every tick of a loop that runs as fast as possible.
    let options = PanelOptions { samples_per_s: 100_000, ..PanelOptions::new(&bench.address.to_string()) };
    let mut seat = Seat::with(options);
    seat.until_text("ACTIVE");
    seat.until_text("you command");
    let mut counter = bench.client("a counter");
    let before = counter.stats().expect("stats");
    let start = std::time::Instant::now();
    (seat.frames, seat.drawing) = (0, Duration::ZERO);
    seat.longest = Duration::ZERO;
    while start.elapsed() < Duration::from_secs(4) {
        seat.frame();
        // What is measured is 4 s of a window that is drawn like this.
        std::thread::sleep(Duration::from_millis(10));
    }
    let seconds = start.elapsed().as_secs_f64();
    let after = counter.stats().expect("stats");
    let ticks = (after.ticks - before.ticks) as f64;
    let received = ticks - (after.dropped_states - before.dropped_states) as f64;
    println!(
        "{:.0} samples/s received of {:.0}/s; {:.0} frames/s of {:?}, the longest {:?}",
        received / seconds,
        ticks / seconds,
        f64::from(seat.frames) / seconds,
        seat.drawing / seat.frames,
        seat.longest
    );
    assert!(seat.longest < Duration::from_secs(1), "a frame took {:?}", seat.longest);
    // The server still obeys.
    let mut witness = Witness::new(&bench);
    seat.click("Stop");
    witness.state("stopped", |state| state.mode == Mode::Estop);
    seat.until_text("ESTOP");
    while let Ok(Some(Event::State(_))) = counter.next_event(Duration::ZERO) {}
}

#[test]
fn a_panel_that_is_closed_leaves_the_rig_as_it_is() {
    // Closing the window releases the lease, so it is no fault even if the rig file makes the loss
    // of the lease holder a fault.
    let rig = [("on_client_lost = \"ramp\"", "on_client_lost = \"fault\"")];
    let bench = AloneServer::start(&ServerSetup { rig: &rig, ..ServerSetup::default() });
    let (seat, mut witness) = seated(&bench);
    let holder = witness.info().lease.and_then(|lease| lease.holder);
    assert_eq!(holder, Some(hbot_api::client_name("panel")), "its user and machine");
    drop(seat);
    let state = witness.later(50.0);
    assert_eq!(state.mode, Mode::Active);
}
