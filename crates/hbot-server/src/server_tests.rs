//! Tests that the last word on the line is zero torque, sent three times, however a server ends.

use std::net::SocketAddr;
use std::sync::{Arc, Mutex, PoisonError, mpsc};

use hbot_api::{Client, TorqueCommand};
use hbot_config::SceneFile;
use hbot_config::rig::Port;
use tokio::net::TcpListener;
use tokio::sync::{mpsc as async_mpsc, oneshot, watch};

use crate::server::{Finished, Part, Server, ServerOptions, Time};
use crate::service::Status;
use hbot_host::run_loop::bridge::EmergencyStop;
use hbot_host::run_loop::engine::Recorder;
use hbot_testing::far::Far;
use hbot_testing::log::Listener;
use hbot_testing::patience::{PATIENCE, eventually};
use hbot_testing::prototype::patient;

/// The handles with which a test can end a server in several ways.
struct Ends {
    address: SocketAddr,
    shutdown: Option<oneshot::Sender<Shutdown>>,
    abandon: Option<oneshot::Sender<()>>,
    stop: EmergencyStop,
}

/// How the future that shuts the service down ends.
enum Shutdown {
    /// The future completes normally.
    Orderly,
    /// The future panics in the service's task.
    Panic,
}

/// Name of a client whose hello makes the log panic. The hello is logged during a request, while
/// the hub is in use.
const PANICS: &str = "one that makes the log panic";

/// Returns the options of a server on the simulated rig, in wall-clock time.
fn options() -> ServerOptions {
    ServerOptions::new(patient(), SceneFile::default_scene(), Time::Wall)
}

async fn shutdown_by(stopped: oneshot::Receiver<Shutdown>) {
    if let Ok(Shutdown::Panic) = stopped.await {
        panic!("as a test asks");
    }
}

/// Starts a server, lets a client command torque, and calls `end` to end the server. Asserts that
/// the last commands on the line are zero torque. Returns the outcome of the server, or `None` if
/// its future was dropped. `log` receives the log messages of the service.
fn ended(
    recorder: Option<Recorder>,
    log: Option<tracing::Dispatch>,
    end: impl FnOnce(&mut Ends),
) -> Option<Finished> {
    let mut rig = patient();
    let far = Far::start(&rig);
    rig.link.port = Port::Devices(vec![far.path.clone()]);
    let (ready, started) = mpsc::channel();
    let (shutdown, stopped) = oneshot::channel();
    let (abandon, abandoned) = oneshot::channel::<()>();
    let (_control, controlled) = async_mpsc::channel(4);
    let server = std::thread::spawn(move || {
        let _log = log.map(|log| tracing::dispatcher::set_default(&log));
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async move {
            let server = Server::start(ServerOptions { rig, recorder, ..options() }).unwrap();
            let listener = TcpListener::bind(("127.0.0.1", 0)).await.unwrap();
            ready.send((listener.local_addr().unwrap(), server.emergency_stop())).unwrap();
            let (status, _status) = watch::channel(Status::default());
            tokio::select! {
                finished = server.serve(listener, controlled, status, shutdown_by(stopped)) => Some(finished),
                _ = abandoned => None,
            }
        })
    });
    let (address, stop) = started.recv_timeout(PATIENCE).unwrap();
    let mut client = Client::connect(&address.to_string(), "pusher").unwrap();
    client.acquire(false).unwrap();
    eventually("torque", || {
        // If the test machine stalls for 20 ms, a fault follows, so reset and enable again. Errors
        // are ignored, because in one test the loop ends as soon as there is torque.
        let _ = client.reset().and_then(|_| client.enable());
        let torque = TorqueCommand { torque: [0.0, 0.1, 0.0], valid_ms: 1000, tick: None, seq: None };
        let _ = client.torque(torque);
        far.pushed()
    });
    let mut ends = Ends { address, shutdown: Some(shutdown), abandon: Some(abandon), stop };
    end(&mut ends);
    let finished = server.join().unwrap();
    far.ends_still();
    finished
}

impl Ends {
    fn shutdown(&mut self, how: Shutdown) {
        assert!(self.shutdown.take().unwrap().send(how).is_ok(), "the service waits for it");
    }
}

