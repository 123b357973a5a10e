//! The test bench: a server in this process, a panel drawn into memory, and a second client that
//! sees what the server really does.

use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpListener as StdListener, TcpStream};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use eframe::egui::accesskit::Role;
use eframe::egui::epaint::Shape;
use eframe::egui::{self, Key};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use hbot_api::{Client, ConnectOptions, Event, StateEvent, Trust};
use hbot_config::{RigConfig, SceneFile};
use hbot_gui::{Folders, Panel, PanelOptions};
use hbot_server::server::{ServerOptions, Time};
use hbot_testing::patience::{PATIENCE, eventually};
use hbot_testing::server::{TestServer, any_port, paced};

use crate::identity::Identity;

/// Lock that lets only one test server run at a time. A server in virtual time needs a whole
/// processor core.
static ONE: Mutex<()> = Mutex::new(());

/// A scene in which the simulated hand holds the sphere still, 0.2 rad from the reference of a
/// spring of 0.2 N m/rad. The torque then depends only on the stiffness.
pub(crate) const STILL: &str = r#"
name = "Still"
[[effect]]
id = "spring"
kind = "spring"
stiffness = 0.2
reference = [0.9950041652780258, 0.09983341664682815, 0, 0]
[simulate]
hand = { stiffness = 50, damping = 1, amplitude = 0 }
"#;

/// A server in virtual time for one test. It can hold a lock, so that no other test runs a server
/// at the same time.
pub(crate) struct AloneServer {
    pub(crate) address: SocketAddr,
    server: TestServer,
    /// The certificate that clients of this server trust. `None` if it does not encrypt.
    trust: Option<Trust>,
    /// Lock that is held until this server has ended, so that the next test waits for it.
    alone: Option<MutexGuard<'static, ()>>,
}

/// The settings of a server for tests.
pub(crate) struct ServerSetup<'a> {
    pub(crate) scene: &'a str,
    /// The text of a rig file.
    pub(crate) file: &'a str,
    /// Pairs of texts: in the rig file, the first is replaced by the second.
    pub(crate) rig: &'a [(&'a str, &'a str)],
    /// Whether virtual time is slowed down to real time, for pictures that people look at. Even
    /// then, no tick is late because of other work on the computer.
    pub(crate) paced: bool,
    pub(crate) address: SocketAddr,
    /// The token that clients must present. `None` if no token is needed.
    pub(crate) token: Option<&'a str>,
    /// The server's certificate and key. `None` if it does not encrypt.
    pub(crate) tls: Option<&'a Identity>,
}

impl Default for ServerSetup<'_> {
    fn default() -> Self {
        let file = include_str!("../../../../rigs/prototype.toml");
        Self { scene: STILL, file, rig: &[], paced: false, address: any_port(), token: None, tls: None }
    }
}

pub(crate) fn alone() -> MutexGuard<'static, ()> {
    ONE.lock().unwrap_or_else(PoisonError::into_inner)
}

impl AloneServer {
    pub(crate) fn start(setup: &ServerSetup<'_>) -> Self {
        let alone = alone();
        let mut bench = Self::beside(setup);
        bench.alone = Some(alone);
        bench
    }

    /// Starts a server in virtual time that renders this scene on the prototype.
    pub(crate) fn with_scene(scene: &str) -> Self {
        Self::start(&ServerSetup { scene, ..ServerSetup::default() })
    }

    /// Starts a server without waiting for other servers to end. The caller must hold the guard of
    /// [`alone`].
    pub(crate) fn beside(setup: &ServerSetup<'_>) -> Self {
        let mut rig = setup.file.to_owned();
        for (from, to) in setup.rig {
            assert!(rig.contains(from), "the rig file has {from:?}");
            rig = rig.replace(from, to);
        }
        let mut rig = RigConfig::from_toml(&rig, "test.toml").expect("a legal rig");
        // The server reads these files when it starts.
        let files = setup.tls.map(Identity::files);
        rig.api.tls = files.as_ref().map(|(_, files)| files.clone());
        let scene = SceneFile::from_toml(setup.scene, "test.toml").expect("a legal scene");
        let token = setup.token.map(str::to_owned);
        let recorder = setup.paced.then(|| paced(rig.rate_hz));
        let options = ServerOptions::new(rig, scene, Time::Virtual);
        let server = TestServer::start(ServerOptions { token, recorder, ..options }, setup.address);
        drop(files);
        let trust = setup.tls.map(Identity::trust);
        Self { address: server.address, server, trust, alone: None }
    }

