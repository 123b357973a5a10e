//! Pictures of each state of the panel in a real window, in two sizes.

use std::net::SocketAddr;
use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use hbot_api::Client;
use hbot_config::rig::Port;
use hbot_config::{RigConfig, SceneFile};
use hbot_server::server::{ServerOptions, Time};
use hbot_testing::far::Far;
use hbot_testing::server::{TestServer, any_port};

use crate::bench::{AloneServer, ServerSetup, Wire, alone};
use crate::display::{Display, Shot};
use crate::joints::MOTEUS;
use crate::window::{CHOSEN, GOOD, LIVE, N3, STOP, TEXT, WARN, count, count_in_bar};

const SIZES: [[u32; 2]; 2] = [[1280, 760], [1024, 600]];

const STOP_BUTTON: [u32; 2] = [140, 75];

const fn lease_button([width, _]: [u32; 2]) -> [u32; 2] {
    [width - 195, 16]
}

/// The columns of the badge, in every window.
const BADGE: Range<u32> = 8..104;

const fn beside_lease_button([width, _]: [u32; 2]) -> Range<u32> {
    width - 460..width - 262
}

const fn joints_tab([width, _]: [u32; 2]) -> [u32; 2] {
    [width - if width < 1100 { 214 } else { 248 }, 45]
}

/// Checks a picture by its name, the size of its window and its pixels.
type Check<'a> = dyn Fn(&str, [u32; 2], &[u8]) + Sync + 'a;

/// Takes a picture of a state in both sizes after `seconds`, and calls `meanwhile` with the size of
/// each window while it is open. `check` gets the pixels.
fn pictures(
    displays: &[Display; 2],
    (state, seconds): (&str, u32),
    server: SocketAddr,
    meanwhile: impl Fn(&Display, [u32; 2]) + Sync,
    check: impl Fn(&str, [u32; 2], &[u8]) + Sync,
) {
    let server = server.to_string();
    std::thread::scope(|scope| {
        for (display, size) in displays.iter().zip(SIZES) {
            let (server, meanwhile, check) = (&server, &meanwhile, &check);
            scope.spawn(move || {
                let name = format!("{state}-{}x{}", size[0], size[1]);
                let args = ["--server", server, "--theme", "dark"];
                let pixels =
                    Shot::start(display, &name, &args, size, seconds).pixels(|| meanwhile(display, size));
                // After a stop it is outlined.
                let filled = count(&pixels, STOP) > 8_000;
                assert_eq!(filled, state != "stopped", "{name}: the stop button is there, and big");
                check(&name, size, &pixels);
            });
        }
    });
}

fn nothing(_: &Display, _: [u32; 2]) {}

#[test]
fn pictures_of_each_state() {
    let _alone = alone();
    let (Some(large), Some(small)) = (Display::start(), Display::start()) else { return };
    let displays = [large, small];
    let spring = include_str!("../../../../scenes/spring.toml");
    let setup = ServerSetup { scene: spring, paced: true, ..ServerSetup::default() };
    let bench = AloneServer::beside(&setup);
    let see = |state: (&str, u32), meanwhile: &(dyn Fn(&Display, [u32; 2]) + Sync), check: &Check<'_>| {
        pictures(&displays, state, bench.address, meanwhile, check);
    };

    let titles = AtomicUsize::new(0);
    let title = |display: &Display, _: [u32; 2]| {
        titles.fetch_add(usize::from(display.has_window("SIMULATED: Hbot prototype")), Ordering::Relaxed);
    };
    see(("simulated", 5), &title, &|name, size, pixels| {
        let badge = count_in_bar(pixels, size, BADGE, TEXT);
        assert!(count(pixels, N3) > 200 && badge > 1_000, "{name}: curves and the badge, {badge}");
        assert!(titles.load(Ordering::Relaxed) > 0, "the title says it too");
    });
    let mut other = bench.client("panel anna@lab2");
    other.acquire(true).expect("stolen");
    see(("observer", 4), &nothing, &|name, size, pixels| {
        let holder = count_in_bar(pixels, size, beside_lease_button(size), WARN);
        assert!(holder > 50 && count(pixels, GOOD) > 50, "{name}: who commands, {holder}");
    });
    see(("taking-over", 5), &|display, size| display.click(lease_button(size)), &|name, _, pixels| {
        // The frame of the question.
        assert!(count(pixels, WARN) > 2_000, "{name}");
    });
    other.release().expect("released");
    silent(&displays, bench.address, ("no-contact", 800_000), None);
    other.estop().expect("stopped");
    see(("stopped", 4), &nothing, &|name, _, pixels| {
        assert!(count(pixels, STOP) > 1_000 && count(pixels, GOOD) < 400, "{name}: the edge of the button");
    });
    bench.stop();

    let rig = [("speed = 30 ", "speed = 0.05 ")];
    let fault = AloneServer::beside(&ServerSetup { scene: "name = \"Nothing\"", rig: &rig, ..setup });
    pictures(&displays, ("fault", 4), fault.address, nothing, |name, _, pixels| {
        assert!(count(pixels, WARN) > 5_000, "{name}: the fault is told");
    });
    fault.stop();
    joints(&displays, spring);
    live(&displays, spring);
}

