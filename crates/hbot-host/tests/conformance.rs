//! Tests that the drivers of this crate pass the conformance suite, and that docs/drivers.md agrees
//! with the code.

#[allow(unreachable_pub, reason = "a test has no outside")]
mod toy;

use hbot_config::RigConfig;
use hbot_config::rig::Protocol as Name;
use hbot_core::Rig;
use hbot_core::design::rig::RigParts;
use hbot_host::bus::conformance::{CASES, Controllers, Subject, assert_conforms};
use hbot_host::bus::drivers::{hbot::HbotLink, moteus::Moteus, odrive::Odrive};
use hbot_host::bus::{Expected, Protocol};
use hbot_host::rig::layout::Layout;
use hbot_sim::controller::{InjectedFault, Line};
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};

use toy::motors::HeldMotors;

/// The documentation page for authors of drivers, whose excerpts are compared with the code.
const PAGE: &str = include_str!("../../../docs/drivers.md");

/// The motor controllers of a simulated rig. The test needs only their protocol, not the mechanics.
struct Simulated(SimulatedRig);

impl Simulated {
    fn hbot() -> Box<dyn Controllers> {
        Self::boxed(RigConfig::prototype().rig, Line::from(Name::Hbot))
    }

    /// Simulated moteus servos on a UART, whose lines have checksums.
    fn moteus() -> Box<dyn Controllers> {
        Self::boxed(with_counts(Name::Moteus), Line::from(Name::Moteus))
    }

    /// Simulated moteus servos behind an adapter, whose lines have no checksums.
    fn moteus_on_fdcanusb() -> Box<dyn Controllers> {
        Self::boxed(with_counts(Name::Moteus), Line { protocol: Name::Moteus, checksums: false })
    }

    /// Simulated ODrives with the watchdog time of the suite, 20 ms. Their firmware has the
    /// `differences` from firmware 0.5.6.
    fn odrive(differences: &[&str]) -> Box<dyn Controllers> {
        let config =
            SimulatedConfig { line: Name::Odrive.into(), ..SimulatedConfig::new(&with_counts(Name::Odrive)) };
        let mut rig = SimulatedRig::new(&config).expect("the prototype can be simulated");
        for joint in 0..4 {
            assert!(rig.controllers_mut().set(joint, "config.watchdog_timeout", 0.02));
            for difference in differences {
                assert!(rig.controllers_mut().set(joint, difference, 1.0), "{difference}");
            }
        }
        Box::new(Self(rig))
    }

    fn boxed(rig: Rig, line: Line) -> Box<dyn Controllers> {
        let config = SimulatedConfig { line, ..SimulatedConfig::new(&rig) };
        Box::new(Self(SimulatedRig::new(&config).expect("the prototype can be simulated")))
    }
}

/// Returns the prototype rig with the counts per turn that the driver of `protocol` uses for its
/// encoders.
fn with_counts(protocol: Name) -> Rig {
    let counts = protocol.counts_per_turn().expect("it reports turns");
    let all = |parts: &mut RigParts| parts.joints.iter_mut().for_each(|joint| joint.counts_per_turn = counts);
    RigConfig::prototype().rig.with(all).expect("legal")
}

impl Controllers for Simulated {
    fn hear(&mut self, now_ns: u64, bytes: &[u8], answer: &mut Vec<u8>) {
        self.0.receive(now_ns, bytes, answer);
    }

    fn torque(&mut self, now_ns: u64) -> Vec<f64> {
        self.0.advance_to(now_ns);
        self.0.joint_torque()[..4].to_vec()
    }

    fn lose_power(&mut self) {
        self.0.inject(InjectedFault::Reboot);
    }
}

fn held_motors() -> Box<dyn Controllers> {
    let joints = RigConfig::prototype().rig.joints;
    Box::new(HeldMotors::new(joints[..4].iter().map(|joint| joint.counts_per_turn).collect()))
}