#[test]
fn the_loop_says_nothing_whatever_happens() {
    let said = Arc::new(Mutex::new(Vec::new()));
    // Collects the messages of all threads and all tests of this process.
    let heard = Arc::clone(&said);
    let note = move |text| heard.lock().unwrap_or_else(PoisonError::into_inner).push(text);
    tracing::subscriber::set_global_default(Listener(note)).unwrap();
    let stop = |ends: &mut Ends| {
        ends.stop.stop_by_signal();
        eventually("the service reports the stop", || {
            said.lock().unwrap().iter().any(|line| line.contains("estop"))
        });
        ends.shutdown(Shutdown::Orderly);
    };
    let _ = ended(None, None, stop);
    let said = said.lock().unwrap();
    assert!(!said.iter().any(|line| line.starts_with("hbot-loop")), "{said:#?}");
}

#[test]
fn a_server_that_is_stopped_leaves_zero_torque_on_the_line() {
    let stop = |ends: &mut Ends| ends.shutdown(Shutdown::Orderly);
    let finished = ended(None, None, stop);
    assert_eq!(finished.unwrap().failed, None);
}

#[test]
fn a_service_that_panics_leaves_zero_torque_on_the_line() {
    let fail = |ends: &mut Ends| ends.shutdown(Shutdown::Panic);
    let finished = ended(None, None, fail);
    assert_eq!(finished.unwrap().failed, Some(Part::Service));
}

#[test]
fn a_request_that_panics_leaves_zero_torque_on_the_line() {
    let fail = |ends: &mut Ends| {
        // The hello can be answered before it is logged, but the ping after it fails.
        let refused = Client::connect(&ends.address.to_string(), PANICS)
            .and_then(|mut client| client.ping(serde_json::Value::Null));
        assert!(refused.is_err(), "its connection has ended");
    };
    // With a single subscriber, `tracing` caches for each log statement whether the first thread
    // that reaches it has the subscriber. That can be a thread of another test, without one. A
    // second subscriber disables this shortcut.
    let _second = tracing::Dispatch::new(tracing::subscriber::NoSubscriber::default());
    let log =
        tracing::Dispatch::new(Listener(|text: String| assert!(!text.contains(PANICS), "as a test asks")));
    let finished = ended(None, Some(log), fail);
    assert_eq!(finished.unwrap().failed, Some(Part::Service));
}

#[test]
fn a_loop_that_panics_leaves_zero_torque_on_the_line() {
    let panics: Recorder = Box::new(|ticked| {
        let outputs = ticked.outputs;
        assert!(
            outputs.drive.torque == [0.0; hbot_core::MAX_JOINTS],
            "as a test asks: in the loop, with torque on the line"
        );
    });
    let finished = ended(Some(panics), None, |_| ());
    assert_eq!(finished.unwrap().failed, Some(Part::Loop));
}

#[test]
fn a_server_that_nobody_waits_for_leaves_zero_torque_on_the_line() {
    let abandon = |ends: &mut Ends| ends.abandon.take().unwrap().send(()).unwrap();
    let finished = ended(None, None, abandon);
    assert!(finished.is_none());
}

/// If the thread of the simulated rig panics, the server does not go on in a fault. It ends, and
/// names the part and the reason.
#[test]
fn a_simulated_rig_that_panics_ends_the_server() {
    let said = Arc::new(Mutex::new(Vec::new()));
    let heard = Arc::clone(&said);
    let _second = tracing::Dispatch::new(tracing::subscriber::NoSubscriber::default());
    let log = tracing::Dispatch::new(Listener(move |text| heard.lock().unwrap().push(text)));
    let _log = tracing::dispatcher::set_default(&log);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let finished = runtime.block_on(async {
        let server = Server::start(ServerOptions { rig: patient(), ..options() }).unwrap();
        server.simulator().unwrap().post(Box::new(|_| panic!("as a test asks: in the simulated rig")));
        let listener = TcpListener::bind(("127.0.0.1", 0)).await.unwrap();
        let (_control, controlled) = async_mpsc::channel(4);
        let (status, _status) = watch::channel(Status::default());
        let serving = server.serve(listener, controlled, status, std::future::pending());
        tokio::time::timeout(PATIENCE, serving).await.expect("the server ends")
    });
    assert_eq!(finished.failed, Some(Part::Simulator));
    let said = said.lock().unwrap();
    assert!(said.iter().any(|line| line.contains("as a test asks: in the simulated rig")), "{said:#?}");
}