/// Takes pictures of the tab for the joints. The firmware of a moteus has a long name.
fn joints(displays: &[Display; 2], scene: &str) {
    let setup = ServerSetup { scene, file: MOTEUS, paced: true, ..ServerSetup::default() };
    let bench = AloneServer::beside(&setup);
    let open = |display: &Display, size| display.click(joints_tab(size));
    pictures(displays, ("joints", 5), bench.address, open, |name, size, pixels| {
        let ([width, _], [x, y]) = (size, joints_tab(size));
        // A line of pixels across the text on the tab.
        let at = |x: u32| 3 * (y * width + x) as usize;
        assert!(count(&pixels[at(x - 19)..at(x + 19)], CHOSEN) > 10, "{name}: the tab is open");
    });
    bench.stop();
}

/// Takes pictures of a server that falls silent after this number of bytes. `before` is called
/// until then, and the user presses the stop button afterwards. Without it, the user only looks.
fn silent(
    displays: &[Display; 2],
    server: SocketAddr,
    (state, bytes): (&str, u64),
    before: Option<&(dyn Fn() + Sync)>,
) {
    let stopped = before.is_some();
    let wire = Wire::to(server);
    let frozen = AtomicBool::new(false);
    let meanwhile = |display: &Display, _: [u32; 2]| {
        // Both windows have curves to show by then.
        if wire.passed() > bytes && !frozen.swap(true, Ordering::Relaxed) {
            wire.freeze(true);
        }
        match before {
            Some(_) if frozen.load(Ordering::Relaxed) => display.click(STOP_BUTTON),
            Some(before) => before(),
            None => {}
        }
    };
    pictures(displays, (state, 8), wire.address, meanwhile, |name, [width, _], pixels| {
        // The lamp of a silent server alone has 78 pixels.
        let (lamps, least) = if stopped { (STOP, 100) } else { (WARN, 50) };
        assert!(count(pixels, lamps) > least && count(pixels, GOOD) < 50, "{name}: nothing looks well");
        let [from, to] = [78, 92].map(|y| (3 * width * y) as usize);
        let line = count(&pixels[from..to], [0xff; 3]);
        assert!(line > 20, "{name}: the button says that a stop may not arrive: {line}");
    });
    assert!(frozen.load(Ordering::Relaxed), "{state}: the server never fell silent");
    wire.freeze(false);
}

/// Takes pictures with motor controllers on a serial port, in wall-clock time. To the server, this
/// is a real rig.
fn live(displays: &[Display; 2], scene: &str) {
    let mut file = include_str!("../../../../rigs/prototype.toml").to_owned();
    // These pictures are not about faults. A busy machine delays the ticks and the bytes of a
    // pseudo-terminal, and at a low rate the limits for both are longer.
    for (from, to) in [("rate_hz = 1000", "rate_hz = 100"), ("timeout_ticks = 20 ", "timeout_ticks = 100 ")] {
        assert!(file.contains(from), "{from}");
        file = file.replace(from, to);
    }
    let mut rig = RigConfig::from_toml(&file, "test.toml").expect("a legal rig");
    let far = Far::start(&rig);
    rig.link.port = Port::Devices(vec![far.path.clone()]);
    let scene = SceneFile::from_toml(scene, "test.toml").expect("a legal scene");
    let server = TestServer::start(ServerOptions::new(rig, scene, Time::Wall), any_port());
    let mut commander = Client::connect(&server.address.to_string(), "panel anna@lab2").expect("a server");
    commander.acquire(false).expect("free");
    let commander = Mutex::new(commander);
    let titles = AtomicUsize::new(0);
    // Changes nothing while the rig is active. Two windows that open at once can stop a busy
    // machine for so long that the loop reports a fault.
    let enable = || {
        let mut commander = commander.lock().expect("no panic");
        let _ = commander.reset().and_then(|_| commander.enable());
    };
    let meanwhile = |display: &Display, _: [u32; 2]| {
        titles.fetch_add(usize::from(display.has_window("LIVE: Hbot prototype")), Ordering::Relaxed);
        enable();
    };
    pictures(displays, ("live", 6), server.address, meanwhile, |name, _, pixels| {
        // The badge, and the tape below the bar.
        assert!(count(pixels, LIVE) > 2_000, "{name}: {}", count(pixels, LIVE));
        assert!(titles.load(Ordering::Relaxed) > 0, "the title says it too");
    });
    silent(displays, server.address, ("not-stopped", 300_000), Some(&enable));
    server.stop();
}