fn subject(protocol: &'static dyn Protocol, controllers: fn() -> Box<dyn Controllers>) -> Subject {
    let rig = RigConfig::prototype().rig;
    let expected = Expected::new("test", &rig, &Layout::single(0..4), 0);
    Subject { protocol, expected, controllers, torque: vec![0.01, -0.02, 0.03, -0.04] }
}

#[test]
fn the_hbot_link_conforms() {
    assert_conforms(&subject(&HbotLink, Simulated::hbot));
}

/// Returns the test subject for a driver whose controllers have ids on a bus.
fn with_ids(
    protocol: &'static dyn Protocol,
    name: Name,
    controllers: fn() -> Box<dyn Controllers>,
) -> Subject {
    let first = *name.ids().expect("its controllers have ids").start() as u8;
    let layout = Layout::single(0..4).numbered_from(first);
    let expected = Expected::new("test", &with_counts(name), &layout, 0);
    Subject { protocol, expected, controllers, torque: vec![0.01, -0.02, 0.03, -0.04] }
}

#[test]
fn moteus_conforms_on_a_uart() {
    assert_conforms(&with_ids(&Moteus, Name::Moteus, Simulated::moteus));
}

#[test]
fn moteus_conforms_on_an_adapter() {
    assert_conforms(&with_ids(&Moteus, Name::Moteus, Simulated::moteus_on_fdcanusb));
}

/// What the watchdog of firmware 0.6 could do otherwise than that of 0.5.6.
const ONLY_ARMED: &str = "watchdog counts only while armed";
const ONLY_INPUTS: &str = "only Set_Input_* feeds the watchdog";

#[test]
fn odrive_conforms() {
    assert_conforms(&with_ids(&Odrive, Name::Odrive, || Simulated::odrive(&[])));
}

#[test]
fn odrive_conforms_with_watchdogs_that_count_only_while_motors_are_on() {
    assert_conforms(&with_ids(&Odrive, Name::Odrive, || Simulated::odrive(&[ONLY_ARMED])));
}

#[test]
fn odrive_conforms_with_watchdogs_that_only_torques_feed() {
    assert_conforms(&with_ids(&Odrive, Name::Odrive, || Simulated::odrive(&[ONLY_INPUTS])));
}

#[test]
fn odrive_conforms_with_watchdogs_that_do_both() {
    assert_conforms(&with_ids(&Odrive, Name::Odrive, || Simulated::odrive(&[ONLY_ARMED, ONLY_INPUTS])));
}

#[test]
fn a_driver_of_one_s_own_conforms() {
    assert_conforms(&subject(&toy::Toy, held_motors));
}

/// Returns the words of a text separated by single spaces, so that texts with different line breaks
/// compare equal.
fn words(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn the_page_for_drivers_lists_all_cases_in_their_order() {
    let table = PAGE.split("\n| case |").nth(1).and_then(|rest| rest.split("\n\n").next());
    let rows = table.expect("docs/drivers.md has a table of cases").lines().skip(2);
    let listed: Vec<&str> = rows.filter_map(|row| row.strip_prefix("| ")?.split(" | ").next()).collect();
    let cases: Vec<&str> = CASES.iter().map(|case| case.name).collect();
    assert_eq!(listed, cases, "the table of cases in docs/drivers.md");
}

#[test]
fn every_excerpt_on_the_page_for_drivers_stands_in_the_code() {
    let sources = [
        include_str!("../src/bus/mod.rs"),
        include_str!("conformance.rs"),
        include_str!("toy/mod.rs"),
        include_str!("../../../tests/server/drivers.rs"),
        include_str!("../../hbot-testing/src/server.rs"),
    ]
    .map(words);
    let excerpts = PAGE.split("```rust\n").skip(1).map(|rest| rest.split("```").next().unwrap_or_default());
    let mut seen = 0;
    for excerpt in excerpts {
        let found = sources.iter().any(|source| source.contains(&words(excerpt)));
        assert!(found, "docs/drivers.md quotes what stands nowhere:\n{excerpt}");
        seen += 1;
    }
    assert!(seen >= 10, "{seen} excerpts");
}
