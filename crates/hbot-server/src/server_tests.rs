//! However a server ends, the last that its motor controllers hear is zero torque, three times.

#[path = "../../../tests/server/far.rs"]
mod far;

use std::net::SocketAddr;
use std::sync::{Arc, Mutex, mpsc};
use std::time::{Duration, Instant};

use far::Far;
use hbot_api::{Client, TorqueCommand};
use hbot_config::rig::Port;
use hbot_config::{RigConfig, SceneFile};
use tokio::net::TcpListener;
use tokio::sync::{mpsc as async_mpsc, oneshot, watch};

use crate::server::{Finished, Options, Part, Server, Time};
use crate::service::{Control, Status};
use hbot_host::bridge::EmergencyStop;
use hbot_host::engine::Recorder;

/// How long a test waits for what must come.
const PATIENCE: Duration = Duration::from_secs(60);

/// What a test has in hand to end a server.
struct Ends {
    address: SocketAddr,
    shutdown: Option<oneshot::Sender<()>>,
    abandon: Option<oneshot::Sender<()>>,
    control: async_mpsc::Sender<Control>,
    stop: EmergencyStop,
}

/// Lets a client push by a server, ends it by `end` while it does, and holds the last commands to be zero: how it ended, where
/// somebody waited for that.
fn ended(recorder: Option<Recorder>, end: impl FnOnce(&mut Ends)) -> Option<Finished> {
    let mut rig = RigConfig::prototype();
    let far = Far::start(&rig);
    rig.link.port = Port::Devices(vec![far.path.clone()]);
    // A busy machine does not step on these.
    rig.link.watchdog_ms = 1000;
    rig.rig.timing.timeout_ticks = 1000;
    let (ready, started) = mpsc::channel();
    let (shutdown, stopped) = oneshot::channel();
    let (abandon, abandoned) = oneshot::channel::<()>();
    let (control, controlled) = async_mpsc::channel(4);
    let server = std::thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async move {
            let options = Options {
                rig,
                scene: SceneFile::default_scene(),
                time: Time::Wall,
                duration: None,
                token: None,
                buses: None,
                last_word: None,
                flight_dir: None,
                recorder,
            };
            let server = Server::start(options).unwrap();
            let listener = TcpListener::bind(("127.0.0.1", 0)).await.unwrap();
            ready.send((listener.local_addr().unwrap(), server.emergency_stop())).unwrap();
            let (status, _status) = watch::channel(Status::default());
            tokio::select! {
                finished = server.serve(listener, controlled, status, async { _ = stopped.await }) => Some(finished.unwrap()),
                _ = abandoned => None,
            }
        })
    });
    let (address, stop) = started.recv_timeout(PATIENCE).unwrap();
    let mut client = Client::connect(&address.to_string(), "pusher").unwrap();
    client.acquire(false).unwrap();
    let start = Instant::now();
    while !far.pushed() {
        assert!(start.elapsed() < PATIENCE, "no torque came about");
        // A machine that stands still for 20 ms makes a fault, which is not what is looked at here. And the loop may end in the midst
        // of this, where its end is to come with the first torque.
        let _ = client.reset().and_then(|_| client.enable());
        let torque = TorqueCommand { torque: [0.0, 0.1, 0.0], valid_ms: 1000, tick: None, seq: None };
        let _ = client.torque(torque);
        std::thread::sleep(Duration::from_millis(20));
    }
    let mut ends = Ends { address, shutdown: Some(shutdown), abandon: Some(abandon), control, stop };
    end(&mut ends);
    let finished = server.join().unwrap();
    far.ends_still();
    finished
}

/// Notes who says something.
struct Witness(Arc<Mutex<Vec<String>>>);

impl tracing::Subscriber for Witness {
    fn enabled(&self, _: &tracing::Metadata<'_>) -> bool {
        true
    }

    fn new_span(&self, _: &tracing::span::Attributes<'_>) -> tracing::span::Id {
        tracing::span::Id::from_u64(1)
    }

    fn record(&self, _: &tracing::span::Id, _: &tracing::span::Record<'_>) {}

    fn record_follows_from(&self, _: &tracing::span::Id, _: &tracing::span::Id) {}

    fn event(&self, event: &tracing::Event<'_>) {
        let thread = std::thread::current().name().unwrap_or_default().to_owned();
        let text = format!("{thread}: {event:?}");
        self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push(text);
    }

    fn enter(&self, _: &tracing::span::Id) {}

    fn exit(&self, _: &tracing::span::Id) {}
}

#[test]
fn the_loop_says_nothing_whatever_happens() {
    let said = Arc::new(Mutex::new(Vec::new()));
    // Of all threads of all tests of this process.
    tracing::subscriber::set_global_default(Witness(Arc::clone(&said))).unwrap();
    let stop = |ends: &mut Ends| {
        ends.stop.stop_by_signal();
        let start = Instant::now();
        while !said.lock().unwrap().iter().any(|line| line.contains("estop")) {
            assert!(start.elapsed() < PATIENCE, "the service has not told of the stop");
            std::thread::sleep(Duration::from_millis(5));
        }
        ends.shutdown.take().unwrap().send(()).unwrap();
    };
    let _ = ended(None, stop);
    let said = said.lock().unwrap();
    assert!(!said.iter().any(|line| line.starts_with("hbot-loop")), "{said:#?}");
}

#[test]
fn a_server_that_is_stopped_leaves_zero_torque_on_the_line() {
    let stop = |ends: &mut Ends| ends.shutdown.take().unwrap().send(()).unwrap();
    let finished = ended(None, stop);
    assert_eq!(finished.unwrap().failed, None);
}

#[test]
fn a_service_that_panics_leaves_zero_torque_on_the_line() {
    let fail = |ends: &mut Ends| ends.control.blocking_send(Control::Fail).unwrap();
    let finished = ended(None, fail);
    assert_eq!(finished.unwrap().failed, Some(Part::Service));
}

#[test]
fn a_request_that_panics_leaves_zero_torque_on_the_line() {
    let fail = |ends: &mut Ends| {
        let refused = Client::connect(&ends.address.to_string(), crate::service::tests::PANICS);
        assert!(refused.is_err(), "its connection has ended");
    };
    let finished = ended(None, fail);
    assert_eq!(finished.unwrap().failed, Some(Part::Service));
}

#[test]
fn a_loop_that_panics_leaves_zero_torque_on_the_line() {
    let panics: Recorder = Box::new(|_, _, outputs| {
        assert!(
            outputs.drive.torque == [0.0; hbot_core::MAX_JOINTS],
            "as a test asks: in the loop, with torque on the line"
        );
    });
    let finished = ended(Some(panics), |_| ());
    assert_eq!(finished.unwrap().failed, Some(Part::Loop));
}

#[test]
fn a_server_that_nobody_waits_for_leaves_zero_torque_on_the_line() {
    let abandon = |ends: &mut Ends| ends.abandon.take().unwrap().send(()).unwrap();
    let finished = ended(None, abandon);
    assert!(finished.is_none());
}