    /// Connects a client with this name to the server.
    pub(crate) fn client(&self, name: &str) -> Client {
        let options = ConnectOptions { trust: self.trust.clone(), ..ConnectOptions::new(name) };
        Client::connect_with(&self.address.to_string(), &options).expect("the server listens")
    }

    pub(crate) fn stop(self) {
        self.server.stop();
    }
}

/// A second client of the server, with which a test checks what the server really does.
pub(crate) struct Witness(Client);

impl Witness {
    pub(crate) fn new(bench: &AloneServer) -> Self {
        let mut client = bench.client("a witness");
        client.subscribe(500).expect("subscribed");
        Self(client)
    }

    /// Waits for the next state for which `ready` returns true, and returns it. `what` names it in
    /// the message if it does not come.
    pub(crate) fn state(&mut self, what: &str, mut ready: impl FnMut(&StateEvent) -> bool) -> StateEvent {
        let start = Instant::now();
        let mut last = None;
        while start.elapsed() < PATIENCE {
            if let Some(Event::State(state)) =
                self.0.next_event(Duration::from_secs(5)).expect("the connection stays")
            {
                if ready(&state) {
                    return state;
                }
                last = Some(state);
            }
        }
        panic!("{what} did not come; the last state: {last:?}");
    }

    /// Waits `seconds` of the control loop's time, and returns the next state. States that arrived
    /// before are skipped.
    pub(crate) fn later(&mut self, seconds: f64) -> StateEvent {
        let from = self.0.ping(serde_json::Value::Null).expect("an answer").t + seconds;
        self.state("a later state", |state| state.t > from)
    }

    /// Asks the server for the value of an effect's parameter, and returns it.
    pub(crate) fn parameter(&mut self, effect: &str, key: &str) -> serde_json::Value {
        let info = self.0.info().expect("info");
        let effects = info.scene["effect"].as_array().expect("effects");
        let effect = effects.iter().find(|e| e["id"] == effect).expect("the effect");
        effect[key].clone()
    }

    pub(crate) fn info(&mut self) -> hbot_api::InfoOk {
        self.0.info().expect("info")
    }
}

pub(crate) fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// A panel in a test. It is drawn into memory instead of a window.
pub(crate) struct Seat {
    pub(crate) harness: Harness<'static, Option<Panel>>,
    /// Longest time that the panel took to draw one frame.
    pub(crate) longest: Duration,
    /// Total time that the panel took to draw all frames.
    pub(crate) drawing: Duration,
    pub(crate) frames: u32,
    pub(crate) out: tempfile::TempDir,
}

impl Seat {
    pub(crate) fn at(server: impl ToString) -> Self {
        Self::with(PanelOptions { samples_per_s: 2, ..PanelOptions::new(&server.to_string()) })
    }

    pub(crate) fn with(options: PanelOptions) -> Self {
        let out = tempfile::tempdir().expect("a folder");
        let scenes = out.path().join("scenes");
        let project = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
        std::fs::create_dir(&scenes).expect("a folder");
        for file in std::fs::read_dir(project).expect("scenes").flatten() {
            std::fs::copy(file.path(), scenes.join(file.file_name())).expect("copied");
        }
        let folders = Folders { scenes, out: out.path().to_owned() };
        let mut start = Some((options, folders));
        let harness = Harness::builder().with_size([1280.0, 760.0]).with_step_dt(1.0 / 60.0).build_ui_state(
            move |ui: &mut egui::Ui, panel: &mut Option<Panel>| {
                if let Some((options, folders)) = start.take() {
                    *panel = Some(Panel::new(ui.ctx(), options, folders).expect("threads"));
                }
                panel.as_mut().expect("made in the first frame").ui(ui);
            },
            None,
        );
        Self { harness, longest: Duration::ZERO, drawing: Duration::ZERO, frames: 0, out }
    }

