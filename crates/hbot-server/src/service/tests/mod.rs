//! Tests of the service over real sockets, with the real loop and the simulated rig in virtual
//! time.

mod attack;
mod commands;
mod connection;
mod faults;
mod framing;
mod hello;
mod lease;
mod metrics;
mod models;
mod overload;
mod scenes;
mod shakes;
mod shape;
mod stops;
mod tls;
mod unauthenticated;
mod wakeups;
mod web;

use std::io::{self, Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::sync::{Arc, mpsc as blocking};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use hbot_api::{Client, ClientError, ConnectOptions, ErrorBody, Event, Mode, Op};
use hbot_config::rig::Protocol;
use hbot_config::{RigConfig, RunningScene, SceneFile};
use hbot_core::Controller;
use hbot_sim::rig::SimulatedRig;
use hbot_testing::lines::JsonLines;
use hbot_testing::patience::{LOOK, PATIENCE, eventually};
use hbot_testing::prototype::simulated_as;
use serde_json::{Value, json};
use tokio::net::TcpListener;
use tokio::sync::{mpsc, oneshot, watch};

use super::{Bounds, Control, ServiceSetup, SetPhenomena, Status, Summary, serve_within};
use crate::server::simulated_hand;
use crate::web::WebOptions;
use hbot_host::bus::drivers::hbot::HbotLink;
use hbot_host::bus::{Expected, Protocol as _};
use hbot_host::line::{Line, Memory, SimulatorCall};
use hbot_host::rig::controllers::Controllers;
use hbot_host::rig::layout::Layout;
use hbot_host::rig::motors::Motors;
use hbot_host::run_loop::bridge::{EmergencyStop, bridge};
use hbot_host::run_loop::clock::Origin;
use hbot_host::run_loop::engine::Engine;
use hbot_host::run_loop::{StopFlag, lockstep};

/// The time of tick 0 that the service of a test is given. The Unix time is larger than 2^53, so
/// that a number that lost its last digits would be noticed.
const ORIGIN: Origin = Origin { monotonic_ns: 12_345_678_901, unix_ns: 1_795_363_200_123_456_789 };

struct TestOptions {
    rig: RigConfig,
    scene: SceneFile,
    token: Option<String>,
    encryption: Option<crate::tls::Encryption>,
    enable_at_start: bool,
    flight_dir: Option<std::path::PathBuf>,
    phenomena: Option<SetPhenomena>,
    /// Whether the rig is one whose simulated hand clients can move.
    hand: bool,
    bounds: Bounds,
    ticks: Option<u64>,
    /// Time that each tick takes on the clock. With zero the loop runs as fast as possible.
    breath: Duration,
}

impl Default for TestOptions {
    fn default() -> Self {
        Self {
            rig: RigConfig::prototype(),
            scene: SceneFile::default_scene(),
            token: None,
            encryption: None,
            enable_at_start: false,
            flight_dir: None,
            phenomena: None,
            hand: false,
            // The hello time is long, so that a slow machine refuses no client. Tests of that time
            // set their own.
            bounds: Bounds { hello: Duration::from_secs(600), ..Bounds::default() },
            ticks: None,
            breath: Duration::from_micros(50),
        }
    }
}

/// A running service with its loop and its simulated rig, for tests inside this crate. Unlike
/// `TestServer` of hbot-testing, it gives access to private parts: a test can set the service's
/// private limits, stop the loop at a given tick, and change the simulated rig.
struct TestService {
    address: SocketAddr,
    /// The web port.
    web: SocketAddr,
    rig: blocking::Sender<SimulatorCall>,
    control: mpsc::Sender<Control>,
    emergency: EmergencyStop,
    status: watch::Receiver<Status>,
    shutdown: Option<oneshot::Sender<()>>,
    stop: StopFlag,
    threads: Option<(JoinHandle<Summary>, JoinHandle<()>)>,
}

/// A line to a simulated rig that sleeps for the given time at each write, so that other threads
/// get processor time.
struct Breathing(Memory, Duration);

impl Line for Breathing {
    fn read(&mut self, now_ns: u64, buffer: &mut [u8]) -> io::Result<usize> {
        self.0.read(now_ns, buffer)
    }

    fn write(&mut self, now_ns: u64, bytes: &[u8]) -> io::Result<usize> {
        if !self.1.is_zero() {
            std::thread::sleep(self.1);
        }
        self.0.write(now_ns, bytes)
    }
}

fn bench() -> TestService {
    TestService::start(TestOptions::default())
}

impl TestService {
    fn start(options: TestOptions) -> Self {
        let (rig, calls) = blocking::channel();
        let (control, controlled) = mpsc::channel(4);
        let (status, watched) = watch::channel(Status::default());
        let (shutdown, stopped) = oneshot::channel();
        let (ready, started) = blocking::channel();
        let to_rig = rig.clone();
        let stop = StopFlag::default();
        let stop_loop = stop.clone();
        let service = std::thread::spawn(move || {
            let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
            runtime.block_on(async move {
                let TestOptions {
                    rig,
                    scene,
                    token,
                    encryption,
                    enable_at_start,
                    flight_dir,
                    phenomena,
                    hand,
                    bounds,
                    ticks,
                    breath,
                } = options;
                let (loop_end, mut end) = bridge().unwrap();
                let mut running = RunningScene::new();
                let compiled = Box::new(running.load(scene));
                let mut line = Memory::new(simulated_as(&rig, |_| ()), calls);
                let layout = Layout::single(rig.controllers.clone());
                let expected = Expected::new("sim", &rig.rig, &layout, 0);
                HbotLink.meet(&mut line, &expected).unwrap();
                let controllers = Controllers::new(Protocol::Hbot, vec![expected.clone()]);
                let bus = HbotLink.bus(Box::new(Breathing(line, breath)), expected);
                let motors = Motors::new(vec![bus], &layout, rig.link.watchdog_ms);
                let engine = Engine::new(
                    motors,
                    Controller::new(rig.rig).with_shaking_guard(rig.shaking_guard),
                    compiled,
                    loop_end,
                    None,
                )
                .enabling(enable_at_start);
                let period_ns = rig.rig.timing.period_ns;
                let ticking = std::thread::spawn(move || {
                    lockstep(engine, period_ns, ticks, &stop_loop);
                });
                end.in_virtual_time(ticking.thread().clone());
                let listener = TcpListener::bind(("127.0.0.1", 0)).await.unwrap();
                let web = std::net::TcpListener::bind(("127.0.0.1", 0)).unwrap();
                let addresses = (listener.local_addr().unwrap(), web.local_addr().unwrap());
                ready.send((addresses, end.emergency_stop(), ticking)).unwrap();
                let accuracy = rig.accuracy.to_owned();
                let setup = ServiceSetup {
                    accuracy,
                    rig,
                    scene: running,
                    phenomena,
                    token,
                    encryption,
                    flight_dir,
                    controllers,
                    origin: ORIGIN,
                    time_waits: false,
                    notes: crate::recording::Notes::default(),
                    web: Some(WebOptions { listener: web, hosts: Arc::default() }),
                    hand: hand.then(|| simulated_hand(move |call| to_rig.send(call).unwrap())),
                };
                serve_within(bounds, listener, end, setup, controlled, status, async {
                    let _ = stopped.await;
                })
                .await
            })
        });
        let ((address, web), emergency, ticking) = started.recv().unwrap();
        let threads = Some((service, ticking));
        Self {
            address,
            web,
            rig,
            control,
            emergency,
            status: watched,
            shutdown: Some(shutdown),
            stop,
            threads,
        }
    }

    fn client(&self, name: &str) -> Client {
        let options = ConnectOptions { timeout: PATIENCE, ..ConnectOptions::new(name) };
        Client::connect_with(&self.address.to_string(), &options).unwrap()
    }

    fn holder(&self) -> Client {
        let mut client = self.client("holder");
        client.call(Op::Acquire { steal: false }).unwrap();
        client
    }

    fn active(&self) -> Client {
        let mut client = self.holder();
        self.wait_for(Mode::Idle);
        client.call(Op::Enable).unwrap();
        self.wait_for(Mode::Active);
        client
    }

    fn raw(&self) -> JsonLines {
        JsonLines::connect(self.address)
    }

    fn with_rig(&self, call: impl FnOnce(&mut SimulatedRig) + Send + 'static) {
        self.rig.send(Box::new(call)).unwrap();
    }

    fn wait_for(&self, mode: Mode) {
        self.wait_until(&format!("mode {mode}"), |status| {
            status.sample.is_some_and(|sample| super::convert::mode(sample.state.mode) == mode)
        });
    }

    fn wait_until(&self, what: &str, condition: impl Fn(&Status) -> bool) {
        eventually(what, || condition(&self.status.borrow()));
    }

    fn wait_ticks(&self, ticks: u64) {
        let now = |status: &Status| status.sample.map_or(0, |sample| sample.state.tick);
        let until = now(&self.status.borrow()) + ticks;
        self.wait_until(&format!("tick {until}"), |status| now(status) >= until);
    }

    fn finish(mut self) -> Summary {
        self.end().unwrap()
    }

    fn end(&mut self) -> Option<Summary> {
        if let Some(shutdown) = self.shutdown.take() {
            // A service that has ended by itself has dropped the receiver.
            let _ = shutdown.send(());
        }
        let (service, ticking) = self.threads.take()?;
        let summary = service.join();
        self.stop.stop();
        ticking.join().unwrap();
        summary.ok()
    }
}

impl Drop for TestService {
    fn drop(&mut self) {
        self.end();
    }
}

fn greeted(bench: &TestService) -> JsonLines {
    JsonLines::greeted(bench.address)
}

fn refused(result: Result<Value, ClientError>) -> ErrorBody {
    match result {
        Err(ClientError::Server(error)) => error,
        other => panic!("not refused: {other:?}"),
    }
}

/// Waits until the client receives an event for which `pick` returns a value, and returns this
/// value.
fn event<T>(client: &mut Client, what: &str, pick: impl Fn(&Event) -> Option<T>) -> T {
    let deadline = Instant::now() + PATIENCE;
    loop {
        let left = deadline.saturating_duration_since(Instant::now());
        let event = client.next_event(left).unwrap().unwrap_or_else(|| panic!("no {what}"));
        if let Some(found) = pick(&event) {
            return found;
        }
    }
}

fn fault_event(client: &mut Client) -> hbot_api::FaultEvent {
    event(client, "fault event", |event| match event {
        Event::Fault(fault) => Some(fault.clone()),
        _ => None,
    })
}

fn scene(value: Value) -> Op {
    Op::LoadScene { scene: value }
}

fn spring(id: &str) -> Value {
    json!({"id": id, "kind": "spring", "stiffness": 1, "anchor": "here"})
}