    pub(crate) fn frame(&mut self) {
        let start = Instant::now();
        self.harness.step();
        let took = start.elapsed();
        self.drawing += took;
        self.longest = self.longest.max(took);
        self.frames += 1;
    }

    /// Draws frames at about 60 Hz until `so` returns true. `what` names the awaited event in the
    /// message if it does not come.
    pub(crate) fn until(&mut self, what: &str, mut so: impl FnMut(&Harness<'static, Option<Panel>>) -> bool) {
        let start = Instant::now();
        while !so(&self.harness) {
            assert!(start.elapsed() < PATIENCE, "{what} did not come; the window:\n{}", self.texts());
            self.frame();
            // Frames at 60 Hz: a window that is drawn without pause would take a core from the
            // server.
            std::thread::sleep(Duration::from_millis(15));
        }
    }

    pub(crate) fn until_text(&mut self, text: &str) {
        self.until(text, |harness| harness.query_all_by_label_contains(text).next().is_some());
    }

    pub(crate) fn shows(&self, text: &str) -> bool {
        self.harness.query_all_by_label_contains(text).next().is_some()
    }

    pub(crate) fn click(&mut self, label: &str) {
        self.until_enabled(label);
        self.harness.get_by_label(label).click_accesskit();
        self.frame();
        self.frame();
    }

    /// Sets a number in the control with this label, in the way that assistive technology does.
    pub(crate) fn set(&mut self, label: &str, value: f64) {
        self.harness.get_by_label(label).set_value_accesskit(value);
        self.frame();
        self.frame();
    }

    /// Waits until the control with this label can be used. On a busy machine no state comes for
    /// a moment, and controls are grey while the server is silent. A click then has no effect.
    fn until_enabled(&mut self, label: &str) {
        self.until(&format!("{label} can be used"), |harness| {
            !harness.get_by_label(label).accesskit_node().is_disabled()
        });
    }

    /// Types a number into the field with this label, as a user does. A field that is grey for a
    /// moment loses the focus and what was typed. Then it is typed again.
    pub(crate) fn type_number(&mut self, label: &str, text: &str) {
        let start = Instant::now();
        loop {
            self.until_enabled(label);
            self.harness.get_by_label(label).focus();
            self.frame();
            self.frame();
            self.harness.get_by_label(label).type_text(text);
            self.frame();
            if self.harness.get_by_label(label).is_focused() {
                break;
            }
            assert!(start.elapsed() < PATIENCE, "{label} does not keep the focus:\n{}", self.texts());
        }
        self.harness.key_press(Key::Enter);
        self.frame();
        self.frame();
    }

    /// Types into the text field with this label.
    pub(crate) fn type_text(&mut self, label: &str, text: &str) {
        self.harness.get_by_label(label).focus();
        self.frame();
        self.harness.get_by_label(label).type_text(text);
        self.frame();
    }

    /// Picks an entry from the drop-down list with this label.
    pub(crate) fn pick(&mut self, list: &str, entry: &str) {
        // A list stays open after an entry was chosen by a screen reader's click.
        if self.harness.query_by_role_and_label(Role::Button, entry).is_none() {
            self.click(list);
        }
        self.until(entry, |harness| harness.query_by_role_and_label(Role::Button, entry).is_some());
        // A parameter can have the same label as an entry, but only the entry is a button.
        self.harness.get_by_role_and_label(Role::Button, entry).click_accesskit();
        self.frame();
        self.frame();
    }

    pub(crate) fn painted(&self) -> Vec<String> {
        painted(&self.harness)
    }

    pub(crate) fn is_enabled(&self, label: &str) -> bool {
        !self.harness.get_by_label(label).accesskit_node().is_disabled()
    }

    /// Returns all text in the window, for the message of a failed test.
    pub(crate) fn texts(&self) -> String {
        format!("{:?}", self.harness.root())
    }
}

/// Returns the texts that the last frame has painted, also those without an own node for screen
/// readers, such as the legend of the sphere.
pub(crate) fn painted(harness: &Harness<'static, Option<Panel>>) -> Vec<String> {
    fn collect(shape: &Shape, texts: &mut Vec<String>) {
        match shape {
            Shape::Vec(shapes) => shapes.iter().for_each(|shape| collect(shape, texts)),
            Shape::Text(shape) => texts.push(shape.galley.text().to_owned()),
            _ => {}
        }
    }
    let mut texts = Vec::new();
    harness.output().shapes.iter().for_each(|shape| collect(&shape.shape, &mut texts));
    texts
}

/// A TCP connection between a panel and its server. A test can freeze it, so that no bytes arrive
/// on either side, or cut it.
pub(crate) struct Wire {
    pub(crate) address: SocketAddr,
    frozen: Arc<AtomicBool>,
    cut: Arc<AtomicBool>,
    /// Number of bytes that have passed, in both directions.
    passed: Arc<AtomicU64>,
    /// Number of requests whose op was replaced.
    replaced: Arc<AtomicU64>,
}

impl Wire {
    pub(crate) fn to(server: SocketAddr) -> Self {
        Self::replacing(server, None)
    }

    /// Makes the server look like one that does not know this op: in the requests of the panel, the
    /// first letter of the op becomes a question mark.
    pub(crate) fn to_one_without(server: SocketAddr, op: &'static str) -> Self {
        Self::replacing(server, Some(op))
    }

    fn replacing(server: SocketAddr, op: Option<&'static str>) -> Self {
        let listener = StdListener::bind(("127.0.0.1", 0)).expect("a free port");
        let address = listener.local_addr().expect("an address");
        let [frozen, cut] = [(); 2].map(|()| Arc::new(AtomicBool::new(false)));
        let passed = Arc::new(AtomicU64::new(0));
        let replaced = Arc::new(AtomicU64::new(0));
        let (hold, end) = (Arc::clone(&frozen), Arc::clone(&cut));
        let (count, found) = (Arc::clone(&passed), Arc::clone(&replaced));
        std::thread::spawn(move || {
            for near in listener.incoming().flatten() {
                let Ok(far) = TcpStream::connect(server) else { continue };
                let half = |socket: &TcpStream| socket.try_clone().expect("a socket");
                let there = (half(&near), half(&far), op);
                for (mut from, mut to, op) in [there, (half(&far), half(&near), None)] {
                    let (hold, end) = (Arc::clone(&hold), Arc::clone(&end));
                    let (count, found) = (Arc::clone(&count), Arc::clone(&found));
                    std::thread::spawn(move || {
                        let mut piece = [0; 4096];
                        while let Ok(n @ 1..) = from.read(&mut piece) {
                            eventually("the wire is let go", || !hold.load(Ordering::Relaxed));
                            count.fetch_add(n as u64, Ordering::Relaxed);
                            if let Some(op) = op {
                                found.fetch_add(spoil(&mut piece[..n], op), Ordering::Relaxed);
                            }
                            if end.load(Ordering::Relaxed) || to.write_all(&piece[..n]).is_err() {
                                break;
                            }
                        }
                        let _ = to.shutdown(std::net::Shutdown::Both);
                    });
                }
            }
        });
        Self { address, frozen, cut, passed, replaced }
    }

    /// Returns how many requests had an op that the server does not know.
    pub(crate) fn replaced(&self) -> u64 {
        self.replaced.load(Ordering::Relaxed)
    }

    /// Returns how many bytes have passed, in both directions.
    pub(crate) fn passed(&self) -> u64 {
        self.passed.load(Ordering::Relaxed)
    }

    pub(crate) fn freeze(&self, frozen: bool) {
        self.frozen.store(frozen, Ordering::Relaxed);
    }

    /// Ends every connection with the next bytes that come.
    pub(crate) fn cut(&self) {
        self.cut.store(true, Ordering::Relaxed);
    }
}

/// Replaces the first letter of a word by a question mark, wherever the word stands in `piece`.
/// Returns how often that is.
fn spoil(piece: &mut [u8], word: &str) -> u64 {
    let windows = piece.windows(word.len()).enumerate();
    let places: Vec<usize> = windows.filter(|(_, it)| *it == word.as_bytes()).map(|(k, _)| k).collect();
    for place in &places {
        piece[*place] = b'?';
    }
    places.len() as u64
}
